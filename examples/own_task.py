"""A task of your own, a hand that draws circles: `python examples/ppo.py examples/own_task.py:Circle` learns it."""

import tightloop as tl
from tightloop.env import JointDelta, Observed, Task, VectorEnv
from tightloop.tasks import franka
from tightloop.tasks.geometry import distance


class Circle(Task):
    fields = ("joint_q", "joint_qd", "site_q")  # of the frame: what the functions below read of `worlds`
    max_episode_steps = 200
    goal_draws = 1  # random numbers that `goal` takes, a world and episode

    def scene(self):
        scene = tl.Scene(dt=1 / 200, substeps=10)  # a control step of 50 ms
        franka.add_arm(scene, [0, -0.57, 0, -2.81, 0, 3.04, 0.74, 0.04, 0.04])
        scene.randomize(joint_q={"arm/fr3_joint1": tl.Uniform(-0.2, 0.2)})  # drawn at each reset
        return scene

    def controls(self):  # what an action in [-1, 1] does
        return [JointDelta(franka.ARM, scale=0.1)]

    def observed(self):  # name, least and largest value, how many
        return [Observed("joints", -4, 4, 9), Observed("velocities", -9, 9, 9), Observed("to the point", -2, 2, 3)]

    def goal(self, xp, worlds, draws):
        return 0.5 + draws  # how fast the point goes around [rad/s]

    def point(self, xp, worlds):
        turn = worlds.goal[:, 0] * worlds.elapsed * 0.05
        return xp.stack([0.5 + 0.0 * turn, 0.15 * xp.sin(turn), 0.4 + 0.15 * xp.cos(turn)], 1)

    def observe(self, xp, worlds):
        return worlds.joint_q, worlds.joint_qd, self.point(xp, worlds) - worlds.site_q[:, 0, :3]

    def reward(self, xp, worlds):
        return 1.0 - xp.tanh(5.0 * distance(xp, worlds.site_q[:, 0, :3], self.point(xp, worlds)))


if __name__ == "__main__":
    envs = VectorEnv(Circle, num_envs=1024)
    envs.reset(seed=0)
    rewards = [envs.step(envs.action_space.sample())[1].mean() for _ in range(200)]
    print(f"mean reward of random actions: {sum(rewards) / len(rewards):.3f}")
    envs.close()
