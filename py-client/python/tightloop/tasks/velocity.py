"""Follow velocity commands on legs: what the tasks of quadrupeds and humanoids have in common.

The command is a velocity ahead and to the left and a turning rate, drawn anew every few seconds. Feet follow a gait: in
turns, two groups of feet rise and sink by the sine of a phase. Physics at 200 Hz, control at 50 Hz, episodes of 20 s.
Rewards and rates follow legged_gym (Rudin et al. 2022, arXiv 2109.11978).
"""

from __future__ import annotations

import inspect
import json
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

import tightloop as tl
from tightloop.checks import arguments as checks
from tightloop.env.controls import Control
from tightloop.env.episodes.disturbances import Push
from tightloop.env.mirror import Flip, Mirror
from tightloop.env.names import Names
from tightloop.env.observed import Observed
from tightloop.env.task import Array, Namespace, Task, Worlds
from tightloop.errors import ArgumentError
from tightloop.planning.policy_terms import Clock, Gravity, Input, LastAction, Values
from tightloop.tasks.geometry import squares
from tightloop.tasks.kinematics import projected_gravity, rotate_inverse
from tightloop.tasks.legged import LeggedModel, LeggedRobot, RobotOptions

if TYPE_CHECKING:
    from tightloop.mujoco.scene_models import Model

LIMIT = 4.0  # of actions
DT, SUBSTEPS = 1 / 200, 4  # [s, –]
CONTROL_DT = DT * SUBSTEPS  # [s]
STILL = 0.1  # share of the commands that are to stand
#: Signs of vectors and axial vectors in the mirror image.
POLAR: Flip = ([0, 1, 2], [1, -1, 1])
AXIAL: Flip = ([0, 1, 2], [-1, 1, -1])


class VelocityTask(Task):
    """The base class of tasks that follow velocity commands.

    Attributes:
        robot: The robot.
        pushes: Largest push of its base [N·s]; 0 for none.
        legs: Number of legs of the robots that the task takes.
        gait: Steps of a leg per second [Hz].
        swing: Height of a foot in the middle of its swing [m].
        command_max: Greatest command ahead, to the left [m/s], and turning [rad/s].
        lowest: Height of the base over the ground at which a robot has fallen [m].
    """

    fields = ("joint_q", "joint_qd", "joint_torque", "site_q")
    max_episode_steps = 1000
    goal_draws = 4
    goal_steps = 250
    legs: int
    robot: LeggedRobot
    pushes: float = 0.0
    gait: float = 2.5
    swing: float = 0.07
    command_max: tuple[float, float, float] = (1.0, 0.6, 1.0)
    lowest: float = 0.15
    _options: str = ""
    _sharpness: float = 200.0  # of the reward for the gait [1/m²]

    def __init__(self, pushes: float | None, push: float, model: Model | None, options: RobotOptions) -> None:
        """Choose the robot.

        Args:
            pushes: Largest push of the base [N·s]; None for one in proportion to its mass.
            push: That of the task's own robot [N·s].
            model: URDF or MJCF of a robot; None for the task's own.
            options: What replaces what is found in the model, or declared of the task's own robot.

        Raises:
            ArgumentError: The robot has another number of legs, an option does not fit it, or ``pushes`` is negative.
            SceneError: The file is no robot that can be simulated.
        """
        own, task = self.robot, type(self).__name__
        if model is None and options.are_given and not isinstance(own, LeggedModel):
            # the imports need what reads models
            from tightloop.tasks.legged_models.own import replaced

            self.robot = replaced(task, own, count=self.legs, options=options)
        elif model is not None or options.are_given:
            from tightloop.tasks.legged_models.read import read

            file = own.file if model is None else model
            self.robot = read(task, file, own=own, count=self.legs, options=options, dt=DT)
        if self.robot is not own:
            # a class of a file may choose its robot itself, and takes no such options
            if "model" in inspect.signature(type(self)).parameters:
                self._options = _told(model, options)
            self._resize(own)
        if pushes is None:
            self.pushes = push * (self.robot.mass / own.mass)
        else:
            self.pushes = checks.number(f"{task}: pushes", pushes, least=0.0, error=ArgumentError)
        # a subclass may name more of both
        further = [field for field in self.fields if field not in VelocityTask.fields]
        self.fields = ("joint_q", "joint_qd", self.robot.torque_field, self.robot.site_field, *further)
        self.initial_draws += self.robot.start_draws

    def _resize(self, own: LeggedRobot) -> None:
        """Scale what depends on the robot's size from the task's own robot to this one.

        Legs swing like pendulums, at a rate in proportion to 1/√length (Alexander and Jayes 1983, 10.1111/j.1469-7998.
        1983.tb04266.x). Torques that hold a robot are in proportion to mass · length, so that their squares have the
        same share of the reward.
        """
        size = self.robot.hip_height / own.hip_height
        self.lowest = self.robot.height - own.height * size + self.lowest * size
        self.swing *= size
        self.gait /= float(np.sqrt(size))
        self._sharpness /= size * size
        load = size * self.robot.mass / own.mass
        self.reward_weights = {
            name: weight / (load * load) if name == "torque" else weight for name, weight in self.reward_weights.items()
        }

    def scene(self) -> tl.Scene:
        """The robot on the ground. Each world starts in another direction, with its joints a little off."""
        scene = tl.Scene(dt=DT, substeps=SUBSTEPS)
        scene.solver(cone="pyramidal", impratio=1.0)  # MuJoCo's defaults, which feet need no more than
        self.add_ground(scene)
        self.robot.add_to(scene)
        return scene

    def add_ground(self, scene: tl.Scene) -> None:
        """Add the ground to the scene."""
        scene.add_ground()

    def controls(self) -> Sequence[Control]:
        """Joint targets."""
        return [self.robot.control(LIMIT)]

    def disturbances(self) -> Sequence[Push]:
        """Pushes of the base."""
        return [Push(self.robot.body, self.pushes, (4.0, 8.0))] if self.pushes else []

    def observed(self) -> Sequence[Observed]:
        """The table of the module."""
        joints, base, dofs = len(self.robot.joints), self.robot.name, self.robot.dofs
        velocity, turning = (Values("joint_qd", of=base, columns=range(n, n + 3), axes_of=base) for n in (0, 3))
        turned = Values("joint_q", of=dofs, minus=self.robot.standing)
        return [
            Observed("velocity", -10, 10, 3, "m/s", source=velocity),
            Observed("angular velocity", -30, 30, 3, "rad/s", source=turning),
            Observed("gravity", -1, 1, 3, source=Gravity(base)),
            Observed("command", -2, 2, 3, "m/s, rad/s", source=Input("command", 3)),
            Observed("joint positions", -4, 4, joints, "rad", source=turned),
            Observed("joint velocities", -60, 60, joints, "rad/s", source=Values("joint_qd", of=dofs)),
            Observed("last action", -LIMIT, LIMIT, joints, source=LastAction()),
            Observed("phase", -1, 1, 2, source=Clock(self.gait, runs_with="command")),
        ]

    def bind(self, names: Names) -> None:
        """Look up the joints and feet."""
        self._joints = _places([names.coord(name) for name in self.robot.dofs])
        self._dofs = _places([names.dof(name) for name in self.robot.dofs])
        self._feet = _places(self.robot.sites(names))
        self._sites, self._torques = self.robot.site_field, self.robot.torque_field
        self._standing = np.array(self.robot.standing, np.float32)

    def initial_state(self, xp: Namespace, worlds: Worlds, draws: Array) -> Mapping[str, Array]:
        """Return random starts of a robot that the scene does not place, from the first draws."""
        joint_q = self.robot.start(draws[:, : self.robot.start_draws])
        return {} if joint_q is None else {"joint_q": joint_q}

    def policy_metadata(self) -> Mapping[str, Any]:
        """Return what a policy's file says of its command, gait and options, and of a robot from MJCF."""
        return {
            "command_names": ("ahead_mps", "left_mps", "turn_radps"),
            "gait_hz": self.gait,
            **self.robot.metadata(),
            **({"task_options": self._options} if self._options else {}),
        }

    def goal(self, xp: Namespace, worlds: Worlds, draws: Array) -> Array:
        """Return the next command: ahead, left, turn; or to stand."""
        moves = draws[:, 3] >= STILL
        signed = 2.0 * draws - 1.0
        return xp.stack([most * signed[:, axis] * moves for axis, most in enumerate(self.command_max)], 1)

    def foot_heights(self, xp: Namespace, worlds: Worlds) -> Array:
        """Return how high the soles are above the ground [m], shape ``(worlds, feet)``."""
        return getattr(worlds, self._sites)[:, self._feet, 2] - self.robot.radius

    def gait_errors(self, xp: Namespace, worlds: Worlds, lift: Array) -> Array:
        """Return how far soles are from the heights of their gait [m], shape ``(worlds, feet)``.

        Args:
            xp: Array namespace.
            worlds: The worlds.
            lift: Heights of the gait above the ground [m], shape ``(worlds, feet)``; 0 for feet that stand.
        """
        return self.foot_heights(xp, worlds) - lift

    def base_height(self, xp: Namespace, worlds: Worlds) -> Array:
        """Return how high the base is above the ground [m], shape ``(worlds,)``."""
        return worlds.joint_q[:, 2]

    def remember(self, xp: Namespace, worlds: Worlds, memory: Mapping[str, Array] | None) -> Mapping[str, Array]:
        """Return velocities in the base's axes, the phase, how far feet are from their gait, and the mean error."""
        quats = worlds.joint_q[:, 3:7]
        velocity = rotate_inverse(xp, quats, worlds.joint_qd[:, 0:3])
        turning = rotate_inverse(xp, quats, worlds.joint_qd[:, 3:6])
        apart = worlds.goal[:, :2] - velocity[:, :2]
        error = xp.sqrt(squares(xp, apart))
        phase = 0.0 * error
        if memory is not None:
            error = memory["error"] + 0.03 * (error - memory["error"])
            phase = (memory["phase"] + 2.0 * np.pi * self.gait * CONTROL_DT) * (squares(xp, worlds.goal) > 0.0)
        swing = xp.sin(phase)
        lift = self.swing * xp.stack([xp.maximum(swing, 0.0 * swing), xp.maximum(-swing, 0.0 * swing)], 1)
        feet = self.gait_errors(xp, worlds, lift[:, self.robot.groups])
        return {
            "velocity": velocity,
            "turning": turning,
            "gravity": projected_gravity(xp, quats),
            "phase": phase,
            "clock": xp.stack([swing, xp.cos(phase)], 1),
            "feet": squares(xp, feet),
            "error": error,
        }

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """Return the parts of the table of the module."""
        own = worlds.memory
        turned = columns(xp, worlds.joint_q, self._joints) - xp.asarray(self._standing)
        moving = columns(xp, worlds.joint_qd, self._dofs)
        return own["velocity"], own["turning"], own["gravity"], worlds.goal, turned, moving, worlds.action, own["clock"]

    def reward_terms(self, xp: Namespace, worlds: Worlds) -> Mapping[str, Array]:
        """Return the terms, before their weights."""
        own = worlds.memory
        velocity, turning, gravity, command = own["velocity"], own["turning"], own["gravity"], worlds.goal
        turn, apart = command[:, 2] - turning[:, 2], squares(xp, command[:, :2] - velocity[:, :2])
        return {
            "follow velocity": xp.exp(-4.0 * apart),
            # far from the command the term before is flat, and standing is a trap
            "miss": xp.sqrt(apart),
            "follow turn": xp.exp(-4.0 * turn * turn),
            "bounce": velocity[:, 2] * velocity[:, 2],
            "roll and pitch rate": squares(xp, turning[:, :2]),
            "tilt": squares(xp, gravity[:, :2]),
            "torque": squares(xp, columns(xp, getattr(worlds, self._torques), self._dofs)),
            "action rate": squares(xp, worlds.action - worlds.previous_action),
            "gait": xp.exp(-self._sharpness * own["feet"]),
            "pose": squares(xp, columns(xp, worlds.joint_q, self._joints) - xp.asarray(self._standing)),
            "fall": 1.0 * self.terminated(xp, worlds),
        }

    def terminated(self, xp: Namespace, worlds: Worlds) -> Array:
        """Return which robots fell."""
        return (worlds.memory["gravity"][:, 2] > -0.5) | (self.base_height(xp, worlds) < self.lowest)

    def metrics(self, xp: Namespace, worlds: Worlds) -> Mapping[str, Array]:
        """Return ``velocity_error``, the mean distance of the velocity from the command [m/s], and ``fell``."""
        return {"velocity_error": worlds.memory["error"], "fell": self.terminated(xp, worlds)}

    def mirrored(self) -> Mirror | None:
        """Return left and right exchanged."""
        joints = self.robot.flip
        if joints is None:
            return None
        return Mirror(
            {
                "velocity": POLAR,
                "angular velocity": AXIAL,
                "gravity": POLAR,
                "command": ([0, 1, 2], [1, -1, -1]),
                "joint positions": joints,
                "joint velocities": joints,
                "last action": joints,
                "phase": ([0, 1], [-1, -1]),
            },
            joints,
        )


def columns(xp: Namespace, array: Array, places: slice | list[int]) -> Array:
    """Return columns of an array, shape ``(worlds, columns)``, with the values of a world side by side."""
    if isinstance(places, slice):
        return array[:, places]
    # an index by a list may put the worlds side by side; sums of rows would then round by their number
    return xp.take(array, xp.asarray(np.array(places)), axis=1)


def _told(model: Model | None, options: RobotOptions) -> str:
    """The arguments that change the robot, as JSON; of a model that is no file the type."""
    file = model if model is None or isinstance(model, str | os.PathLike) else type(model).__name__
    given = {"model": None if file is None else os.fspath(file), **vars(options)}
    return json.dumps(
        {name: value for name, value in given.items() if value is not None},
        default=lambda value: dict(value) if isinstance(value, Mapping) else float(value),
    )


def _places(places: list[int]) -> slice | list[int]:
    """Columns, as a slice where they are side by side."""
    if places == list(range(places[0], places[0] + len(places))):
        return slice(places[0], places[0] + len(places))
    return places
