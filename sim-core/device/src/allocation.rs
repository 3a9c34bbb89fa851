//! What every allocation has in common, on both routes.

/// Allocations are multiples of this, so that they can be cleared and copied whole [bytes].
pub(crate) const GRAIN: u64 = 16;

/// What every buffer may be used for.
pub(crate) const USAGES: wgpu::BufferUsages = wgpu::BufferUsages::STORAGE
    .union(wgpu::BufferUsages::INDIRECT)
    .union(wgpu::BufferUsages::COPY_SRC)
    .union(wgpu::BufferUsages::COPY_DST);

/// Where memory lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Residence {
    /// Beside the processors of the device.
    Device,
    /// Where the host can read and write it at any time.
    Host,
}
