//! Errors of backends and their arguments.

/// An invalid argument, or one that this computer cannot meet.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BackendError {
    /// No worlds.
    #[error("worlds is 0; ask for at least 1")]
    NoWorlds,
    /// No threads.
    #[error("threads is 0; ask for at least 1, or leave it out")]
    NoThreads,
    /// More memory than is available.
    #[error(
        "{worlds} worlds need {needed_mb} MB of memory and {available_mb} MB are available; ask for fewer worlds or fields"
    )]
    Memory {
        /// Worlds asked for.
        worlds: usize,
        /// [MB]
        needed_mb: u64,
        /// [MB]
        available_mb: u64,
    },
    /// A block width that this processor does not support.
    #[error(
        "this processor has no {instructions}, which {lanes} worlds a block need; use lanes = auto"
    )]
    Lanes {
        /// Worlds a block.
        lanes: usize,
        /// Instruction set.
        instructions: &'static str,
    },
    /// The system does not start so many threads.
    #[error("cannot start {threads} threads: {reason}; ask for fewer")]
    Threads {
        /// Threads asked for.
        threads: usize,
        /// The system's message.
        reason: String,
    },
    /// A field of another group.
    #[error("field `{field}` is not {expected}; use one of: {choices}")]
    Group {
        /// The field.
        field: &'static str,
        /// What would be.
        expected: &'static str,
        /// Fields that are.
        choices: String,
    },
    /// Sensors of MuJoCo models that cannot be shown.
    #[error(
        "field `sensordata` cannot be shown: {reasons}; remove them from the model, or leave the field out"
    )]
    Sensors {
        /// A sentence per sensor.
        reasons: String,
    },
    /// A value that is neither on nor off.
    #[error("`{field}` of `{name}` in world {world} is {value}; give 1 for on, 0 for off")]
    Switch {
        /// The field.
        field: &'static str,
        /// World of the value.
        world: usize,
        /// What it switches.
        name: String,
        /// The value.
        value: f64,
    },
    /// Columns outside of a field.
    #[error("field `{field}` has {columns} columns; {start}..{end} is outside")]
    Columns {
        /// The field.
        field: &'static str,
        /// Columns it has.
        columns: usize,
        /// First asked for.
        start: usize,
        /// One past the last asked for.
        end: usize,
    },
    /// An array of the wrong size.
    #[error(
        "`{field}` has {got} values; {worlds} worlds × {columns} columns = {expected} are needed"
    )]
    Length {
        /// The field.
        field: &'static str,
        /// Values given.
        got: usize,
        /// Values needed.
        expected: usize,
        /// Worlds of the simulation.
        worlds: usize,
        /// Columns written.
        columns: usize,
    },
    /// A mask of the wrong size.
    #[error("the mask has {got} entries; the simulation has {worlds} worlds")]
    Mask {
        /// Entries given.
        got: usize,
        /// Worlds of the simulation.
        worlds: usize,
    },
    /// Seeds of the wrong number.
    #[error("seed has {got} entries; give one, or one per world, of which there are {worlds}")]
    Seeds {
        /// Entries given.
        got: usize,
        /// Worlds of the simulation.
        worlds: usize,
    },
    /// A target of a free body.
    #[error(
        "`{field}` is {value} in world {world} for `{name}`, which is free and has no drive; nothing was written, send 0 and push it with joint_f"
    )]
    FreeTarget {
        /// The field.
        field: &'static str,
        /// First world concerned.
        world: usize,
        /// `robot/joint.part`.
        name: String,
        /// The value.
        value: f64,
    },
    /// A quaternion without direction.
    #[error(
        "the quaternion that begins at `{name}` has no direction in world {world}; nothing was written, send (x, y, z, w) of length 1"
    )]
    Quaternion {
        /// First coordinate.
        name: String,
        /// First world concerned.
        world: usize,
    },
    /// Some entries of a quaternion without the others.
    #[error(
        "the columns hold only a part of the quaternion that begins at `{name}`; write all four entries"
    )]
    PartOfQuaternion {
        /// First coordinate.
        name: String,
    },
    /// NaN or infinity.
    #[error(
        "`{field}` is {value} in world {world} for `{name}`; nothing was written, send finite numbers"
    )]
    NotFinite {
        /// The field.
        field: &'static str,
        /// First world concerned.
        world: usize,
        /// `robot/joint`.
        name: String,
        /// The value.
        value: f64,
    },
    /// A parameter that does not vary in this run.
    #[error(
        "`{param}` is the same constant in all worlds of this run; to write it, name it at launch: params=(\"{param}\",) (of this run vary: {varying})"
    )]
    Constant {
        /// The parameter.
        param: &'static str,
        /// Those that vary.
        varying: String,
    },
    /// A parameter that is too small.
    #[error(
        "`{param}` is {value} in world {world} for `{name}`; nothing was written, give at least {least}"
    )]
    BelowLeast {
        /// The parameter.
        param: &'static str,
        /// The world.
        world: usize,
        /// What it is of.
        name: String,
        /// The value.
        value: f64,
        /// The least that it may be.
        least: f64,
    },
    /// A command delay beyond the scene's `command_delay_max`.
    #[error(
        "command_delay is {value} in world {world}; nothing was written, give at most {most}, or more room with the scene's command_delay_max"
    )]
    Delay {
        /// The world.
        world: usize,
        /// The value [substeps].
        value: f64,
        /// The most that it may be [substeps].
        most: usize,
    },
    /// A position gain of a drive that follows velocities.
    #[error(
        "joint_target_ke of `{name}` is {value}, but its drive follows velocity targets only; give 0, or another target mode in the scene"
    )]
    VelocityMode {
        /// The joint.
        name: String,
        /// The gain.
        value: f64,
    },
    /// A bound that every world exceeds.
    #[error("the bound of {bound} is {value}; give a number above 0, or infinity for none")]
    Bound {
        /// What it bounds.
        bound: &'static str,
        /// The bound.
        value: f64,
    },
    /// An error of an accelerator or its driver.
    #[error("{reason}")]
    Device {
        /// The message.
        reason: String,
    },
    /// A driver takes too long to compile a program.
    #[error(
        "{reason}, or use device = cpu, or give the driver longer: TIGHTLOOP_COMPILE_LIMIT=600 [s]"
    )]
    CompileTimeout {
        /// Which program, and the limit.
        reason: String,
    },
    /// A compile limit that is no duration.
    #[error("TIGHTLOOP_COMPILE_LIMIT is {value:?}; give seconds, such as 600, or leave it out")]
    CompileLimit {
        /// The value.
        value: String,
    },
    /// An adapter that does not exist.
    #[error("{reason}")]
    Adapter {
        /// The adapters that exist.
        reason: String,
    },
    /// An accelerator has too little memory.
    #[error("{reason}")]
    DeviceMemory {
        /// The message.
        reason: String,
    },
    /// A model whose stages cannot be recorded.
    #[error("this model cannot be written as a program of a GPU: {reason}; use device = cpu")]
    Program {
        /// Why.
        reason: String,
    },
    /// A GPU that cannot have the processor's bits.
    #[error("{reason}; launch without cpu_bits, or with device = cpu")]
    OtherBits {
        /// Why.
        reason: String,
    },
    /// Memory of the device cannot be given to a client.
    #[error("{reason}")]
    Share {
        /// What is missing.
        reason: String,
    },
    /// Double precision on a GPU.
    #[error("a GPU computes in single precision; use precision = f32, or device = cpu")]
    DoubleOnGpu,
    /// Outputs of the last substep on a GPU.
    #[error(
        "a GPU evaluates outputs at the state in the frame; use outputs_at = frame, or device = cpu"
    )]
    LastSubstepOnGpu,
    /// Sweeps of friction on a GPU.
    #[error(
        "a GPU has no `noslip_iterations`; launch with device=\"cpu\", or read the model without them: without=(\"noslip_iterations\",)"
    )]
    NoSlipOnGpu,
    /// The integrator `implicit` on a GPU.
    #[error(
        "a GPU has no integrator `implicit`; launch with device=\"cpu\", or read the model with implicitfast: without=(\"integrator\",)"
    )]
    ImplicitOnGpu,
    /// Sensors at the last of the four points of a Runge-Kutta substep, where MuJoCo has none.
    #[error(
        "field `sensordata` of a Runge-Kutta step is evaluated at the state in the frame; use outputs_at = frame, or leave the field out"
    )]
    LastSubstepSensors,
}

impl From<sim_device::DeviceError> for BackendError {
    fn from(error: sim_device::DeviceError) -> BackendError {
        let reason = error.to_string();
        use sim_device::DeviceError;
        match error {
            DeviceError::UnknownAdapter { .. } => BackendError::Adapter { reason },
            DeviceError::OutOfMemory { .. } => BackendError::DeviceMemory { reason },
            DeviceError::Export { .. } => BackendError::Share { reason },
            DeviceError::CompileTimeout { .. } => BackendError::CompileTimeout { reason },
            _ => BackendError::Device { reason },
        }
    }
}
