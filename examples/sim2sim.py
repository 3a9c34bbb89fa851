"""Runs a walking policy in MuJoCo C, from its file alone: does it walk there, too?

    pip install mujoco onnxruntime
    python examples/sim2sim.py out/ppo/QuadrupedVelocityFlat-0/policy.onnx

The ONNX file's metadata says what the policy sees and what its actions mean. MuJoCo's model is written from the task's
scene by `Scene.to_mujoco`; a robot from MJCF stands on MuJoCo's plane. The side of tightloop is the task itself.

First both simulators play the same actions from the same state, open loop. The distances of their joints and
observations are printed. Then the policy drives each robot for 10 s per command, closed loop, and the error of its
velocity is printed.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from learning.program import needed
from numpy.typing import NDArray

import tightloop as tl
from tightloop.env import Worlds
from tightloop.env.names import Names
from tightloop.env.registry import make_task
from tightloop.tasks.legged import LeggedModel, LeggedRobot
from tightloop.tasks.legged_models.known import KNOWN
from tightloop.tasks.velocity import VelocityTask

with needed("mujoco", "onnxruntime"):
    import mujoco
    import onnxruntime

ORDER = ("ahead_mps", "left_mps", "turn_radps")
COMMANDS = np.array([[0.5, 0, 0], [1, 0, 0], [-0.5, 0, 0], [0, 0.5, 0], [0, 0, 1], [0.7, 0, -0.7]])  # in this order
STEPS, OPEN_LOOP = 500, 50  # control steps of each


class Facts:
    """Metadata of a policy, by name."""

    def __init__(self, path: Path, metadata: Mapping[str, str]) -> None:
        self._path, self._metadata = path, metadata

    def names(self, name: str) -> list[str]:
        """Return a list of names."""
        if name in self._metadata:
            return self._metadata[name].split(",")
        if "task" in self._metadata:
            raise SystemExit(
                f"{self._path} is a policy of {self._metadata['task']} without metadata {name!r}; only policies of "
                "velocity tasks run here"
            )
        raise SystemExit(f"{self._path} has no metadata {name!r}; examples/policy_file.py writes that of its task")

    def numbers(self, name: str) -> NDArray[np.float64]:
        """Return a list of numbers."""
        return np.array(self.names(name), np.float64)

    def number(self, name: str) -> float:
        """Return a single number."""
        return float(self.numbers(name)[0])

    def options(self) -> dict[str, Any]:
        """Return the arguments that the task was made with."""
        return json.loads(self._metadata.get("task_options", "{}"))


class Player:
    """A robot in some simulator, which follows commands.

    Attributes:
        obs: What the policy sees, shape ``(1, size)``.
        joints: Joint positions in the order of ``joint_names`` [rad].
    """

    obs: NDArray[np.float32]
    joints: NDArray[np.float64]

    def __init__(self, facts: Facts, robot: LeggedRobot) -> None:
        self.names = facts.names("joint_names")
        # the task observes these alone; drives hold the others
        self._driven = [self.names.index(name) for name in robot.joints]
        self._scale, self._offset = facts.numbers("action_scale"), facts.numbers("action_offset")
        self._low, self._high = facts.numbers("action_low"), facts.numbers("action_high")
        self._targets = facts.numbers("default_joint_pos")
        sizes, parts = facts.numbers("observation_sizes").astype(int), facts.names("observation_names")
        first = int(sizes[: parts.index("velocity")].sum())
        self._velocity = [first, first + 1]
        self._plane = [facts.names("command_names").index(name) for name in ORDER[:2]]
        self.command, self.action = np.zeros(3), np.zeros(len(self._driven))

    def begin(self, joint_q: NDArray[np.float64], command: NDArray[np.float64]) -> None:
        """Start at rest, from positions as tightloop has them."""
        self.command, self.action = command, np.zeros(len(self._driven))
        self._start(joint_q)

    def step(self, action: NDArray[np.float32]) -> None:
        """Take a control step with an action, shape ``(1, actions)``."""
        # an environment's actions are float32
        self.action = np.clip(action[0].astype(np.float64), self._low, self._high)
        self._targets[self._driven] = self._offset + self._scale * self.action
        self._step(self._targets)

    def error(self) -> float:
        """Distance of the velocity from the command, in the plane [m/s]."""
        return float(np.linalg.norm(self.obs[0, self._velocity] - self.command[self._plane]))

    def _start(self, joint_q: NDArray[np.float64]) -> None:
        raise NotImplementedError

    def _step(self, targets: NDArray[np.float64]) -> None:
        raise NotImplementedError


class InMujoco(Player):
    """In MuJoCo C, from the scene as MJCF, seen as the metadata says."""

    def __init__(self, facts: Facts, robot: LeggedRobot, scene: tl.Scene) -> None:
        super().__init__(facts, robot)
        # what MuJoCo compiled stays as it is
        is_own = isinstance(robot, LeggedModel)
        self.model = robot.on_ground() if is_own else mujoco.MjModel.from_xml_string(scene.to_mujoco())
        self.data = mujoco.MjData(self.model)
        own = [self.model.joint(name if is_own else f"{robot.name}/{name}").id for name in self.names]
        self._coords, self._dofs = self.model.jnt_qposadr[own], self.model.jnt_dofadr[own]
        # a joint without gains has no actuator
        self._actuators = [list(own).index(joint) for joint in self.model.actuator_trnid[:, 0]]
        free = int(np.flatnonzero(self.model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0])
        self._free, self._trunk = int(self.model.jnt_qposadr[free]), int(self.model.jnt_bodyid[free])
        self._parts, self._rest = facts.names("observation_names"), facts.numbers("default_joint_pos")
        self._bounds = facts.numbers("observation_low"), facts.numbers("observation_high")
        if set(facts.numbers("observation_history")) != {1}:
            raise SystemExit("the policy sees steps before; this shows it the current one only")
        self._turn = 2 * np.pi * facts.number("gait_hz") * facts.number("control_dt") if "phase" in self._parts else 0.0
        # tightloop clips targets of drives to the joint's range, and leaves MuJoCo's controls to the actuator
        is_clipped = self.model.jnt_limited[own] & (not is_own)
        self._range = np.where(is_clipped, self.model.jnt_range[own].T, [[-np.inf], [np.inf]])
        self._substeps, self._phase = int(facts.number("substeps")), 0.0

    def _start(self, joint_q: NDArray[np.float64]) -> None:
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self._free : self._free + 7] = joint_q[[0, 1, 2, 6, 3, 4, 5]]
        self.data.qpos[self._coords] = joint_q[7:]
        self._phase = 0.0
        self._observe()

    def _step(self, targets: NDArray[np.float64]) -> None:
        self.data.ctrl[:] = np.clip(targets, *self._range)[self._actuators]
        mujoco.mj_step(self.model, self.data, self._substeps)
        # a robot that is to stand marks no time
        self._phase = (self._phase + self._turn) * self.command.any()
        self._observe()

    def _observe(self) -> None:
        data, trunk, twist = self.data, self._trunk, np.zeros(6)
        mujoco.mj_forward(self.model, data)
        # angular, then that of the trunk's centre of mass, in world axes
        mujoco.mj_objectVelocity(self.model, data, mujoco.mjtObj.mjOBJ_BODY, trunk, twist, 0)
        to_trunk = data.xmat[trunk].reshape(3, 3).T
        self.joints = data.qpos[self._coords]
        seen = {
            "velocity": to_trunk @ twist[3:],
            "angular velocity": to_trunk @ twist[:3],
            "gravity": to_trunk @ (0.0, 0.0, -1.0),
            "command": self.command,
            "joint positions": (self.joints - self._rest)[self._driven],
            "joint velocities": data.qvel[self._dofs][self._driven],
            "last action": self.action,
            "phase": np.array([np.sin(self._phase), np.cos(self._phase)]),
        }
        if unknown := [name for name in self._parts if name not in seen]:
            raise SystemExit(f"the policy sees {', '.join(unknown)}, which this cannot show in MuJoCo")
        self.obs = np.clip(np.concatenate([seen[name] for name in self._parts]), *self._bounds)[None].astype(np.float32)


class InTightloop(Player):
    """In tightloop, in a daemon with one world, seen by the task's own functions."""

    def __init__(self, facts: Facts, task: VelocityTask, sim: tl.Sim) -> None:
        super().__init__(facts, task.robot)
        self.task, self.sim, self._memory = task, sim, None
        names = Names(sim.info)
        task.bind(names)
        self._robot, self._is_own = task.robot.name, isinstance(task.robot, LeggedModel)
        self._coords = [names.coord(f"{self._robot}/{name}") for name in self.names]
        if not self._is_own:
            self._range = np.asarray(task.scene().robots[self._robot].joint_range)[-len(self.names) :].T

    def _start(self, joint_q: NDArray[np.float64]) -> None:
        self.sim.reset()
        self._memory = None
        self._observe(self.sim.write(joint_q=joint_q, joint_qd=np.zeros(len(self.sim.info["dof_names"]))))

    def _step(self, targets: NDArray[np.float64]) -> None:
        if self._is_own:
            self._observe(self.sim.step(ctrl=targets[self._driven]))
        else:
            self._observe(self.sim.step(joint_target_q={self._robot: np.clip(targets, *self._range)}))

    def _observe(self, frame: Any) -> None:
        self.joints = np.array(frame.joint_q[0, self._coords], np.float64)
        seen = {name: np.asarray(getattr(frame, name), np.float32) for name in self.task.fields}
        seen |= {"goal": self.command[None].astype(np.float32), "action": self.action[None].astype(np.float32)}
        self._memory = self.task.remember(np, Worlds(**seen), self._memory)
        parts = self.task.observe(np, Worlds(**seen, memory=self._memory))
        self.obs = np.concatenate([np.asarray(part, np.float32).reshape(1, -1) for part in parts], 1)


def main() -> None:
    """Read the policy and compare."""
    parser = argparse.ArgumentParser(description="Run a walking policy in MuJoCo C.")
    parser.add_argument("policy", type=Path, help="ONNX file with metadata, of a task that follows velocities")
    parser.add_argument("--robot", type=Path, help="URDF or MJCF file (default: that of the policy's task)")
    args = parser.parse_args()
    if not args.policy.is_file():
        raise SystemExit(f"there is no policy {args.policy}; name an ONNX file, such as those in examples/trained")
    try:
        session = onnxruntime.InferenceSession(args.policy, providers=["CPUExecutionProvider"])
    except Exception as error:
        raise SystemExit(f"{args.policy} is no ONNX file that onnxruntime can read; export it again: {error}") from None
    facts = Facts(args.policy, session.get_modelmeta().custom_metadata_map)
    options = facts.options()
    # the policy's own robot, or a copy of its file elsewhere
    if args.robot:
        options["model"] = str(args.robot)
    model = options.get("model")
    if model is not None and model not in KNOWN and not Path(model).is_file():
        raise SystemExit(f"there is no robot {model}; name its file by --robot")
    try:
        compare(session, facts, options)
    except tl.TightloopError as error:
        raise SystemExit(f"{args.policy}: {error}") from None


def compare(session: onnxruntime.InferenceSession, facts: Facts, options: dict[str, Any]) -> None:
    """Play the same actions in both simulators, then follow each command in both, and print the errors."""
    commands = COMMANDS[:, [ORDER.index(name) for name in facts.names("command_names")]]

    def policy(obs: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.asarray(session.run(None, {session.get_inputs()[0].name: obs})[0])

    task = make_task(facts.names("task")[0], options)
    if not isinstance(task, VelocityTask):
        raise SystemExit(f"the policy is one of {type(task).__name__}; only those of velocity tasks run here")
    scene = task.scene()
    with tl.launch(scene, worlds=1, precision="f64", fields=task.fields) as sim:
        start = np.array(sim.reset().joint_q[0], np.float64)
        if isinstance(task.robot, LeggedModel):
            start = task.robot.start_q  # the scene begins where the file does
        ours, theirs = InTightloop(facts, task, sim), InMujoco(facts, task.robot, scene)
        for simulation in (ours, theirs):
            simulation.begin(start, commands[1])
        for step in range(1, OPEN_LOOP + 1):
            action = policy(ours.obs)
            for simulation in (ours, theirs):
                simulation.step(action)
            if step in (1, 5, 10, 25, OPEN_LOOP):
                joints, seen = (np.abs(a - b).max() for a, b in ((ours.joints, theirs.joints), (ours.obs, theirs.obs)))
                seconds = step * facts.number("control_dt")
                print(f"same actions, {seconds:.2f} s: joints are {joints:.1e} rad apart, observations {seen:.1e}")
        print("command: ahead, left, turn      error of the velocity: tightloop, MuJoCo C")
        for shown, command in zip(COMMANDS, commands, strict=True):
            errors = []
            for player in (ours, theirs):
                player.begin(start, command)
                off = []
                for _ in range(STEPS):
                    player.step(policy(player.obs))
                    off.append(player.error())
                errors.append(float(np.mean(off[STEPS // 2 :])))
            print(f"{shown[0]:5.1f} {shown[1]:5.1f} {shown[2]:5.1f}" + "".join(f"{e:16.3f} m/s" for e in errors))


if __name__ == "__main__":
    main()
