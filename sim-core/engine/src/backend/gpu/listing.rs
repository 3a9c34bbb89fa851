//! The kernels that a model becomes on a hardware GPU, for people and for tests. No adapter is needed.

use super::compiled::dispatches_of;
use super::create::{HARDWARE, constants, programs};
use super::kernels::programs::{How, KernelSequence, KernelSource};
use super::kernels::room::Room;
use super::kernels::workgroups;
use crate::backend::BackendError;
use sim_device::{Source, translated};
use sim_model::Model;
use sim_physics::arrays::Layout;
use sim_record::wgsl::Exchange;

/// What a hardware GPU is given of a model.
#[derive(Clone, Debug)]
pub struct Listing {
    /// Kernels of the substeps, then those of the evaluation.
    pub kernels: Vec<KernelListing>,
    /// Memory of a world: state, commands and what stages leave for each other [bytes].
    pub fields_bytes: usize,
    /// Memory of a world: contacts, with the room that it has at the start [bytes].
    pub contacts_bytes: usize,
    /// The same with room for all contacts that there may be [bytes].
    pub contacts_bytes_max: usize,
}

/// A kernel of physics.
#[derive(Clone, Debug)]
pub struct KernelListing {
    /// Its name, as time stamps have it.
    pub label: String,
    /// How often a frame dispatches it.
    pub dispatches: usize,
    /// Threads that share a world.
    pub threads: usize,
    /// Statements of its source.
    pub statements: usize,
    /// Its SPIR-V [bytes].
    pub bytes: usize,
    /// Its source.
    pub wgsl: String,
}

/// Lists the kernels for frames with this layout, with so many threads per world where contacts can be; none = what suits the model.
///
/// # Errors
/// A model that cannot be written as programs of a GPU.
pub fn listing(
    model: &Model,
    layout: &Layout,
    world_threads: Option<usize>,
) -> Result<Listing, BackendError> {
    let threads = world_threads
        .unwrap_or_else(|| workgroups::for_model(model.constants(), workgroups::SUBGROUP));
    let m = &constants(model, threads, layout, false);
    let how = How {
        limits: HARDWARE,
        lanes: threads,
        exchange: Exchange::Subgroup,
        corrections: None,
    };
    let (programs, places, _) = programs(m, layout, model.substeps(), how)?;
    let mut kernels = listed("step", programs.step)?;
    kernels.extend(listed("evaluate", programs.evaluate)?);
    Ok(Listing {
        kernels,
        fields_bytes: 4 * places.len as usize,
        contacts_bytes: 4 * Room::at_start(m).numbers(m),
        contacts_bytes_max: 4 * Room::at_most(m).numbers(m),
    })
}

fn listed(name: &str, sequence: KernelSequence) -> Result<Vec<KernelListing>, BackendError> {
    let KernelSequence { kernels, order } = sequence;
    let list = |(k, kernel): (usize, KernelSource)| {
        let label = format!("{name} {k}");
        let source = Source {
            label: label.clone(),
            wgsl: kernel.wgsl,
            entry: "main".to_owned(),
            // the values do not matter
            constants: [("worlds", 4096), ("workgroup", workgroups::SUBGROUP)]
                .map(|(name, value)| (name.to_owned(), f64::from(value)))
                .into(),
        };
        let spirv = translated(&source, true).map_err(|reason| BackendError::Program { reason })?;
        Ok(KernelListing {
            label,
            dispatches: dispatches_of(k, &order),
            threads: kernel.lanes as usize,
            statements: source.wgsl.matches(';').count(),
            bytes: 4 * spirv.len(),
            wgsl: source.wgsl,
        })
    };
    kernels.into_iter().enumerate().map(list).collect()
}
