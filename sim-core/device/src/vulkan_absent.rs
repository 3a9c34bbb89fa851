//! Where this crate has no Vulkan route: types of which there are no values, so that the other route is the only one.

#![allow(
    clippy::unused_self,
    reason = "the functions of the route that is not here"
)]

use crate::batch::Command;
use crate::module::Module;
use std::convert::Infallible;
use thiserror::Error;

/// There is none.
pub(crate) struct Vulkan(Infallible);
/// There is none.
pub(crate) struct Handle(pub Infallible);
/// There is none.
pub(crate) struct Mapped(Infallible);
/// There is none.
pub(crate) struct Pipeline(Infallible);
/// There is none.
pub(crate) struct Recording(Infallible);

/// There is none.
#[derive(Debug, Error)]
pub(crate) enum Failure {
    #[error("the device is lost")]
    Lost,
    #[error("{0}")]
    Other(Infallible),
}

/// Where memory shall lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    Device,
    Host,
}

/// What a buffer is made of.
pub(crate) type Made = (wgpu::Buffer, Handle, Option<Mapped>);

/// wgpu does not tell.
pub(crate) fn facts(_: &wgpu::Adapter) -> (Option<u64>, bool) {
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

    pub fn allocate(&self, _: &wgpu::Device, _: u64, _: Place) -> Result<Made, Failure> {
        match self.0 {}
    }

    /// # Safety
    /// Never called.
    pub unsafe fn import(&self, _: &wgpu::Device, _: *mut u8, _: u64) -> Result<Made, String> {
        match self.0 {}
    }

    pub fn pipeline(&self, _: &Module, _: &str) -> Result<Pipeline, Failure> {
        match self.0 {}
    }

    pub fn record(&self, _: &[Command]) -> Result<Box<Recording>, Failure> {
        match self.0 {}
    }

    pub fn execute(&self, _: &mut wgpu::CommandEncoder, _: &[&Recording]) -> bool {
        match self.0 {}
    }
}
