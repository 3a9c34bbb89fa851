//! A client for C: `extern "C"` functions over [`sim_protocol::Client`], with status codes and a sentence for each error.
//!
//! `include/tightloop_client.h` is made of this crate by cbindgen; `tests/header.rs` checks that it is current. Each module is
//! one step of a call:
//!
//! - [`status`]: a Rust error becomes a status and a sentence, and a panic ends at the border.
//! - [`pointers`]: what C passes is checked, as far as a pointer can be. `unsafe` is here and in the calls.
//! - [`handle`]: clients and frames that C keeps; a stale one is an error.
//! - [`description`]: names and shapes as C reads them.
//! - [`staged`]: inputs wait for the next step.
//! - [`client`], [`calls`], [`frame`] and [`timing`]: what C calls.
//!
//! # Safety
//! The same holds for every call. A client is one of `tl_attach`, a frame one that a call has stored, or NULL. Texts end with a
//! NUL byte, arrays have as many entries as their count says, and results go to variables of the caller. NULL is an error.
//! The header states it too.

// in the order of the header
mod status;

mod client;

mod description;

mod calls;

mod frame;

mod timing;

mod handle;
mod pointers;
mod staged;
