//! The calls that move worlds: set inputs, step in one or two halves, reset, write.

use std::ffi::c_char;

use sim_protocol::{Command, Frame, Hook, Values};

use crate::client::{ClientHandle, State};
use crate::frame::{self, FrameHandle};
use crate::pointers::{Output, entries, handle, text};
use crate::status::{Failure, Status, call};

/// A call that ends with a frame.
///
/// # Safety
/// As of the calls.
unsafe fn framed(
    client: *mut ClientHandle,
    frame: *mut *mut FrameHandle,
    body: impl FnOnce(&State, Hook<'_>) -> Result<Frame, Failure>,
) -> Status {
    call(|| {
        // SAFETY: the caller's promise.
        let (output, client) = unsafe {
            let output = Output::new(frame, std::ptr::null_mut(), "frame")?;
            (output, handle(client, "client")?)
        };
        let made = body(&*client.state()?, &mut || client.poll())?;
        output.set(frame::lend(made));
        Ok(())
    })
}

/// A mask of worlds; NULL for all.
///
/// # Safety
/// As of [`entries`].
unsafe fn mask_of(mask: *const u8, worlds: usize) -> Result<Option<Vec<bool>>, Failure> {
    if mask.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller's promise.
    let bytes = unsafe { entries(mask, worlds, "mask") }?;
    Ok(Some(bytes.iter().map(|&byte| byte != 0).collect()))
}

/// Sets an input, such as "joint_target_q", for the next step: `count` = worlds * columns values, copied at once.
///
/// The next tl_step or tl_send sends what was set, once, whatever becomes of it. An input that is not set keeps its last
/// value in the daemon. TL_STATUS_UNKNOWN_NAME lists the inputs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_set_f32(
    client: *mut ClientHandle,
    input: *const c_char,
    values: *const f32,
    count: usize,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        set(client, input, || {
            Ok(Values::F32(entries(values, count, "values")?))
        })
    }
}

/// As tl_set_f32, of double precision.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_set_f64(
    client: *mut ClientHandle,
    input: *const c_char,
    values: *const f64,
    count: usize,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        set(client, input, || {
            Ok(Values::F64(entries(values, count, "values")?))
        })
    }
}

/// # Safety
/// As of the calls.
unsafe fn set<'a>(
    client: *mut ClientHandle,
    input: *const c_char,
    values: impl FnOnce() -> Result<Values<'a>, Failure>,
) -> Status {
    call(|| {
        // SAFETY: the caller's promise.
        let (client, input) = unsafe { (handle(client, "client")?, text(input, "input")?) };
        client.state()?.staged().set(input, values()?)?;
        Ok(())
    })
}

/// Advances every world by one control frame, with the inputs that were set, and waits for the frame.
///
/// The first call takes control of the daemon. TL_STATUS_LEASE_HELD names the process that has it. After
/// TL_STATUS_REFUSED, TL_STATUS_FRAMES_HELD and TL_STATUS_STEP_IN_FLIGHT no world was touched.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_step(
    client: *mut ClientHandle,
    frame: *mut *mut FrameHandle,
) -> Status {
    let step =
        |state: &State, hook: Hook<'_>| state.with_inputs(|inputs| state.client.step(inputs, hook));
    // SAFETY: the caller's promise.
    unsafe { framed(client, frame, step) }
}

/// The first half of tl_step: sends the inputs and returns while the daemon steps.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_send(client: *mut ClientHandle) -> Status {
    call(|| {
        // SAFETY: the caller's promise.
        let client = unsafe { handle(client, "client") }?;
        let state = client.state()?;
        state.with_inputs(|inputs| state.client.send(inputs, &mut || client.poll()))
    })
}

/// The second half of tl_step: waits for the frame of the step that was sent.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_recv(
    client: *mut ClientHandle,
    frame: *mut *mut FrameHandle,
) -> Status {
    let recv = |state: &State, hook: Hook<'_>| Ok(state.client.recv(hook)?);
    // SAFETY: the caller's promise.
    unsafe { framed(client, frame, recv) }
}

/// Puts worlds back to the start. `mask` has a byte per world, `mask_count` of them, or is NULL for all worlds.
///
/// `seeds` has one seed for all worlds or one per world, or is NULL: then each world begins its next episode.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_reset(
    client: *mut ClientHandle,
    mask: *const u8,
    mask_count: usize,
    seeds: *const u64,
    seed_count: usize,
    frame: *mut *mut FrameHandle,
) -> Status {
    let reset = |state: &State, hook: Hook<'_>| {
        // SAFETY: the caller's promise.
        let (mask, seeds) = unsafe {
            (
                mask_of(mask, mask_count)?,
                entries(seeds, seed_count, "seeds")?,
            )
        };
        let seeds = (!seeds.is_empty()).then_some(seeds);
        Ok(state.client.reset(mask.as_deref(), seeds, hook)?)
    };
    // SAFETY: the caller's promise.
    unsafe { framed(client, frame, reset) }
}

/// Writes a part of the state, such as "joint_q", and evaluates the frame there: `count` = worlds * columns values.
///
/// `mask` has a byte per world, `mask_count` of them: worlds with 0 keep their state. NULL is all worlds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_write_f32(
    client: *mut ClientHandle,
    field: *const c_char,
    values: *const f32,
    count: usize,
    mask: *const u8,
    mask_count: usize,
    frame: *mut *mut FrameHandle,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        let values = || Ok(Values::F32(entries(values, count, "values")?));
        write(client, field, values, || mask_of(mask, mask_count), frame)
    }
}

/// As tl_write_f32, of double precision.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_write_f64(
    client: *mut ClientHandle,
    field: *const c_char,
    values: *const f64,
    count: usize,
    mask: *const u8,
    mask_count: usize,
    frame: *mut *mut FrameHandle,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        let values = || Ok(Values::F64(entries(values, count, "values")?));
        write(client, field, values, || mask_of(mask, mask_count), frame)
    }
}

/// # Safety
/// As of the calls.
unsafe fn write<'a>(
    client: *mut ClientHandle,
    field: *const c_char,
    values: impl FnOnce() -> Result<Values<'a>, Failure>,
    mask: impl FnOnce() -> Result<Option<Vec<bool>>, Failure>,
    frame: *mut *mut FrameHandle,
) -> Status {
    let write = |state: &State, hook: Hook<'_>| {
        // SAFETY: the caller's promise.
        let field = unsafe { text(field, "field") }?;
        let inputs = &state.client.description().writes;
        // an unknown name is refused with those that are known
        let input = inputs.iter().find(|input| input.name == field);
        let array = Command {
            field,
            columns: 0..input.map_or(0, |input| input.columns),
            values: values()?,
        };
        Ok(state.client.write(&[array], mask()?.as_deref(), hook)?)
    };
    // SAFETY: the caller's promise.
    unsafe { framed(client, frame, write) }
}
