"""A walking task of your own, whole: `python examples/ppo.py examples/own_quadruped.py:Walk --minutes 5` learns it.

It uses what `tightloop.env.Task` offers for robots that walk: memory of the episode, named reward terms, commands that
change within an episode, pushes, a history of observations, and an observation for the critic alone.
"""

from collections.abc import Mapping

import numpy as np

import tightloop as tl
from tightloop.env import JointTarget, Observed, Push, Task, VectorEnv
from tightloop.tasks.geometry import squares
from tightloop.tasks.kinematics import projected_gravity, rotate_inverse

LEGS = ("FL", "FR", "RL", "RR")
JOINTS = [f"dog/{leg}_{joint}" for leg in LEGS for joint in ("hip", "thigh", "calf")]
STANDING = np.array([0.0, 0.8, -1.6] * 4, np.float32)  # [rad]
STEP = 0.02  # [s]


class Walk(Task):
    fields = ("joint_q", "joint_qd", "joint_torque", "contact_sensor", "site_q")
    max_episode_steps = 1000  # 20 s
    goal_draws, goal_steps = 3, 250  # a command every 5 s
    reward_weights: Mapping[str, float] = {
        "speed": 1.5 * STEP,
        "turn": 0.75 * STEP,
        "gait": 1.0 * STEP,
        "upright": -2.5 * STEP,
        "smooth": -0.01 * STEP,
        "torque": -2e-4 * STEP,
        "fall": -1.0,
    }

    def scene(self):
        scene = tl.Scene(dt=STEP / 4, substeps=4)
        scene.solver(cone="pyramidal", impratio=1.0)
        scene.add_ground()
        dog = scene.add_urdf(tl.assets.QUADRUPED, name="dog", floating=True, pos=(0, 0, 0.32))
        dog.joint_q = dog.joint_target_q = STANDING
        dog.joint_target_ke, dog.joint_target_kd, dog.joint_armature = 40.0, 1.0, 0.01
        for leg in LEGS:
            scene.add_contact_sensor(of=f"dog/{leg}_foot", name=leg)
            scene.add_site(body=f"dog/{leg}_foot", name=leg)
        scene.randomize(
            joint_q={"dog": tl.Uniform(-0.1, 0.1)},
            params={"shape_mu": {"ground": tl.Uniform(0.6, 1.2)}, "joint_target_ke": {"dog": tl.Uniform(36, 44)}},
        )
        scene.friction_combine = "min"  # the feet have a friction of 1
        return scene

    def controls(self):
        return [JointTarget(JOINTS, 0.3, limit=4.0)]

    def disturbances(self):
        return [Push("dog/trunk", impulse=4.0, interval=(4.0, 8.0))]

    def observed(self):
        return [
            Observed("turning", -30, 30, 3, "rad/s"),
            Observed("gravity", -1, 1, 3),
            Observed("command", -2, 2, 3, "m/s, rad/s"),
            Observed("joints", -4, 4, 12, "rad", history=2),
            Observed("velocities", -60, 60, 12, "rad/s"),
            Observed("last action", -4, 4, 12),
            Observed("clock", -1, 1, 2),
        ]

    def privileged_observed(self):  # what no robot measures well, for the critic alone
        return [*self.observed(), Observed("velocity", -10, 10, 3, "m/s"), Observed("contact", 0, 1, 4)]

    def goal(self, xp, worlds, draws):  # ahead, left, turn
        return (2.0 * draws - 1.0) * xp.asarray([1.0, 0.5, 1.0])

    def remember(self, xp, worlds, memory):
        quats, phase = worlds.joint_q[:, 3:7], 0.0 * worlds.joint_q[:, 0]
        if memory is not None:
            phase = memory["phase"] + 2.0 * np.pi * 2.5 * STEP  # 2.5 steps of a leg in a second
        swing = xp.sin(phase)
        lift = 0.07 * xp.stack([xp.maximum(swing, 0.0 * swing), xp.maximum(-swing, 0.0 * swing)], 1)
        return {
            "velocity": rotate_inverse(xp, quats, worlds.joint_qd[:, 0:3]),
            "turning": rotate_inverse(xp, quats, worlds.joint_qd[:, 3:6]),
            "gravity": projected_gravity(xp, quats),
            "phase": phase,
            "clock": xp.stack([swing, xp.cos(phase)], 1),
            "feet": squares(xp, worlds.site_q[:, :, 2] - 0.02 - lift[:, [0, 1, 1, 0]]),  # diagonal feet swing together
        }

    def observe(self, xp, worlds):
        own, joints = worlds.memory, worlds.joint_q[:, 7:] - STANDING
        return own["turning"], own["gravity"], worlds.goal, joints, worlds.joint_qd[:, 6:], worlds.action, own["clock"]

    def privileged_observe(self, xp, worlds):
        return *self.observe(xp, worlds), worlds.memory["velocity"], worlds.contact_sensor[:, :, 2] > 1.0

    def reward_terms(self, xp, worlds):
        own, turn = worlds.memory, worlds.goal[:, 2] - worlds.memory["turning"][:, 2]
        return {
            "speed": xp.exp(-4.0 * squares(xp, worlds.goal[:, :2] - own["velocity"][:, :2])),
            "turn": xp.exp(-4.0 * turn * turn),
            "gait": xp.exp(-200.0 * own["feet"]),
            "upright": squares(xp, own["gravity"][:, :2]),
            "smooth": squares(xp, worlds.action - worlds.previous_action),
            "torque": squares(xp, worlds.joint_torque),
            "fall": 1.0 * self.terminated(xp, worlds),
        }

    def terminated(self, xp, worlds):
        return (worlds.memory["gravity"][:, 2] > -0.5) | (worlds.joint_q[:, 2] < 0.15)


if __name__ == "__main__":
    envs = VectorEnv(Walk, 256)
    envs.reset(seed=0)
    rewards = [envs.step(envs.action_space.sample())[1].mean() for _ in range(100)]
    print(f"mean reward of random actions: {sum(rewards) / len(rewards):.4f}")
    envs.close()
