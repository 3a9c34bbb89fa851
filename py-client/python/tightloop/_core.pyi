"""Types of the compiled module."""

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from tightloop.arrays.frames import FrameCopy

__version__: str

_Real = TypeVar("_Real", NDArray[np.float32], NDArray[np.float64])

class Sample: ...

class Frame:
    """The state of all worlds at one instant; each field is a read-only NumPy view of shared memory, worlds first.

    A frame, and every array taken from it, stays valid and unchanged until you drop it, even after the daemon ended.
    At most ``frames_held`` frames may be alive; ``copy()`` keeps one for longer. Real arrays are float32 or float64,
    as the precision of the run. A frame carries the fields of ``launch(fields=...)``, and always ``time``, ``step``,
    ``status`` and ``contacts_left_out``.

    Every array is aligned to 64 bytes, so that ``np.from_dlpack``, ``torch.from_dlpack`` and ``jax.device_put`` copy
    nothing, and their results keep the frame alive. torch does not support read-only memory: a write to such a tensor
    ends the process, so ``clone()`` it first. JAX copies 64-bit arrays unless ``jax_enable_x64`` is set, and its
    ``from_dlpack`` refuses read-only arrays.

    Raises:
        UnknownField: The frame does not carry that field; the message lists those it carries.
    """

    def __getattr__(self, name: str) -> NDArray[Any]:
        """Images of cameras, such as ``wrist_depth``, ``(worlds, height, width)``."""
        ...

    joint_q: NDArray[Any]
    """Joint positions [rad or m], ``(worlds, coords)``."""
    joint_qd: NDArray[Any]
    """Joint velocities [rad/s or m/s], ``(worlds, dofs)``."""
    joint_qdd: NDArray[Any]
    """Joint accelerations at the current commands, with constraints [rad/s² or m/s²], ``(worlds, dofs)``."""
    act: NDArray[Any]
    """Activations of the actuators of MuJoCo models that have one [–], ``(worlds, activations)``."""
    efc_D: NDArray[Any]
    """Regularised stiffness of each constraint row, zero if inactive [kg·m² or kg], ``(worlds, rows)``."""
    efc_aref: NDArray[Any]
    """Reference acceleration of each constraint row [rad/s² or m/s²], ``(worlds, rows)``."""
    efc_force: NDArray[Any]
    """Force of each constraint row [N·m or N], ``(worlds, rows)``."""
    constraint_force: NDArray[Any]
    """Constraint forces in joint space [N·m or N], ``(worlds, dofs)``."""
    joint_f: NDArray[Any]
    """Joint torques applied [N·m or N], ``(worlds, dofs)``."""
    joint_target_q: NDArray[Any]
    """Position targets of the drives [rad or m], ``(worlds, dofs)``."""
    joint_target_qd: NDArray[Any]
    """Velocity targets of the drives [rad/s or m/s], ``(worlds, dofs)``."""
    ctrl: NDArray[Any]
    """Controls of the actuators of MuJoCo models, before they are clamped to their ranges, ``(worlds, actuators)``."""
    mocap_pos: NDArray[Any]
    """Positions of the mocap bodies of MuJoCo models in the world [m], ``(worlds, mocaps, 3)``."""
    mocap_quat: NDArray[Any]
    """Their quaternions (w, x, y, z) [–], of any length, ``(worlds, mocaps, 4)``."""
    eq_active: NDArray[Any]
    """1 where an equality of a MuJoCo model acts, 0 where it does not, ``(worlds, equalities)``."""
    bias_force: NDArray[Any]
    """Coriolis, centrifugal and gravity forces [N·m or N], ``(worlds, dofs)``."""
    smooth_force: NDArray[Any]
    """All forces except constraint forces, minus the bias force [N·m or N], ``(worlds, dofs)``."""
    actuator_length: NDArray[Any]
    """Length of each actuator of MuJoCo models, gear included [rad or m], ``(worlds, actuators)``."""
    actuator_velocity: NDArray[Any]
    """How fast it changes [rad/s or m/s], ``(worlds, actuators)``."""
    actuator_force: NDArray[Any]
    """Force of each actuator of MuJoCo models along its length [N or N·m], ``(worlds, actuators)``."""
    body_q: NDArray[Any]
    """Link frames in the world: position [m], then quaternion (x, y, z, w), ``(worlds, bodies, 7)``."""
    body_qd: NDArray[Any]
    """Velocity of each link's centre of mass [m/s], then its angular velocity [rad/s], in world axes,
    ``(worlds, bodies, 6)``."""
    kinetic_energy: NDArray[Any]
    """Kinetic energy of the world, ½ q̇ᵀ M q̇ with the armature [J], ``(worlds,)``."""
    potential_energy: NDArray[Any]
    """Potential energy in gravity of the bodies that move [J], ``(worlds,)``: 0 at the height of the world's origin."""
    joint_torque: NDArray[Any]
    """Sum of ``joint_f`` and the drive force, which its effort limit clamps [N·m or N], ``(worlds, dofs)``. It does not
    include damping, friction and contacts."""
    site_q: NDArray[Any]
    """Pose of each site: position [m], then quaternion (x, y, z, w), in the world or in the site's reference frame,
    ``(worlds, sites, 7)``."""
    site_qd: NDArray[Any]
    """Velocity of each site [m/s], then its angular velocity [rad/s], ``(worlds, sites, 6)``: in world axes, or
    relative to the site's reference frame and in its axes."""
    gyro: NDArray[Any]
    """Angular velocity of each site, in its own axes [rad/s], ``(worlds, sites, 3)``."""
    accelerometer: NDArray[Any]
    """Acceleration of each site minus gravity, in its own axes [m/s²], ``(worlds, sites, 3)``; 9.81 upwards at rest."""
    height_scan: NDArray[Any]
    """Height of each scan's frame above the ground under each of its rays [m], scans one after another, x innermost,
    ``(worlds, scan_rays)``; negative where the ground is higher than the frame."""
    xpos: NDArray[Any]
    """Origin of each body of MuJoCo models in the world [m], the world of each model first, ``(worlds, nbody, 3)``."""
    xquat: NDArray[Any]
    """Orientation of each body of MuJoCo models in the world, (w, x, y, z), ``(worlds, nbody, 4)``."""
    xmat: NDArray[Any]
    """Orientation of each body of MuJoCo models in the world, a matrix row by row, ``(worlds, nbody, 9)``."""
    xipos: NDArray[Any]
    """Centre of mass of each body of MuJoCo models in the world [m], ``(worlds, nbody, 3)``."""
    ximat: NDArray[Any]
    """Principal axes of inertia of each body of MuJoCo models in the world, a matrix row by row,
    ``(worlds, nbody, 9)``."""
    site_xpos: NDArray[Any]
    """Origin of each site of MuJoCo models in the world [m], ``(worlds, nsite, 3)``."""
    site_xmat: NDArray[Any]
    """Orientation of each site of MuJoCo models in the world, a matrix row by row, ``(worlds, nsite, 9)``."""
    geom_xpos: NDArray[Any]
    """Centre of each geom of MuJoCo models in the world [m], ``(worlds, ngeom, 3)``, also of geoms that touch
    nothing."""
    geom_xmat: NDArray[Any]
    """Orientation of each geom of MuJoCo models in the world, a matrix row by row, ``(worlds, ngeom, 9)``."""
    ten_length: NDArray[Any]
    """Length of each tendon of MuJoCo models [rad or m], ``(worlds, ntendon)``, also of tendons that nothing uses."""
    ten_velocity: NDArray[Any]
    """Rate of change of the length of each tendon of MuJoCo models [rad/s or m/s], ``(worlds, ntendon)``."""
    subtree_com: NDArray[Any]
    """Centre of mass of each body of MuJoCo models with all bodies below it, in the world [m],
    ``(worlds, nbody, 3)``."""
    cvel: NDArray[Any]
    """Velocity of each body of MuJoCo models in world axes, ``(worlds, nbody, 6)``: angular [rad/s], then that of the
    point of the body at the centre of mass of its tree [m/s], as MuJoCo's ``cvel``."""
    cinert: NDArray[Any]
    """Inertia of each body of MuJoCo models in world axes, about the point that ``cvel`` is about,
    ``(worlds, nbody, 10)``: xx, yy, zz, xy, xz, yz [kg·m²], then mass times the place of its centre [kg·m], then mass
    [kg], as MuJoCo's ``cinert``; 0 for the world."""
    subtree_linvel: NDArray[Any]
    """Velocity of the centre of mass of each body of MuJoCo models with all bodies below it, in world axes [m/s],
    ``(worlds, nbody, 3)``."""
    subtree_angmom: NDArray[Any]
    """Angular momentum of each body of MuJoCo models with all bodies below it, about their centre of mass, in world
    axes [kg·m²/s], ``(worlds, nbody, 3)``."""
    cacc: NDArray[Any]
    """Acceleration of each body of MuJoCo models minus gravity, as MuJoCo's ``cacc``: angular [rad/s²], then linear
    [m/s²], ``(worlds, nbody, 6)``."""
    cfrc_int: NDArray[Any]
    """Torque [N·m], then force [N], from the parent on each body of MuJoCo models, as MuJoCo's ``cfrc_int``,
    ``(worlds, nbody, 6)``."""
    cfrc_ext: NDArray[Any]
    """Torque [N·m], then force [N], of contacts, ``body_f``, connects and welds on each body of MuJoCo models, as
    MuJoCo's ``cfrc_ext``, ``(worlds, nbody, 6)``."""
    sensordata: NDArray[Any]
    """Sensors of MuJoCo models, in MuJoCo's order, ``(worlds, nsensordata)``; ``sim.sensors`` has the columns of
    each."""
    body_jacobian: NDArray[Any]
    """Jacobian J of the bodies, ``body_qd = J @ joint_qd``, ``(worlds, bodies, 6, dofs)``."""
    mass_matrix: NDArray[Any]
    """Joint-space inertia with armature [kg·m², kg·m or kg], ``(worlds, dofs, dofs)``."""
    efc_J: NDArray[Any]
    """Constraint Jacobian, zero in inactive rows [–], ``(worlds, rows, dofs)``."""
    contact_count: NDArray[np.int32]
    """Number of contacts of the world, the used rows of the other contact fields [–], ``(worlds,)``."""
    contact_pos: NDArray[Any]
    """Midpoint between the two surfaces, in the world [m], ``(worlds, contacts, 3)``."""
    contact_normal: NDArray[Any]
    """Unit normal from the first shape of the pair to the second [–], ``(worlds, contacts, 3)``."""
    contact_distance: NDArray[Any]
    """Distance of the two surfaces, negative for penetration [m], ``(worlds, contacts)``."""
    contact_force: NDArray[Any]
    """Force on the second shape of the pair, in world axes [N], ``(worlds, contacts, 3)``."""
    contact_pair: NDArray[np.int32]
    """The two shapes, as indices in ``sim.shape_names`` [–]; -1 in unused rows, ``(worlds, contacts, 2)``."""
    body_contact_force: NDArray[Any]
    """Sum of the contact forces on each link, in world axes [N], ``(worlds, bodies, 3)``."""
    joint_q_measured: NDArray[Any]
    """Joint positions with the noise of ``params.joint_q_noise`` [rad or m], ``(worlds, coords)``."""
    joint_qd_measured: NDArray[Any]
    """Joint velocities with the noise of ``params.joint_qd_noise`` [rad/s or m/s], ``(worlds, dofs)``."""
    site_inverse_jacobian: NDArray[Any]
    """Damped inverse Jacobian of each site [rad or m per m or rad], ``(worlds, sites, dofs, 6)``.

    A joint displacement ``site_inverse_jacobian @ d`` moves the site by about ``d``: a displacement of its origin [m],
    then a rotation vector [rad], in the axes of ``site_qd``. It is the damped least-squares inverse Jᵀ (J Jᵀ + λ² I)⁻¹,
    where ``site_qd = J @ joint_qd`` and λ is the site's ``damping``. It is zero for dofs that do not move the site. It
    includes the dofs of a floating base, and treats mimic joints as independent."""
    contact_sensor: NDArray[Any]
    """Sum of the contact forces of each contact sensor, in world axes [N], ``(worlds, contact_sensors, 3)``."""
    qpos: NDArray[Any]
    """Joint positions in MuJoCo's order [rad or m], ``(worlds, coords)``: a quaternion is (w, x, y, z)."""
    qvel: NDArray[Any]
    """Joint velocities as MuJoCo has them [rad/s or m/s], ``(worlds, dofs)``. A free joint has the velocity of its
    frame's origin in world axes, then the angular velocity in its own axes."""
    qacc: NDArray[Any]
    """Joint accelerations as MuJoCo has them, at the current commands, with constraints [rad/s² or m/s²],
    ``(worlds, dofs)``."""
    qfrc_actuator: NDArray[Any]
    """Forces of the actuators of MuJoCo models in joint space, as MuJoCo has them [N·m or N], ``(worlds, dofs)``."""
    qfrc_constraint: NDArray[Any]
    """Constraint forces in joint space, as MuJoCo has them [N·m or N], ``(worlds, dofs)``."""
    qfrc_bias: NDArray[Any]
    """Coriolis, centrifugal and gravity forces in joint space, as MuJoCo has them [N·m or N], ``(worlds, dofs)``."""
    qfrc_passive: NDArray[Any]
    """Forces of springs and dampers in joint space, as MuJoCo has them [N·m or N], ``(worlds, dofs)``. Drives are not
    in it."""
    time: NDArray[np.float64]
    """Simulated time since the world's reset [s], ``(worlds,)``."""
    step: NDArray[np.uint64]
    """Control frames since the world's reset [–], ``(worlds,)``."""
    status: NDArray[np.uint32]
    """Status bits of the world [–], ``(worlds,)``; 0 is no problem.

    1: the state was not finite or, with ``on_nan="freeze"``, a command was not. 8: the state was beyond the bounds of
    the run. With either bit the world is faulted and keeps its state until it is reset or restored. Evaluated fields of
    a faulted world, such as ``joint_qdd``, may not be finite while the commands or parameters that broke it persist.
    2: the solver reached its iteration limit in some physics step of the last frame. 4: contacts did not fit into the
    scene's ``contacts_max`` or ``rows_max``, and were left out.
    """
    contacts_left_out: NDArray[np.uint32]
    """Contacts that did not fit: the maximum over the physics steps of the last frame [–], ``(worlds,)``."""
    state: NDArray[np.uint8]
    """A snapshot of the worlds of this frame, as bytes; only in frames of `Sim.latest`."""

    @property
    def fields(self) -> list[str]:
        """Names of the fields in this frame."""

    def torch(self, name: str) -> Any:
        """Return a field as a tensor of torch on the simulation's GPU, ``(worlds, …)``; it shares the daemon's memory.

        The tensor holds the frame: it stays valid and unchanged until you drop it. Do not write to it. The rules are
        those of `Sim.keep_on_gpu`.

        Raises:
            GpuMemoryError: The frame is not on a GPU that this process sees; the message has the cure.
            MissingLibrary: torch is not installed.
            UnknownField: The frame does not carry that field.
        """

    def cuda(self, name: str) -> Any:
        """Return a field on the simulation's GPU for CuPy and JAX, ``(worlds, …)``. Raises as `torch` does.

        It has ``__cuda_array_interface__`` and ``__dlpack__``.
        """

    def copy(self) -> FrameCopy:
        """Copy the arrays into memory of their own, as attributes of the same names."""

class NotReady(Exception):
    """Values that are converted before the client takes them, by name, as its argument; nothing was done."""

class Columns:
    """Values that are converted: runs of neighbouring columns, each with its first, shape ``(worlds, columns)``."""

    def __init__(self, runs: Sequence[tuple[int, NDArray[np.float64]]], /) -> None: ...

class Client:
    """A connection to a daemon; `tightloop.Sim` wraps it, and documents its methods.

    Calls with values by name take None, an array of all columns that is contiguous and of floats, a dict of such by
    robot, and `Columns`.

    Raises: NotReady: Another value was given.
    """

    def __init__(self, name: str, *, lease: bool) -> None: ...
    def describe(self) -> str: ...
    def device_memory(self) -> tuple[str, list[int]]: ...
    def keep_on(self, card: Any, /) -> None: ...
    def land(self) -> None: ...
    def layout(self, name: str, /) -> tuple[list[str], int, int, list[tuple[str, int, int, int]] | None] | None: ...
    def step(self, given: dict[str, Any], on_device: tuple[int, int] | None, /) -> Frame: ...
    def send(self, given: dict[str, Any], on_device: tuple[int, int] | None, /) -> None: ...
    def recv(self) -> Frame: ...
    def write(self, given: dict[str, Any], mask: NDArray[np.bool_] | None, is_known: bool, /) -> Frame: ...
    def reset(
        self, given: dict[str, Any], mask: NDArray[np.bool_] | None, seeds: NDArray[np.uint64] | None, /
    ) -> Frame: ...
    def forward(self) -> Frame: ...
    def snapshot(self, path: str, /) -> Frame: ...
    def ik(self, path: str, /) -> Frame: ...
    def rollout(self, path: str, /) -> Frame: ...
    def restore(self, path: str, mask: NDArray[np.bool_] | None, from_world: int | None, /) -> Frame: ...
    def latest(self) -> Frame | None: ...
    def wait_newer(self, timeout: float, /) -> Frame | None: ...
    def timing(self, clear: bool, /) -> str: ...
    def controller(self) -> int | None: ...
    def xla_token(self) -> tuple[int, int]:
        """Return the number under which programs of XLA know this client, and how many calls they have made."""

    def release(self) -> None: ...
    def close(self) -> None: ...

class Evaluation:
    """Evaluates fields at states that a daemon publishes; `tightloop.view` uses it.

    Args:
        scene: The scene as TOML, with paths relative to ``folder``.
        worlds: Number of worlds: the first ones of each state.
        precision: Precision of the run.
        fields: Fields to evaluate, besides those of every frame.
        drawn: What draws depend on: the first world's number, ``draws`` of the launch, and whether faults reset worlds.

    Raises:
        SceneError: The scene is not valid, or its files cannot be read.
        UnknownField: There is no such field.
    """

    def __init__(
        self,
        scene: str,
        folder: str,
        worlds: int,
        precision: str,
        fields: Sequence[str],
        *,
        drawn: tuple[int, str, bool] = (0, "world", False),
    ) -> None: ...
    @property
    def model_hash(self) -> int: ...
    def evaluate(self, state: NDArray[np.uint8], /) -> dict[str, NDArray[Any]]:
        """Return the fields by name, worlds first, at the ``state`` of a frame of `Client.latest`.

        Raises:
            SnapshotError: The state does not fit these worlds.
        """

class Playback:
    """Replays a recording frame by frame without a daemon; `tightloop.view` uses it.

    Args:
        path: The file.
        worlds: Number of worlds in its frames: the first ones.
        fields: Fields of its frames, besides those of every frame.
        starts: Whether the states at the beginning and behind gaps are frames, too.
        threads: Most threads of a step; all cores if left out.
        cameras: Cameras besides those of the scene, as a JSON list of tables of a scene file.

    Raises:
        RecordingError: The file cannot be read or is no recording, or files of its scene are missing.
        UnknownField: There is no such field.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        worlds: int,
        fields: Sequence[str],
        *,
        starts: bool = False,
        threads: int | None = None,
        cameras: str | None = None,
    ) -> None: ...
    def describe(self) -> str: ...
    @property
    def shows(self) -> Literal["start", "step", "still"]: ...
    @property
    def sent(self) -> list[str]: ...
    @property
    def note(self) -> str | None: ...
    @property
    def end(self) -> str | None: ...
    def next(self) -> dict[str, NDArray[Any]] | None: ...

class Dynamics:
    """A scene's model at given states; `tightloop.Dynamics` wraps it, and documents its methods."""

    def __init__(self, scene: str, folder: str) -> None: ...
    @property
    def model_hash(self) -> int: ...
    @property
    def names(self) -> tuple[list[str], list[str], list[str]]: ...
    def evaluate(
        self, field: str, joint_q: NDArray[np.float64], joint_qd: NDArray[np.float64], /
    ) -> NDArray[np.float64]: ...
    def inverse_dynamics(
        self,
        joint_q: NDArray[np.float64],
        joint_qd: NDArray[np.float64],
        joint_qdd: NDArray[np.float64],
        damping: bool,
        /,
    ) -> NDArray[np.float64]: ...

class Ik:
    """A scene's frames; `tightloop.ik` makes it."""

    def __init__(self, scene: str, folder: str) -> None: ...
    @property
    def names(self) -> tuple[list[str], list[str], list[str]]: ...
    @property
    def start(self) -> list[float]: ...
    def solver(self, task: str, /) -> IkTaskSolver: ...

class IkTaskSolver:
    """A solver of a task; `tightloop.IkSolver` wraps it, and documents its method."""

    def solve(
        self,
        count: int,
        arrays: Sequence[NDArray[np.float64]],
        attempts: tuple[int, int, int],
        tolerance: tuple[float, float],
        run: tuple[bool, int],
        /,
    ) -> tuple[
        NDArray[np.float64],
        NDArray[np.bool_],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.uint32],
        NDArray[np.uint32],
    ]: ...

class PolicyNetwork:
    """A multilayer perceptron; `tightloop.Policy` wraps it, and documents its methods."""

    def __init__(self, data: bytes, folder: str, output: str | None, /) -> None: ...
    @property
    def sizes(self) -> tuple[int, int]: ...
    @property
    def ports(self) -> tuple[str, str]: ...
    @property
    def metadata(self) -> list[tuple[str, str]]: ...
    @property
    def layers(self) -> str: ...
    @property
    def parameters(self) -> NDArray[np.float32]: ...
    def run(self, observations: NDArray[np.float32], /) -> NDArray[np.float32]: ...

class RayScene:
    """What rays meet in a scene; `tightloop.sim.rays.Rays` wraps it."""

    def __init__(self, scene: str, folder: str, first_bodies: Mapping[str, int]) -> None: ...
    def geoms(self) -> dict[str, list[Any]]: ...
    def cast(
        self,
        chosen: NDArray[np.int64],
        poses: Sequence[NDArray[Any]],
        pnt: NDArray[Any],
        vec: NDArray[Any],
        exclude: NDArray[np.int32],
        threads: int,
        /,
    ) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]: ...

def pack(
    out: NDArray[np.float32],
    parts: Sequence[NDArray[Any]],
    low: NDArray[np.float32],
    high: NDArray[np.float32],
    /,
) -> bool: ...
def drive(
    out: NDArray[np.float32],
    first: int,
    action: NDArray[np.float32],
    scale: NDArray[np.float32],
    start: NDArray[np.float32] | None,
    low: NDArray[np.float32],
    high: NDArray[np.float32],
    joint_q: NDArray[np.float32] | None,
    lead: float,
    /,
) -> None: ...
@overload
def draw(
    seeds: NDArray[np.uint64],
    episodes: NDArray[np.uint32],
    stream: int,
    columns: int,
    out: None = None,
    firsts: NDArray[np.uint32] | None = None,
) -> NDArray[np.float64]: ...
@overload
def draw(
    seeds: NDArray[np.uint64],
    episodes: NDArray[np.uint32],
    stream: int,
    columns: int,
    out: _Real,
    firsts: NDArray[np.uint32] | None = None,
) -> _Real:
    """Draw uniform numbers in [0, 1), as a function of seed, episode, stream and column alone.

    Philox4x32-10 with the seed as key, at the counter (0, episode, 64 + stream, first + column). In float32 they are
    rounded towards zero, so that they stay below 1.

    Args:
        seeds: Seed of each row, uint64, shape ``(n,)``.
        episodes: Episode of each row, uint32, shape ``(n,)``.
        stream: Stream of the numbers, 0 to 31; different streams are independent.
        columns: Numbers per row, at most 2**24.
        out: Output, float32 or float64, shape ``(n, columns)``, possibly a view of a larger array; a new float64 array
            if left out.
        firsts: Index in the stream of each row's first number, uint32, shape ``(n,)``; 0 if left out.

    Returns:
        ``out``, or the new array, shape ``(n, columns)``.

    Raises:
        ArgumentError: A shape or the stream is not valid. A wrong dtype is a TypeError.
    """

def xla_handlers(major: int, minor: int) -> tuple[int, int]:
    """Return the addresses of the handlers of XLA's foreign functions: of the CPU, and of devices that are refused.

    Args:
        major: Major version of the interface.
        minor: Minor version; the handlers answer with it, or with the newest that is known here.

    Raises:
        ValueError: The major version is not known.
    """

def xla_function(function: Any, name: str, /) -> int:
    """Return the number of a function from now on known to programs of XLA.

    Args:
        function: It takes the name of a call and a list of arrays, and returns a list of arrays.
        name: What it is, for messages.
    """

def xla_call(call: str, inputs: str, fields: str, operands: list[NDArray[Any]], outputs: list[NDArray[Any]], /) -> None:
    """Make the call of a program of XLA with arrays of NumPy.

    Args:
        call: ``"step"``, ``"reset"``, ``"write"`` or ``"forward"``.
        inputs: Names of the operands behind the token and, of a reset or a write, the mask.
        fields: Names of the outputs behind the token.
        operands: The token, uint32, shape ``(2,)``, and others, contiguous.
        outputs: Arrays that are overwritten: the next token, and the fields; bool comes as uint8.

    Raises:
        CommandRefused: The token was used before, or an array does not fit. Other errors are those of the call.
    """

def groups(name: str, wait: float | None = None, /) -> int: ...
def sweep(name: str, /) -> bool: ...
def command_line(arguments: list[str], /) -> int: ...
def read_urdf(
    path: str,
    package_dirs: list[str],
    floating: bool,
    strict: bool,
    mesh_max_hull_vertices: int,
    convex_decomposition: bool,
    collada_up_axis: bool,
    /,
) -> str: ...
def field_names() -> list[str]: ...
def param_names() -> list[str]: ...
def command_rows() -> list[tuple[str, str, int, str, str, list[bool]]]: ...
def read_mesh(
    path: str, scale: tuple[float, float, float], max_hull_vertices: int, convex_decomposition: bool, /
) -> str: ...
def read_mujoco(path: str, max_hull_vertices: int, /) -> str: ...
def compiled_scene(scene: str, /) -> str: ...
def scene_to_toml(scene: str, /) -> str: ...
def save_scene(scene: str, path: str, /) -> None: ...
def load_scene(path: str, /) -> str: ...
def parse_scene(text: str, /) -> str: ...
def parts(scene: str, folder: str, /) -> tuple[str, list[tuple[NDArray[np.float32], NDArray[np.uint32]]]]: ...
def visual_mesh(path: str, collada_up_axis: bool, /) -> dict[str, Any]: ...

class Renderer:
    """Draws meshes on the CPU, without a display or a graphics driver; `tightloop.view.Picture` uses it.

    The same calls give the same bytes, with any number of threads.

    Args:
        width: Width of pictures [pixels], at most 8192.
        height: Height of pictures [pixels], at most 8192.
        threads: Largest number of threads per picture; all cores if left out.

    Raises:
        ArgumentError: A size is out of range. Its methods raise it for a shape or value that is not valid. A wrong
            dtype is a TypeError.
    """

    def __new__(cls, width: int, height: int, threads: int | None = None) -> Renderer: ...
    def resized(self, width: int, height: int) -> Renderer:
        """Return a renderer of another size that shares the meshes.

        Args:
            width: Width of pictures [pixels], at most 8192.
            height: Height of pictures [pixels], at most 8192.
        """

    def add(
        self, vertices: NDArray[np.float32], faces: NDArray[np.uint32], colors: NDArray[np.uint8], flat: bool = False
    ) -> int:
        """Add a mesh; returns its index.

        Args:
            vertices: Shape ``(n, 3)`` [m].
            faces: Shape ``(m, 3)``, counter-clockwise from outside.
            colors: Red, green, blue, opacity of each face, shape ``(m, 4)``.
            flat: Whether each face is shaded on its own; else faces that meet at less than 35° look round.
        """

    def render(
        self,
        camera: Sequence[Sequence[float]],
        angle: float,
        around: Sequence[float],
        floor: Sequence[float] | None,
        meshes: NDArray[np.uint32],
        poses: NDArray[np.float64],
        tints: NDArray[np.uint8],
        opacities: NDArray[np.float32],
        lines: NDArray[np.float64],
        line_colors: NDArray[np.uint8],
        line_widths: NDArray[np.float32],
        lamps: NDArray[np.float64] | None = None,
    ) -> NDArray[np.uint8]:
        """Render a picture, shape ``(height, width, 3)``; instances and lines that are not finite are left out.

        Args:
            camera: Position [m], target [m] and up direction.
            angle: Vertical field of view [rad].
            around: Centre and radius of the scene [m]; floor and shadows fade beyond.
            floor: Height of the floor and distance of its lines [m]; None for no floor.
            meshes: Mesh index of each instance, shape ``(k,)``.
            poses: Pose of each instance, position [m] and quaternion (x, y, z, w), shape ``(k, 7)``.
            tints: Tint of each instance, and its strength, shape ``(k, 4)``.
            opacities: Opacity of each instance, 0 to 1, shape ``(k,)``.
            lines: Both ends of overlay lines [m], shape ``(l, 6)``; equal ends make a dot.
            line_colors: Red, green, blue, opacity, shape ``(l, 4)``.
            line_widths: Width of each line [pixels], shape ``(l,)``.
            lamps: Lights of the scene, shape ``(n, 22)``, as `tightloop.view.lights.rows` makes them; fixed lights if
                left out.
        """
