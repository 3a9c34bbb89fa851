//! A task on a model, ready to run: which bodies are placed, what varies, what each frame depends on.
//!
//! A variable is a dof that is free to move. Dofs that follow it move with it by a slope, and their limits bound it. Frames
//! that a MuJoCo model ties together reach each other: one more target.

use crate::error::IkError;
use crate::followers::{Couplings, Relation};
use crate::task::{Reach, Task};
use sim_model::Model;
use sim_physics::constants::ties::{Lengths, Measure, TieLaw};
use sim_physics::constants::{Body, Motion};
use sim_physics::math::factor::Pattern;
use std::collections::BTreeSet;

/// Past this a bound is none [rad or m].
const FAR: f64 = 1e17;

/// A task on a model, in double precision; [`crate::tables`] has it in the precision of a run.
pub struct Plan {
    /// Bodies that are placed, parents first.
    pub bodies: Vec<usize>,
    /// Coordinates that a solve reads, rising.
    pub coords: Vec<usize>,
    /// The dofs of variables, rising.
    pub variables: Vec<usize>,
    /// Bounds of each variable [rad or m].
    pub bounds: Vec<[f64; 2]>,
    /// The same of every dof.
    pub ranges: Vec<[f64; 2]>,
    /// Joints that follow others, also those that no frame depends on.
    pub relations: Vec<Relation>,
    /// Balls that may not turn freely: first coordinate, largest turn [rad].
    pub turns: Vec<(usize, f64)>,
    /// Joints of the variables.
    pub joints: Vec<Joint>,
    /// What couples joints; of relations only those that matter here.
    pub couplings: Couplings,
    /// Frames and their targets: those of the task, then those that the model ties together.
    pub reaches: Vec<Reach>,
    /// How many of them are of the task.
    pub own_reaches: usize,
    /// Of each reach, the dofs that move it against what it is measured from.
    pub columns: Vec<Vec<Column>>,
    /// Which entries of the normal equations may differ from 0.
    pub pattern: Pattern,
    /// Weight of each variable's distance from its reference.
    pub posture_weight: Vec<f64>,
    /// The variable that moves each dof.
    pub variable_of: Vec<Option<usize>>,
}

/// A joint whose dofs are variables.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Its body.
    pub body: usize,
    /// Its motion.
    pub motion: Motion,
    /// Its first coordinate.
    pub coord: usize,
    /// Its first variable.
    pub variable: usize,
    /// Largest turn of a ball [rad].
    pub turn_max: Option<f64>,
}

/// A dof that moves a frame.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// The dof.
    pub dof: usize,
    /// Does it move what the frame is measured from?
    pub is_of_other: bool,
}

impl Plan {
    /// The plan of a task.
    ///
    /// # Errors
    /// No joint moves a frame, or limits exclude each other.
    pub fn new(model: &Model, task: &Task) -> Result<Plan, IkError> {
        let m = model.constants();
        // a ball or a free joint moves as a whole
        let of_joint = |dof: usize| m.bodies[m.dofs[dof].body].dofs();
        let all = |dof: usize| of_joint(dof).all(|dof| task.moves[dof]);
        let moves: Vec<bool> = (0..m.dofs.len()).map(all).collect();
        let mut couplings = Couplings::from_model(model)?;
        let mut closures = closures(model);
        let columns_of = |reach: &Reach| {
            let other = reach.relative_to.as_ref().and_then(|other| other.body);
            columns(&m.bodies, reach.frame.body, other)
        };
        // what moves a frame may move what is tied to it, which then moves too
        let mut dofs = BTreeSet::new();
        for reach in &task.reaches {
            dofs.extend(columns_of(reach).iter().map(|column| column.dof));
        }
        let (mut reaches, mut lengths) = (task.reaches.clone(), Vec::new());
        loop {
            let before = (dofs.len(), reaches.len(), lengths.len());
            for dof in dofs.clone() {
                dofs.extend(couplings.root(dof));
            }
            let held = std::mem::take(&mut couplings.lengths);
            let leads = |dof: usize| {
                let root = couplings.root(dof);
                root.is_some_and(|root| dofs.contains(&root) && moves[root])
            };
            let (tied, rest): (Vec<_>, Vec<_>) = closures
                .into_iter()
                .partition(|reach| columns_of(reach).iter().any(|column| leads(column.dof)));
            let (summed, others): (Vec<_>, Vec<_>) = held
                .into_iter()
                .partition(|lengths| dofs_of(lengths).any(leads));
            couplings.lengths = others;
            for reach in &tied {
                dofs.extend(columns_of(reach).iter().map(|column| column.dof));
            }
            for lengths in &summed {
                dofs.extend(dofs_of(lengths));
            }
            closures = rest;
            reaches.extend(tied);
            lengths.extend(summed);
            if before == (dofs.len(), reaches.len(), lengths.len()) {
                break;
            }
        }
        couplings.lengths = lengths;
        let variables: Vec<usize> = dofs
            .iter()
            .copied()
            .filter(|&dof| moves[dof] && couplings.root(dof) == Some(dof))
            .collect();
        let variable_of: Vec<Option<usize>> = (0..m.dofs.len())
            .map(|dof| variables.binary_search(&couplings.root(dof)?).ok())
            .collect();
        let moved = |dof: usize| variable_of[dof].is_some();
        let columns: Vec<Vec<Column>> = reaches
            .iter()
            .map(|reach| {
                let all = columns_of(reach).into_iter();
                all.filter(|column| moved(column.dof)).collect()
            })
            .collect();
        let own_reaches = task.reaches.len();
        if let Some(still) = (0..own_reaches).find(|&k| columns[k].is_empty()) {
            return Err(IkError::Still {
                name: reaches[still].name.clone(),
            });
        }
        let ranges = ranges(model, &couplings, task.limits)?;
        let relations = couplings.relations.clone();
        couplings
            .relations
            .retain(|r| moved(r.follower) || (r.leader.is_none() && dofs.contains(&r.follower)));
        let turns = m.bodies.iter().filter(|body| body.motion == Motion::Ball);
        let turns = turns.filter_map(|body| Some((body.coord, turn_max(model, body)?)));
        let mut plan = Plan {
            bodies: placed(&m.bodies, &reaches),
            coords: Vec::new(),
            joints: joints(model, &variables, task.limits),
            posture_weight: variables.iter().map(|&d| task.posture_weight[d]).collect(),
            pattern: Pattern::default(),
            bounds: variables.iter().map(|&dof| ranges[dof]).collect(),
            turns: turns.filter(|_| task.limits).collect(),
            variables,
            ranges,
            relations,
            couplings,
            reaches,
            own_reaches,
            columns,
            variable_of,
        };
        plan.pattern = plan.pattern();
        plan.coords = plan.coords(&m.bodies);
        Ok(plan)
    }

    /// Is the target of a reach measured in the world, while the reference point of its robot is not a constant?
    pub fn moves_reference(&self, model: &Model, reach: usize) -> bool {
        let reach = &self.reaches[reach];
        let root = root_motion(&model.constants().bodies, reach.frame.body);
        reach.relative_to.is_none() && matches!(root, Some(Motion::Free | Motion::Mocap))
    }

    /// Variables that one frame or one length depends on are coupled.
    fn pattern(&self) -> Pattern {
        let of_reaches = self.columns.iter().map(|columns| {
            let dofs = columns.iter().map(|column| column.dof);
            dofs.collect::<Vec<usize>>()
        });
        let of_lengths = self.couplings.lengths.iter().map(|l| dofs_of(l).collect());
        let mut entries = BTreeSet::new();
        for dofs in of_reaches.chain(of_lengths) {
            let moved = dofs.iter().filter_map(|&dof| self.variable_of[dof]);
            let moved: BTreeSet<usize> = moved.collect();
            for &i in &moved {
                entries.extend(moved.range(..i).map(|&j| (i, j)));
            }
        }
        Pattern::new(self.variables.len(), entries)
    }

    /// Coordinates that variables move, each after its place among those that a solve reads.
    pub fn moved(&self) -> Vec<(usize, usize)> {
        let joints = self.joints.iter();
        let coords = joints.flat_map(|joint| joint.coord..joint.coord + joint.motion.coords());
        let places = coords.map(|c| (self.coords.binary_search(&c).expect("it is read"), c));
        places.collect()
    }

    /// Coordinates of placed bodies, of followers with their leaders, and of lengths.
    fn coords(&self, bodies: &[Body<f64>]) -> Vec<usize> {
        let coord_of = |dof: usize| {
            let body = bodies.iter().find(|body| body.dofs().contains(&dof));
            let body = body.expect("every dof has a body");
            body.coord..body.coord + body.motion.coords()
        };
        let mut coords = BTreeSet::new();
        for &body in &self.bodies {
            let body = &bodies[body];
            coords.extend(body.coord..body.coord + body.motion.coords());
        }
        for relation in &self.couplings.relations {
            coords.extend(coord_of(relation.follower));
            coords.extend(relation.leader.into_iter().flat_map(coord_of));
        }
        for lengths in &self.couplings.lengths {
            coords.extend(dofs_of(lengths).flat_map(coord_of));
        }
        for joint in &self.joints {
            coords.extend(joint.coord..joint.coord + joint.motion.coords());
        }
        coords.into_iter().collect()
    }
}

/// How the root moves that carries a body; none for what is fixed to the world.
fn root_motion(bodies: &[Body<f64>], body: Option<usize>) -> Option<Motion> {
    let carriers = std::iter::successors(body, |&body| bodies[body].parent);
    carriers.last().map(|root| bodies[root].motion)
}

/// Dofs of an equality of lengths.
fn dofs_of(lengths: &Lengths<f64>) -> impl Iterator<Item = usize> + '_ {
    let both = lengths.first.terms.iter().chain(&lengths.second.terms);
    both.map(|term| term.dof)
}

/// Frames that the model ties together, by equalities that act at its start.
fn closures(model: &Model) -> Vec<Reach> {
    let ties = model.constants().ties.iter();
    let frames = ties.filter_map(|tie| match (&tie.measure, tie.law) {
        (Measure::Frames(frames), TieLaw::Equality(place)) => {
            let mounts = [&frames.first, &frames.second];
            // what clients place pulls a frame by its equality: it is a command, and no loop
            let is_placed =
                |body| root_motion(&model.constants().bodies, body) == Some(Motion::Mocap);
            let acts = model.start().eq_active[place] != 0.0
                && !mounts.into_iter().any(|mount| is_placed(mount.body));
            acts.then(|| Reach {
                name: model.equality_names()[place].clone(),
                frame: frames.first.clone(),
                relative_to: Some(frames.second.clone()),
                position_weight: [1.0; 3],
                orientation_weight: [f64::from(u8::from(frames.torque_scale.is_some())); 3],
            })
        }
        _ => None,
    });
    frames.collect()
}

/// Dofs on the path of a body from its root.
fn path(bodies: &[Body<f64>], body: Option<usize>) -> BTreeSet<usize> {
    let carriers = std::iter::successors(body, |&body| bodies[body].parent);
    carriers.flat_map(|body| bodies[body].dofs()).collect()
}

/// The dofs that move one of two bodies and not the other, rising.
fn columns(bodies: &[Body<f64>], body: Option<usize>, other: Option<usize>) -> Vec<Column> {
    let (body_dofs, other) = (path(bodies, body), path(bodies, other));
    let apart = body_dofs.symmetric_difference(&other);
    apart
        .map(|&dof| Column {
            dof,
            is_of_other: other.contains(&dof),
        })
        .collect()
}

/// Bodies that carry frames, with those that carry them, parents first.
fn placed(bodies: &[Body<f64>], reaches: &[Reach]) -> Vec<usize> {
    let mounts = reaches.iter().flat_map(|reach| {
        let other = reach.relative_to.as_ref().and_then(|other| other.body);
        [reach.frame.body, other]
    });
    let all: BTreeSet<usize> = mounts
        .flat_map(|body| std::iter::successors(body, |&body| bodies[body].parent))
        .collect();
    all.into_iter().collect()
}

/// The joints of variables.
fn joints(model: &Model, variables: &[usize], limits: bool) -> Vec<Joint> {
    let m = model.constants();
    let bodies = m.bodies.iter().enumerate();
    let moved = bodies.filter_map(|(k, body)| {
        let variable = variables.binary_search(&body.dof).ok()?;
        (body.motion.dofs() > 0).then(|| Joint {
            body: k,
            motion: body.motion,
            coord: body.coord,
            variable,
            turn_max: turn_max(model, body).filter(|_| limits),
        })
    });
    moved.collect()
}

/// Largest turn of a ball that has one [rad].
fn turn_max(model: &Model, body: &Body<f64>) -> Option<f64> {
    let ties = model.constants().ties.iter();
    let largest = ties.filter_map(|tie| match (&tie.measure, tie.law) {
        (Measure::Angle(_, dof), TieLaw::Range([_, most])) if *dof == body.dof => Some(most),
        _ => None,
    });
    largest.reduce(f64::min)
}

/// Bounds of each dof: its own limits, and those of the joints that follow it.
fn ranges(model: &Model, couplings: &Couplings, limits: bool) -> Result<Vec<[f64; 2]>, IkError> {
    let free = [f64::NEG_INFINITY, f64::INFINITY];
    let m = model.constants();
    let mut ranges = vec![free; m.dofs.len()];
    if limits {
        for limit in &m.limits {
            let [lower, upper] = ranges[limit.dof];
            ranges[limit.dof] = [
                if limit.lower > -FAR {
                    lower.max(limit.lower)
                } else {
                    lower
                },
                if limit.upper < FAR {
                    upper.min(limit.upper)
                } else {
                    upper
                },
            ];
        }
        for range in &mut ranges {
            if range[0] > range[1] {
                *range = [0.5 * (range[0] + range[1]); 2];
            }
        }
        // followers first: what bounds them bounds their leaders
        for relation in couplings.relations.iter().rev() {
            let Some(leader) = relation.leader else {
                continue;
            };
            if ranges[relation.follower] == free {
                continue;
            }
            let range = relation.leader_range(ranges[leader], ranges[relation.follower]);
            ranges[leader] = range.ok_or_else(|| IkError::Limits {
                leader: model.dof_names()[leader].clone(),
                follower: model.dof_names()[relation.follower].clone(),
            })?;
        }
    }
    Ok(ranges)
}
