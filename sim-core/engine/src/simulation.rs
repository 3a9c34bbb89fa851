//! Many worlds of one model: reset, write, step, read.

pub use crate::backend::{
    Faults, FirstFrozen, Frozen, Histogram, LaneWork, Lanes, MachineCode, OutputsAt, Part,
    Precision, Profile, ProgramInfo, StageProfile,
};
pub use crate::options::{AUTO_WORLDS, Device, Options};
pub use crate::random::Draws;

use crate::backend::sharing::Sharing;
use crate::backend::{Backend, BackendError, HostPages};
use crate::canonical::make_canonical;
use crate::options::{backends, check_memory, memory_of};
use crate::random::Episode;
use crate::snapshot::{self, Head, SnapshotError};
use sim_model::Model;
use sim_physics::arrays::{Dtype, Field, Layout};
use sim_physics::constants::options::Integrator;
use std::sync::Arc;

/// Many worlds of one model.
pub struct Simulation {
    model: Arc<Model>,
    worlds: usize,
    precision: Precision,
    layout: Layout,
    freezes_nan: bool,
    /// Whether frames of the processor are made canonical; a GPU does that itself.
    makes_canonical: bool,
    backend: Box<dyn Backend>,
    device_note: Option<String>,
}

impl Simulation {
    /// Worlds at the start state of the model.
    ///
    /// # Errors
    /// Options that are invalid or that this computer cannot meet, memory included (checked before
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
        let senses = options.fields.contains(&Field::Sensordata);
        let integrator = model.constants().integrator;
        let lags = options.outputs_at == OutputsAt::LastSubstep;
        if senses && lags && integrator == Integrator::RungeKutta {
            return Err(BackendError::LastSubstepSensors);
        }
        let refused = model.refused_sensors();
        if senses && !refused.is_empty() {
            return Err(BackendError::Sensors {
                reasons: refused.join("; "),
            });
        }
        check_memory(&model, options, groups)?;
        let layout = Simulation::layout_of(&model, options);
        let (made, device_note) = backends(&model, options, groups, &layout)?;
        let with = |mut backend: Box<dyn Backend>| {
            backend.set_faults(options.faults);
            let is_on_cpu = backend.adapter().is_empty();
            Simulation {
                model: Arc::clone(&model),
                worlds: options.worlds,
                precision: options.precision,
                layout: layout.clone(),
                freezes_nan: options.faults.freezes_nan,
                makes_canonical: options.cpu_bits && is_on_cpu,
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
    /// Name of the processor or GPU, for people.
    pub fn device(&self) -> &str {
        self.backend.device()
    }
    /// Sizes of the machine code of a substep, without rare cases and with them; none where no stage is compiled.
    pub fn compiled(&self) -> Option<[MachineCode; 2]> {
        self.backend.compiled()
    }
    /// Where the machine code of a substep is in memory: address, bytes and stage of each piece; empty where no stage is compiled.
    pub fn code_pieces(&self) -> Vec<(usize, usize, &'static str)> {
        self.backend.code_pieces()
    }
    /// Why [`Device::Auto`] chose this device, for people.
    pub fn device_note(&self) -> Option<&str> {
        self.device_note.as_deref()
    }
    /// The error that lost the device. Frames do not change after it.
    pub fn lost(&self) -> Option<&BackendError> {
        self.backend.lost()
    }
    /// Loses the device, as a driver may. For tests of the error path.
    #[doc(hidden)]
    pub fn lose(&mut self) {
        self.backend.lose();
    }
    /// Sets the bounds and what happens to faulted worlds. For tests: clients give them at the launch.
    #[doc(hidden)]
    pub fn set_faults(&mut self, faults: Faults) {
        self.backend.set_faults(faults);
    }
    /// Name of the GPU, empty on the CPU.
    pub fn adapter(&self) -> &str {
        self.backend.adapter()
    }
    /// How frames reach arenas: `direct` on the CPU, `imported` on a GPU that can write into those of [`Simulation::import`], otherwise
    /// `copied`.
    pub fn delivery(&self) -> &'static str {
        self.backend.delivery()
    }
    /// Bytes of frames that the processor has copied; 0 if the device writes into the arenas itself.
    pub fn copied(&self) -> u64 {
        self.backend.copied()
    }
    /// Joint positions of all worlds, `(worlds, coords)` [rad or m].
    pub fn positions(&self) -> Vec<f64> {
        let coords = self.model.coords();
        snapshot::positions(&self.snapshot(), &self.head(), self.model.dofs(), coords)
    }
    /// Lets a GPU write into this arena whenever it is stepped into; false if it cannot, and on the CPU, which always writes there.
    ///
    /// The `owner` of its pages is asked for when the arena comes for the first time. The GPU owns them too from then on, until
    /// [`Simulation::forget`] or the end of the simulation.
    pub fn import(
        &mut self,
        arena: &[u64],
        owner: &dyn Fn() -> Option<Arc<dyn HostPages>>,
    ) -> bool {
        self.backend.import(arena, owner)
    }
    /// Forgets all imported arenas, whose pages go with their last owner, and the memory of a GPU that a client maps.
    pub fn forget(&mut self) {
        self.backend.forget();
    }
    /// The memory of a GPU that clients can map; none on the CPU.
    pub fn sharing(&mut self) -> Option<&mut dyn Sharing> {
        self.backend.sharing()
    }
    /// The programs of a GPU; none on the CPU.
    pub fn programs(&self) -> &[ProgramInfo] {
        self.backend.programs()
    }
    /// Contacts of a class that a world of a GPU has room for now; none where all have room from the start, as on the CPU.
    pub fn contact_room(&self) -> Option<usize> {
        self.backend.contact_room()
    }
    /// What each command of the last frame took on a GPU, of its first tile [s]: the name of a program, or `copy`. Empty unless
    /// `Options::replay` is `Replay::Timed`, and on the CPU.
    pub fn seconds(&self) -> Vec<(&str, f64)> {
        self.backend.seconds()
    }
    /// Threads that a step uses.
    pub fn threads(&self) -> usize {
        self.backend.threads()
    }
    /// What the draws of the first worlds depend on, as many as fit.
    pub fn episodes(&self, to: &mut [Episode]) {
        self.backend.episodes(to);
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

    /// Resets the worlds of the mask (none = all): start state, `joint_f` 0, targets of the scene.
    ///
    /// Values with a distribution in the scene are drawn from (seed, world, episode), or with [`Draws::Seed`] from (seed, episode). A
    /// reset starts the next episode of a world. With a seed, one for all worlds or one per world, it starts the first episode of that
    /// seed. Seed and episode are 0 at first.
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

    /// Counts of the worlds that were frozen since the last call, for people.
    pub fn take_frozen(&mut self) -> Frozen {
        self.backend.take_frozen()
    }

    /// All worlds as bytes, from which a run resumes bit for bit; [`crate::snapshot`] describes the format. Invalid if
    /// [`Simulation::lost`] reports an error afterwards.
    pub fn snapshot(&self) -> Vec<u8> {
        let mut bytes = vec![0; self.snapshot_bytes(self.worlds)];
        self.snapshot_first(self.worlds, &mut bytes);
        bytes
    }

    /// A snapshot of the first worlds alone, for observers.
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
        let records = snapshot::check(bytes, &self.head(), &self.quaternions(), mask, from_world)?;
        self.backend.restore(records, mask, from_world);
        Ok(())
    }

    /// Sets all worlds to the first ones of a snapshot, which may have more, for observers. A world that is not finite in the snapshot,
    /// or has no rotation, stays as it is, and the checksum is not compared.
    ///
    /// # Errors
    /// Bytes that are no snapshot, or not of this model and precision, or of fewer worlds; nothing is changed then.
    pub fn restore_first(&mut self, bytes: &[u8]) -> Result<(), SnapshotError> {
        let (records, are_sound) = snapshot::first(bytes, &self.head(), &self.quaternions())?;
        self.backend.restore(records, Some(&are_sound), None);
        Ok(())
    }

    /// Places of quaternions in the scalars of a world in a snapshot.
    fn quaternions(&self) -> Vec<usize> {
        snapshot::quaternions(self.model.constants().quaternions(), self.model.dofs())
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
        self.run(self.model.substeps(), arena);
    }

    fn run(&mut self, substeps: usize, arena: &mut [u64]) {
        self.backend.run(substeps, arena);
        self.finish(arena);
    }

    /// Leaves a frame as it is shown.
    fn finish(&self, arena: &mut [u64]) {
        if self.makes_canonical {
            make_canonical(&self.layout, arena);
        }
    }

    /// As [`Simulation::step`], on one thread, and adds what that took to a profile; false on a GPU, where nothing is done.
    ///
    /// # Panics
    /// As [`Simulation::step`].
    pub fn step_profiled(&mut self, arena: &mut [u64], to: &mut Profile) -> bool {
        let done = self.backend.run_profiled(self.model.substeps(), arena, to);
        self.finish(arena);
        done
    }

    /// Evaluates every field at the present state into the arena, without stepping.
    ///
    /// # Panics
    /// If the arena (8-byte words) is smaller than the layout.
    pub fn forward(&mut self, arena: &mut [u64]) {
        self.run(0, arena);
    }
}
