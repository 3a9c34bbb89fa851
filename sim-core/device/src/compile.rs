//! Compiles programs on all cores.

use crate::device::Device;
use crate::error::DeviceError;
use crate::program::workers::within;
use crate::program::{Program, build, read};
use crate::shader::source::Source;
use crate::software;
use std::time::Duration;

impl Device {
    /// Compiles programs on all cores and runs each once without workgroups; the order is kept.
    ///
    /// A driver that exceeds `limit` cannot be stopped. Its thread is abandoned and keeps the device open until the driver returns;
    /// `compiling` counts such threads. Call [`crate::leave`] before the process exits.
    ///
    /// Errors: the first program that does not compile, takes too long or needs more than the adapter has. Programs that compile at
    /// that moment are finished and dropped.
    pub fn programs(
        &self,
        sources: &[Source],
        limit: Duration,
    ) -> Result<Vec<Program>, DeviceError> {
        self.inner.alive()?;
        let translated = software::precompile(self, sources, limit)?;
        let labels = sources.iter().map(|source| source.label.clone()).collect();
        let sources = sources.to_vec();
        let inner = self.inner.clone();
        let compile = move |place: usize| {
            let source = &sources[place];
            let module = match &translated[place] {
                Some(module) => module.clone(),
                None => read(&inner, source)?,
            };
            build(&inner, source, module, limit)
        };
        let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
        let made = within(&self.inner, labels, cores, limit, compile);
        self.inner.alive()?;
        let made = made?;
        let first_runs = software::run_empty(self, &made, limit);
        self.inner.alive()?;
        first_runs?;
        if let (Some(vulkan), Some(cache)) = (&self.inner.vulkan, &self.inner.cache) {
            cache.keep_pipelines(&vulkan.remembered());
            cache.keep_within_bounds();
        }
        Ok(made)
    }
}
