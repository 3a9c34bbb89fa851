//! A plan in the precision of a run, by the arrays that the kernel walks over.

use crate::plan::{Joint, Plan};
use sim_model::Model;
use sim_physics::arrays::Block;
use sim_physics::constants::site::Mount;
use sim_physics::constants::ties::Lengths;
use sim_physics::constants::{Constants, Motion, Recast};
use sim_physics::lane::{Num, Real};
use sim_physics::math::factor::Pattern;

/// A plan as the kernel reads it.
pub struct Tables<R> {
    /// Constants of the model.
    pub constants: Constants<R>,
    /// Positions and quaternions of bodies that clients place, at the scene's start.
    pub mocaps: [Vec<R>; 2],
    /// Bodies that are placed, parents first.
    pub bodies: Vec<usize>,
    /// Coordinates that a solve reads, rising.
    pub coords: Vec<usize>,
    /// Of those coordinates that variables move, their places among these, and the coordinates.
    pub moved: Vec<(usize, usize)>,
    /// Bounds of each variable, rounded inwards [rad or m].
    pub bounds: Vec<[R; 2]>,
    /// The coordinate of each variable that is one; none for balls and free joints.
    pub coord_of: Vec<Option<usize>>,
    /// Balls and free joints.
    pub turning: Vec<Turning<R>>,
    /// Joints that follow others, leaders first.
    pub followers: Vec<Following<R>>,
    /// Frames and their targets.
    pub reaches: Vec<ReachTable<R>>,
    /// Lengths that are to be equal.
    pub lengths: Vec<LengthTable<R>>,
    /// Squares of the weights of each variable's distance from its reference.
    pub posture: Vec<R>,
    /// Is any of them above 0?
    pub has_posture: bool,
    /// Entries of the normal equations.
    pub pattern: Pattern,
    /// Of each variable, places of its row's entries with those before it that it is coupled with, and their variables.
    pub rows: Vec<Vec<(usize, usize)>>,
    /// Of each variable, the place of its diagonal entry.
    pub diagonal: Vec<usize>,
}

/// A ball or a free joint.
pub struct Turning<R> {
    /// Its motion.
    pub motion: Motion,
    /// Its first coordinate.
    pub coord: usize,
    /// Its first variable.
    pub variable: usize,
    /// Centre of mass in the body's frame [m].
    pub center: [R; 3],
    /// Largest turn of a ball [rad].
    pub turn_max: Option<R>,
}

/// `q = p(scale q' - offset)`
pub struct Following<R> {
    /// Coordinate that follows.
    pub coord: usize,
    /// Coordinate that leads.
    pub leader: Option<usize>,
    /// The leader's own place in this list, if it follows too.
    pub leader_slope: Option<usize>,
    /// [–]
    pub scale: R,
    /// [rad or m]
    pub offset: R,
    /// Coefficients of p, the constant first.
    pub polynomial: [R; 5],
}

/// How errors along three axes are weighted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Weight<R> {
    /// They do not count.
    None,
    /// All alike.
    Uniform(R),
    /// Each axis on its own.
    Axes([R; 3]),
}

/// A frame and its target.
pub struct ReachTable<R> {
    /// The frame.
    pub frame: Mount<R>,
    /// What its target is measured from.
    pub relative_to: Option<Mount<R>>,
    /// Do both belong to one robot?
    pub is_same_tree: bool,
    /// Does the robot's reference point move, or is it where targets in the world are measured from?
    pub moves_reference: bool,
    /// Weight of its position.
    pub position: Weight<R>,
    /// Weight of its rotation.
    pub rotation: Weight<R>,
    /// Variables that move it, rising.
    pub variables: Vec<usize>,
    /// Dofs that move it, by their variables.
    pub entries: Vec<Entry>,
    /// Places in the normal equations of each of its variables with those up to it.
    pub places: Vec<usize>,
}

/// A dof that moves a frame.
pub struct Entry {
    /// The dof.
    pub dof: usize,
    /// The place of its variable among those of the frame.
    pub column: usize,
    /// Does it move what the frame is measured from?
    pub is_of_other: bool,
    /// Its slope over the variable, if it is not 1.
    pub slope: Option<usize>,
    /// Is it the first of its variable?
    pub is_first: bool,
}

/// `l₁ - o₁ - p(l₂ - o₂) = 0`
pub struct LengthTable<R> {
    /// Terms of l₁ and of l₂.
    pub terms: [Vec<TermTable<R>>; 2],
    /// o₁ and o₂.
    pub offsets: [R; 2],
    /// Coefficients of p, the constant first.
    pub polynomial: [R; 5],
    /// Variables that move it, rising.
    pub variables: Vec<usize>,
    /// Places in the normal equations of each of them with those up to it.
    pub places: Vec<usize>,
}

/// A term of a length.
pub struct TermTable<R> {
    /// Its coordinate.
    pub coord: usize,
    /// The place of its variable among those of the length, if it has one.
    pub column: Option<usize>,
    /// Its slope over the variable, if it is not 1.
    pub slope: Option<usize>,
    /// [–]
    pub coefficient: R,
}

impl<R: Real> Tables<R> {
    /// A block in which clients have placed their bodies.
    pub fn block<F: Num<Real = R>>(&self) -> Block<F, F> {
        let mut block = Block::new(&self.constants, F::c(0.0));
        let [positions, quats] = &self.mocaps;
        block.mocap_pos = positions.iter().map(|&x| F::k(x)).collect();
        block.mocap_quat = quats.iter().map(|&x| F::k(x)).collect();
        block
    }
}

impl<R: Real> Tables<R>
where
    f64: Recast<R, Out = R>,
{
    /// A plan in this precision.
    pub fn new(model: &Model, plan: &Plan) -> Tables<R> {
        let m = model.constants();
        let pattern = plan.pattern.clone();
        let count = plan.variables.len();
        let relations = &plan.couplings.relations;
        let slope_of = |dof: usize| relations.iter().position(|r| r.follower == dof);
        let coord = |dof: usize| m.dofs[dof].coord;
        let followers = relations.iter().map(|relation| Following {
            coord: coord(relation.follower),
            leader: relation.leader.map(coord),
            leader_slope: relation.leader.and_then(slope_of),
            scale: R::from_f64(relation.scale),
            offset: R::from_f64(relation.offset),
            polynomial: relation.polynomial.map(R::from_f64),
        });
        let mut coord_of = vec![None; count];
        for joint in &plan.joints {
            if joint.motion.coords() == 1 {
                coord_of[joint.variable] = Some(joint.coord);
            }
        }
        let turning = plan.joints.iter().filter(|j| j.motion.coords() > 1);
        let lengths = plan.couplings.lengths.iter();
        let rows = (0..count).map(|i| {
            let others = (0..i).filter(|&j| pattern.has(i, j));
            others.map(|j| (pattern.at(i, j), j)).collect()
        });
        let start = model.start();
        let mocaps = [&start.mocap_pos, &start.mocap_quat];
        Tables {
            mocaps: mocaps.map(|values| values.iter().map(|&x| R::from_f64(x)).collect()),
            bodies: plan.bodies.clone(),
            coords: plan.coords.clone(),
            moved: plan.moved(),
            bounds: plan.bounds.iter().map(|&bounds| inwards(bounds)).collect(),
            coord_of,
            turning: turning.map(|joint| turning_of(model, joint)).collect(),
            followers: followers.collect(),
            reaches: (0..plan.reaches.len())
                .map(|k| reach_table(model, plan, k, &slope_of))
                .collect(),
            lengths: lengths
                .map(|l| length_table(model, plan, l, &slope_of))
                .collect(),
            posture: plan
                .posture_weight
                .iter()
                .map(|w| R::from_f64(w * w))
                .collect(),
            has_posture: plan.posture_weight.iter().any(|&w| w > 0.0),
            rows: rows.collect(),
            diagonal: (0..count).map(|i| pattern.at(i, i)).collect(),
            pattern,
            constants: m.cast(),
        }
    }
}

/// Bounds that no rounding widens.
fn inwards<R: Real>([lower, upper]: [f64; 2]) -> [R; 2] {
    let step = |x: f64, by: f64| {
        let near = R::from_f64(x);
        match (near.to_f64() - x) * by < 0.0 {
            // one rounding further inside
            true => R::from_f64(near.to_f64() + by * R::EPSILON * x.abs().max(f64::MIN_POSITIVE)),
            false => near,
        }
    };
    let inside = [step(lower, 1.0), step(upper, -1.0)];
    match inside[0] <= inside[1] {
        true => inside,
        // both ends are one value, which this precision does not have
        false => [R::from_f64(lower); 2],
    }
}

fn turning_of<R: Real>(model: &Model, joint: &Joint) -> Turning<R> {
    Turning {
        motion: joint.motion,
        coord: joint.coord,
        variable: joint.variable,
        center: model.constants().bodies[joint.body].center.map(R::from_f64),
        turn_max: joint.turn_max.map(R::from_f64),
    }
}

/// Places in the normal equations of each variable with those up to it.
fn places(pattern: &Pattern, variables: &[usize]) -> Vec<usize> {
    let pairs = variables.iter().enumerate();
    let pairs = pairs.flat_map(|(i, &a)| variables[..=i].iter().map(move |&b| (a, b)));
    pairs.map(|(a, b)| pattern.at(a, b)).collect()
}

fn weight<R: Real>(weights: [f64; 3]) -> Weight<R> {
    match weights {
        [0.0, 0.0, 0.0] => Weight::None,
        [x, y, z] if x == y && y == z => Weight::Uniform(R::from_f64(x)),
        axes => Weight::Axes(axes.map(R::from_f64)),
    }
}

fn reach_table<R: Real>(
    model: &Model,
    plan: &Plan,
    k: usize,
    slope_of: &impl Fn(usize) -> Option<usize>,
) -> ReachTable<R>
where
    f64: Recast<R, Out = R>,
{
    let reach = &plan.reaches[k];
    let variable_of = |dof: usize| plan.variable_of[dof].expect("columns are of variables");
    let mut columns = plan.columns[k].clone();
    columns.sort_by_key(|column| (variable_of(column.dof), column.dof));
    let mut variables: Vec<usize> = columns
        .iter()
        .map(|column| variable_of(column.dof))
        .collect();
    variables.dedup();
    let mut entries: Vec<Entry> = Vec::new();
    for column in columns {
        let place = variables.binary_search(&variable_of(column.dof));
        let place = place.expect("it is one of them");
        let last = entries.last().map(|entry| entry.column);
        entries.push(Entry {
            dof: column.dof,
            column: place,
            is_of_other: column.is_of_other,
            slope: slope_of(column.dof),
            is_first: last != Some(place),
        });
    }
    let other = reach.relative_to.as_ref();
    ReachTable {
        frame: reach.frame.recast(),
        relative_to: other.map(Mount::recast),
        is_same_tree: other.is_some_and(|other| other.tree == reach.frame.tree),
        moves_reference: plan.moves_reference(model, k),
        position: weight(reach.position_weight),
        rotation: weight(reach.orientation_weight),
        places: places(&plan.pattern, &variables),
        variables,
        entries,
    }
}

fn length_table<R: Real>(
    model: &Model,
    plan: &Plan,
    lengths: &Lengths<f64>,
    slope_of: &impl Fn(usize) -> Option<usize>,
) -> LengthTable<R> {
    let both = || lengths.first.terms.iter().chain(&lengths.second.terms);
    let mut variables: Vec<usize> = both().filter_map(|t| plan.variable_of[t.dof]).collect();
    variables.sort_unstable();
    variables.dedup();
    let terms = [&lengths.first, &lengths.second].map(|length| {
        let terms = length.terms.iter().map(|term| TermTable {
            coord: model.constants().dofs[term.dof].coord,
            column: plan.variable_of[term.dof].and_then(|v| variables.binary_search(&v).ok()),
            slope: slope_of(term.dof),
            coefficient: R::from_f64(term.coefficient),
        });
        terms.collect()
    });
    LengthTable {
        terms,
        offsets: lengths.offsets.map(R::from_f64),
        polynomial: lengths.polynomial.map(R::from_f64),
        places: places(&plan.pattern, &variables),
        variables,
    }
}
