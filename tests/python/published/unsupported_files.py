"""Files in the wheels that tightloop does not load, and why. Whatever else is there loads, and is compared.

MuJoCo refuses the same files, and two more that `urdf_to_mujoco.py` repairs for it. It does not refuse those whose
collision meshes are missing, since it gets no collision shapes.
"""

from __future__ import annotations

import re
from typing import NamedTuple


class Refusal(NamedTuple):
    """Which files, and what their error says."""

    files: str
    """Pattern of their names, which are paths in `out/published` cut short."""
    message: str
    """Pattern of the message, which names the culprit."""


NO_MASS = "has no mass, nor has any link fixed to it"
NO_INERTIA = "has no inertia, nor has any link fixed to it"
MISSING_MESH = "collision mesh .* is missing"

REFUSALS = [
    # Numbers that are none, or not as many as they should be
    Refusal(r"biped2d", r'`lower` is "-1.57.", which is not a number'),
    Refusal(r"microtaur", r'`rpy` is "-3.14159 1.57079 0 0", too many numbers'),
    Refusal(r"racecar_differential", r'`scale` is "1 1 1 1", too many numbers'),
    # Substitutions are left in it, and expanded/husky.urdf is without
    Refusal(r"3.2.7/husky", r"\$\(optenv HUSKY_IMU_XYZ"),
    # A prismatic joint from 1 to -1, and an inertia with a negative moment besides
    Refusal(r"cube_no_rotation", r"`x_to_world`: lower limit 1 is above upper limit -1"),
    # A mass, but an inertia of nothing but zeros: pybullet passes over the inertia of files
    Refusal(r"laikago(_toes|_toes_limits)?\.urdf", NO_INERTIA),
    Refusal(r"al5d_robot", NO_INERTIA),
    # Planes without end, distance fields and deformable bodies, which only pybullet knows
    Refusal(r"plane_implicit|concave_box", r"<(plane|cdf)> is no shape"),
    Refusal(r"torus_deform", r"has no links"),
    # All is commented out, or was never there
    Refusal(r"test_bench", r"has no links"),
    Refusal(r"imu_test", r"holds elements of xacro and no links"),
    Refusal(r"data/test\.urdf", r"broken XML"),
    # Links that neither the file nor the wheel has
    Refusal(r"expanded/pincher_arm", r"`arm_mount_joint`: parent link `arm_base_link` does not exist"),
    Refusal(r"right_arm", r"`r_shoulder_pan_joint`: parent link `link0` does not exist"),
    Refusal(r"model_for_sdf|GEN3-6DOF_VISION|GEN3_URDF_V12|GEN3-LITE", MISSING_MESH),
    # A box of no size
    Refusal(r"two_arm_robot_example", r"sizes are above 0"),
    # Joints that stand for wheels or for the slide of a gripper move links that are but frames
    Refusal(r"frankie|ridgeback|fetch(_camera)?\.urdf", NO_MASS),
    Refusal(r"pr2(_no_kinect|_se)?\.urdf", r"`r_gripper_l_finger_tip_frame` is moved by joint .* " + NO_MASS),
    # Fingers, and a whole arm, with neither <inertial> nor collisions
    Refusal(r"(hand|dual_panda_example)\.urdf", r"leftfinger` is moved by joint .* " + NO_MASS),
    Refusal(r"puma560_description/urdf/puma560_robot", r"`link2` is moved by joint `j1` but " + NO_MASS),
    Refusal(r"pxpincher/urdf/(pincher|turtlebot)_arm", r"`gripper_link` is moved by joint .* " + NO_MASS),
]


def refusal(name: str) -> Refusal | None:
    """What is expected of a file, if it does not load."""
    return next((entry for entry in REFUSALS if re.search(entry.files, name)), None)
