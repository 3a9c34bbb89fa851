//! Where inputs and outputs lie.

/// Where an input or an output of a program lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Address {
    /// Which of the arrays that the program is given.
    pub array: u32,
    /// The register in it: scalars of one number of all worlds.
    pub at: u32,
}
