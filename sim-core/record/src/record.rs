//! Records physics code.

use crate::error::RecordError;
use crate::ir::recording::{Origin, Recording};
use crate::ir::tree::Operand;
use crate::passes::dead_code;
use crate::passes::loop_fusion;
use crate::recorder::Recorder;
use crate::recorder::handles::Recorded;
use crate::recorder::state::{self, Value};
use std::panic::Location;

/// Records physics code with so many scalar inputs. What the code returns are the outputs, in order.
///
/// # Errors
/// The first [`Misuse`], with its location in the code.
#[track_caller]
pub fn record(
    inputs: usize,
    text: impl FnOnce(&mut Recorder, &[Recorded]) -> Vec<Recorded>,
) -> Result<Recording, RecordError> {
    let place = Location::caller();
    let session = state::Session::start(place);
    let given: Vec<Recorded> = state::with(place, |s| {
        (0..inputs)
            .map(|i| {
                let input = s.input(i as u32);
                s.handle(input)
            })
            .collect()
    });
    let results = text(&mut Recorder::new(), &given);
    let (outputs, mut body) = state::with(place, |s| {
        let outputs: Vec<Operand> = results.iter().map(|x| s.see(*x)).collect();
        (outputs, s.leave(0))
    });
    let mut state = session.finish();
    if let Some(error) = state.take_error() {
        return Err(error);
    }
    let kept: Vec<Operand> = outputs.iter().copied().chain(state.assumed).collect();
    dead_code::prune(&state.values, &mut body, &kept, place)?;
    let mut values = state.values.iter().map(|v| v.op).collect();
    let origin = |value: &Value| Origin {
        part: value.part,
        place: value.place,
    };
    let origins = state.values.iter().map(origin).collect();
    let mut names = state.counters().names as usize;
    loop_fusion::fuse(&mut body, &mut values, &mut names);
    let mut recording = Recording {
        inputs,
        outputs,
        names,
        values,
        origins,
        scratch: 0,
        lanes: state.lanes,
        assumed: state.assumed,
        body,
    };
    recording.scratch = recording.reach();
    Ok(recording)
}
