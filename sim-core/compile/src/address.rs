//! Where inputs, outputs and scratch memory lie.

/// Where an input or an output of a program lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Address {
    /// Which of the arrays that the program is given.
    pub array: u32,
    /// The register in it: scalars of one number of all worlds.
    pub at: u32,
}

/// Where a program finds what it reads and writes.
#[derive(Clone, Copy, Debug)]
pub struct Places<'a> {
    /// The inputs of the recording, in order.
    pub inputs: &'a [Address],
    /// Its outputs.
    pub outputs: &'a [Address],
    /// Which of the arrays is its scratch memory. It overlaps no input and no output.
    pub memory: Option<u32>,
}
