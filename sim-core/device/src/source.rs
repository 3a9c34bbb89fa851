//! A program before it is compiled.

/// A program to be compiled. All its bindings are storage buffers of group 0.
#[derive(Clone, Debug)]
pub struct Source {
    /// Name, for errors.
    pub label: String,
    /// Kernel source.
    pub wgsl: String,
    /// Its `@compute` function.
    pub entry: String,
    /// Values of its overrides.
    pub constants: Vec<(String, f64)>,
}
