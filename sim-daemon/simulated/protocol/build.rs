//! Builds the sources of sim-protocol with the doors of the simulated machine.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-cfg=simulated");
}
