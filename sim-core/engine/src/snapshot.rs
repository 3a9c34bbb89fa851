//! Snapshots: all worlds as bytes, from which a run resumes bit for bit, whatever its lanes and threads.
//!
//! ```text
//! head     magic 8 · version u32 · checksum u32 · model u64 · worlds u64 · scalars u32 · bytes of a scalar u32
//! record   steps u64 · status u32 · contacts left out u32 · seed u64 · episode u32 · scalars         per world, in order
//! ```
//! Everything is little endian. The scalars of a record are f32 or f64. The checksum is the CRC-32 (IEEE 802.3) of all that follows it.
//!
//! A record holds the world's counters and its whole state vector: positions and their rounding remainders, velocities, warm start, held
//! commands, and the parameters that vary. A value that joins the state vector is therefore part of snapshots without further
//! code. Records are world-major and know no lanes: a snapshot taken with 16 lanes and restored in a scalar run gives the same
//! bits. Everything is checked before a world changes.
//!
//! Snapshot and restore travel as commands that name a file. The daemon writes it under another name first and renames it. Bytes that
//! Python holds pass through a file in `/dev/shm`.

use crate::backend::{COUNTERS, Precision};

/// First bytes of a snapshot; the line end reveals a transfer in text mode.
const MAGIC: [u8; 8] = *b"tlsnap\r\n";
/// Version of the format. Increase it when the scalars of a world change their meaning but not their number.
/// Once they did and it stayed: the start of the solver of free bodies of MuJoCo's in `f64`, which changes no minimum.
const VERSION: u32 = 1;
/// Where what the checksum covers begins.
const COVERED: usize = 16;
/// Bytes before the first record.
const HEAD: usize = 40;

/// Why a snapshot is not restored; no world was changed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SnapshotError {
    /// Something else.
    #[error("this is no snapshot; give what was saved as one")]
    NotASnapshot,
    /// Of another format.
    #[error(
        "the snapshot is of format {got}, this release reads format {VERSION}; take it again with this release"
    )]
    Version {
        /// Version it has.
        got: u32,
    },
    /// The end is missing.
    #[error("the snapshot is cut short: {got} bytes of {expected}; copy it again, whole")]
    CutShort {
        /// Bytes given.
        got: usize,
        /// Bytes according to its head.
        expected: u128,
    },
    /// Changed since it was taken.
    #[error("the snapshot is damaged: its checksum does not match; copy it again, or take another")]
    Damaged,
    /// Of another model.
    #[error(
        "the snapshot is of another model ({got:016x}, here {expected:016x}); restore it in the scene it was taken in, with the same release"
    )]
    Model {
        /// Hash of its model.
        got: u64,
        /// Hash of the model here.
        expected: u64,
    },
    /// Of another precision.
    #[error(
        "the snapshot has numbers of {got} bits, the simulation of {expected}; launch with precision f{got}"
    )]
    Precision {
        /// Bits of its numbers.
        got: u64,
        /// Bits of the numbers here.
        expected: u64,
    },
    /// Of a state of another size.
    #[error(
        "a world of the snapshot has {got} numbers, one of the simulation {expected}; take it again with this release"
    )]
    Numbers {
        /// Scalars per world in the snapshot.
        got: usize,
        /// Scalars per world of the simulation.
        expected: usize,
    },
    /// Of more or fewer worlds.
    #[error(
        "the snapshot has {got} worlds, the simulation {expected}; launch as many, or put one of them into all with from_world"
    )]
    Worlds {
        /// Its worlds.
        got: usize,
        /// Worlds here.
        expected: usize,
    },
    /// A world that the snapshot does not have.
    #[error("from_world is {got}; the snapshot has worlds 0 to {last}")]
    FromWorld {
        /// World asked for.
        got: usize,
        /// Last one there is.
        last: usize,
    },
    /// A mask of the wrong size.
    #[error("the mask has {got} entries; the simulation has {worlds} worlds")]
    Mask {
        /// Entries given.
        got: usize,
        /// Worlds of the simulation.
        worlds: usize,
    },
    /// NaN or infinity.
    #[error(
        "world {world} of the snapshot holds a number that is not finite; leave it out by the mask, or take another snapshot"
    )]
    NotFinite {
        /// First world concerned, in the snapshot.
        world: usize,
    },
    /// A rotation that no simulation leaves.
    #[error(
        "world {world} of the snapshot holds a quaternion of length {length}, where a simulation keeps length 1; leave it out by the mask, or take another snapshot"
    )]
    Quaternion {
        /// First world concerned, in the snapshot.
        world: usize,
        /// Its length, to three digits [–].
        length: String,
    },
}

/// What a snapshot is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Head {
    pub model: u64,
    pub worlds: usize,
    /// Scalars per world.
    pub numbers: usize,
    pub precision: Precision,
}

impl Head {
    /// Bytes of a number.
    fn real(&self) -> usize {
        match self.precision {
            Precision::F32 => 4,
            Precision::F64 => 8,
        }
    }

    fn record(&self) -> usize {
        COUNTERS + self.numbers * self.real()
    }

    /// Bytes of the whole snapshot.
    pub fn bytes(&self) -> usize {
        HEAD + self.worlds * self.record()
    }
}

/// Writes a snapshot, as long as its head requires; `fill` writes the records.
pub(crate) fn write(head: &Head, bytes: &mut [u8], fill: impl FnOnce(&mut [u8])) {
    fill(&mut bytes[HEAD..]);
    bytes[..8].copy_from_slice(&MAGIC);
    bytes[8..12].copy_from_slice(&VERSION.to_le_bytes());
    bytes[16..24].copy_from_slice(&head.model.to_le_bytes());
    bytes[24..32].copy_from_slice(&(head.worlds as u64).to_le_bytes());
    bytes[32..36].copy_from_slice(&(head.numbers as u32).to_le_bytes());
    bytes[36..40].copy_from_slice(&(head.real() as u32).to_le_bytes());
    let checksum = crc32fast::hash(&bytes[COVERED..]);
    bytes[12..16].copy_from_slice(&checksum.to_le_bytes());
}

/// Arrays of a record with a scalar for each dof, before the positions: velocities, accelerations and commands.
const DOF_ARRAYS: usize = 5;

/// How far the squared length of a quaternion may be from 1 [–]: a step normalizes, which leaves some 1e-7 in f32.
const UNIT: f64 = 1e-3;

/// Joint positions of all worlds of a snapshot of this head, `(worlds, coords)` [rad or m].
pub(crate) fn positions(bytes: &[u8], head: &Head, dofs: usize, coords: usize) -> Vec<f64> {
    let (real, first) = (head.real(), DOF_ARRAYS * dofs);
    let records = bytes[HEAD..].chunks_exact(head.record());
    let numbers = records.flat_map(|record| {
        let positions = &record[COUNTERS + first * real..][..coords * real];
        positions.chunks_exact(real)
    });
    numbers.map(number).collect()
}

/// A scalar of a record.
fn number(bytes: &[u8]) -> f64 {
    match *bytes {
        [a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
        _ => f64::from_le_bytes(std::array::from_fn(|i| bytes[i])),
    }
}

/// Places in the scalars of a record of quaternions that begin at these coordinates.
pub(crate) fn quaternions(coords: impl Iterator<Item = usize>, dofs: usize) -> Vec<usize> {
    coords.map(|coord| DOF_ARRAYS * dofs + coord).collect()
}

/// Length of the first quaternion of a record, at these places, that is no rotation [–].
fn length_of_none(record: &[u8], real: usize, quaternions: &[usize]) -> Option<f64> {
    let squares = quaternions.iter().map(|place| {
        let quaternion = record[COUNTERS + place * real..][..4 * real].chunks_exact(real);
        quaternion.map(|x| number(x).powi(2)).sum::<f64>()
    });
    let mut wrong = squares.filter(|square| (square - 1.0).abs() > UNIT);
    wrong.next().map(f64::sqrt)
}

/// Records of a snapshot that fits a simulation, which `here` describes, and may be restored in the worlds of the mask
/// (none = all).
///
/// # Errors
/// The first thing that is wrong.
pub(crate) fn check<'a>(
    bytes: &'a [u8],
    here: &Head,
    quaternions: &[usize],
    mask: Option<&[bool]>,
    from_world: Option<usize>,
) -> Result<&'a [u8], SnapshotError> {
    let worlds = fit(bytes, here, true)?;
    match from_world {
        None if worlds != here.worlds => {
            let (got, expected) = (worlds, here.worlds);
            return Err(SnapshotError::Worlds { got, expected });
        }
        Some(got) if got >= worlds => {
            let last = worlds.saturating_sub(1);
            return Err(SnapshotError::FromWorld { got, last });
        }
        _ => {}
    }
    if let Some(mask) = mask
        && mask.len() != here.worlds
    {
        let (got, worlds) = (mask.len(), here.worlds);
        return Err(SnapshotError::Mask { got, worlds });
    }
    let records = &bytes[HEAD..];
    let sources = match from_world {
        Some(world) => world..world + 1,
        None => 0..worlds,
    };
    let is_taken = |world: &usize| from_world.is_some() || mask.is_none_or(|mask| mask[*world]);
    for world in sources.filter(is_taken) {
        let record = &records[world * here.record()..][..here.record()];
        if !is_finite(&record[COUNTERS..], here.precision) {
            return Err(SnapshotError::NotFinite { world });
        }
        if let Some(length) = length_of_none(record, here.real(), quaternions) {
            let length = format!("{length:.3}");
            return Err(SnapshotError::Quaternion { world, length });
        }
    }
    Ok(records)
}

/// Records of a snapshot of as many worlds as a simulation, or more, and which of the simulation's worlds are sound there. For
/// observers: it never left memory, so its checksum is not compared.
///
/// # Errors
/// The first thing that is wrong.
pub(crate) fn first<'a>(
    bytes: &'a [u8],
    here: &Head,
    quaternions: &[usize],
) -> Result<(&'a [u8], Vec<bool>), SnapshotError> {
    let (got, expected) = (fit(bytes, here, false)?, here.worlds);
    if got < expected {
        return Err(SnapshotError::Worlds { got, expected });
    }
    let records = &bytes[HEAD..];
    let world_records = records.chunks_exact(here.record()).take(expected);
    let are_sound = world_records.map(|record| {
        is_finite(&record[COUNTERS..], here.precision)
            && length_of_none(record, here.real(), quaternions).is_none()
    });
    Ok((records, are_sound.collect()))
}

/// Worlds of a snapshot that fits the model and precision of `here`; `is_summed` compares the checksum.
fn fit(bytes: &[u8], here: &Head, is_summed: bool) -> Result<usize, SnapshotError> {
    let (model, worlds, numbers, real) = read_head(bytes)?;
    if is_summed && crc32fast::hash(&bytes[COVERED..]) != word(bytes, 12) {
        return Err(SnapshotError::Damaged);
    }
    if model != here.model {
        let expected = here.model;
        return Err(SnapshotError::Model {
            got: model,
            expected,
        });
    }
    if real != here.real() {
        let (got, expected) = (8 * real as u64, 8 * here.real() as u64);
        return Err(SnapshotError::Precision { got, expected });
    }
    if numbers != here.numbers {
        let (got, expected) = (numbers, here.numbers);
        return Err(SnapshotError::Numbers { got, expected });
    }
    Ok(worlds)
}

/// Model, worlds, scalars per world and bytes of a scalar, of a snapshot with the length that follows from them.
fn read_head(bytes: &[u8]) -> Result<(u64, usize, usize, usize), SnapshotError> {
    if !bytes.starts_with(&MAGIC) {
        return Err(SnapshotError::NotASnapshot);
    }
    let short = |expected| SnapshotError::CutShort {
        got: bytes.len(),
        expected,
    };
    if bytes.len() < HEAD {
        return Err(short(HEAD as u128));
    }
    let version = word(bytes, 8);
    if version != VERSION {
        return Err(SnapshotError::Version { got: version });
    }
    let long = |at| u64::from(word(bytes, at)) | u64::from(word(bytes, at + 4)) << 32;
    let (worlds, numbers, real) = (long(24), word(bytes, 32), word(bytes, 36));
    let record = COUNTERS as u128 + u128::from(numbers) * u128::from(real);
    // a world has at least its counters, so that what overflows here is longer than any snapshot
    let expected = u128::from(worlds)
        .checked_mul(record)
        .map_or(u128::MAX, |records| records.saturating_add(HEAD as u128));
    match (bytes.len() as u128).cmp(&expected) {
        std::cmp::Ordering::Less => Err(short(expected)),
        std::cmp::Ordering::Greater => Err(SnapshotError::Damaged),
        // it lies in memory, so that these fit
        std::cmp::Ordering::Equal => {
            Ok((long(16), worlds as usize, numbers as usize, real as usize))
        }
    }
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// Whether all scalars are finite. Without an early exit, so that it vectorizes.
fn is_finite(numbers: &[u8], precision: Precision) -> bool {
    match precision {
        Precision::F32 => (numbers.as_chunks().0.iter())
            .fold(true, |all, &x| all & f32::from_le_bytes(x).is_finite()),
        Precision::F64 => (numbers.as_chunks().0.iter())
            .fold(true, |all, &x| all & f64::from_le_bytes(x).is_finite()),
    }
}
