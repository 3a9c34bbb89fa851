//! Which stages an evaluation of outputs runs, for a model.

use crate::arrays::{Field, Source};
use crate::constants::Constants;
use crate::lane::Real;
use crate::step::StageId;

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
