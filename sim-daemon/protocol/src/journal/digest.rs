//! Digests of a frame: a number of each world's part of each field, by which a replay finds what differs.

use xxhash_rust::xxh3::xxh3_64;

use crate::Table;

/// XXH3 of bytes, 64 bits.
pub fn checksum(bytes: &[u8]) -> u64 {
    xxh3_64(bytes)
}

/// Digests that a frame of this table has: of its first field those of all worlds, then of the next.
pub fn digests_of(frame: &Table) -> usize {
    frame.rows().iter().map(|row| row.shape[0]).sum()
}

/// Writes the digests of a frame: the lower half of XXH3 of each row of each array, or the row itself where it has 4 bytes.
///
/// # Panics
/// When `arena` is smaller than `frame` says, or `digests` are not as many as [`digests_of`] says.
pub fn digest(frame: &Table, arena: &[u64], digests: &mut [u32]) {
    assert_eq!(digests.len(), digests_of(frame), "room for the digests");
    let bytes: &[u8] = bytemuck::cast_slice(arena);
    let head = Table::head_bytes(frame.rows().len());
    let mut rest = digests;
    for row in frame.rows() {
        let (digests, others) = rest.split_at_mut(row.shape[0]);
        rest = others;
        let array = &bytes[row.offset - head..][..row.bytes];
        let of_world = row.bytes / row.shape[0];
        match of_world {
            0 => digests.fill(0),
            4 => digests.copy_from_slice(bytemuck::cast_slice(array)),
            _ => {
                let parts = array.chunks_exact(of_world);
                for (digest, part) in digests.iter_mut().zip(parts) {
                    *digest = xxh3_64(part) as u32;
                }
            }
        }
    }
}
