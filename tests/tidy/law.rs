//! Which package has which door, which knows which others, and where `unsafe` may stand.

/// The doors of each heavy package: one, and that of a simulation.
pub const DOORS: [(&str, &str); 30] = [
    ("ash", "sim-core/device/src/vulkan"),
    ("naga", "sim-core/device/src/shader/module.rs"),
    ("wgpu", "sim-core/device/src"),
    ("iced_x86", "sim-core/compile/src/x86"),
    ("urdf_rs", "sim-core/model/src/urdf"),
    ("faer", "sim-core/model/src"),
    ("parry3d_f64", "sim-core/model/src/geometry"),
    ("gltf", "sim-core/model/src/geometry/load"),
    ("base64", "sim-core/model/src/geometry/load"),
    ("blake3", "sim-core/model/src/cache_files.rs"),
    ("postcard", "sim-core/model/src/geometry/cache.rs"),
    ("rayon", "sim-core/engine/src/workers.rs"),
    ("crc32fast", "sim-core/engine/src/snapshot.rs"),
    ("iceoryx2", "sim-daemon/protocol/src"),
    ("iceoryx2", "sim-daemon/simulated/machine/src"),
    ("iceoryx2_cal", "sim-daemon/protocol/src"),
    ("clap", "sim-daemon/src/cli"),
    ("clap", "sim-daemon/simulated/protocol/src/main.rs"),
    ("clap_complete", "sim-daemon/src/cli/pages.rs"),
    ("clap_mangen", "sim-daemon/src/cli/pages.rs"),
    ("lz4_flex", "sim-daemon/src/recording/blocks.rs"),
    ("xxhash_rust", "sim-daemon/protocol/src/journal/digest.rs"),
    ("noto_sans_mono_bitmap", "sim-daemon/src/inspect/picture"),
    ("png", "sim-daemon/src/inspect/picture"),
    ("pyo3", "py-client/src"),
    ("numpy", "py-client/src"),
    ("hyper", "sim-daemon/src/top/http.rs"),
    ("hyper_util", "sim-daemon/src/top/http.rs"),
    ("http_body_util", "sim-daemon/src/top/http.rs"),
    ("tokio", "sim-daemon/src/top/http.rs"),
];

/// Sources of a package, and other packages of which they know nothing.
pub const STRANGERS: &[(&str, &[&str])] = &[
    (
        "sim-core/physics/src",
        &[
            "sim_model",
            "sim_device",
            "sim_engine",
            "sim_protocol",
            "sim_daemon",
        ],
    ),
    (
        "sim-core/model/src",
        &["sim_device", "sim_engine", "sim_protocol", "sim_daemon"],
    ),
    (
        "sim-core/compile/src",
        &[
            "sim_model",
            "sim_device",
            "sim_engine",
            "sim_protocol",
            "sim_daemon",
        ],
    ),
    (
        "sim-core/device/src",
        &[
            "sim_physics",
            "sim_model",
            "sim_engine",
            "sim_protocol",
            "sim_daemon",
        ],
    ),
    ("sim-core/engine/src", &["sim_protocol", "sim_daemon"]),
    (
        "sim-core/ik/src",
        &["sim_device", "sim_engine", "sim_protocol", "sim_daemon"],
    ),
    (
        "sim-core/policy/src",
        &["sim_physics", "sim_model", "sim_engine", "sim_daemon"],
    ),
    (
        "sim-core/render/src",
        &["sim_device", "sim_engine", "sim_protocol", "sim_daemon"],
    ),
    (
        "sim-daemon/protocol/src",
        &[
            "sim_physics",
            "sim_model",
            "sim_device",
            "sim_engine",
            "sim_daemon",
        ],
    ),
    (
        "sim-daemon/client-c/src",
        &[
            "sim_physics",
            "sim_model",
            "sim_device",
            "sim_engine",
            "sim_daemon",
        ],
    ),
    (
        "sim-daemon/picture/src",
        &[
            "sim_physics",
            "sim_model",
            "sim_device",
            "sim_engine",
            "sim_protocol",
            "sim_daemon",
        ],
    ),
    (
        "py-client/src",
        &[
            "sim_physics",
            "sim_model",
            "sim_device",
            "sim_engine",
            "sim_ik",
        ],
    ),
];

/// Where `unsafe` may stand, and why.
pub const UNSAFE: [&str; 60] = [
    "py-client/src/frame.rs",                                     // NumPy views
    "py-client/src/xla/abi.rs", // structs and arrays of XLA's foreign functions
    "sim-core/compile/src/lib.rs", // runs machine code
    "sim-core/device/src/host_pages.rs", // imports pages of the host
    "sim-core/device/src/program/portable.rs", // programs without checks at run time
    "sim-core/device/src/software/exit.rs", // process exit beside a driver thread
    "sim-core/device/src/vulkan/export.rs", // the driver's memory for other processes
    "sim-core/device/src/vulkan/memory.rs", // the driver's memory, and the host's
    "sim-core/device/src/vulkan/mod.rs", // the driver's handles
    "sim-core/device/src/vulkan/pipeline.rs", // as mod.rs
    "sim-core/device/src/vulkan/recording.rs", // as mod.rs
    "sim-core/device/src/vulkan/stamps.rs", // as mod.rs
    "sim-core/device/src/vulkan_absent.rs", // the same functions, never called
    "sim-core/engine/src/backend/cpu/backend.rs", // calls what dispatch chose
    "sim-core/engine/src/backend/cpu/compiled/check.rs", // runs stages and machine code of an instruction set
    "sim-core/engine/src/backend/cpu/compiled/section.rs", // runs the machine code of an instruction set
    "sim-core/engine/src/backend/cpu/contacts.rs",         // rows of a frame, as transfer.rs
    "sim-core/engine/src/backend/cpu/dispatch.rs",         // instruction sets
    "sim-core/engine/src/backend/cpu/gathering.rs", // runs the solver on gathered worlds, as run.rs
    "sim-core/engine/src/backend/cpu/run.rs",       // calls the stages of an instruction set
    "sim-core/engine/src/backend/cpu/transfer.rs",  // rows of a frame, written by several threads
    "sim-core/engine/src/backend/gpu/imported.rs",  // memory of readers that a device writes to
    "sim-core/ik/src/dispatch.rs",                  // instruction sets
    "sim-core/physics/src/compiled.rs", // what only a processor with the instructions may run
    "sim-core/physics/src/lane/simd/neon.rs", // intrinsics
    "sim-core/physics/src/lane/simd/x86.rs", // intrinsics
    "sim-core/policy/src/kernel.rs",    // instruction sets
    "sim-core/render/src/image.rs",     // instruction sets
    "sim-daemon/client-c/src/calls.rs", // pointers of C, which pointers.rs checks
    "sim-daemon/client-c/src/client.rs", // as calls.rs
    "sim-daemon/client-c/src/description.rs", // pointers to texts of the same struct
    "sim-daemon/client-c/src/frame.rs", // as calls.rs
    "sim-daemon/client-c/src/timing.rs", // as calls.rs
    "sim-daemon/client-c/src/pointers.rs", // what C passes: texts, arrays, places of results
    "sim-daemon/src/eyes/memory.rs",    // images of a frame, written by several threads
    "sim-daemon/src/eyes/part.rs",      // as memory.rs
    "sim-daemon/protocol/src/memory/frame.rs", // views of a sample
    "sim-daemon/protocol/src/waiting/park.rs", // the descriptor of a listener
    "sim-daemon/protocol/src/memory/loaned.rs", // loaned samples
    "sim-daemon/protocol/src/memory/mapping.rs", // tests that read mapped files
    "sim-daemon/protocol/src/memory/port.rs", // ports that are dropped or left alone
    "sim-daemon/protocol/src/memory/reentrant.rs", // a value that a lock abandons
    "sim-daemon/protocol/src/memory/storage.rs", // what mapped files hold
    "sim-daemon/simulated/machine/src/iceoryx2/port/listener.rs", // as waiting/park.rs, where it does nothing
    "sim-daemon/simulated/machine/src/iceoryx2/port/loan.rs",     // loans, as iceoryx2 has them
    "sim-daemon/simulated/machine/src/iceoryx2/sample.rs",        // samples, as iceoryx2 has them
    "sim-daemon/simulated/machine/src/iceoryx2/service/builder/mod.rs", // facts of types that the caller sets
    "sim-daemon/simulated/machine/src/iceoryx2/slot.rs", // slots that several ports see
    "sim-daemon/simulated/machine/src/system/files.rs", // as waiting/park.rs, where it does nothing
    "sim-daemon/src/environment.rs",                    // a variable, set while there is one thread
    "sim-daemon/src/serve/shown.rs",                    // samples that a device writes to
    "sim-daemon/system/src/unix/faults.rs",             // a handler of missing pages
    "sim-daemon/system/src/unix/files.rs",              // the descriptor of a listener
    "sim-daemon/system/src/unix/forks.rs",              // a handler of forks
    "sim-daemon/system/src/windows/clock.rs",           // calls of Windows
    "sim-daemon/system/src/windows/cores.rs",           // as clock.rs
    "sim-daemon/system/src/windows/faults.rs",          // the same function, which does nothing
    "sim-daemon/system/src/windows/files.rs",           // as clock.rs
    "sim-daemon/system/src/windows/process.rs",         // as clock.rs
    "sim-daemon/system/src/windows/storage.rs",         // as clock.rs
];

/// Whether a line has `package::` as a word of its own: `hash::` is not `ash::`.
pub fn names_package(line: &str, package: &str) -> bool {
    let path = format!("{package}::");
    line.match_indices(&path).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        before.is_none_or(|c| !c.is_alphanumeric() && c != '_')
    })
}
