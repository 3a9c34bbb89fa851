//! The map by which `perf` names the stages of machine code: a line for each piece with its address, its bytes and its name
//! (Linux, `tools/perf/Documentation/jit-interface.txt`).

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use sim_engine::simulation::Simulation;
use sim_system::files;

/// With the value 1 processes write the map.
const VARIABLE: &str = "TIGHTLOOP_PERF_MAP";

/// Writes the map of this process where the environment asks for it. Returns a note for people if that failed.
pub(crate) fn write(simulation: &Simulation) -> Option<String> {
    let pieces = simulation.code_pieces();
    let is_asked = std::env::var_os(VARIABLE).is_some_and(|value| value == "1");
    if !is_asked || pieces.is_empty() || cfg!(not(target_os = "linux")) {
        return None;
    }
    let lines = pieces.iter().map(|(address, bytes, stage)| {
        format!(
            "{address:x} {bytes:x} tightloop::{}\n",
            stage.replace(' ', "_")
        )
    });
    // where perf looks for it
    let path = PathBuf::from(format!("/tmp/perf-{}.map", std::process::id()));
    let error = write_new(&path, &lines.collect::<String>()).err()?;
    Some(format!(
        "no map of machine code in {}: {error}",
        path.display()
    ))
}

/// Writes a file that only this user can read. One that an earlier process of the user left is replaced; in that folder others'
/// cannot be removed, and what is there is never followed.
fn write_new(path: &Path, text: &str) -> io::Result<()> {
    let _ = fs::remove_file(path);
    let mut options = files::private();
    let mut file = options.write(true).create_new(true).open(path)?;
    file.write_all(text.as_bytes())
}
