//! Which stages a step or an evaluation of outputs runs, for a model.

use crate::arrays::{Field, Source};
use crate::constants::Constants;
use crate::lane::Real;
use crate::step::{Runs, StageId};

/// The stages of a step that a model needs, in order.
///
/// A step finds its forces once and moves the state by them. One by Runge-Kutta begins, finds them four times, each time
/// followed by a part of its move, and takes commands the first time.
pub fn step_stages<R: Real>(m: &Constants<R>) -> Vec<StageId> {
    let stages = |runs| -> Vec<StageId> {
        let of_row = StageId::all().filter(|stage| stage.row().runs == runs);
        of_row.filter(|stage| stage.is_needed(m)).collect()
    };
    let (commands, forces) = (stages(Runs::Once), stages(Runs::Both));
    match &stages(Runs::RungeKutta)[..] {
        [] => [commands, forces, stages(Runs::Step)].concat(),
        [begin, parts @ ..] => {
            let mut order = [vec![*begin], commands].concat();
            for part in parts {
                order.extend(&forces);
                order.push(*part);
            }
            order
        }
    }
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
        if !row.runs.moves() && completes && stage.is_needed(m) {
            wanted.extend(row.reads);
            stages.push(stage);
        }
    }
    stages.reverse();
    stages
}
