//! Which models are compiled.

use sim_physics::constants::Constants;
use sim_physics::schedule::step_stages;

/// Most entries of the mass matrix of a model that is compiled: its factor is written out, and that of a chain of 34 dofs is a
/// hundred thousand bytes of code [–].
const ENTRIES_MAX: usize = 600;
/// Most dofs, bodies, rows of joints and actuators together, times the evaluations of its forces in a substep: the code of larger
/// models fits no cache, and takes long to make [–].
const PARTS_MAX: usize = 384;

/// Is it a model without contacts, of a size for which machine code pays?
pub(super) fn suits(m: &Constants<f64>) -> bool {
    let parts = m.dofs.len() + m.bodies.len() + m.rows() + m.actuators.all.len();
    let stages = step_stages(m);
    let evaluations = stages.iter().filter(|stage| stage.name() == "kinematics");
    m.contacts.groups.is_empty()
        && m.pattern.len() <= ENTRIES_MAX
        && parts * evaluations.count() <= PARTS_MAX
}
