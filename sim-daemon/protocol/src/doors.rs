//! Doors to what is outside of this crate: clock, threads and their locks, files, processes, the system, the transport.
//!
//! In a simulation (`cfg(simulated)`, see `sim-daemon/simulated`) the same names are those of a machine that follows a seed. So
//! no other module names `std::fs`, `std::thread`, `std::time::Instant`, `std::sync`, `std::process`, `sim_system` or iceoryx2.

#[cfg(not(simulated))]
mod real {
    pub(crate) use ::{iceoryx2, iceoryx2_bb_posix};
    pub(crate) use sim_system as system;
    pub(crate) use std::{fs, process, sync, thread_local};

    /// Clocks.
    pub(crate) mod time {
        pub(crate) use std::time::Instant;
    }

    /// Threads.
    pub(crate) mod thread {
        pub(crate) use std::hint::spin_loop;
        pub(crate) use std::thread::{
            Builder, JoinHandle, ThreadId, available_parallelism, sleep, yield_now,
        };

        thread_local! {
            static THIS: ThreadId = std::thread::current().id();
        }

        /// The calling thread, without counting its references.
        pub(crate) fn this() -> ThreadId {
            THIS.with(|thread| *thread)
        }
    }

    /// Whether a path names something.
    pub(crate) fn exists(path: &std::path::Path) -> bool {
        path.exists()
    }

    /// A random number: two runs must not be taken for each other, nothing more.
    pub(crate) fn random() -> u64 {
        use std::hash::{BuildHasher, Hasher, RandomState};
        RandomState::new().build_hasher().finish()
    }
}

#[cfg(simulated)]
mod simulated {
    pub(crate) use sim_machine::fs::exists;
    pub(crate) use sim_machine::{
        fs, iceoryx2, process, random, sync, system, thread, thread_local, time,
    };

    /// The transport's descriptors.
    pub(crate) mod iceoryx2_bb_posix {
        pub(crate) mod file_descriptor {
            pub(crate) use sim_machine::iceoryx2::FileDescriptorBased;
        }
    }
}

#[cfg(not(simulated))]
pub(crate) use real::*;
#[cfg(simulated)]
pub(crate) use simulated::*;
