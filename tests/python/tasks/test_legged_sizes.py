"""Velocity tasks fit robots of any size: weights of the reward, gaits, knees, and warnings of too weak drives."""

from __future__ import annotations

import re
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import tightloop as tl
from tightloop.assets import QUADRUPED
from tightloop.tasks.quadruped import ROBOT, QuadrupedVelocityFlat

sys.path.insert(0, str(Path(__file__).parents[3] / "examples"))

from learning.watch import TermWatch, nothing_learnt

OWN = QuadrupedVelocityFlat.reward_weights


def scaled(path: Path, mass: float, length: float) -> Path:
    """Write the task's own quadruped with all lengths and masses multiplied, and drives as strong for its weight."""
    powers = {"mass": (("value",), mass), "inertia": (("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), mass * length**2)}
    powers |= {"origin": (("xyz",), length), "box": (("size",), length), "limit": (("effort",), mass * length)}
    powers |= {tag: (("radius", "length"), length) for tag in ("sphere", "cylinder", "capsule")}

    def element(match: re.Match[str]) -> str:
        names, factor = powers.get(match[1], ((), 1.0))

        def value(found: re.Match[str]) -> str:
            if found[1] not in names:
                return found[0]
            return f'{found[1]}="{" ".join(repr(factor * float(x)) for x in found[2].split())}"'

        return re.sub(r'(\w+)="([^"]*)"', value, match[0])

    path.write_text(re.sub(r"<(\w+)\b[^>]*>", element, QUADRUPED.read_text()))
    return path


def test_torques_of_a_robot_of_any_size_have_the_same_share_of_the_reward(tmp_path: Path) -> None:
    same, large = (QuadrupedVelocityFlat(model=scaled(tmp_path / f"{m}.urdf", m, k)) for m, k in ((1, 1), (3.5, 1.6)))
    np.testing.assert_allclose(large.robot.mass, 3.5 * same.robot.mass, rtol=1e-6)
    np.testing.assert_allclose(large.robot.hip_height, 1.6 * same.robot.hip_height, rtol=0.02)
    ratio = large.reward_weights["torque"] / same.reward_weights["torque"]
    np.testing.assert_allclose(ratio, (3.5 * 1.6) ** -2, rtol=0.05)
    np.testing.assert_allclose(large.gait / same.gait, 1.6**-0.5, rtol=0.02)
    np.testing.assert_allclose((large.swing / same.swing, large.lowest / same.lowest), 1.6, rtol=0.05)
    assert all(large.reward_weights[name] == weight for name, weight in OWN.items() if name != "torque")
    # the class and its own robot stay as they are
    assert QuadrupedVelocityFlat.reward_weights is OWN and QuadrupedVelocityFlat().reward_weights == OWN
    assert QuadrupedVelocityFlat().gait == 2.5


def test_a_class_that_chooses_its_robot_itself_has_its_size_too(tmp_path: Path) -> None:
    file = scaled(tmp_path / "large.urdf", 3.5, 1.6)

    class Own(QuadrupedVelocityFlat):
        def __init__(self) -> None:
            super().__init__(model=file)

    assert Own().swing == QuadrupedVelocityFlat(model=file).swing > 1.5 * QuadrupedVelocityFlat.swing
    assert Own().reward_weights == QuadrupedVelocityFlat(model=file).reward_weights


def legs(bent: float) -> str:
    """A quadruped whose feet are ahead of its shanks in front and behind them at the back, as some robots have them."""
    parts = ['<robot name="x"><link name="base"><inertial><mass value="27"/><inertia ixx="0.8" iyy="1.2" izz="1.5" '
             'ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><box size="0.6 0.3 0.2"/></geometry></collision>'
             "</link>"]  # fmt: skip
    for name, x, y in (("LF", 1, 1), ("RF", 1, -1), ("LH", -1, 1), ("RH", -1, -1)):
        for link, mass, size in (("hip", 2.0, 3e-3), ("thigh", 3.0, 2e-2), ("shank", 0.7, 6e-3)):
            sole = (
                f'<collision><origin xyz="{bent * x} 0 -0.34"/><geometry><sphere radius="0.03"/></geometry></collision>'
            )
            parts.append(
                f'<link name="{name}_{link}"><inertial><mass value="{mass}"/><inertia ixx="{size}" iyy="{size}" '
                f'izz="{size}" ixy="0" ixz="0" iyz="0"/></inertial>{sole if link == "shank" else ""}</link>'
            )
        for joint, parent, child, place, axis in (
            ("HAA", "base", f"{name}_hip", f"{0.3 * x} {0.1 * y} 0", "1 0 0"),
            ("HFE", f"{name}_hip", f"{name}_thigh", f"{0.06 * x} {0.18 * y} 0", "0 1 0"),
            ("KFE", f"{name}_thigh", f"{name}_shank", "0 0 -0.285", "0 1 0"),
        ):
            parts.append(
                f'<joint name="{name}_{joint}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
                f'<origin xyz="{place}"/><axis xyz="{axis}"/><limit lower="-2.5" upper="2.5" effort="80" velocity="8"/>'
                "</joint>"
            )
    return "".join([*parts, "</robot>"])


def test_knees_of_hind_legs_bend_ahead_where_that_is_easier(tmp_path: Path) -> None:
    file = tmp_path / "x.urdf"
    file.write_text(legs(0.09))
    robot = QuadrupedVelocityFlat(model=file).robot
    pose = dict(zip(robot.joints, robot.standing, strict=True))
    assert pose["LF_HFE"] > 0.3 and pose["RF_HFE"] > 0.3, "front knees are behind"
    assert pose["LH_HFE"] < -0.3 and pose["RH_HFE"] < -0.3, "hind knees are ahead"
    # all knees are behind where no other way is much easier
    own = dict(zip(ROBOT.joints, QuadrupedVelocityFlat(model=QUADRUPED).robot.standing, strict=True))
    assert all(own[f"{leg}_thigh"] > 0.3 for leg in ("FL", "FR", "RL", "RR"))


def test_standing_that_takes_half_of_an_effort_limit_is_reported(tmp_path: Path) -> None:
    text, file = QUADRUPED.read_text(), tmp_path / "weak.urdf"
    with warnings.catch_warnings():
        warnings.simplefilter("error", tl.TightloopWarning)
        QuadrupedVelocityFlat(model=QUADRUPED)
    file.write_text(re.sub(r'effort="[^"]*"', 'effort="7"', text))
    with pytest.warns(
        tl.TightloopWarning, match=r"standing takes \d\.\d+ N·m of '.._calf', whose effort limit is 7 N·m"
    ):
        QuadrupedVelocityFlat(model=file)


def test_a_term_that_outweighs_all_others_for_a_minute_is_reported_once() -> None:
    watch = TermWatch()
    heavy = {"train/return/torque": -61.0, "train/return/follow": 4.0, "train/return/gait": 2.0, "train/error": 900.0}
    even = heavy | {"train/return/torque": -59.0}
    assert [watch.see(heavy, seconds) for seconds in (0.0, 30.0, 59.0)] == [None] * 3
    assert watch.see(even, 60.0) is None and watch.see(heavy, 61.0) is None, "the minute begins anew"
    told = watch.see(heavy, 121.0)
    assert told is not None and "'torque' has outweighed all others 10 times for 60 s" in told
    assert watch.see(heavy, 300.0) is None
    assert watch.see({"train/return/only": -5.0}, 400.0) is None and watch.see({}, 500.0) is None


@pytest.mark.parametrize(
    ("first", "last", "learnt"),
    [
        ({"return": -50.0, "velocity_error": 0.57}, {"return": 11.0, "velocity_error": 0.556}, False),
        ({"return": -50.0, "velocity_error": 0.57}, {"return": -60.0, "velocity_error": 0.1}, True),
        ({"return": 5.0, "success": 0.0, "error": 0.3}, {"return": 9.0, "success": 0.0, "error": 0.29}, False),
        ({"return": 5.0, "success": 0.0, "error": 0.3}, {"return": 9.0, "success": 0.2, "error": 0.29}, True),
        ({"return": 5.0}, {"return": 5.1}, True),
        ({"return": 5.0}, {"return": 4.9}, False),
    ],
)
def test_a_training_in_which_nothing_was_learnt_is_reported(first, last, learnt) -> None:
    told = nothing_learnt([first, {"return": 1e9, "velocity_error": 0.0}, last])
    assert (told is None) == learnt
    assert nothing_learnt([first]) is None
