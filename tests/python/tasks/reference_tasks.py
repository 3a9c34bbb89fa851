"""Reference implementations of the tasks in plain Python, for one world, from the formulas of their documents."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.env import Task, Worlds

#: Arrays of one world, by name.
World = Mapping[str, NDArray[np.float64]]
Vector = Sequence[float] | NDArray[np.float64]


@dataclass
class Told:
    """What a task says of a world."""

    obs: list[float] | NDArray[np.float64]
    reward: float
    terminated: bool = False
    success: bool = False


def cart_pole_balance(world: World) -> Told:
    (x, angle), (speed, rate) = world["joint_q"], world["joint_qd"]
    return Told([x, math.sin(angle), math.cos(angle), speed, rate], 1.0, terminated=abs(angle) > 0.2095 or abs(x) > 2.4)


def cart_pole_swing_up(world: World) -> Told:
    (x, angle), (_, rate), (force,) = world["joint_q"], world["joint_qd"], world["action"]
    upright, quiet, middle = (1 + math.cos(angle)) / 2, 1 / (1 + rate**2 / 25), 1 - x**2 / 2.4**2
    reward = upright * (1 + quiet) / 2 * (1 + middle) / 2 * (1 - force**2 / 5)
    upright = abs(math.remainder(angle, 2 * math.pi)) < 0.2
    return Told(cart_pole_balance(world).obs, reward, success=upright and abs(rate) < 1)


def reach(world: World) -> Told:
    start = [0.0, -0.569, 0.0, -2.81, 0.0, 3.037, 0.741, 0.04, 0.04]
    q, qd, tcp, goal = world["joint_q"], world["joint_qd"], world["site_q"][0], world["goal"]
    error = math.dist(tcp[:3], goal[:3])
    angle = 2 * math.acos(min(1.0, abs(dot(tcp[3:], goal[3:]))))
    effort = math.dist(world["action"], world["previous_action"]) ** 2 + dot(qd, qd)
    reward = -0.2 * error + 0.1 * (1 - math.tanh(error / 0.1)) - 0.1 * angle - 1e-4 * effort
    return Told([*(q - start), *qd, *goal, *world["action"]], reward, success=error < 0.02)


def push_cube(world: World) -> Told:
    q, qd, tcp, goal = world["joint_q"], world["joint_qd"], world["site_q"][0], world["goal"]
    cube = q[9:12]
    to_push = math.dist(tcp[:3], [cube[0] - 0.025, cube[1], cube[2]])
    error = math.dist(cube[:2], goal[:2])
    success = error < 0.1 and cube[2] < 0.025
    reward = 1 - math.tanh(5 * to_push)
    if to_push < 0.01:
        reward += 1 - math.tanh(5 * error)
    return Told([*q[:9], *qd[:9], *tcp, *goal, *q[9:16]], 1.0 if success else reward / 3, success=success)


def pick_cube(world: World) -> Told:
    q, qd, tcp, goal = world["joint_q"], world["joint_qd"], world["site_q"][0], world["goal"]
    cube, arm = q[9:12], [abs(speed) for speed in qd[:7]]
    held = holds(tcp[3:], *world["contact_sensor"])
    error = math.dist(cube, goal)
    success = error <= 0.025 and max(arm) <= 0.2
    reward = 1 - math.tanh(5 * math.dist(tcp[:3], cube))
    if held:
        reward += 1 + 1 - math.tanh(5 * error)
    if error <= 0.025:
        reward += 1 - math.tanh(5 * math.hypot(*arm))
    obs = [*q[:9], *qd[:9], float(held), *tcp, *goal, *q[9:16], *(cube - tcp[:3]), *(goal - cube)]
    return Told(obs, 1.0 if success else reward / 5, success=success)


def pick_cube_depth(world: World) -> Told:
    known = pick_cube(world)
    return replace(known, obs=np.concatenate([known.obs[:29], world["wrist_depth"].ravel()]))


def lift(world: World) -> Told:
    start = [0.0, -0.569, 0.0, -2.81, 0.0, 3.037, 0.741, 0.04, 0.04]
    q, qd, tcp, goal = world["joint_q"], world["joint_qd"], world["site_q"][0], world["goal"]
    cube = q[9:12]
    error = math.dist(cube, goal[:3])
    reward = 1 - math.tanh(math.dist(tcp[:3], cube) / 0.1)
    if cube[2] > 0.04:
        reward += 15 + 16 * (1 - math.tanh(error / 0.3)) + 5 * (1 - math.tanh(error / 0.05))
    reward -= 1e-4 * math.dist(world["action"], world["previous_action"]) ** 2 + 1e-4 * dot(qd[:9], qd[:9])
    return Told([*(q[:9] - start), *qd[:9], *cube, *goal, *world["action"]], reward, success=error < 0.025)


def walking(
    world: World,
    *,
    standing: Vector,
    soles: Vector,
    pairs: Sequence[int],
    swing: float,
    height: float,
    lowest: float,
    nearest: Vector | None = None,
) -> tuple[list[float], dict[str, float], bool]:
    """Observation, terms of the reward and fall that the velocity tasks have in common; heights over the ground."""
    q, qd, action, command, phase = (world[name] for name in ("joint_q", "joint_qd", "action", "goal", "phase"))
    axes = axes_of(q[3:7])
    velocity, turning = ([dot(axis, part) for axis in axes] for part in (qd[:3], qd[3:6]))
    gravity = [-axis[2] for axis in axes]
    turned = q[7:] - standing
    lift = [swing * max(0.0, math.sin(phase)), swing * max(0.0, -math.sin(phase))]
    feet = [sole - lift[pair] for sole, pair in zip(soles, pairs, strict=True)]
    if nearest is not None:  # soles above the highest ground around them
        swings = [lift[pair] > 1e-3 for pair in pairs]
        lacks = [max(0.0, lift[pair] - sole) for sole, pair in zip(nearest, pairs, strict=True)]
        feet = [lack if swung else sole for swung, lack, sole in zip(swings, lacks, soles, strict=True)]
    fell = gravity[2] > -0.5 or height < lowest
    terms = {
        "velocity": math.exp(-4 * math.dist(command[:2], velocity[:2]) ** 2),
        "miss": math.dist(command[:2], velocity[:2]),
        "turn": math.exp(-4 * (command[2] - turning[2]) ** 2),
        "bounce": velocity[2] ** 2,
        "rate": dot(turning[:2], turning[:2]),
        "tilt": dot(gravity[:2], gravity[:2]),
        "torque": dot(world["joint_torque"][6:], world["joint_torque"][6:]),
        "action": math.dist(action, world["previous_action"]) ** 2,
        "gait": math.exp(-200 * dot(feet, feet)),
        "pose": dot(turned, turned),
        "fall": float(fell),
    }
    clock = [math.sin(phase), math.cos(phase)]
    return [*velocity, *turning, *gravity, *command, *turned, *qd[6:], *action, *clock], terms, fell


def weighed(terms: Mapping[str, float], **weights: float) -> float:
    """A step's reward, from terms and what they are worth in a second."""
    return 0.02 * sum(weight * terms[name] for name, weight in weights.items())


TROT = {"standing": [0.0, 0.8, -1.6] * 4, "pairs": (0, 1, 1, 0), "lowest": 0.15}


def quadruped(world: World) -> Told:
    soles = [site[2] - 0.02 for site in world["site_q"]]
    obs, terms, fell = walking(world, soles=soles, swing=0.07, height=world["joint_q"][2], **TROT)
    reward = weighed(
        terms, velocity=1.5, miss=-1.0, turn=0.75, bounce=-1.0, rate=-0.05, tilt=-2.5, torque=-2e-4, action=-0.01,
        gait=1.0, pose=-0.1, fall=-300.0,
    )  # fmt: skip
    return Told(obs, reward, terminated=fell)


def quadruped_rough(world: World) -> Told:
    """As on flat ground, with heights over the ground below: 13 x 7 rays under the trunk, 3 x 3 about each foot."""
    scan = world["height_scan"]
    feet = [[height - 0.02 for height in scan[first : first + 9]] for first in range(91, 127, 9)]
    soles, nearest = [foot[4] for foot in feet], [min(foot) for foot in feet]
    obs, terms, fell = walking(world, soles=soles, nearest=nearest, swing=0.08, height=scan[45], **TROT)
    reward = weighed(
        terms, velocity=1.5, miss=-1.0, turn=0.75, bounce=-0.25, rate=-0.05, tilt=-0.5, torque=-2e-4, action=-0.01,
        gait=1.0, pose=-0.05, fall=-100.0,
    )  # fmt: skip
    return Told([*obs, *(scan[:91] - 0.32)], reward, terminated=fell)


def humanoid(world: World) -> Told:
    leg, waist, arm = [-0.3, 0.0, 0.0, 0.6, -0.3, 0.0], [0.0] * 3, [0.2, 0.2, 0.0, -0.6]
    standing = [*leg, *leg, *waist, *arm, 0.2, -0.2, 0.0, -0.6]
    soles, height = [site[2] for site in world["site_q"]], world["joint_q"][2]
    obs, terms, fell = walking(
        world, standing=standing, soles=soles, pairs=(0, 1), swing=0.08, height=height, lowest=0.45
    )
    # pitch joints of the legs move ahead
    quiet = np.delete(world["joint_q"][7:] - standing, [0, 3, 4, 6, 9, 10])
    reward = weighed(
        terms | {"quiet": dot(quiet, quiet)}, velocity=2.0, miss=-1.0, turn=0.75, bounce=-0.5, rate=-0.05, tilt=-2.5,
        torque=-1e-5, action=-0.01, gait=1.0, pose=-0.05, quiet=-0.5, fall=-250.0,
    )  # fmt: skip
    return Told(obs, reward, terminated=fell)


def ant_run(world: World) -> Told:
    q, qd, action = (world[name] for name in ("joint_q", "joint_qd", "action"))
    axes = axes_of(q[3:7])
    gravity = [-axis[2] for axis in axes]
    fell = gravity[2] > 0 or not 0.13 <= q[2] <= 1.0
    velocity, turning = ([dot(axis, part) for axis in axes] for part in (qd[:3], qd[3:6]))
    turned = q[7:] - np.array([0.0, 1.1] * 4)
    obs = [q[2], *gravity, axes[0][0], axes[1][0], *velocity, *turning, *turned, *qd[6:], *action]
    effort = 0.02 * dot(action, action) + 0.02 * math.dist(action, world["previous_action"]) ** 2
    return Told(obs, 0.02 * (qd[0] - 0.3 * qd[1] ** 2 - effort) - float(fell), terminated=fell)


PLAIN: dict[str, Callable[[World], Told]] = {
    "CartPoleBalance": cart_pole_balance,
    "CartPoleSwingUp": cart_pole_swing_up,
    "FrankaReach": reach,
    "FrankaPushCube": push_cube,
    "FrankaPickCube": pick_cube,
    "FrankaPickCubeDepth": pick_cube_depth,
    "FrankaLift": lift,
    "QuadrupedVelocityFlat": quadruped,
    "QuadrupedVelocityRough": quadruped_rough,
    "HumanoidVelocityFlat": humanoid,
    "AntRun": ant_run,
}


def dot(a: Vector, b: Vector) -> float:
    return math.fsum(x * y for x, y in zip(a, b, strict=True))


def axes_of(quat: Vector) -> list[list[float]]:
    """Axes of a frame, by its quaternion (x, y, z, w)."""
    x, y, z, w = quat
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
        [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
        [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
    ]


def holds(hand: Vector, left: Vector, right: Vector) -> bool:
    """Whether each finger is pressed with 0.5 N or more, within 85° of the way in which it opens."""
    x, y, z, w = hand
    opens = [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)]
    for force, sign in ((left, 1), (right, -1)):
        size = math.hypot(*force)
        if size < 0.5 or math.degrees(math.acos(sign * dot(force, opens) / size)) > 85:
            return False
    return True


def any_worlds(envs: Any, count: int, seed: int) -> Worlds:
    """Worlds in any states, among them such as a task has a special case for; float32, as frames have them."""
    rng, frame = np.random.default_rng(seed), envs.sim.forward()

    def near(center: Any, *scales: float) -> NDArray[np.float64]:
        """Around a centre, in each world as far as one of these scales."""
        shape = np.shape(center)
        scale = rng.choice(scales, (count,) + (1,) * (len(shape) - 1))
        return center + scale * rng.uniform(-1, 1, shape)

    def turned(shape: tuple[int, ...]) -> NDArray[np.float64]:
        quats = rng.normal(size=shape)
        return quats / np.linalg.norm(quats, axis=-1, keepdims=True)

    arrays: dict[str, Any] = {name: np.zeros((count, *getattr(frame, name).shape[1:])) for name in envs.task.fields}
    arrays["joint_q"] = near(arrays["joint_q"], 0.1, 4.0)
    arrays["joint_qd"] = near(arrays["joint_qd"], 0.01, 0.25, 5.0)
    arrays["action"], arrays["previous_action"] = rng.uniform(-1, 1, (2, count, *envs.single_action_space.shape))
    arrays["goal"] = np.zeros((count, 0))
    if type(envs.task).remember is not Task.remember:
        return _walking(envs.task, arrays, near, turned, rng)
    if "site_q" in arrays:
        tcp = arrays["site_q"]
        tcp[:, 0, :3], tcp[:, 0, 3:] = near(np.full((count, 3), 0.1), 0.3), turned((count, 4))
        goal = near(tcp[:, 0, :3], 0.01, 0.1, 0.5)
        if arrays["joint_q"].shape[1] > 9:
            arrays["joint_q"][:, 9:12] = near(tcp[:, 0, :3], 0.005, 0.05, 0.5)
            arrays["joint_q"][:, 12:] = turned((count, 4))
            # on the ground, and above it
            arrays["joint_q"][:, 11] = np.where(rng.uniform(size=count) < 0.5, 0.02, arrays["joint_q"][:, 11])
            goal = near(arrays["joint_q"][:, 9:12], 0.01, 0.1, 0.5)
        size = envs.task.goal(np, Worlds(**{n: a[:1] for n, a in arrays.items()}), np.zeros((1, 9))).shape[1]
        arrays["goal"] = np.concatenate([goal, turned((count, 4))], 1)[:, :size]
    if "contact_sensor" in arrays:
        x, y, z, w = arrays["site_q"][:, 0, 3:].T
        opens = np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], 1)
        pressed = near(np.stack([opens, -opens], 1), 0.5, 3.0)
        arrays["contact_sensor"] = rng.choice([0.0, 0.4, 1.0, 30.0], (count, 2, 1)) * pressed
    if "wrist_depth" in arrays:
        arrays["wrist_depth"] = near(np.full_like(arrays["wrist_depth"], 0.5), 0.4, 0.7)
    elapsed = np.zeros(count, np.int32)
    return Worlds(elapsed=elapsed, **{name: array.astype(np.float32) for name, array in arrays.items()})


def _walking(task: Any, arrays: dict[str, Any], near: Any, turned: Any, rng: np.random.Generator) -> Worlds:
    """Worlds of robots that walk, upright or not, and in any phase."""
    count = len(arrays["joint_q"])
    tilt = near(np.zeros((count, 3)), 0.0, 0.1, 1.0)
    quats = np.concatenate([tilt, np.ones((count, 1))], 1)
    arrays["joint_q"][:, 3:7] = quats / np.linalg.norm(quats, axis=1, keepdims=True)
    arrays["joint_q"][:, 2] = near(np.full(count, task.lowest + 0.1), 0.2)
    if "joint_torque" in arrays:
        arrays["joint_torque"] = near(arrays["joint_torque"], 10.0)
        arrays["site_q"] = near(arrays["site_q"], 0.1)
        arrays["goal"] = rng.choice([0.0, 1.0], (count, 1)) * rng.uniform(-1, 1, (count, 3))
    if "height_scan" in arrays:
        # under the trunk, and under each foot
        arrays["height_scan"] = near(np.full_like(arrays["height_scan"], task.lowest + 0.1), 0.2)
        arrays["height_scan"][:, -36:] = near(np.full((count, 36), 0.05), 0.1)
    plain = {name: array.astype(np.float32) for name, array in arrays.items()}
    before = dict(task.remember(np, Worlds(**plain), None))
    if "phase" in before:
        before["phase"] = rng.uniform(0, 2 * np.pi, count).astype(np.float32)
    return Worlds(**plain, elapsed=np.zeros(count, np.int32), memory=task.remember(np, Worlds(**plain), before))


def one(worlds: Worlds, world: int) -> World:
    """A world of these, in float64, what it remembers included."""
    all_arrays = {**vars(worlds), **vars(worlds).get("memory", {})}
    arrays = {name: array for name, array in all_arrays.items() if name != "memory"}
    return {name: np.asarray(array)[world].astype(np.float64) for name, array in arrays.items()}
