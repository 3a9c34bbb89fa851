"""Runs a quadruped's policy in MuJoCo C: does it walk there, too?

    pip install mujoco onnxruntime
    python examples/sim2sim.py out/ppo/QuadrupedVelocityFlat-0/policy.onnx

First both simulators play the same actions from the same state, open loop, and the distance of their joints is printed.
Then the policy drives each robot for 10 s per command, closed loop, and the error of its velocity is printed.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from training import needed

import tightloop as tl
from tightloop.env import Worlds
from tightloop.env.names import Names
from tightloop.tasks import quadruped, velocity
from tightloop.tasks.quadruped import ROBOT

with needed("mujoco", "onnxruntime"):
    import mujoco
    import onnxruntime

COMMANDS = np.array([[0.5, 0, 0], [1, 0, 0], [-0.5, 0, 0], [0, 0.5, 0], [0, 0, 1], [0.7, 0, -0.7]], np.float32)
STEPS, OPEN_LOOP = 500, 50  # control steps of each
# Joint limits of tightloop: stiffness and damping in force space, and the largest impedance of MuJoCo's default solimp
LIMIT_KE, LIMIT_KD, IMPEDANCE_MAX = 1e4, 10.0, 0.95


def mujoco_model() -> mujoco.MjModel:
    """The task's robot and ground, from the same URDF file."""
    text = tl.assets.QUADRUPED.read_text()
    head = text.index(">", text.index("<robot")) + 1
    compiler = '<mujoco><compiler fusestatic="false" discardvisual="true"/></mujoco>'
    spec = mujoco.MjSpec.from_string(text[:head] + compiler + text[head:])
    for geom in spec.geoms:
        geom.contype, geom.conaffinity = 0, 1  # not against each other
    for joint in spec.joints:
        joint.armature = ROBOT.armature
        actuator = spec.add_actuator(name=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint.name)
        actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        actuator.gainprm[0], actuator.biasprm[:3] = ROBOT.stiffness, (0, -ROBOT.stiffness, -ROBOT.damping)
        effort = 36.0 if joint.name.endswith("calf") else 24.0
        actuator.forcelimited, actuator.forcerange = True, (-effort, effort)
        joint.actfrclimited = False
    spec.worldbody.first_body().add_freejoint()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
    for leg in ROBOT.feet:
        spec.body(f"{leg}_foot").add_site(name=leg)
    option = spec.option
    option.timestep, option.integrator = velocity.DT, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.iterations, option.tolerance = 20, 1e-8
    model = spec.compile()
    flexibility = model.dof_invweight0[model.jnt_dofadr] * (1 - IMPEDANCE_MAX)
    limited = model.jnt_limited.astype(bool)
    model.jnt_solref[limited, 0] = (2 / (LIMIT_KD * flexibility))[limited]
    model.jnt_solref[limited, 1] = (LIMIT_KD * flexibility / 2 * np.sqrt(1 / (LIMIT_KE * flexibility)))[limited]
    return model


class Player:
    """One robot of the task in some simulator, seen by the task's own functions."""

    def __init__(self, names: Names) -> None:
        self.task = quadruped.QuadrupedVelocityFlat(pushes=0.0)
        self.task.bind(names)
        self.action = np.zeros((1, 12), np.float32)
        self.memory: Any = None

    def begin(self, joint_q: NDArray[np.float64], command: NDArray[np.float32]) -> NDArray[np.float32]:
        """Start at rest; returns what the policy sees, shape ``(1, size)``."""
        self.action[:], self.memory, self.command = 0.0, None, command[None]
        return self._observe(self._start(joint_q))

    def step(self, action: NDArray[np.float32]) -> NDArray[np.float32]:
        """Take a control step; returns what the policy sees."""
        self.action[:] = np.clip(action, -velocity.LIMIT, velocity.LIMIT)
        return self._observe(self._step(np.array(ROBOT.standing) + ROBOT.scale * self.action[0].astype(np.float64)))

    def _observe(self, arrays: dict[str, NDArray[np.float64]]) -> NDArray[np.float32]:
        self.joint_q = arrays["joint_q"]
        seen = {name: array[None].astype(np.float32) for name, array in arrays.items()}
        seen |= {"goal": self.command, "action": self.action}
        self.memory = self.task.remember(np, Worlds(**seen), self.memory)
        parts = self.task.observe(np, Worlds(**seen, memory=self.memory))
        return np.concatenate([np.asarray(part, np.float32).reshape(1, -1) for part in parts], 1)

    def _start(self, joint_q: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        raise NotImplementedError

    def _step(self, targets: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        raise NotImplementedError


class InMujoco(Player):
    """In MuJoCo C."""

    def __init__(self, names: Names) -> None:
        super().__init__(names)
        self.model = mujoco_model()
        self.data = mujoco.MjData(self.model)

    def _start(self, joint_q: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = joint_q[[0, 1, 2, 6, 3, 4, 5, *range(7, 19)]]
        return self._arrays()

    def _step(self, targets: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        self.data.ctrl[:] = np.clip(targets, *self.model.jnt_range[1:].T)
        mujoco.mj_step(self.model, self.data, velocity.SUBSTEPS)
        return self._arrays()

    def _arrays(self) -> dict[str, NDArray[np.float64]]:
        data, velocity = self.data, np.zeros(6)
        mujoco.mj_forward(self.model, data)
        # angular, then that of the trunk's centre of mass, in world axes
        mujoco.mj_objectVelocity(self.model, data, mujoco.mjtObj.mjOBJ_BODY, 1, velocity, 0)
        return {
            "joint_q": data.qpos[[0, 1, 2, 4, 5, 6, 3, *range(7, 19)]],
            "joint_qd": np.concatenate([velocity[3:], velocity[:3], data.qvel[6:]]),
            "site_q": np.pad(data.site_xpos, ((0, 0), (0, 4))),
        }


class InTightloop(Player):
    """In tightloop, in a daemon with one world."""

    def __init__(self, sim: tl.Sim, limits: NDArray[np.float64]) -> None:
        super().__init__(Names(sim.info))
        self.sim, self.limits = sim, limits

    def _start(self, joint_q: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        self.sim.reset()
        return self._arrays(self.sim.write(joint_q=joint_q, joint_qd=np.zeros(18)))

    def _step(self, targets: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        return self._arrays(self.sim.step(joint_target_q={"dog": np.clip(targets, *self.limits)}))

    def _arrays(self, frame: Any) -> dict[str, NDArray[np.float64]]:
        return {name: np.array(getattr(frame, name)[0], np.float64) for name in ("joint_q", "joint_qd", "site_q")}


def main() -> None:
    """Compare the two."""
    parser = argparse.ArgumentParser(description="Run a quadruped's policy in MuJoCo C.")
    parser.add_argument("policy", type=Path, help="ONNX file of QuadrupedVelocityFlat")
    args = parser.parse_args()
    session = onnxruntime.InferenceSession(args.policy, providers=["CPUExecutionProvider"])

    def policy(obs: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.asarray(session.run(["action"], {"obs": obs})[0])

    scene = quadruped.QuadrupedVelocityFlat(pushes=0.0).scene()
    with tl.launch(scene, worlds=1, precision="f64", fields=("joint_q", "joint_qd", "site_q")) as sim:
        start = np.array(sim.reset().joint_q[0], np.float64)
        limits = np.asarray(scene.robots["dog"].joint_range)[-12:].T
        ours, theirs = InTightloop(sim, limits), InMujoco(Names(sim.info))
        obs, _ = ours.begin(start, COMMANDS[1]), theirs.begin(start, COMMANDS[1])
        for step in range(1, OPEN_LOOP + 1):
            action = policy(obs)
            obs, _ = ours.step(action), theirs.step(action)
            if step in (1, 5, 10, 25, OPEN_LOOP):
                apart = np.abs(ours.joint_q[7:] - theirs.joint_q[7:]).max()
                print(f"same actions, {step * velocity.CONTROL_DT:.2f} s: joints are {apart:.1e} rad apart")
        print("command: ahead, left, turn      error of the velocity: tightloop, MuJoCo C")
        for command in COMMANDS:
            errors = []
            for player in (ours, theirs):
                obs, off = player.begin(start, command), []
                for _ in range(STEPS):
                    obs = player.step(policy(obs))
                    off.append(np.linalg.norm(player.memory["velocity"][0, :2] - command[:2]))
                errors.append(float(np.mean(off[STEPS // 2 :])))
            print(f"{command[0]:5.1f} {command[1]:5.1f} {command[2]:5.1f}" + "".join(f"{e:16.3f} m/s" for e in errors))


if __name__ == "__main__":
    main()
