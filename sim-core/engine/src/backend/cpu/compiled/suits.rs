//! Which models are compiled, and which of their stages.

use sim_physics::arrays::Array;
use sim_physics::constants::Constants;
use sim_physics::constants::options::Integrator;
use sim_physics::schedule::step_stages;
use sim_physics::step::StageId;
use std::ops::Range;

/// Most entries of the mass matrix of a model that is compiled: its factor is written out, and that of a chain of 34 dofs is a
/// hundred thousand bytes of code [–].
const ENTRIES_MAX: usize = 600;
/// Most parts of a model without contacts, times the evaluations of its forces in a substep: the code of larger models fits no
/// cache, and takes long to make [–].
const PARTS_MAX: usize = 384;
/// The same of a model with contacts, of which less is compiled. A Franka arm is 11 % faster by it, a humanoid no faster [–].
const TOUCHING_PARTS_MAX: usize = 72;

/// Contacts as they are found. Their number differs from world to world, and no program has been made for that.
const OF_CONTACTS: [Array; 3] = [
    Array::ContactPoints,
    Array::ContactRows,
    Array::ContactForces,
];

/// Is it a model of a size for which machine code pays?
pub(super) fn suits(m: &Constants<f64>) -> bool {
    let stages = step_stages(m);
    let evaluations = stages.iter().filter(|stage| stage.name() == "kinematics");
    let parts_max = match m.contacts.groups.is_empty() {
        true => PARTS_MAX,
        false => TOUCHING_PARTS_MAX,
    };
    // the code of a sweep over rows of friction would have the factor of M once per row
    let sweeps = m.solver.noslip.is_some();
    // both triangles of the step's matrix would be written out
    let implicit = m.integrator == Integrator::Implicit;
    !sweeps
        && !implicit
        && m.pattern.len() <= ENTRIES_MAX
        && parts(m) * evaluations.count() <= parts_max
}

/// What a bend of a tendon around a shape counts: its code is as long as that of so many joints [–].
const BEND_PARTS: usize = 8;

/// The same of a geom that counts as an ellipsoid in a medium [–].
const FLUID_PARTS: usize = 8;

/// Dofs, bodies, rows of joints, actuators, pieces of spatial tendons, geoms in a medium, commands that wait, and rests of springs
/// that yield.
fn parts(m: &Constants<f64>) -> usize {
    let commands = m.delay.frames * m.dofs.len() + m.actuators.kept_controls();
    let rests = m.springs.plastic_rests();
    let spans = m.tendons.iter().flat_map(|tendon| &tendon.spans);
    let spans = spans.map(|span| 1 + BEND_PARTS * usize::from(span.wrap.is_some()));
    let tendons: usize = spans.sum();
    let fluid = FLUID_PARTS * m.fluid_geoms.len();
    let parts = m.dofs.len() + m.bodies.len() + m.rows() + m.actuators.all.len();
    parts + tendons + fluid + commands + rests
}

/// Runs of stages that are compiled, as long as they can be, by their places in a substep.
pub(super) fn runs(m: &Constants<f32>, substep: &[StageId]) -> Vec<Range<usize>> {
    let is_compiled =
        |place: &usize| m.contacts.groups.is_empty() || !meets_contacts(substep[*place]);
    let mut runs: Vec<Range<usize>> = Vec::new();
    for place in (0..substep.len()).filter(is_compiled) {
        match runs.last_mut() {
            Some(run) if run.end == place => run.end = place + 1,
            _ => runs.push(place..place + 1),
        }
    }
    runs
}

/// Does a stage find contacts, or read lists of them? The one that places shapes is no faster as machine code. The integrator
/// reads how many there are, which no list is needed for.
fn meets_contacts(stage: StageId) -> bool {
    let mut arrays = stage.reads().iter().chain(stage.writes());
    arrays.any(|array| OF_CONTACTS.contains(array))
}
