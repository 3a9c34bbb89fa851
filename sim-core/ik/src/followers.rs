//! Joints that follow others: mimic joints, and MuJoCo's equalities of joints; and the equalities that stay equations.

use crate::error::IkError;
use sim_model::Model;
use sim_physics::constants::lengths::Term;
use sim_physics::constants::ties::{Lengths, Measure, TieLaw};

/// Where a leader without a range is looked for if its follower has one, and does not follow along a line [rad or m].
const WINDOW: f64 = 10.0;

/// `q = p(scale q' - offset)`, where q' is the leader's position.
#[derive(Clone, Debug)]
pub struct Relation {
    /// The dof that follows.
    pub follower: usize,
    /// The dof that leads; none where q is p(-offset).
    pub leader: Option<usize>,
    /// [–]
    pub scale: f64,
    /// [rad or m]
    pub offset: f64,
    /// Coefficients of p, the constant first.
    pub polynomial: [f64; 5],
}

/// What couples joints of a model.
#[derive(Default)]
pub struct Couplings {
    /// Joints that follow others, leaders first.
    pub relations: Vec<Relation>,
    /// Equalities of lengths that no joint follows from.
    pub lengths: Vec<Lengths<f64>>,
}

impl Couplings {
    /// Those of a model, of equalities those that act at its start.
    ///
    /// # Errors
    /// An equality of spatial tendons.
    pub fn from_model(model: &Model) -> Result<Couplings, IkError> {
        let m = model.constants();
        let mut couplings = Couplings::default();
        for equality in &m.equalities {
            couplings.add(Lengths {
                first: vec![term(equality.follower)].into(),
                second: vec![term(equality.leader)].into(),
                offsets: [0.0; 2],
                polynomial: [equality.offset, equality.multiplier, 0.0, 0.0, 0.0],
                referred: [None; 2],
            });
        }
        for tie in &m.ties {
            let TieLaw::Equality(place) = tie.law else {
                continue;
            };
            if let (Measure::Lengths(lengths), true) =
                (&tie.measure, model.start().eq_active[place] != 0.0)
            {
                if lengths.first.tendon.or(lengths.second.tendon).is_some() {
                    let name = model.equality_names()[place].clone();
                    return Err(IkError::Tendon { name });
                }
                couplings.add(lengths.clone());
            }
        }
        couplings.sort();
        Ok(couplings)
    }

    /// Adds an equality: as a relation, unless its joint follows another one already or leads its own leader.
    fn add(&mut self, lengths: Lengths<f64>) {
        let ([first], true) = (&lengths.first.terms[..], lengths.second.terms.len() <= 1) else {
            self.lengths.push(lengths);
            return;
        };
        let leader = lengths.second.terms.first();
        let follows = |dof| self.relations.iter().find(|r| r.follower == dof);
        let mut ahead = leader.map(|leader| leader.dof);
        while let Some(dof) = ahead.filter(|&dof| dof != first.dof) {
            ahead = follows(dof).and_then(|relation| relation.leader);
        }
        if follows(first.dof).is_some() || ahead.is_some() || first.coefficient == 0.0 {
            self.lengths.push(lengths);
            return;
        }
        let [first_offset, other] = lengths.offsets;
        let mut polynomial = lengths.polynomial;
        polynomial[0] += first_offset;
        self.relations.push(Relation {
            follower: first.dof,
            leader: leader.map(|leader| leader.dof),
            scale: leader.map_or(0.0, |leader| leader.coefficient),
            offset: other,
            polynomial: polynomial.map(|c| c / first.coefficient),
        });
    }

    /// Puts each relation after that of its leader.
    fn sort(&mut self) {
        let depth = |relation: &Relation| {
            let mut leader = relation.leader;
            let mut depth = 0;
            while let Some(dof) = leader {
                depth += 1;
                let next = self.relations.iter().find(|r| r.follower == dof);
                leader = next.and_then(|relation| relation.leader);
            }
            depth
        };
        let mut order: Vec<(usize, Relation)> = self
            .relations
            .iter()
            .map(|relation| (depth(relation), relation.clone()))
            .collect();
        order.sort_by_key(|(depth, _)| *depth);
        self.relations = order.into_iter().map(|(_, relation)| relation).collect();
    }

    /// The dof that a dof follows in the end, or itself.
    pub fn root(&self, dof: usize) -> Option<usize> {
        let mut dof = dof;
        while let Some(relation) = self.relations.iter().find(|r| r.follower == dof) {
            dof = relation.leader?;
        }
        Some(dof)
    }
}

impl Relation {
    /// The follower's position.
    pub fn position(&self, leader: f64) -> f64 {
        let x = self.scale * leader - self.offset;
        self.polynomial.iter().rev().fold(0.0, |sum, c| sum * x + c)
    }

    /// The part of the leader's range in which the follower is within its own; none if there is no such part.
    pub fn leader_range(&self, leader: [f64; 2], follower: [f64; 2]) -> Option<[f64; 2]> {
        let [constant, slope, rest @ ..] = self.polynomial;
        let slope = slope * self.scale;
        if rest == [0.0; 3] && slope != 0.0 {
            let base = constant - self.polynomial[1] * self.offset;
            let ends = follower.map(|end| (end - base) / slope);
            let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
            let range = [leader[0].max(low), leader[1].min(high)];
            return (range[0] <= range[1]).then_some(range);
        }
        let is_inside = |x: f64| (follower[0]..=follower[1]).contains(&self.position(x));
        let leader = [leader[0].max(-WINDOW), leader[1].min(WINDOW)];
        // the longest run of samples inside
        const SAMPLES: usize = 1000;
        let at = |k: usize| leader[0] + (leader[1] - leader[0]) * k as f64 / SAMPLES as f64;
        let (mut best, mut first) = (None::<[usize; 2]>, None);
        for k in 0..=SAMPLES {
            first = is_inside(at(k)).then(|| first.unwrap_or(k));
            let Some(first) = first else { continue };
            if best.is_none_or(|[low, high]| k - first > high - low) {
                best = Some([first, k]);
            }
        }
        best.map(|ends| ends.map(at))
    }
}

fn term(dof: usize) -> Term<f64> {
    Term {
        dof,
        coefficient: 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn relation(polynomial: [f64; 5]) -> Relation {
        Relation {
            follower: 0,
            leader: Some(1),
            scale: 1.0,
            offset: 0.0,
            polynomial,
        }
    }

    #[test]
    fn a_follower_bounds_its_leader() {
        let mirrored = relation([0.1, -2.0, 0.0, 0.0, 0.0]);
        let range = mirrored.leader_range([-1.0, 1.0], [-0.5, 0.5]).unwrap();
        assert_eq!(range, [-0.2, 0.3]);
        assert_eq!(mirrored.leader_range([-1.0, -0.5], [-0.5, 0.5]), None);
    }

    #[test]
    fn a_curve_bounds_its_leader_by_samples() {
        let square = relation([0.0, 0.0, 1.0, 0.0, 0.0]);
        let free = [f64::NEG_INFINITY, f64::INFINITY];
        let [low, high] = square.leader_range(free, [0.0, 4.0]).unwrap();
        // samples are 0.02 apart
        assert!((-2.0..=-1.98).contains(&low) && (1.98..=2.0).contains(&high));
        assert!(square.position(low) <= 4.0 && square.position(high) <= 4.0);
    }
}
