//! Which stages a step or an evaluation of outputs runs, for a model.

use crate::arrays::{Field, Source};
use crate::constants::Constants;
use crate::constants::options::Integrator;
use crate::lane::Real;
use crate::step::{Runs, StageId};

/// The stages of a step that a model needs, in order.
pub fn step_stages<R: Real>(m: &Constants<R>) -> Vec<StageId> {
    let stages = StageId::all().filter(|stage| stage.row().runs != Runs::Evaluation);
    let stages: Vec<StageId> = stages.filter(|stage| stage.is_needed(m)).collect();
    if m.integrator != Integrator::RungeKutta {
        return stages;
    }
    // a Runge-Kutta step evaluates its forces four times; commands come due once
    let (mut ends, forces): (Vec<StageId>, Vec<StageId>) = stages
        .into_iter()
        .partition(|stage| stage.name().starts_with("runge_kutta"));
    let mut all = vec![ends.remove(0)];
    for (k, end) in ends.into_iter().enumerate() {
        let again = |stage: &&StageId| k == 0 || stage.name() != "command";
        all.extend(forces.iter().filter(again));
        all.push(end);
    }
    all
}

/// The stages that evaluate outputs of a state, in order: those that complete what the outputs are made of, and those whose
/// arrays these read.
pub fn evaluation_stages<R: Real>(
    m: &Constants<R>,
    fields: impl IntoIterator<Item = Field>,
) -> Vec<StageId> {
    let mut wanted = Vec::new();
    for field in fields {
        match &field.row().source {
            Source::Array(array) => wanted.push(*array),
            Source::Computed(arrays) | Source::Contacts(arrays) => wanted.extend(*arrays),
            Source::Counter => {}
        }
    }
    let mut stages = Vec::new();
    // a stage reads what stages before it write, so one backward pass finds all
    for stage in StageId::all().collect::<Vec<_>>().into_iter().rev() {
        let row = stage.row();
        let completes = row.completes.iter().any(|array| wanted.contains(array));
        if row.runs != Runs::Step && completes && stage.is_needed(m) {
            wanted.extend(row.reads);
            stages.push(stage);
        }
    }
    stages.reverse();
    stages
}
