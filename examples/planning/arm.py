"""An arm holds its hand at a place, evades a ball that sweeps through it, and returns."""

from __future__ import annotations

import numpy as np

import tightloop as tl
from planning.problem import Array, Problem
from tightloop import assets

HOME = np.array([0.0, -0.6, 0.0, -2.3, 0.0, 1.7, 0.785, 0.04, 0.04])  # [rad, m]
STIFFNESS = np.array([4500.0, 4500, 3500, 3500, 2000, 2000, 2000, 100, 100])  # [N·m/rad, N/m]
PASSES = 3  # of the ball in a run
PERIOD, SPEED = 3.0, 0.6  # between two passes [s], of the ball [m/s]
RADIUS, MASS = 0.08, 0.5  # of the ball [m, kg]
SEEN = 0.25  # distance from which on frames list the ball beside a link [m]
CLEARANCE = 0.1  # that the planner keeps [m]
REACH, TOLERANCE = 10.0, 0.02  # weight of the hand's distance from its place [1/m²], and how near it must return [m]


class Arm(Problem):
    """The evasion, by position targets of the arm's joints. The ball flies straight on, for no force acts on it."""

    command, columns = "joint_target_q", tuple(range(7))
    rest = np.concatenate((HOME, np.zeros(6)))  # the ball's dofs have no drive
    low, high, effort = HOME[:7] - 1.0, HOME[:7] + 1.0, 0.5  # [rad], [1/rad]
    seconds, duration = 0.04, PASSES * PERIOD + 1.0
    horizon, knot, noise, samples = 25, 6, 0.4, 128
    params = ("body_f",)
    fields = ("joint_q", "joint_qd", "site_q", "contact_count", "contact_distance")

    def scene(self) -> tl.Scene:
        """Return the arm and the ball."""
        made = tl.Scene(dt=self.seconds / 4, substeps=4)
        arm = made.add_urdf(assets.FR3, name="arm")
        arm.joint_q, arm.joint_target_ke, arm.joint_target_kd = HOME, STIFFNESS, STIFFNESS / 10
        made.add_site(body="arm/fr3_hand_tcp", name="hand")
        ball = made.add_body(name="ball", pos=(0, 3, 1), mass=MASS)
        made.add_sphere(body=ball, radius=RADIUS, gap=SEEN)
        return made

    def cost(self, frame: tl.Frame) -> Array:
        """Return the cost of the hand's distance from its place, of the joints' speed, and of the ball's nearness."""
        away = np.square(frame.site_q[:, 0, :3] - self._place).sum(axis=1)
        near = np.maximum(1 - distance(frame) / CLEARANCE, 0)
        return REACH * away + 0.01 * np.square(frame.joint_qd[:, :7]).sum(axis=1) + 20 * near + 100 * (near >= 1)

    def begin(self, plant: tl.Sim, seed: int) -> None:
        """Let the arm settle, without a ball; where its hand is then is its place."""
        self._random = np.random.default_rng(seed)
        self._throws = [round(number * PERIOD / self.seconds) for number in range(PASSES)]
        plant.reset()
        lift = np.zeros((len(plant.body_names), 6))
        lift[plant.bodies["ball"], 2] = 9.81 * MASS
        frame = plant.step(joint_target_q=self.rest, body_f=lift)
        for _ in range(25):
            frame = plant.step()
        self._place = np.array(frame.site_q[0, 0, :3])
        self._distances: list[float] = []
        self._errors: list[float] = []
        self._touched = 0

    def between(self, plant: tl.Sim, frame: int) -> None:
        """Throw the ball towards a place of the hand or the forearm, now and then."""
        if frame not in self._throws:
            return
        turn = self._random.uniform(-0.6, 0.6) + np.pi * self._random.integers(2)
        way = np.array([-np.sin(turn), np.cos(turn), 0.0])
        middle = self._place + self._random.uniform((-0.1, -0.05, 0.0), (0.0, 0.05, 0.2))
        self._velocity = SPEED * way
        plant.write(
            joint_q={"ball": [*(middle - 0.9 * way), 0, 0, 0, 1]}, joint_qd={"ball": [*self._velocity, 0, 0, 0]}
        )

    def observe(self, frame: tl.Frame) -> None:
        """Take note of distances, and of whether something deflected the ball."""
        self._distances.append(float(distance(frame)[0]))
        self._errors.append(float(np.linalg.norm(frame.site_q[0, 0, :3] - self._place)))
        self._touched += bool(np.abs(frame.joint_qd[0, -6:-3] - self._velocity).max() > 1e-3)

    def judge(self) -> tuple[bool, str]:
        """Return whether nothing touched the ball, and the hand came back."""
        nearest, error = min(self._distances), max(self._errors[-round(0.2 / self.seconds) :])
        text = f"ball {1e3 * nearest:.0f} mm from the arm at least, {'deflected' if self._touched else 'not touched'}"
        text += f"; hand {1e3 * error:.0f} mm from its place at the end, {1e3 * max(self._errors):.0f} mm at most"
        return nearest > 0 and not self._touched and error < TOLERANCE, text


def distance(frame: tl.Frame) -> Array:
    """Return the distance of the ball from the nearest link [m], ``(worlds,)``; `SEEN` where it is farther."""
    listed = np.arange(frame.contact_distance.shape[1]) < frame.contact_count[:, None]
    return np.where(listed, frame.contact_distance, SEEN).min(axis=1)
