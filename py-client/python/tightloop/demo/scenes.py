"""The scenes of the demo: what each one runs, and its summary."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

import tightloop as tl
from tightloop.assets import policy
from tightloop.demo import lesson

# Where the goal stands in observations of `tightloop.tasks.pick_cube`, in the world's axes [m].
_GOAL = slice(26, 29)


class DemoScene(ABC):
    """A scene of the demo.

    Attributes:
        name: Name on the command line.
        title: What it shows, in a few words.
        worlds: Number of worlds.
        frames: Control frames of a round.
        shown: Largest number of worlds in its picture.
        params: Parameters that vary between worlds.
        sim: The simulation, after `open`.
        frame: The newest frame.
        seconds: Time spent in steps since the round began [s].
        done: Frames of the round so far.
    """

    name: str
    title: str
    params: tuple[str, ...] = ()
    sim: tl.Sim
    frame: Any
    frames = lesson.FRAMES
    shown = 9

    def __init__(self, worlds: int) -> None:
        self.worlds = worlds
        self.seconds, self.done = 0.0, 0

    @abstractmethod
    def open(self, name: str | None, device: str, threads: int | None) -> None:
        """Launch the simulation; arguments are those of `tightloop.launch`."""

    def close(self) -> None:
        """End the simulation."""
        self.sim.close()

    def begin(self) -> None:
        """Start a round."""
        self.seconds, self.done = 0.0, 0
        self.restart()

    def advance(self) -> None:
        """Advance by a control frame."""
        began = time.perf_counter()
        self.step(self.done)
        self.seconds += time.perf_counter() - began
        self.done += 1

    def rate(self) -> float:
        """Return the physics steps of all worlds per second."""
        return self.worlds * self.sim.substeps * self.done / max(self.seconds, 1e-9)

    def state(self) -> NDArray[np.float64]:
        """Return joint positions of the worlds in its picture, shape ``(worlds, coords)``."""
        return np.array(self.frame.joint_q[: self.shown], np.float64)

    def goals(self) -> dict[str, Any]:
        """Return the goals to draw, as of `tightloop.view.picture.Picture.render`."""
        return {}

    @abstractmethod
    def restart(self) -> None:
        """Reset all worlds."""

    @abstractmethod
    def step(self, frame: int) -> None:
        """Do one step; ``frame`` counts from 0."""

    @abstractmethod
    def summary(self) -> str:
        """Summarize the results so far."""


class LaunchedScene(DemoScene):
    """A scene of the demo that runs a `tightloop.Scene`."""

    def open(self, name: str | None, device: str, threads: int | None) -> None:
        options: dict[str, Any] = {"name": name, "device": device, "threads": threads, "params": self.params}
        self.sim = tl.launch(self.scene(), worlds=self.worlds, fields=("joint_q",), **options)

    @abstractmethod
    def scene(self) -> tl.Scene:
        """Return the scene to simulate."""


class _Recorded(LaunchedScene):
    """A scene whose world 0 repeats a recorded run of MuJoCo."""

    until = lesson.FRAMES

    def __init__(self, worlds: int) -> None:
        super().__init__(worlds)
        self._record = lesson.record(self.name)

    def restart(self) -> None:
        self.frame = self.sim.reset()
        self._off = 0.0

    def _compare(self) -> None:
        """Update the largest deviation of world 0 from the record, as long as they can be compared."""
        if self.done < self.until:
            off = np.abs(self.frame.joint_q[0, :9] - self._record[self.done + 1, :9])
            self._off = max(self._off, float(off.max()))

    def _deviation(self) -> str:
        span = min(self.done, self.until) * self.sim.dt * self.sim.substeps
        return f"world 0 is within {self._off:.1e} rad of MuJoCo C over {span:.2g} s"


class Torque(_Recorded):
    """Torques, and nothing else."""

    name = "torque"
    title = "arms pushed by torques, each with its own amplitude"
    # an arm without drives is chaotic and amplifies rounding: f32 and f64 diverge after a second
    until = 60

    def scene(self) -> tl.Scene:
        return lesson.arm(driven=False)

    def step(self, frame: int) -> None:
        self.frame = self.sim.step(joint_f={"arm": lesson.torques(frame, self.worlds)})
        self._compare()

    def summary(self) -> str:
        return self._deviation()


class Target(_Recorded):
    """Position targets."""

    name = "target"
    title = "arms that follow targets of their drives"

    def scene(self) -> tl.Scene:
        return lesson.arm(driven=True)

    def step(self, frame: int) -> None:
        self.frame = self.sim.step(joint_target_q={"arm": lesson.targets(frame, self.worlds)})
        self._compare()

    def summary(self) -> str:
        return self._deviation()


class Grasp(_Recorded):
    """A cube, grasped and lifted."""

    name = "grasp"
    title = "arms that lift a cube with randomized position and friction"
    params = ("shape_mu",)
    # frames until the fingers close; then the cube's slip decides
    until = 90
    lifted = 0.2  # least height of a lifted cube's centre [m]: it starts at 0.125 m and ends at 0.275 m

    def __init__(self, worlds: int) -> None:
        super().__init__(worlds)
        self._goals = lesson.record("goals").astype(np.float32)
        # the lesson's friction first; 0.1 is too slippery
        self._mus = np.resize([1.0, 0.7, 0.4, 0.1], worlds)

    def scene(self) -> tl.Scene:
        return lesson.grasp()

    def restart(self) -> None:
        super().restart()
        self.sim.params.shape_mu = self._mus[:, None] * np.ones(len(self.sim.shape_names))
        others = np.arange(self.worlds) > 0  # world 0 keeps the scene's start bit for bit
        if others.any():
            self.frame = self.sim.write(joint_q={"cube": lesson.cubes(self.worlds)}, mask=others)

    def step(self, frame: int) -> None:
        self.frame = self.sim.step(joint_target_q={"arm": self._goals[frame]})
        self._compare()

    def summary(self) -> str:
        up = self.frame.joint_q[:, self.sim.coords["cube"].start + 2] > self.lifted
        slippery = int((up & (self._mus < 0.2)).sum())
        return (
            f"{int(up.sum())} of {self.worlds} cubes are up ({slippery} of them at friction 0.1); {self._deviation()}"
        )


class Many(LaunchedScene):
    """Thousands of worlds in one daemon."""

    name = "worlds"
    title = "arms in one daemon, moving in a wave"
    shown = 256

    def __init__(self, worlds: int) -> None:
        super().__init__(worlds)
        self._side = math.ceil(math.sqrt(min(worlds, self.shown)))

    def scene(self) -> tl.Scene:
        return lesson.arm(driven=True)

    def restart(self) -> None:
        self.frame = self.sim.reset()

    def step(self, frame: int) -> None:
        self.frame = self.sim.step(joint_target_q={"arm": lesson.wave(frame, self.worlds, self._side)})

    def summary(self) -> str:
        simulated = self.worlds * self.done * self.sim.dt * self.sim.substeps
        return f"{simulated / max(self.seconds, 1e-9):,.0f} s of robot time in a second"


class Trained(DemoScene):
    """A policy trained with this simulator."""

    name = "policy"
    title = "arms that pick and place a cube, by a policy trained in 35 minutes"
    frames = 50

    def open(self, name: str | None, device: str, threads: int | None) -> None:
        from tightloop.env import AutoresetMode, VectorEnv
        from tightloop.tasks.pick_cube import FrankaPickCube

        class Named(FrankaPickCube):
            launch_options = FrankaPickCube.launch_options | {"name": name}

        self._policy = policy("FrankaPickCube")
        self._env = VectorEnv(
            Named(), self.worlds, autoreset_mode=AutoresetMode.DISABLED, device=device, threads=threads
        )
        self.sim = self._env.sim

    def close(self) -> None:
        self._env.close()

    def restart(self) -> None:
        self._obs, _ = self._env.reset(seed=0)
        self._done = np.zeros(self.worlds, bool)

    def step(self, frame: int) -> None:
        self._obs, *_, infos = self._env.step(self._policy(self._obs))
        self._done = np.asarray(infos["success"], bool)

    def state(self) -> NDArray[np.float64]:
        return np.array(self.sim.forward().joint_q[: self.shown], np.float64)

    def goals(self) -> dict[str, Any]:
        return {"goal": (self._obs[: self.shown, _GOAL], 0.02, (40, 190, 90))}

    def summary(self) -> str:
        return f"{self._done.mean():.0%} of the cubes are where they should be"


#: All scenes in order, each with its default number of worlds.
SCENES: tuple[tuple[type[DemoScene], int], ...] = ((Torque, 64), (Target, 64), (Grasp, 64), (Many, 4096), (Trained, 64))
