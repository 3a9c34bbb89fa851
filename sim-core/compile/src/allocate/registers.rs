//! What the registers hold.

use crate::code::Kind;
use crate::machine::Register;

/// How many registers a processor has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Files {
    pub scalars: usize,
    /// Of masks; none where they share those of scalars.
    pub masks: Option<usize>,
}

/// Values by register.
#[derive(Clone)]
pub(super) struct Registers {
    scalars: Vec<Option<u32>>,
    masks: Option<Vec<Option<u32>>>,
}

impl Registers {
    pub fn new(files: Files) -> Registers {
        Registers {
            scalars: vec![None; files.scalars],
            masks: files.masks.map(|count| vec![None; count]),
        }
    }

    pub fn file(&self, kind: Kind) -> &[Option<u32>] {
        match (kind, &self.masks) {
            (Kind::Mask, Some(masks)) => masks,
            _ => &self.scalars,
        }
    }

    pub fn file_mut(&mut self, kind: Kind) -> &mut [Option<u32>] {
        match (kind, &mut self.masks) {
            (Kind::Mask, Some(masks)) => masks,
            _ => &mut self.scalars,
        }
    }

    /// All values that are held, with the register of each in the file of its kind.
    pub fn held(&self) -> impl Iterator<Item = (Register, u32)> {
        let files = [Some(&self.scalars), self.masks.as_ref()];
        files.into_iter().flatten().flat_map(|file| {
            let registers = file.iter().enumerate();
            registers.filter_map(|(register, value)| Some((register as Register, (*value)?)))
        })
    }

    /// Keeps what another path left in the same registers.
    pub fn keep_common(&mut self, other: &Registers) {
        for kind in [Kind::Scalar, Kind::Mask] {
            let theirs = other.file(kind);
            for (mine, theirs) in self.file_mut(kind).iter_mut().zip(theirs) {
                if *mine != *theirs {
                    *mine = None;
                }
            }
        }
    }
}
