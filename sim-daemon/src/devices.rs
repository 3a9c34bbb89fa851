//! `tightloop devices`: the GPUs of this machine, and what fits on each.

use sim_engine::options::{AdapterInfo, adapters};

use crate::error::DaemonError;
use crate::output;

/// Numbers that a world of the lesson's grasp keeps on a GPU, about: an arm of 9 dofs, a cube and a table [–].
const NUMBERS: u64 = 16_000;

/// Prints a line an adapter.
pub(crate) fn run() -> Result<(), DaemonError> {
    let mut lines: Vec<String> = adapters().iter().map(line).collect();
    if lines.is_empty() {
        lines.push("no GPU: no Vulkan driver shows one (a software one: apt-get install mesa-vulkan-drivers libvulkan1)".to_owned());
    }
    lines.push(String::new());
    output::print(lines.join("\n").as_bytes()).map_err(DaemonError::stdout)
}

fn line(info: &AdapterInfo) -> String {
    let memory = info.memory.map_or_else(String::new, |bytes| {
        let worlds = bytes / (4 * NUMBERS);
        format!(
            ", {:.1} GB: about {worlds} worlds of an arm with a cube",
            bytes as f64 / 1e9
        )
    });
    let delivery = if info.imports {
        "writes frames into shared memory"
    } else {
        "frames are copied"
    };
    format!(
        "{}  {}  ({:?}, {}, {}{memory}; {delivery})",
        info.index, info.name, info.kind, info.backend, info.driver
    )
}
