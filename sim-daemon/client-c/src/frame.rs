//! Frames: what C holds, looks at and drops.

use std::ffi::{c_char, c_void};

use sim_protocol::Frame;

use crate::description::{EntryType, padded};
use crate::handle::{Pool, Slot};
use crate::pointers::{Output, handle, text};
use crate::status::{Failure, Status, call};

/// The state of all worlds at one instant. It stays as it is until tl_frame_drop.
#[derive(Debug)]
pub struct FrameHandle {
    slot: Slot<Frame>,
}

static POOL: Pool<FrameHandle> = Pool::new();
const STALE: &str = "frame: it was dropped before; use a frame until tl_frame_drop, and not after";

/// A handle of a frame, for C to keep.
pub(crate) fn lend(frame: Frame) -> *mut FrameHandle {
    let slot = Slot::empty;
    let handle = POOL.lend(|| FrameHandle { slot: slot() });
    handle.slot.fill(frame);
    std::ptr::from_ref(handle).cast_mut()
}

/// An array of a frame. Read-only, contiguous, 64-byte aligned, valid until tl_frame_drop.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Array {
    /// First entry.
    pub data: *const c_void,
    /// Type of the entries.
    pub dtype: EntryType,
    /// Worlds.
    pub rows: usize,
    /// Entries of a world: data[world * columns + column].
    pub columns: usize,
    /// Axes in use.
    pub axes: usize,
    /// Shape, worlds first, row-major; 1 for axes that are not in use.
    pub shape: [usize; 4],
}

/// Number and times of a frame.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct FrameInfo {
    /// Frames that the daemon made before, and this one.
    pub number: u64,
    /// Time that the daemon computed for it [ns].
    pub busy_ns: u64,
    /// When the next frame is due on CLOCK_MONOTONIC, in real time; else 0 [ns].
    pub due_next_ns: u64,
}

const NOTHING: Array = Array {
    data: std::ptr::null(),
    dtype: EntryType::U8,
    rows: 0,
    columns: 0,
    axes: 0,
    shape: [0; 4],
};

/// Finds an array of a frame by its name, such as "joint_q". Nothing is copied.
///
/// TL_STATUS_UNKNOWN_NAME lists the fields that the frame has; `tightloop serve --fields` adds others.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_frame_field(
    frame: *const FrameHandle,
    name: *const c_char,
    array: *mut Array,
) -> Status {
    call(|| {
        // SAFETY: the caller's promise.
        let (array, frame, name) = unsafe {
            (
                Output::new(array, NOTHING, "array")?,
                handle(frame, "frame")?,
                text(name, "name")?,
            )
        };
        let field = frame.slot.with(STALE, |frame| {
            let view = frame.field(name)?;
            Ok(Array {
                data: view.ptr.cast(),
                dtype: view.dtype.into(),
                rows: view.shape.first().copied().unwrap_or(1),
                columns: view.shape.iter().skip(1).product(),
                axes: view.shape.len(),
                shape: padded(view.shape),
            })
        })?;
        array.set(field);
        Ok(())
    })
}

/// Number and times of a frame.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_frame_describe(
    frame: *const FrameHandle,
    info: *mut FrameInfo,
) -> Status {
    let nothing = FrameInfo {
        number: 0,
        busy_ns: 0,
        due_next_ns: 0,
    };
    call(|| {
        // SAFETY: the caller's promise.
        let (info, frame) = unsafe {
            let info = Output::new(info, nothing, "info")?;
            (info, handle(frame, "frame")?)
        };
        let described = frame.slot.with(STALE, |frame| {
            let header = frame.header();
            Ok(FrameInfo {
                number: header.frame,
                busy_ns: header.busy_ns,
                due_next_ns: header.due_next,
            })
        })?;
        info.set(described);
        Ok(())
    })
}

/// Drops a frame: its slot is the daemon's again. NULL does nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tl_frame_drop(frame: *mut FrameHandle) -> Status {
    call(|| {
        if frame.is_null() {
            return Ok(());
        }
        // SAFETY: the caller's promise.
        let frame = unsafe { handle(frame, "frame") }?;
        let held = frame.slot.take();
        drop(held.ok_or_else(|| Failure::new(Status::StaleHandle, STALE))?);
        POOL.give_back(frame);
        Ok(())
    })
}
