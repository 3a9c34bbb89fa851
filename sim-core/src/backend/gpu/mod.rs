//! The GPU: recorded programs (see `lane::record`) as WGSL.
