//! Many worlds of one model: reset, write, step, read.

pub use crate::backend::{Faults, FirstFrozen, Frozen, Lanes, Precision, ProgramFacts};
pub use crate::options::{AUTO_WORLDS, Device, Options};
pub use crate::random::Draws;

use crate::backend::{Backend, BackendError, Values};
use crate::options::{backends, check_memory, memory_of};
use crate::snapshot::{self, Head, SnapshotError};
use sim_model::Model;
use sim_physics::arrays::{Dtype, Field, Group, Layout};
use sim_physics::constants::Motion;
use std::ops::Range;
use std::sync::Arc;

/// Shortest quaternion that says a rotation.
const QUATERNION_MIN: f64 = 1e-6;

/// Many worlds of one model.
pub struct Simulation {
    model: Arc<Model>,
    worlds: usize,
    precision: Precision,
    layout: Layout,
    freezes_nan: bool,
    backend: Box<dyn Backend>,
    device_note: Option<String>,
}

impl Simulation {
    /// Worlds at the start state of the model.
    ///
    /// # Errors
    /// Options that make no sense or that this machine cannot meet, memory included (checked before
    /// it is taken).
    pub fn new(model: Arc<Model>, options: &Options) -> Result<Simulation, BackendError> {
        let mut made = Simulation::groups(model, options, 1)?;
        Ok(made.pop().expect("one group was asked for"))
    }

    /// Groups of worlds, `options.worlds` in each, that share threads and step independently: group `g` has the worlds from number
    /// `options.first_world + g * options.worlds` on, and the bits that these have where all are together.
    ///
    /// # Errors
    /// As of [`Simulation::new`].
    pub fn groups(
        model: Arc<Model>,
        options: &Options,
        groups: usize,
    ) -> Result<Vec<Simulation>, BackendError> {
        if options.worlds == 0 {
            return Err(BackendError::NoWorlds);
        }
        if options.threads == Some(0) {
            return Err(BackendError::NoThreads);
        }
        let Faults {
            joint_q_max,
            joint_qd_max,
            ..
        } = options.faults;
        for (bound, value) in [("joint_q", joint_q_max), ("joint_qd", joint_qd_max)] {
            if value <= 0.0 || value.is_nan() {
                return Err(BackendError::Bound { bound, value });
            }
        }
        check_memory(&model, options, groups)?;
        let layout = Simulation::layout_of(&model, options);
        let (made, device_note) = backends(&model, options, groups, &layout)?;
        let with = |mut backend: Box<dyn Backend>| {
            backend.set_faults(options.faults);
            Simulation {
                model: Arc::clone(&model),
                worlds: options.worlds,
                precision: options.precision,
                layout: layout.clone(),
                freezes_nan: options.faults.freezes_nan,
                backend,
                device_note: device_note.clone(),
            }
        };
        Ok(made.into_iter().map(with).collect())
    }

    pub(crate) fn backend(&self) -> &dyn Backend {
        &*self.backend
    }
    pub(crate) fn backend_mut(&mut self) -> &mut dyn Backend {
        &mut *self.backend
    }
    pub(crate) fn freezes_nan(&self) -> bool {
        self.freezes_nan
    }
    /// The model.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }
    /// Number of worlds.
    pub fn worlds(&self) -> usize {
        self.worlds
    }
    /// Precision of the run.
    pub fn precision(&self) -> Precision {
        self.precision
    }
    /// What it runs on, for people.
    pub fn device(&self) -> &str {
        self.backend.device()
    }
    /// Why [`Device::Auto`] chose what it runs on, for people.
    pub fn device_note(&self) -> Option<&str> {
        self.device_note.as_deref()
    }
    /// What made it useless: a device that is gone. Frames stay as they are from then on.
    pub fn lost(&self) -> Option<&BackendError> {
        self.backend.lost()
    }
    /// Loses the device, as a driver might. For tests of what comes after.
    #[doc(hidden)]
    pub fn lose(&mut self) {
        self.backend.lose();
    }
    /// Name of the GPU, empty on the CPU.
    pub fn adapter(&self) -> &str {
        self.backend.adapter()
    }
    /// How frames reach arenas: `direct` on the CPU; of a GPU `imported` where it can write into those of [`Simulation::import`],
    /// else `copied`.
    pub fn delivery(&self) -> &'static str {
        self.backend.delivery()
    }
    /// Bytes of frames that the processor has copied: 0 where the device writes into the arenas itself.
    pub fn copied(&self) -> u64 {
        self.backend.copied()
    }
    /// Lets a GPU write into this arena whenever it is stepped into; false where it cannot, and on the CPU, which always does.
    ///
    /// # Safety
    /// Its memory stays mapped where it is, to the same pages, until [`Simulation::forget`] or the end of the simulation, and
    /// nothing else that lies in its pages is written during a step.
    pub unsafe fn import(&mut self, arena: &mut [u64]) -> bool {
        // SAFETY: by contract.
        unsafe { self.backend.import(arena) }
    }
    /// Forgets all arenas that were imported: their memory may go.
    pub fn forget(&mut self) {
        self.backend.forget();
    }
    /// The programs of a GPU; none on the CPU.
    pub fn programs(&self) -> &[ProgramFacts] {
        self.backend.programs()
    }
    /// Threads that a step uses.
    pub fn threads(&self) -> usize {
        self.backend.threads()
    }
    /// Arrays that `step` and `forward` write.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The layout that a simulation would have.
    pub fn layout_of(model: &Model, options: &Options) -> Layout {
        let real = match options.precision {
            Precision::F32 => Dtype::F32,
            Precision::F64 => Dtype::F64,
        };
        Layout::new(&model.sizes(), options.worlds, real, &options.fields)
    }

    /// Memory that the worlds take in this process, an arena not included [bytes].
    pub fn memory_of(model: &Model, options: &Options) -> u64 {
        memory_of(model, options)
    }

    /// Sets columns of the state in the worlds of the mask (none = all), and clears their warm start.
    ///
    /// `values` is `(worlds, columns)`, world-major; rows of other worlds are not looked at.
    ///
    /// # Errors
    /// A field that is no state, columns, length or mask that do not fit, a value that is not finite or a
    /// quaternion without direction; nothing is written then.
    pub fn write(
        &mut self,
        field: Field,
        columns: Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) -> Result<(), BackendError> {
        self.check(field, Group::State, &columns, values, mask)?;
        self.backend.write(field, columns, values, mask);
        Ok(())
    }

    /// Back to the start state, `joint_f` 0 and targets as in the scene, in the worlds of the mask (none = all).
    ///
    /// What of state and parameters the scene has distributions of is drawn from (seed, world, episode), or with [`Draws::Seed`] from
    /// (seed, episode). A reset starts the next episode of a world; with a seed, one for all or one a world, the first one of that seed. Seed and episode are 0 at first.
    ///
    /// # Errors
    /// A mask or seeds of the wrong length; no world is touched then.
    pub fn reset(
        &mut self,
        mask: Option<&[bool]>,
        seed: Option<&[u64]>,
    ) -> Result<(), BackendError> {
        self.check_mask(mask)?;
        if let Some(seed) = seed
            && seed.len() != 1
            && seed.len() != self.worlds
        {
            return Err(BackendError::Seeds {
                got: seed.len(),
                worlds: self.worlds,
            });
        }
        self.backend.reset(mask, seed);
        Ok(())
    }

    /// The worlds that were frozen since this was asked last, counted for people.
    pub fn take_frozen(&mut self) -> Frozen {
        self.backend.take_frozen()
    }

    /// All worlds as bytes, from which a run resumes bit for bit; [`crate::snapshot`] says how they lie. Worthless where
    /// [`Simulation::lost`] says so after it.
    pub fn snapshot(&self) -> Vec<u8> {
        let mut bytes = vec![0; self.snapshot_bytes(self.worlds)];
        self.snapshot_first(self.worlds, &mut bytes);
        bytes
    }

    /// A snapshot of the first worlds alone, for those who look on.
    ///
    /// # Panics
    /// If `to` is not of [`Simulation::snapshot_bytes`], or there are fewer worlds.
    pub fn snapshot_first(&self, worlds: usize, to: &mut [u8]) {
        assert!(worlds <= self.worlds, "there are fewer worlds");
        let head = Head {
            worlds,
            ..self.head()
        };
        assert_eq!(to.len(), head.bytes(), "another size than a snapshot's");
        snapshot::write(&head, to, |records| self.backend.save(records));
    }

    /// Bytes of a snapshot of so many worlds.
    pub fn snapshot_bytes(&self, worlds: usize) -> usize {
        let head = self.head();
        Head { worlds, ..head }.bytes()
    }

    /// Sets the worlds of the mask (none = all) to what a snapshot has of them, counters and commands included;
    /// with `from_world`, all of them to that world of the snapshot, which may then have another number of worlds.
    ///
    /// # Errors
    /// Bytes that are no snapshot, or damaged, or not of this model, precision and number of worlds; a world that the
    /// snapshot does not have; a mask of the wrong length; nothing is changed then.
    pub fn restore(
        &mut self,
        bytes: &[u8],
        mask: Option<&[bool]>,
        from_world: Option<usize>,
    ) -> Result<(), SnapshotError> {
        let records = snapshot::check(bytes, &self.head(), mask, from_world)?;
        self.backend.restore(records, mask, from_world);
        Ok(())
    }

    /// Sets all worlds to the first ones of a snapshot, which may have more, for those who look on: a world that is not finite
    /// there stays as it is, and a checksum is not asked for.
    ///
    /// # Errors
    /// Bytes that are no snapshot, or not of this model and precision, or of fewer worlds; nothing is changed then.
    pub fn restore_first(&mut self, bytes: &[u8]) -> Result<(), SnapshotError> {
        let (records, are_finite) = snapshot::first(bytes, &self.head())?;
        self.backend.restore(records, Some(&are_finite), None);
        Ok(())
    }

    fn head(&self) -> Head {
        Head {
            model: self.model.hash(),
            worlds: self.worlds,
            numbers: self.backend.numbers(),
            precision: self.precision,
        }
    }

    /// Advances every world by one control frame, then writes every field into the arena.
    ///
    /// # Panics
    /// If the arena (8-byte words) is smaller than the layout.
    pub fn step(&mut self, arena: &mut [u64]) {
        self.backend.run(self.model.substeps(), arena);
    }

    /// Evaluates every field at the present state into the arena, without stepping.
    ///
    /// # Panics
    /// If the arena (8-byte words) is smaller than the layout.
    pub fn forward(&mut self, arena: &mut [u64]) {
        self.backend.run(0, arena);
    }

    /// Checks what [`Simulation::command`] or [`Simulation::write`] would, without setting anything:
    /// so that of several arrays none is set when one is wrong.
    ///
    /// # Errors
    /// As theirs; `group` is the one the field must be of. Rows of worlds outside the mask are not looked at.
    pub fn check(
        &self,
        field: Field,
        group: Group,
        columns: &Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) -> Result<(), BackendError> {
        self.check_mask(mask)?;
        let row = field.row();
        if row.group != group {
            let choices = Field::ALL
                .iter()
                .map(|field| field.row())
                .filter(|row| row.group == group);
            return Err(BackendError::Group {
                field: row.name,
                expected: if group == Group::State {
                    "part of the state"
                } else {
                    "a command"
                },
                choices: choices.map(|row| row.name).collect::<Vec<_>>().join(", "),
            });
        }
        let all = field.elements(&self.model.sizes());
        self.check_shape(row.name, all, columns, values.len())?;
        let names = match field {
            Field::JointQ => self.model.coord_names(),
            _ => self.model.dof_names(),
        };
        let row_of = |world: usize| world * columns.len()..(world + 1) * columns.len();
        let not_finite = match mask {
            None => values.first_not_finite(0..values.len(), self.precision),
            Some(mask) => (0..self.worlds)
                .filter(|&world| mask[world])
                .find_map(|world| values.first_not_finite(row_of(world), self.precision)),
        };
        let is_kept_out = self.freezes_nan && group == Group::Command;
        if let Some(place) = not_finite.filter(|_| !is_kept_out) {
            return Err(BackendError::NotFinite {
                field: row.name,
                world: place / columns.len(),
                name: names[columns.start + place % columns.len()].clone(),
                value: self.precision.round(values.at(place)),
            });
        }
        match field {
            Field::JointQ => self.check_quaternions(columns, values, mask)?,
            Field::JointTargetQ | Field::JointTargetQd => {
                self.check_targets(field, columns, values)?;
            }
            _ => {}
        }
        Ok(())
    }

    /// Refuses columns or a number of values that do not fit; `all` columns there are.
    pub(crate) fn check_shape(
        &self,
        field: &'static str,
        all: usize,
        columns: &Range<usize>,
        got: usize,
    ) -> Result<(), BackendError> {
        if columns.start > columns.end || columns.end > all {
            return Err(BackendError::Columns {
                field,
                columns: all,
                start: columns.start,
                end: columns.end,
            });
        }
        let expected = self.worlds * columns.len();
        if got != expected {
            return Err(BackendError::Length {
                field,
                got,
                expected,
                worlds: self.worlds,
                columns: columns.len(),
            });
        }
        Ok(())
    }

    /// Refuses targets of a free body: nothing drives it, and nothing is dropped in silence.
    fn check_targets(
        &self,
        field: Field,
        columns: &Range<usize>,
        values: Values<'_>,
    ) -> Result<(), BackendError> {
        let bodies = &self.model.constants().bodies;
        let free = bodies.iter().filter(|body| body.motion == Motion::Free);
        for dof in free
            .flat_map(|body| body.dofs())
            .filter(|dof| columns.contains(dof))
        {
            for world in 0..self.worlds {
                let place = world * columns.len() + dof - columns.start;
                let value = match values {
                    Values::F32(v) => f64::from(v[place]),
                    Values::F64(v) => v[place],
                };
                if value.abs() > 0.0 {
                    return Err(BackendError::FreeTarget {
                        field: field.row().name,
                        world,
                        name: self.model.dof_names()[dof].clone(),
                        value,
                    });
                }
            }
        }
        Ok(())
    }

    /// Refuses quaternions that are no rotation; those of another length than 1 are made unit.
    fn check_quaternions(
        &self,
        columns: &Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) -> Result<(), BackendError> {
        for first in self.model.constants().quaternions() {
            if first + 4 <= columns.start || columns.end <= first {
                continue;
            }
            let name = || self.model.coord_names()[first].clone();
            if first < columns.start || columns.end < first + 4 {
                return Err(BackendError::PartOfQuaternion { name: name() });
            }
            for world in (0..self.worlds).filter(|&world| mask.is_none_or(|mask| mask[world])) {
                let place = world * columns.len() + first - columns.start;
                let square: f64 = (place..place + 4)
                    .map(|i| match values {
                        Values::F32(v) => f64::from(v[i]).powi(2),
                        Values::F64(v) => v[i].powi(2),
                    })
                    .sum();
                if !square.is_finite() || square < QUATERNION_MIN * QUATERNION_MIN {
                    return Err(BackendError::Quaternion {
                        name: name(),
                        world,
                    });
                }
            }
        }
        Ok(())
    }

    /// Checks the length of a mask.
    ///
    /// # Errors
    /// A mask of the wrong length.
    pub fn check_mask(&self, mask: Option<&[bool]>) -> Result<(), BackendError> {
        match mask {
            Some(mask) if mask.len() != self.worlds => Err(BackendError::Mask {
                got: mask.len(),
                worlds: self.worlds,
            }),
            _ => Ok(()),
        }
    }
}
