"""A running simulation, which `launch` and `attach` make."""

from __future__ import annotations

import functools
import json
import os
import weakref
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop import _core, checks
from tightloop._core import Frame
from tightloop.daemon import Daemon
from tightloop.dynamics import Dynamics
from tightloop.errors import ArgumentError, CommandRefused, UnknownField
from tightloop.params import Params
from tightloop.snapshot import Snapshot, passing
from tightloop.view.process import Viewer

#: An array (worlds, dofs) for the whole scene, one (dofs,) for every world, or such arrays by robot name.
Command = ArrayLike | Mapping[str, ArrayLike]


class FrameCopy:
    """The arrays of a frame in memory of its own; `Frame.copy` makes it. Attributes are those of the frame."""

    def __init__(self, arrays: dict[str, NDArray[Any]]) -> None:
        self.__dict__.update(arrays)

    def __getattr__(self, name: str) -> NDArray[Any]:
        raise UnknownField(f"this frame carries no field {name!r}; it carries: {', '.join(self.__dict__)}")


class Sim:
    """A simulation that a daemon runs; made by `launch` and `attach`, closed by ``close`` or the end of a ``with``.

    Attributes:
        name: Name of the daemon, or of the group of worlds that this is, such as ``"franka.0"``.
        pid: Its process.
        device: Where the physics runs, such as ``"cpu (AVX-512, 16 worlds a block, 2 threads)"`` or ``"gpu (…)"``.
        precision: ``"f32"`` or ``"f64"``, the type of every real array.
        worlds: Number of worlds.
        threads: Threads that a step may use; all groups of a daemon share them.
        dt: Physics step [s].
        substeps: Physics steps a control frame.
        fields: What every frame carries.
        dof_names: ``robot/joint`` of each dof.
        coord_names: ``robot/joint`` of each coordinate.
        body_names: ``robot/link`` of each body.
        shape_names: Each collision shape: ``shape`` of static ones, which come first, ``robot/link/shape``,
            ``body/shape``.
        site_names: Sites of the scene, in the order of ``site_q`` and the other fields of sites.
        contact_sensor_names: Its contact sensors, in the order of ``contact_sensor``.
        dofs: Slice of each robot's dofs, by robot name.
        coords: Slice of each robot's coordinates.
        bodies: Slice of each robot's bodies.
        info: Everything the daemon tells about itself, notes on the scene included. ``delivery`` says how frames reach
            shared memory: ``"direct"`` from the CPU, ``"imported"`` where a GPU writes them there, ``"copied"`` where
            the processor copies them from it. ``groups`` and ``group`` say how many the daemon has and which one this
            is, and ``first_world`` the number of its first world among those of all.
    """

    def __init__(self, client: _core.Client, daemon: Daemon | None) -> None:
        self._client = client
        self.info: dict[str, Any] = json.loads(client.describe())
        self.name: str = self.info["name"]
        # Runs when the last reference goes, and at interpreter exit
        self._viewers: list[Viewer] = []
        self._end = weakref.finalize(self, _end, client, daemon, self.name, os.getpid(), self._viewers)
        self.pid: int = self.info["pid"]
        self.device: str = self.info["device"]
        self.precision: str = self.info["precision"]
        self.worlds: int = self.info["worlds"]
        self.threads: int = self.info["threads"]
        self.dt: float = self.info["dt"]
        self.substeps: int = self.info["substeps"]
        self.fields = tuple(field["name"] for field in self.info["fields"])
        self.dof_names: list[str] = self.info["dof_names"]
        self.coord_names: list[str] = self.info["coord_names"]
        self.body_names: list[str] = self.info["body_names"]
        self.shape_names: list[str] = self.info["shape_names"]
        self.site_names: list[str] = self.info["site_names"]
        self.contact_sensor_names: list[str] = self.info["contact_sensor_names"]
        self.dofs, self.coords, self.bodies = (
            {robot["name"]: slice(*robot[range_]) for robot in self.info["robots"]}
            for range_ in ("dofs", "coords", "bodies")
        )

    def step(
        self,
        *,
        joint_f: Command | None = None,
        joint_target_q: Command | None = None,
        joint_target_qd: Command | None = None,
        body_f: Command | None = None,
    ) -> Frame:
        """Advance every world by one control frame. What is left out keeps its last value.

        Args:
            joint_f: Joint torques [N·m or N], shape ``(worlds, dofs)`` or ``(dofs,)``, held over the substeps.
                Not clamped by the effort limit.
            joint_target_q: Drive targets [rad or m], same shapes.
            joint_target_qd: Drive velocity targets [rad/s or m/s], same shapes.
                Each may be a dict of arrays by robot name, with that robot's dofs only.
            body_f: Force on each link at its centre of mass [N], then torque [N·m], in world axes, shape
                ``(worlds, bodies, 6)`` or ``(bodies, 6)``; asked for by ``launch(params=("body_f",))``.

        Returns:
            A frame of read-only views. It stays valid, unchanged, until it is dropped.

        Raises:
            CommandRefused: A wrong shape, dtype or value; no world was touched.
            FramesHeld: As many frames are alive as ``frames_held`` allows.
            LeaseHeld: Another client controls the daemon.
            LeaseLost: This client did, and no longer does.
            DaemonLost: The daemon went away; its state is lost.
        """
        wrench = None if body_f is None else self.params.ready("body_f", body_f)
        return self._client.step(joint_f, joint_target_q, joint_target_qd, wrench)

    def send(
        self,
        *,
        joint_f: Command | None = None,
        joint_target_q: Command | None = None,
        joint_target_qd: Command | None = None,
        body_f: Command | None = None,
    ) -> None:
        """Begin a step and return at once: the worlds advance while the caller does something else, until `recv`.

        Until then every other command (a second ``send``, `step`, `reset`, `write`, `forward`, `snapshot`, `restore`,
        and reading or writing ``params``) is refused and touches nothing.

        Args:
            joint_f: As of `step`; the arrays are copied, and may be written to again at once.
            joint_target_q: As of `step`.
            joint_target_qd: As of `step`.
            body_f: As of `step`.

        Raises:
            CommandRefused: A wrong shape or dtype, or a step is in flight; nothing was sent. A wrong value, such as
                NaN, shows in `recv`. Other errors are those of `step`.
        """
        wrench = None if body_f is None else self.params.ready("body_f", body_f)
        self._client.send(joint_f, joint_target_q, joint_target_qd, wrench)

    def recv(self) -> Frame:
        """Wait for the frame of the step that `send` began. A wait that Ctrl-C ended may be taken up again.

        Returns:
            The frame that `step` would have returned.

        Raises:
            CommandRefused: A value was wrong, and no world was touched; or no step was sent.
            LeaseLost: This client controlled the daemon, and no longer does.
            DaemonLost: The daemon went away; its state is lost.
        """
        return self._client.recv()

    def reset(
        self,
        *,
        mask: ArrayLike | None = None,
        seed: int | Sequence[int] | NDArray[np.integer[Any]] | None = None,
    ) -> Frame:
        """Put worlds back to the scene's start: state, ``time``, ``joint_f`` = 0, and targets, which stay the scene's.

        It frees a world that was frozen when it was no longer finite (bit 1 of ``status``).

        What `Scene.randomize` has distributions of is drawn anew, parameters too; other parameters stay. A draw depends
        on the world's number, its seed and its episode, which counts its resets since it got the seed, and on nothing
        else: neither on the number of worlds nor on precision or threads. A launch draws episode 0 of seed 0. With
        ``launch(draws="seed")`` it does not depend on the world's number either.

        Args:
            mask: Which worlds, bool, shape ``(worlds,)``; all if left out.
            seed: Seed of these worlds from now on, beginning with its episode 0: an int from 0 to 2**64 - 1, which
                gives each world other numbers (the same ones with ``draws="seed"``), or a sequence with one a world.
                Their next episode if left out.

        Returns:
            A frame evaluated at that state. Raises as `step` does.
        """
        return self._client.reset(mask, seed)

    def write(
        self,
        *,
        joint_q: Command | None = None,
        joint_qd: Command | None = None,
        mask: ArrayLike | None = None,
    ) -> Frame:
        """Set the state. What is left out, and worlds outside the mask, keep theirs; a frozen world stays frozen.

        Args:
            joint_q: Joint positions [rad or m], shape ``(worlds, coords)`` or ``(coords,)``, or a dict by robot.
            joint_qd: Joint velocities [rad/s or m/s], shape ``(worlds, dofs)`` or ``(dofs,)``, or a dict by robot.
            mask: Which worlds, bool, shape ``(worlds,)``; all if left out.

        Returns:
            A frame evaluated at that state. Raises as `step` does.
        """
        return self._client.write(joint_q, joint_qd, mask)

    def forward(self) -> Frame:
        """Evaluate every field at the present state and commands, without stepping. Raises as `step` does."""
        return self._client.forward()

    def latest(self, timeout: float = 0.0) -> Frame | None:
        """What observers see: the newest frame of the first ``info["watch_worlds"]`` worlds, whoever steps them.

        It needs no control, and costs whoever has it next to nothing: about 1% of the daemon's time at most. States
        after a step are shown some 60 times a second (half as often where there are more than 256 worlds to see, and
        more seldom where it takes long, but four times a second at least), and so is any at which the simulation rests.

        Args:
            timeout: How long to wait for one [s].

        Returns:
            A frame that carries those worlds only, and in ``state`` a snapshot of them as bytes; None if there is none
            that this client has not seen.

        Raises:
            ArgumentError: ``timeout`` is no number, or below 0.
            FramesHeld: As many such frames are alive as ``frames_held`` allows.
            DaemonLost: The daemon went away.
        """
        timeout = checks.number("latest: timeout", timeout, least=0.0, error=ArgumentError)
        return self._client.wait_newer(timeout) if timeout > 0.0 else self._client.latest()

    def controller(self) -> int | None:
        """The process that controls the simulation, if any: one that has stepped or reset it and has not let go."""
        return self._client.controller()

    def release(self) -> None:
        """Let another client take control; the next command takes it back, or raises `LeaseHeld`."""
        self._client.release()

    def snapshot(self) -> Snapshot:
        """Keep all worlds as they are now: a run that is restored from it goes on with the same bits.

        It holds state, commands, parameters, seed and episode, ``step`` and ``status`` of every world, on their way
        through a file in shared memory.

        Raises:
            SnapshotError: There is no room for it. Other errors are those of `step`.
        """
        with passing() as path:
            self._client.snapshot(str(path))
            return Snapshot.load(path)

    def restore(
        self,
        snapshot: Snapshot,
        *,
        worlds: ArrayLike | None = None,
        from_world: int | None = None,
    ) -> Frame:
        """Put worlds back to what they were in a snapshot: state, commands, parameters, seeds, ``step``, ``status``.

        Under the same commands the run then has the bits that it had after the snapshot, on any number of threads.
        A world that was frozen then is frozen again, any other is freed.

        Args:
            snapshot: Of the same scene and precision; without ``from_world`` of as many worlds, too.
            worlds: Which worlds of this simulation, bool, shape ``(worlds,)``; all if left out.
            from_world: A world of the snapshot, which goes into all these worlds; each to its own if left out.

        Returns:
            A frame evaluated at that state.

        Raises:
            SnapshotError: The snapshot does not fit, or has no such world; no world was touched. Also where there is no
                room for it.
            CommandRefused: ``worlds`` has another shape or dtype, or ``from_world`` is no whole number.
                Other errors are those of `step`.
        """
        if not isinstance(snapshot, Snapshot):
            raise CommandRefused(f"restore: snapshot is {type(snapshot).__name__}; give a tightloop.Snapshot")
        if from_world is not None:
            from_world = checks.integer("restore: from_world", from_world, least=0, error=CommandRefused)
        with passing() as path:
            snapshot.save(path)
            return self._client.restore(str(path), worlds, from_world)

    @property
    def params(self) -> Params:
        """Numbers of the model that differ from world to world; see `tightloop.params.Params`."""
        # made anew each time: kept, it and the simulation would keep each other alive
        return Params(self._client, self.info, lambda: self.snapshot().numbers)

    @functools.cached_property
    def dynamics(self) -> Dynamics:
        """The scene's kinematics and dynamics as functions of a state; they touch no world, nor do they know `params`.

        Raises:
            SceneError: A robot's file cannot be read here, or is no longer what the daemon read.
        """
        return Dynamics.of_daemon(self.info)

    def forward_kinematics(self, joint_q: ArrayLike) -> NDArray[np.float64]:
        """Link frames at given positions; see `Dynamics.forward_kinematics`."""
        return self.dynamics.forward_kinematics(joint_q)

    def inverse_dynamics(
        self,
        joint_q: ArrayLike,
        joint_qd: ArrayLike | None = None,
        joint_qdd: ArrayLike | None = None,
        *,
        damping: bool = True,
    ) -> NDArray[np.float64]:
        """Joint forces that give accelerations at given states; see `Dynamics.inverse_dynamics`."""
        return self.dynamics.inverse_dynamics(joint_q, joint_qd, joint_qdd, damping=damping)

    def view(self, *, port: int = 8080, worlds: int = 256, open: bool = False) -> Viewer:
        """Show it in the browser, by a process of its own that takes no time of this one. It ends with the simulation.

        The page shows what happens, and drives the simulation while nobody else is in control.

        Args:
            port: Port of the page on this machine; the next free one if it is taken.
            worlds: The most worlds to show, up to 1024; the daemon shows its first ``watch_worlds``.
            open: Whether to open the page in this machine's browser.

        Returns:
            The viewer: its ``url``, and ``close()``.

        Raises:
            LaunchError: The viewer did not start; stderr says why.
        """
        viewer = Viewer(self.name, port=port, worlds=worlds, open=open)
        self._viewers.append(viewer)
        return viewer

    def close(self) -> None:
        """End the simulation: a launched daemon stops (with the last of its groups), an attached one is released.

        Frames stay valid.
        """
        self._end()

    def __enter__(self) -> Sim:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        state = "" if self._end.alive else ", closed"
        return f"Sim({self.name!r}, worlds={self.worlds}, device={self.device!r}, pid={self.pid}{state})"


def _end(client: _core.Client, daemon: Daemon | None, name: str, owner: int, viewers: list[Viewer]) -> None:
    # A forked child must not end what belongs to its parent
    if os.getpid() != owner:
        return
    for viewer in viewers:
        viewer.close()
    client.close()
    if daemon is None:
        _core.sweep(name)  # does nothing while the daemon lives
    else:
        daemon.leave()
