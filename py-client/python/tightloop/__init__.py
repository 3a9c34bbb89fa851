"""Robot simulation in thousands of worlds on one machine, stepped from Python through shared memory.

>>> import tightloop as tl
>>> scene = tl.Scene(dt=1 / 480, substeps=8)
>>> arm = scene.add_urdf("fr3_franka_hand.urdf", name="arm")
>>> with tl.launch(scene, worlds=4096) as sim:
...     frame = sim.step(joint_f={"arm": torques})
...     frame.joint_q                      # (4096, 9), a view of shared memory

Conventions: SI units, radians, right-handed axes, z up, quaternions (x, y, z, w). Arrays have the worlds first.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tightloop import assets as assets
    from tightloop import terrain as terrain
    from tightloop._core import Frame, __version__
    from tightloop.arrays.frames import FrameCopy
    from tightloop.errors import (
        ArgumentError,
        CallInProgress,
        CommandRefused,
        ConstantParameter,
        DaemonLost,
        DaemonRestarted,
        FramesHeld,
        GpuMemoryError,
        LaunchError,
        LeaseHeld,
        LeaseLost,
        MissingLibrary,
        OutputError,
        ProtocolMismatch,
        RecordingError,
        ResourceError,
        SceneError,
        SignatureError,
        SimClosed,
        SnapshotError,
        TightloopError,
        TightloopWarning,
        TransportError,
        UnknownAttribute,
        UnknownDaemon,
        UnknownField,
        UnknownName,
        UrdfError,
        WaitTimeout,
    )
    from tightloop.planning.dynamics import Dynamics
    from tightloop.planning.ik_objectives import Posture, Reach
    from tightloop.planning.inverse_kinematics import IkResult, IkSolver, ik
    from tightloop.planning.linearization import Linearization, linearize
    from tightloop.planning.policies import Policy
    from tightloop.planning.policy_terms import Drive
    from tightloop.planning.rollouts import Rollout
    from tightloop.scene.body import Body
    from tightloop.scene.distributions import Normal, Uniform
    from tightloop.scene.joint_order import JointOrder
    from tightloop.scene.robot import Link, Robot
    from tightloop.scene.scene import Scene
    from tightloop.scene.sensors import ContactSensor, Site
    from tightloop.scene.shapes import Shape, Surface
    from tightloop.sim.groups import Groups
    from tightloop.sim.launching import attach, launch
    from tightloop.sim.rays import RayHits
    from tightloop.sim.realtime import RealTime, Timing
    from tightloop.sim.sim import Sim
    from tightloop.sim.snapshot import Snapshot

_HOMES = {
    "tightloop._core": ("Frame", "__version__"),
    "tightloop.arrays.frames": ("FrameCopy",),
    "tightloop.errors": (
        "ArgumentError",
        "CallInProgress",
        "CommandRefused",
        "ConstantParameter",
        "DaemonLost",
        "DaemonRestarted",
        "FramesHeld",
        "GpuMemoryError",
        "LaunchError",
        "LeaseHeld",
        "LeaseLost",
        "MissingLibrary",
        "OutputError",
        "ProtocolMismatch",
        "RecordingError",
        "ResourceError",
        "SceneError",
        "SignatureError",
        "SimClosed",
        "SnapshotError",
        "TightloopError",
        "TightloopWarning",
        "TransportError",
        "UnknownAttribute",
        "UnknownDaemon",
        "UnknownField",
        "UnknownName",
        "UrdfError",
        "WaitTimeout",
    ),
    "tightloop.planning.dynamics": ("Dynamics",),
    "tightloop.planning.ik_objectives": ("Posture", "Reach"),
    "tightloop.planning.inverse_kinematics": ("IkResult", "IkSolver", "ik"),
    "tightloop.planning.linearization": ("Linearization", "linearize"),
    "tightloop.planning.policies": ("Policy",),
    "tightloop.planning.policy_terms": ("Drive",),
    "tightloop.planning.rollouts": ("Rollout",),
    "tightloop.scene.body": ("Body",),
    "tightloop.scene.distributions": ("Normal", "Uniform"),
    "tightloop.scene.joint_order": ("JointOrder",),
    "tightloop.scene.robot": ("Link", "Robot"),
    "tightloop.scene.scene": ("Scene",),
    "tightloop.scene.sensors": ("ContactSensor", "Site"),
    "tightloop.scene.shapes": ("Shape", "Surface"),
    "tightloop.sim.groups": ("Groups",),
    "tightloop.sim.launching": ("attach", "launch"),
    "tightloop.sim.rays": ("RayHits",),
    "tightloop.sim.realtime": ("RealTime", "Timing"),
    "tightloop.sim.sim": ("Sim",),
    "tightloop.sim.snapshot": ("Snapshot",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "ArgumentError",
    "Body",
    "CallInProgress",
    "CommandRefused",
    "ConstantParameter",
    "ContactSensor",
    "DaemonLost",
    "DaemonRestarted",
    "Drive",
    "Dynamics",
    "Frame",
    "FrameCopy",
    "FramesHeld",
    "GpuMemoryError",
    "Groups",
    "IkResult",
    "IkSolver",
    "JointOrder",
    "LaunchError",
    "LeaseHeld",
    "LeaseLost",
    "Linearization",
    "Link",
    "MissingLibrary",
    "Normal",
    "OutputError",
    "Policy",
    "Posture",
    "ProtocolMismatch",
    "RayHits",
    "Reach",
    "RealTime",
    "RecordingError",
    "ResourceError",
    "Robot",
    "Rollout",
    "Scene",
    "SceneError",
    "Shape",
    "SignatureError",
    "Sim",
    "SimClosed",
    "Site",
    "Snapshot",
    "SnapshotError",
    "Surface",
    "TightloopError",
    "TightloopWarning",
    "Timing",
    "TransportError",
    "Uniform",
    "UnknownAttribute",
    "UnknownDaemon",
    "UnknownField",
    "UnknownName",
    "UrdfError",
    "WaitTimeout",
    "__version__",
    "attach",
    "ik",
    "launch",
    "linearize",
]


def __getattr__(name: str) -> Any:
    # Lazy (PEP 562): the daemon also starts through this package, and must not wait for the import of NumPy.
    if name in ("assets", "terrain"):
        from importlib import import_module

        return import_module(f"tightloop.{name}")
    home = _HOME_OF.get(name)
    if home is None:
        if name.startswith("_"):
            raise AttributeError(f"module `tightloop` has no attribute `{name}`")
        from tightloop.checks.attributes import suggestion
        from tightloop.errors import UnknownAttribute

        raise UnknownAttribute(f"module `tightloop` has no attribute `{name}`; {suggestion(name, __all__)}")
    from importlib import import_module

    value = globals()[name] = getattr(import_module(home), name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
