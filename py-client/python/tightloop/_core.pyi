"""Types of the Rust module."""

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
    def close(self) -> None: ...

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
