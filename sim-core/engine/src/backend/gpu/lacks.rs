//! Whether a world of a tile lacked room for contacts.

use super::words;
use sim_device::{BatchBuilder, Buffer, Device, DeviceError, Staging};

/// What of a frame has to run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Again {
    /// All of it: the state is that from before.
    Substeps,
    /// What is shown.
    Evaluation,
}

/// Words that kernels set where a world lacked room: in the substeps, in the evaluation. The third is the tile's number of worlds.
pub(super) struct Lacks {
    pub buffer: Buffer,
    copy: Staging,
}

impl Lacks {
    const BYTES: u64 = 16;

    pub fn new(device: &Device, worlds: usize) -> Result<Lacks, DeviceError> {
        Ok(Lacks {
            buffer: super::compiled::constant(device, "lacks", &[0, 0, worlds as u32, 0])?,
            copy: device.staging("lacks", Lacks::BYTES)?,
        })
    }

    /// Records what shows the words to the host.
    pub fn read(&self, batch: &mut BatchBuilder) {
        batch.copy(&self.buffer, 0, &self.copy, 0, Lacks::BYTES);
    }

    /// What has to run again, as of the last frame.
    pub fn again(&self) -> Option<Again> {
        let copy = self.copy.read();
        match words::words(&copy)[..2] {
            [0, 0] => None,
            [0, _] => Some(Again::Evaluation),
            _ => Some(Again::Substeps),
        }
    }
}
