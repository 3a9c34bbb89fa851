//! A program before it is compiled.

use std::borrow::Cow;

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

/// A directive that naga 30 does not know: it has subgroup operations without it.
const SUBGROUPS: &str = "enable subgroups;";

impl Source {
    /// The kernel source for naga; places in it stay where they are.
    pub(crate) fn plain(&self) -> Cow<'_, str> {
        match self.wgsl.contains(SUBGROUPS) {
            true => Cow::Owned(self.wgsl.replace(SUBGROUPS, &" ".repeat(SUBGROUPS.len()))),
            false => Cow::Borrowed(&self.wgsl),
        }
    }

    /// Whether it may have subgroup operations: their names begin so.
    pub(crate) fn names_subgroups(&self) -> bool {
        self.wgsl.contains("subgroup")
    }

    /// Whether it may have floats of 64 bits: their type is named so.
    pub(crate) fn names_doubles(&self) -> bool {
        self.wgsl.contains("f64")
    }
}
