"""Types of the Rust module."""

import os
from collections.abc import Sequence
from typing import Any, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from tightloop.sim import FrameCopy

__version__: str

_Real = TypeVar("_Real", NDArray[np.float32], NDArray[np.float64])

class Sample: ...

class Frame:
    """The state of all worlds at one instant: each field is a read-only NumPy view of shared memory, worlds first.

    A frame, and every array taken from it, stays valid and unchanged until dropped, even after the daemon died.
    At most ``frames_held`` frames may be alive; ``copy()`` is for those to keep. Real arrays are float32 or float64,
    as the precision of the run says. Only the fields asked for in ``launch(fields=...)`` are there, besides
    ``time``, ``step``, ``status`` and ``contacts_left_out``.

    Every array begins at a multiple of 64 bytes, so other libraries take it as it is: ``np.from_dlpack``,
    ``torch.from_dlpack`` and ``jax.device_put`` copy nothing, and what they return keeps the frame alive. torch knows
    no read-only memory: writing to such a tensor ends the process, so ``clone()`` it first. JAX copies 64-bit arrays
    unless it runs with ``jax_enable_x64``, and its ``from_dlpack`` refuses arrays that are read-only.

    Raises:
        UnknownField: The frame does not carry that field; the message lists those it carries.
    """

    joint_q: NDArray[Any]
    """Joint positions [rad or m], ``(worlds, coords)``."""
    joint_qd: NDArray[Any]
    """Joint velocities [rad/s or m/s], ``(worlds, dofs)``."""
    joint_qdd: NDArray[Any]
    """Joint accelerations under the commands held, constraints included [rad/s² or m/s²], ``(worlds, dofs)``."""
    joint_f: NDArray[Any]
    """Joint torques applied [N·m or N], ``(worlds, dofs)``."""
    joint_target_q: NDArray[Any]
    """Position targets of the drives [rad or m], ``(worlds, dofs)``."""
    joint_target_qd: NDArray[Any]
    """Velocity targets of the drives [rad/s or m/s], ``(worlds, dofs)``."""
    body_q: NDArray[Any]
    """Link frames in the world: position [m], then quaternion (x, y, z, w), ``(worlds, bodies, 7)``."""
    body_qd: NDArray[Any]
    """Velocity of each link's centre of mass [m/s], then its angular velocity [rad/s], in world axes,
    ``(worlds, bodies, 6)``."""
    body_jacobian: NDArray[Any]
    """What takes ``joint_qd`` to ``body_qd``, ``(worlds, bodies, 6, dofs)``."""
    mass_matrix: NDArray[Any]
    """Joint-space inertia, armature included [kg·m², kg·m or kg], ``(worlds, dofs, dofs)``."""
    bias_force: NDArray[Any]
    """Coriolis, centrifugal and gravity forces [N·m or N], ``(worlds, dofs)``."""
    smooth_force: NDArray[Any]
    """All forces but the constraints', less the bias [N·m or N], ``(worlds, dofs)``."""
    constraint_force: NDArray[Any]
    """Constraint forces in joint space [N·m or N], ``(worlds, dofs)``."""
    efc_J: NDArray[Any]
    """Constraint Jacobian, zero in a row that is not active [–], ``(worlds, rows, dofs)``."""
    efc_D: NDArray[Any]
    """Regularised stiffness of a constraint row, zero if not active [kg·m² or kg], ``(worlds, rows)``."""
    efc_aref: NDArray[Any]
    """Reference acceleration of a constraint row [rad/s² or m/s²], ``(worlds, rows)``."""
    efc_force: NDArray[Any]
    """Force of a constraint row [N·m or N], ``(worlds, rows)``."""
    contact_count: NDArray[np.int32]
    """Contacts of the world: how many rows of the other contact fields are in use [–], ``(worlds,)``."""
    contact_pos: NDArray[Any]
    """Point half-way between the two surfaces, in the world [m], ``(worlds, contacts, 3)``."""
    contact_normal: NDArray[Any]
    """Unit normal from the first shape of the pair to the second [–], ``(worlds, contacts, 3)``."""
    contact_distance: NDArray[Any]
    """Distance of the two surfaces, negative in penetration [m], ``(worlds, contacts)``."""
    contact_force: NDArray[Any]
    """Force on the second shape of the pair, in world axes [N], ``(worlds, contacts, 3)``."""
    contact_pair: NDArray[np.int32]
    """The two shapes, as places in ``sim.shape_names`` [–]; -1 in a row not in use, ``(worlds, contacts, 2)``."""
    body_contact_force: NDArray[Any]
    """Sum of the contact forces on each link, in world axes [N], ``(worlds, bodies, 3)``."""
    joint_q_measured: NDArray[Any]
    """Joint positions with the noise of ``params.joint_q_noise`` [rad or m], ``(worlds, coords)``."""
    joint_qd_measured: NDArray[Any]
    """Joint velocities with the noise of ``params.joint_qd_noise`` [rad/s or m/s], ``(worlds, dofs)``."""
    kinetic_energy: NDArray[Any]
    """Kinetic energy of the world, ½ q̇ᵀ M q̇ with the armature [J], ``(worlds,)``."""
    potential_energy: NDArray[Any]
    """Potential energy in gravity of the bodies that move [J], ``(worlds,)``: 0 at the height of the world's origin."""
    joint_torque: NDArray[Any]
    """What ``joint_f`` and the drive, clamped by its effort limit, give [N·m or N], ``(worlds, dofs)``. Damping,
    friction and contacts are not in it."""
    site_q: NDArray[Any]
    """Sites: position [m], then quaternion (x, y, z, w), in the world or the frame that a site is relative to,
    ``(worlds, sites, 7)``."""
    site_qd: NDArray[Any]
    """Velocity of each site [m/s], then its angular velocity [rad/s], ``(worlds, sites, 6)``: in world axes, or as seen
    from the frame that it is relative to, in its axes."""
    gyro: NDArray[Any]
    """Angular velocity of each site, in its own axes [rad/s], ``(worlds, sites, 3)``."""
    accelerometer: NDArray[Any]
    """Acceleration of each site less gravity, in its own axes [m/s²], ``(worlds, sites, 3)``; 9.81 upwards at rest."""
    site_inverse_jacobian: NDArray[Any]
    """What takes a small displacement of each site to one of the joints [rad or m per m or rad], ``(worlds, sites,
    dofs, 6)``: ``joint_qd * dt = site_inverse_jacobian @ d`` moves the site by about ``d``, three numbers of its origin
    [m] and three of a rotation vector [rad], in the axes of ``site_qd``. Damped least squares, Jᵀ (J Jᵀ + λ² I)⁻¹,
    where J takes ``joint_qd`` to ``site_qd`` and λ is the site's ``damping``. Zero for dofs that do not move the site;
    those of a floating base do, and each joint of a mimic counts for itself."""
    contact_sensor: NDArray[Any]
    """Sum of the contact forces of each contact sensor, in world axes [N], ``(worlds, contact_sensors, 3)``."""
    time: NDArray[np.float64]
    """Simulated time since the world's reset [s], ``(worlds,)``."""
    step: NDArray[np.uint64]
    """Control frames since the world's reset [–], ``(worlds,)``."""
    status: NDArray[np.uint32]
    """Trouble of the world, as bits [–], ``(worlds,)``; 0 is none.

    1: it was no longer finite (or, with ``on_nan="freeze"``, a command of it was not), 8: it was beyond the bounds of
    the run: it is frozen until it is reset or restored. What is evaluated of a frozen world, such as ``joint_qdd``,
    need not be finite while the commands or parameters are there that broke it.
    2: the solver used up its iterations in some physics step of the last frame. 4: contacts did not fit into the
    scene's ``contacts_max`` or ``rows_max``, and were left out.
    """
    contacts_left_out: NDArray[np.uint32]
    """Contacts that did not fit: the most of any physics step of the last frame [–], ``(worlds,)``."""

    state: NDArray[np.uint8]
    """A snapshot of the worlds of this frame, as bytes; in frames of `Sim.latest` only."""

    @property
    def fields(self) -> list[str]:
        """Names of the fields that this frame carries."""

    def copy(self) -> FrameCopy:
        """The frame's arrays in memory of their own, as attributes of the same names."""

class Client:
    """A connection to a daemon; `tightloop.Sim` wraps it, and documents its methods."""

    def __init__(self, name: str, *, lease: bool) -> None: ...
    def describe(self) -> str: ...
    def step(self, joint_f: Any, joint_target_q: Any, joint_target_qd: Any, body_f: Any, /) -> Frame: ...
    def send(self, joint_f: Any, joint_target_q: Any, joint_target_qd: Any, body_f: Any, /) -> None: ...
    def recv(self) -> Frame: ...
    def write(self, joint_q: Any, joint_qd: Any, mask: Any, /) -> Frame: ...
    def write_params(self, params: dict[str, NDArray[np.float64]], mask: Any, /) -> Frame: ...
    def reset(self, mask: Any, seed: Any, /) -> Frame: ...
    def forward(self) -> Frame: ...
    def snapshot(self, path: str, /) -> Frame: ...
    def restore(self, path: str, mask: Any, from_world: int | None, /) -> Frame: ...
    def latest(self) -> Frame | None: ...
    def wait_newer(self, timeout: float, /) -> Frame | None: ...
    def controller(self) -> int | None: ...
    def release(self) -> None: ...
    def close(self) -> None: ...

class Evaluation:
    """Worlds of a scene at states that a daemon shows; `tightloop.view` uses it.

    Args:
        scene: The scene as TOML, with paths relative to ``folder``.
        worlds: How many: the first ones of each state.
        precision: Of the run.
        fields: What is evaluated, besides what every frame has.

    Raises:
        SceneError: The scene is not valid, or its files cannot be read.
        UnknownField: There is no such field.
    """

    def __init__(self, scene: str, folder: str, worlds: int, precision: str, fields: Sequence[str]) -> None: ...
    @property
    def model_hash(self) -> int: ...
    def evaluate(self, state: NDArray[np.uint8], /) -> dict[str, NDArray[Any]]:
        """The fields by name, worlds first, at the ``state`` of a frame of `Client.latest`.

        Raises:
            SnapshotError: It is no state of such worlds.
        """

class Playback:
    """A recording, run again without a daemon, frame after frame; `tightloop.view` uses it.

    Args:
        path: The file.
        worlds: How many worlds its frames show: the first ones.
        fields: What they carry, besides what every frame has.

    Raises:
        RecordingError: It cannot be read, or is no recording, or its scene's files are not where they were.
        UnknownField: There is no such field.
    """

    def __init__(self, path: str | os.PathLike[str], worlds: int, fields: Sequence[str]) -> None: ...
    def describe(self) -> str: ...
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

def pack(
    out: NDArray[np.float32],
    parts: Sequence[NDArray[Any]],
    low: NDArray[np.float32],
    high: NDArray[np.float32],
    /,
) -> None: ...
def drive(
    out: NDArray[np.float32],
    first: int,
    action: NDArray[np.float32],
    scale: NDArray[np.float32],
    start: NDArray[np.float32] | None,
    low: NDArray[np.float32],
    high: NDArray[np.float32],
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
    """Uniform numbers in [0, 1), the same for the same seed, episode, stream and column, whatever else is asked for.

    Philox4x32-10 under the seed as key, at the counter (0, episode, 64 + stream, first + column). In float32 they are
    rounded towards zero, so that they stay below 1.

    Args:
        seeds: Seed of each row, uint64, shape ``(n,)``.
        episodes: Episode of each row, uint32, shape ``(n,)``.
        stream: What the numbers are for, 0 to 31; those of different streams have nothing to do with each other.
        columns: How many numbers a row gets, at most 2**24.
        out: Where they go, float32 or float64, shape ``(n, columns)``, a part of another array if need be; a new
            float64 array if left out.
        firsts: Which number of the stream each row begins with, uint32, shape ``(n,)``; 0 if left out.

    Returns:
        ``out``, or the new array, shape ``(n, columns)``.

    Raises:
        ArgumentError: A shape or the stream is not as above. A wrong dtype is a TypeError.
    """

def groups(name: str, /) -> int: ...
def sweep(name: str, /) -> bool: ...
def command_line(arguments: list[str], /) -> int: ...
def read_urdf(
    path: str,
    package_dirs: list[str],
    floating: bool,
    strict: bool,
    mesh_max_hull_vertices: int,
    convex_decomposition: bool,
    /,
) -> str: ...
def read_mesh(
    path: str, scale: tuple[float, float, float], max_hull_vertices: int, convex_decomposition: bool, /
) -> str: ...
def scene_to_toml(scene: str, /) -> str: ...
def save_scene(scene: str, path: str, /) -> None: ...
def load_scene(path: str, /) -> str: ...
def parts(scene: str, folder: str, /) -> tuple[str, list[tuple[NDArray[np.float32], NDArray[np.uint32]]]]: ...

class Renderer:
    """Draws meshes on the processor: no display, no graphics driver. `tightloop.view.Picture` draws scenes with it.

    The same calls give the same bytes, on any number of threads.

    Args:
        width: Of pictures [pixels], at most 8192.
        height: Likewise.
        threads: Most threads a picture takes; all cores if left out.

    Raises:
        ArgumentError: A size is out of range; also from its methods, where a shape or a number is not as they say.
            A wrong dtype is a TypeError.
    """

    def __new__(cls, width: int, height: int, threads: int | None = None) -> Renderer: ...
    def add(self, vertices: NDArray[np.float32], faces: NDArray[np.uint32], colors: NDArray[np.uint8]) -> int:
        """Keep a mesh; returns its number.

        Args:
            vertices: Shape ``(n, 3)`` [m].
            faces: Shape ``(m, 3)``, counter-clockwise from outside.
            colors: Red, green, blue, opacity of each face, shape ``(m, 4)``.
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
    ) -> NDArray[np.uint8]:
        """A picture, shape ``(height, width, 3)``. What is not finite is left out.

        Args:
            camera: Where it is, what it looks at [m], and what is up.
            angle: Its vertical field of view [rad].
            around: Middle of what matters and how far it reaches [m]: beyond, floor and shadows fade.
            floor: Height of the floor and distance of its lines [m]; None for no floor.
            meshes: Numbers of the meshes that are seen, shape ``(k,)``.
            poses: Where, position [m] and quaternion (x, y, z, w), shape ``(k, 7)``.
            tints: A colour laid over each, and how much of it, shape ``(k, 4)``.
            opacities: From 0 to 1, shape ``(k,)``.
            lines: Both ends of lines on top [m], shape ``(l, 6)``; ends in one place are a dot.
            line_colors: Red, green, blue, opacity, shape ``(l, 4)``.
            line_widths: Shape ``(l,)`` [pixels].
        """
