#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tightloop_fuzz_simulation::replay(bytes));
