//! Frames and buffers as bytes, words and arrays.

/// An array of a frame, by its offset and size [bytes].
pub(super) fn array<T: bytemuck::Pod>(arena: &mut [u64], offset: usize, size: usize) -> &mut [T] {
    bytemuck::cast_slice_mut(&mut bytes(arena)[offset..offset + size])
}

/// A frame as bytes.
pub(super) fn bytes(arena: &mut [u64]) -> &mut [u8] {
    bytemuck::cast_slice_mut(arena)
}

/// Aligned bytes as words.
pub(super) fn words(bytes: &[u8]) -> &[u32] {
    bytemuck::cast_slice(bytes)
}
