"""FrankaPickCube on MuJoCo C, one world an environment: what a user of gymnasium and MuJoCo would write.

The URDF file, drives, limits, shapes, pairs that touch and their softness, solver, time step and substeps are those of
`tightloop.tasks.pick_cube`, and so are actions, observations and rewards, in NumPy. Not the same: double precision; and
the forces on the fingers are those at the beginning of the last substep, which saves an evaluation per step.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from tightloop.tasks import cube, pick_cube
from tightloop.tasks.pick_cube import FrankaPickCube

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "physics"))
from contacts import FRICTION_DAMPING, IMPEDANCE_MAX, arm_of
from record import REPOSITORY

sys.path.append(str(REPOSITORY / "tests/python/mujoco"))
from mujoco_model import limits_in_force_space  # the tests are no package

ARM = 7
STILL = "fr3_link0"  # the link that stands on the ground and never moves
DELTA = 0.1  # of a joint's target for an action of 1 [rad]
FINGERS_MIDDLE, FINGERS_HALF = 0.015, 0.025  # their target at an action of 0, and from there to 1 [m]
NOISE = 0.02  # of the joints at the start [rad]


def model() -> mujoco.MjModel:
    """MuJoCo's model of the task's scene."""
    scene = FrankaPickCube().scene()
    spec, shapes = arm_of(scene, impratio=10.0)
    off = {"contype": 0, "conaffinity": 0}
    spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1), **off)
    body = spec.worldbody.add_body(name="cube", pos=(0.0, 0.0, cube.HALF))
    body.add_freejoint()
    box = mujoco.mjtGeom.mjGEOM_BOX
    body.add_geom(name="cube", type=box, size=(cube.HALF,) * 3, density=1000.0, **off)
    pairs = [("ground", "cube", cube.MU)]
    # the names have the prefix by now
    links = [geom.name for geom in shapes]
    pairs += [("cube", link, cube.MU_ARM) for link in links]
    pairs += [("ground", link, cube.MU_ARM) for link in links if not link.startswith(f"arm/{STILL}/")]
    for first, second, mu in pairs:
        spec.add_pair(geomname1=first, geomname2=second, condim=3, solref=(2 / cube.KD, 1.0), friction=[mu] * 5)
    for name, finger in zip(cube.TOUCH, ("arm/fr3_leftfinger", "arm/fr3_rightfinger"), strict=True):
        kinds = {"objtype": mujoco.mjtObj.mjOBJ_BODY, "reftype": mujoco.mjtObj.mjOBJ_BODY}
        names = {"objname": "cube", "refname": finger}
        sensor = spec.add_sensor(name=name, type=mujoco.mjtSensor.mjSENS_CONTACT, **kinds, **names)
        # the net force on the second body, in the world
        sensor.intprm[:3] = 1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 3, 1
    made = spec.compile()
    limits_in_force_space(made)
    bodies = made.geom_bodyid[np.stack([made.pair_geom1, made.pair_geom2])]
    weight = made.body_invweight0[bodies, 0].sum(axis=0)
    softness = FRICTION_DAMPING * weight * ((1 - IMPEDANCE_MAX) / spec.option.impratio + IMPEDANCE_MAX)
    made.pair_solreffriction[:] = np.stack([2 / softness, np.ones_like(softness)], axis=1)
    return made


class MujocoPickCube(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """The task in one world; observations, actions and rewards as `tightloop.tasks.pick_cube` tabulates them."""

    def __init__(self, file: Path) -> None:
        """The model comes from a binary file, so that processes need not compile it."""
        self.model = mujoco.MjModel.from_binary_path(str(file))
        self.data = mujoco.MjData(self.model)
        parts = FrankaPickCube().observed()
        low, high = np.concatenate([part.bounds for part in parts], axis=1)
        self.observation_space, self.action_space = Box(low, high), Box(-1.0, 1.0, (ARM + 1,), np.float32)
        self._low, self._high = low, high
        self._tcp = self.model.body("arm/fr3_hand_tcp").id
        self._range = self.model.jnt_range[:ARM].T.copy()
        self._target, self._goal = np.zeros(ARM), np.zeros(3)
        self._obs = np.zeros(len(low))
        self._elapsed = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode."""
        super().reset(seed=seed)
        random = self.np_random
        q = np.array(pick_cube.START)
        q[:ARM] += random.normal(0.0, NOISE, ARM)
        place, yaw = random.uniform(-pick_cube.SPREAD, pick_cube.SPREAD, 2), random.uniform(-math.pi, math.pi)
        turn = (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))
        return self.begin(np.array([*q, *place, cube.HALF, *turn]), random.uniform(pick_cube.LOW, pick_cube.HIGH)), {}

    def begin(self, qpos: NDArray[np.float64], goal: NDArray[np.float64]) -> NDArray[np.float32]:
        """Begin an episode at positions as MuJoCo has them, with that goal [m]; returns the observation."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = qpos
        self._target[:], self._goal[:], self._elapsed = pick_cube.START[:ARM], goal, 0
        mujoco.mj_forward(self.model, self.data)
        return self._observe()

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """One control step."""
        action = np.clip(action, -1.0, 1.0)
        self._target += DELTA * action[:ARM]
        np.clip(self._target, *self._range, out=self._target)
        self.data.ctrl[:ARM], self.data.ctrl[ARM:] = self._target, FINGERS_MIDDLE + FINGERS_HALF * action[ARM]
        mujoco.mj_step(self.model, self.data, FrankaPickCube.substeps)
        # the pose of the tcp belongs to the state before the last substep until this
        mujoco.mj_kinematics(self.model, self.data)
        self._elapsed += 1
        obs = self._observe()
        reward, success = self._reward()
        return obs, reward, False, self._elapsed >= FrankaPickCube.max_episode_steps, {"success": success}

    def _observe(self) -> NDArray[np.float32]:
        data, obs = self.data, self._obs
        obs[:9], obs[9:18] = data.qpos[:9], data.qvel[:9]
        tcp, place = data.xpos[self._tcp], data.qpos[9:12]
        w, x, y, z = data.xquat[self._tcp]
        way = (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x))
        self._held = _presses(data.sensordata[:3], way, 1.0) and _presses(data.sensordata[3:], way, -1.0)
        obs[18] = self._held
        obs[19:22], obs[22:26] = tcp, (x, y, z, w)
        obs[26:29], obs[29:32] = self._goal, place
        obs[32:35], obs[35] = data.qpos[13:16], data.qpos[12]
        obs[36:39], obs[39:42] = place - tcp, self._goal - place
        return np.clip(obs, self._low, self._high, dtype=np.float32, casting="same_kind")

    def _reward(self) -> tuple[float, bool]:
        obs = self._obs
        reach, error = math.hypot(*obs[36:39]), math.hypot(*obs[39:42])
        speeds = obs[9:16]
        placed = error <= pick_cube.CLOSE
        if placed and abs(speeds).max() <= pick_cube.STILL:
            return 1.0, True
        staged = 1 - math.tanh(5 * reach) + self._held * (2 - math.tanh(5 * error))
        return 0.2 * (staged + placed * (1 - math.tanh(5 * math.hypot(*speeds)))), False


def _presses(force: NDArray[np.float64], way: tuple[float, float, float], side: float) -> bool:
    """Whether a finger is pressed by at least 0.5 N, within 85° of the way in which it opens."""
    x, y, z = force
    size = math.sqrt(x * x + y * y + z * z)
    along = side * (x * way[0] + y * way[1] + z * way[2])
    return size >= cube.FORCE and along >= size * math.cos(math.radians(85.0))
