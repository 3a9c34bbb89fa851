//! Stands in for `vulkan` on systems without the Vulkan route: types without values, so that only the portable route exists.

#![allow(
    clippy::unused_self,
    reason = "functions of a route that does not exist here"
)]

use crate::allocation::Residence;
use crate::raw_op::RawOp;
use crate::shader::module::Module;
use std::convert::Infallible;
use std::time::Duration;
use thiserror::Error;

/// Has no values.
pub(crate) struct Vulkan(Infallible);
/// Has no values.
pub(crate) struct Handle(pub Infallible);
/// Has no values.
pub(crate) struct Mapped(Infallible);
/// Has no values.
pub(crate) struct Pipeline(Infallible);
/// Has no values.
pub(crate) struct Recording(Infallible);
/// Has no values.
pub(crate) struct RawTimeline(Infallible);

/// Memory as another process imports it.
pub(crate) struct Exported {
    pub memory: Descriptor,
    pub bytes: u64,
    pub dedicated: bool,
}

#[cfg(unix)]
type Descriptor = std::os::fd::OwnedFd;
#[cfg(not(unix))]
type Descriptor = Infallible;

/// Has no values.
#[derive(Debug, Error)]
pub(crate) enum Failure {
    #[error("the device is lost")]
    Lost,
    #[error("{0}")]
    Other(Infallible),
}

/// A buffer: wgpu's handle, Vulkan's, and the mapping of host memory.
pub(crate) type Made = (wgpu::Buffer, Handle, Option<Mapped>);

/// wgpu does not tell.
pub(crate) fn properties(_: &wgpu::Adapter) -> (Option<u64>, bool) {
    (None, false)
}

/// Never on this route.
pub(crate) fn open(
    _: &wgpu::Adapter,
    _: &wgpu::DeviceDescriptor,
) -> Option<Result<(wgpu::Device, wgpu::Queue, Vulkan), String>> {
    None
}

impl Mapped {
    pub fn slice(&self) -> &[u8] {
        match self.0 {}
    }

    pub fn slice_mut(&mut self) -> &mut [u8] {
        match self.0 {}
    }
}

impl RawTimeline {
    pub fn wait(&self, _: u64, _: Duration) -> Result<bool, Failure> {
        match self.0 {}
    }
}

impl Vulkan {
    pub fn driver(&self) -> &str {
        match self.0 {}
    }

    pub fn remember(&mut self, _: &[u8]) {
        match self.0 {}
    }

    pub fn remembered(&self) -> Vec<u8> {
        match self.0 {}
    }

    pub fn probe(&self, _: &wgpu::Device) -> bool {
        match self.0 {}
    }

    pub fn allocate(&self, _: &wgpu::Device, _: u64, _: Residence) -> Result<Made, Failure> {
        match self.0 {}
    }

    /// # Safety
    /// Never called.
    pub unsafe fn import(&self, _: &wgpu::Device, _: *mut u8, _: u64) -> Result<Made, String> {
        match self.0 {}
    }

    pub fn uuid(&self) -> [u8; 16] {
        match self.0 {}
    }

    pub fn allocate_exported(&self, _: &wgpu::Device, _: u64) -> Result<(Made, Exported), String> {
        match self.0 {}
    }

    pub fn timeline(&self) -> Result<(RawTimeline, Descriptor), String> {
        match self.0 {}
    }

    pub fn order(
        &self,
        _: &wgpu::Queue,
        _: Option<(&RawTimeline, u64)>,
        _: Option<(&RawTimeline, u64)>,
    ) {
        match self.0 {}
    }

    pub fn pipeline(&self, _: &Module, _: &str) -> Result<Pipeline, Failure> {
        match self.0 {}
    }

    pub fn record(
        &self,
        _: &[RawOp<'_, Pipeline, Handle>],
        _: bool,
    ) -> Result<Box<Recording>, Failure> {
        match self.0 {}
    }

    pub fn seconds(&self, _: &Recording) -> Vec<f64> {
        match self.0 {}
    }

    pub fn done(&self, _: &Recording) {
        match self.0 {}
    }

    pub fn execute(&self, _: &mut wgpu::CommandEncoder, _: &[&Recording]) -> bool {
        match self.0 {}
    }
}
