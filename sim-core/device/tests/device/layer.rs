//! Tests of a program, run again under Vulkan's validation layer.

use std::path::Path;
use std::process::Command;

/// The layer, as the loader knows it.
const LAYER: &str = "VK_LAYER_KHRONOS_validation";

/// Errors, warnings and hazards between commands. They go to stdout: a file would be begun anew by each instance of Vulkan.
const SETTINGS: &str = "\
    khronos_validation.debug_action = VK_DBG_LAYER_ACTION_LOG_MSG\n\
    khronos_validation.report_flags = error,warn\n\
    khronos_validation.enables = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT\n";

/// Runs tests of this program under the layer. Returns what they and the layer print.
pub fn under_the_layer(name: &str, arguments: &[&str]) -> String {
    let file = format!("layer-{name}-{}.txt", std::process::id());
    let settings = Path::new(env!("CARGO_TARGET_TMPDIR")).join(file);
    std::fs::write(&settings, SETTINGS).unwrap();
    let run = Command::new(std::env::current_exe().unwrap())
        .args(arguments)
        .env("VK_INSTANCE_LAYERS", LAYER)
        .env("VK_LAYER_SETTINGS_PATH", &settings)
        .output()
        .unwrap();
    std::fs::remove_file(&settings).unwrap();
    let printed = String::from_utf8_lossy(&run.stdout).into_owned();
    let trouble = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(run.status.success(), "{printed}\n{trouble}");
    printed
}

/// What the layer says, of all that was printed.
pub fn messages(printed: &str) -> Vec<&str> {
    let said = |line: &&str| line.contains("Validation ") && line.contains("MessageID");
    printed.lines().filter(said).collect()
}
