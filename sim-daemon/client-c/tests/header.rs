//! The header in `include/` is the one that cbindgen makes of the sources.

use std::path::Path;

/// Set, this variable makes the test write the header.
const WRITE: &str = "TIGHTLOOP_WRITE_HEADER";

#[test]
fn the_header_is_current() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).expect("it is read");
    let made = cbindgen::Builder::new()
        .with_crate(folder)
        .with_config(config)
        .generate()
        .expect("the sources are parsed");
    let mut text = Vec::new();
    made.write(&mut text);
    let made = String::from_utf8(text).expect("a header is text");
    let path = folder.join("include/tightloop_client.h");
    if std::env::var_os(WRITE).is_some() {
        std::fs::write(&path, &made).expect("the header can be written");
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    let cure = format!("run `{WRITE}=1 cargo test --release -p sim-client-c --test header`");
    assert!(
        made == committed,
        "include/tightloop_client.h is old: {cure}"
    );
    // each function that the library exports is there, and nothing of Rust
    for name in [
        "tl_attach(",
        "tl_frame_field(",
        "TL_STATUS_PROTOCOL_VERSION = 14",
    ] {
        assert!(made.contains(name), "{name}");
    }
    assert!(!made.contains("# Safety") && !made.contains("ClientHandle"));
}
