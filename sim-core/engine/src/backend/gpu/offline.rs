//! The kernels of a model without a device, as benches/gpu/offline judges them.

use super::blocks::with_blocks;
use super::bookkeeping;
use super::merged::merged;
use super::places::Places;
use super::programs::{How, Programs};
use super::show;
use super::workgroups::{BOOKKEEPING, SUBGROUP};
use super::{create, software};
use crate::backend::state::{Shape, finds_contacts};
use crate::backend::{BackendError, COUNTERS};
use sim_model::Model;
use sim_physics::arrays::{Array, Field, Layout};
use sim_physics::constants::Constants;
use sim_physics::schedule::evaluation_stages;
use sim_record::split::Part;
use sim_record::wgsl::Exchange;

/// The drivers that kernels are made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// Hardware GPUs.
    Hardware,
    /// The software driver.
    Software,
}

/// A kernel.
pub struct OfflineKernel {
    /// Its name.
    pub label: String,
    /// Its source.
    pub wgsl: String,
    /// Threads per workgroup.
    pub workgroup: u32,
}

/// All kernels of a model, their order, and where values lie.
pub struct Offline {
    /// Those of a step first, then those of an evaluation, then the others in the order of a frame.
    pub kernels: Vec<OfflineKernel>,
    /// Dispatches of a frame's substeps.
    pub step: Vec<Part>,
    /// Dispatches of an evaluation; numbers follow those of the step's kernels.
    pub evaluate: Vec<Part>,
    /// Substeps per frame.
    pub substeps: usize,
    /// Values per world in `fields`.
    pub fields: u32,
    /// The first of them: what a frame starts from.
    pub state: u32,
    /// The first of them: what a frame changes.
    pub moving: u32,
    /// Values per world in `scratch`.
    pub scratch: usize,
    /// Tables of the model.
    pub numbers: Vec<f32>,
    /// Indices of tables of the model.
    pub indices: Vec<u32>,
    record: Vec<u32>,
}

impl Offline {
    /// Records the kernels of a model that shows these fields.
    ///
    /// # Errors
    /// Physics code that cannot be recorded.
    pub fn new(
        model: &Model,
        layout: &Layout,
        target: Target,
        lanes: usize,
        cuts: create::Cuts,
    ) -> Result<Offline, BackendError> {
        let constants: Constants<f32> = match lanes {
            1 => model.constants().cast(),
            _ => with_blocks(merged(model.constants())).cast(),
        };
        let m = &constants;
        let computed: Vec<(Field, usize)> = show::computed(layout);
        let mut places = Places::new(m, &computed);
        let fields = layout.slots.iter().map(|slot| slot.field);
        let shown = evaluation_stages(m, fields.clone());
        let wanted: Vec<Array> = fields.flat_map(show::copied).collect();
        let limits = cuts.replace(match target {
            Target::Hardware => create::HARDWARE,
            Target::Software => software::LIMITS,
        });
        let programs = Programs::new(
            m,
            &places,
            model.substeps(),
            &shown,
            &computed,
            &wanted,
            How {
                limits,
                lanes,
                exchange: Exchange::Subgroup,
            },
        )
        .map_err(|e| BackendError::Program {
            reason: e.to_string(),
        })?;
        places.len += programs.spare;
        let frame_s = model.substeps() as f64 * model.dt();
        let sensors = model.contact_sensors();
        let shapes = sensors.first().map_or(0, |sensor| sensor.of.len());
        let mut kernels = Vec::new();
        for (name, sequence) in [("step", &programs.step), ("evaluate", &programs.evaluate)] {
            for (k, kernel) in sequence.kernels.iter().enumerate() {
                kernels.push(OfflineKernel {
                    label: format!("{name} {k}"),
                    wgsl: kernel.wgsl.clone(),
                    workgroup: SUBGROUP,
                });
            }
        }
        let counts = finds_contacts(&shown);
        let check_faults = bookkeeping::check_faults(&places, m, !counts);
        let around = [
            ("rows", Some(bookkeeping::ROWS.to_owned())),
            ("begin", Some(bookkeeping::begin(&places, true))),
            ("check faults", Some(check_faults)),
            ("show", Some(show::show(&places, layout, frame_s, counts))),
            ("contacts", show::contacts(m, &places, layout, shapes)),
        ];
        for (label, wgsl) in around {
            kernels.extend(wgsl.map(|wgsl| OfflineKernel {
                label: label.to_owned(),
                wgsl,
                workgroup: BOOKKEEPING,
            }));
        }
        Ok(Offline {
            kernels,
            step: programs.step.order,
            evaluate: programs.evaluate.order,
            substeps: model.substeps(),
            fields: places.len,
            state: places.state,
            moving: places.moving,
            scratch: m.contacts.memory.len,
            numbers: m.contacts.tables.numbers.clone(),
            indices: m.contacts.tables.indices.clone(),
            record: places.record(Shape::of(m)),
        })
    }

    /// The values of all worlds of a snapshot of single precision, [`Offline::state`] a world, in the order of `fields`.
    pub fn states(&self, snapshot: &[u8], worlds: usize) -> Vec<f32> {
        let record = COUNTERS + 4 * self.record.len();
        let records = &snapshot[snapshot.len() - worlds * record..];
        let mut states = vec![0.0; worlds * self.state as usize];
        for (record, state) in records
            .chunks_exact(record)
            .zip(states.chunks_exact_mut(self.state as usize))
        {
            for (x, place) in record[COUNTERS..].chunks_exact(4).zip(&self.record) {
                state[*place as usize] = f32::from_le_bytes(std::array::from_fn(|k| x[k]));
            }
        }
        states
    }
}
