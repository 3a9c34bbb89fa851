"""A running simulation, made by `launch` and `attach`."""

from __future__ import annotations

import functools
import json
import os
import weakref
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop import _core, notebook
from tightloop._core import Frame
from tightloop.arrays.frames import FrameCopy
from tightloop.arrays.inputs import as_mask, as_seed
from tightloop.checks import arguments as checks
from tightloop.checks.attributes import Attributes, ByName, nearest
from tightloop.checks.params_advice import ParamsAdvice
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError, CommandRefused, SimClosed, UnknownAttribute
from tightloop.gpu import card
from tightloop.gpu.card import Card
from tightloop.mujoco import keyframes
from tightloop.planning import plans, rollouts
from tightloop.planning.dynamics import Dynamics
from tightloop.planning.ik_objectives import Posture, Reach
from tightloop.planning.ik_of_daemon import IkOfDaemon
from tightloop.planning.inverse_kinematics import IkSolver
from tightloop.planning.policies import Policy
from tightloop.planning.policy_rollouts import PolicyArguments
from tightloop.planning.rollouts import Rollout
from tightloop.scene.sensors import slices_by_name
from tightloop.sim.command_arrays import Command, called, commanded
from tightloop.sim.companions import Companion, end
from tightloop.sim.daemon import Daemon
from tightloop.sim.params import Params
from tightloop.sim.rays import RayHits, Rays, ray_poses
from tightloop.sim.realtime import Timing, read_timing
from tightloop.sim.recorder_process import Recording
from tightloop.sim.snapshot import Snapshot, transfer_file
from tightloop.sim.viewer_process import Viewer

if TYPE_CHECKING:
    from PIL.Image import Image


@checked_calls
class Sim(Attributes):
    """A simulation in a daemon. `launch` and `attach` make it; ``close`` or the end of a ``with`` block closes it.

    Attributes:
        name: Name of the daemon, or of this group of worlds, such as ``"franka.0"``.
        pid: Process id of the daemon.
        device: Device that runs the physics, such as ``"cpu (AVX-512, 16 worlds a block, 2 threads)"``.
            With ``machine code`` in it, the model runs as machine code of its own, entirely or
            ``but for contacts and solver``. ``stages only: …`` gives the reason where that failed.
        precision: ``"f32"`` or ``"f64"``, the type of every real array.
        worlds: Number of worlds.
        threads: Largest number of threads of a step; all groups of a daemon share them.
        dt: Physics step [s].
        substeps: Physics steps per control frame.
        fields: Fields of every frame.
        dof_names: ``robot/joint`` of each dof.
        coord_names: ``robot/joint`` of each coordinate.
        body_names: ``robot/link`` of each body.
        shape_names: Name of each collision shape: static ones, then ``robot/link/shape`` and ``body/shape``.
        site_names: Name of each site, in the order of ``site_q`` and the other site fields.
        contact_sensor_names: Name of each contact sensor, in the order of ``contact_sensor``.
        actuator_names: ``model/actuator`` of each actuator, in the order of ``ctrl``.
        activation_names: Those of them that have an activation, in the order of ``act``.
        mocap_names: ``model/body`` of each mocap body, in the order of ``mocap_pos``.
        equality_names: ``model/equality`` of each equality, in the order of ``eq_active``.
        keyframe_names: ``model/keyframe`` of each keyframe.
        sensor_names: ``model/sensor`` of each sensor of MuJoCo models, in MuJoCo's order.
        segment_names: What the labels of segmentation images stand for: bodies as in ``body_names``, then parts of the
            world. Empty without images.
        sensors: Columns of each sensor in ``sensordata``, by its name, and by ``sensor`` alone where one model has it.
        dofs: Slice of each robot's dofs, by robot name.
        coords: Slice of each robot's coordinates.
        bodies: Slice of each robot's bodies.
        info: The daemon's description of itself, with notes on the scene. ``delivery`` says how frames reach shared
            memory: ``"direct"`` from the CPU, ``"imported"`` if a GPU writes them there, ``"copied"`` if the CPU copies
            them from the GPU.
            ``groups`` is the number of groups, ``group`` this one's index, ``first_world`` that of its first world.
    """

    _card: Card | None = None

    def __init__(self, client: _core.Client, daemon: Daemon | None) -> None:
        self._client = client
        self.info: dict[str, Any] = json.loads(client.describe())
        self.name: str = self.info["name"]
        # runs when the last reference is gone, and at interpreter exit
        self._companions: list[Companion] = []
        self._end = weakref.finalize(self, end, client, daemon, self.name, os.getpid(), self._companions)
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
        self.actuator_names: list[str] = self.info["actuator_names"]
        self.activation_names: list[str] = self.info["activation_names"]
        self.mocap_names: list[str] = self.info["mocap_names"]
        self.equality_names: list[str] = self.info["equality_names"]
        self.keyframe_names: list[str] = [known["name"] for known in self.info["keyframes"]]
        self.sensor_names: list[str] = self.info["sensor_names"]
        self.segment_names: list[str] = self.info["segment_names"]
        self.sensors: dict[str, slice] = slices_by_name(self.sensor_names, self.info["sensors"])
        self.dofs, self.coords, self.bodies = (
            ByName("robot", {robot["name"]: slice(*robot[range_]) for robot in self.info["robots"]})
            for range_ in ("dofs", "coords", "bodies")
        )
        self._params_advice = ParamsAdvice(self.info)
        self._sealed = True

    def step(
        self,
        *,
        joint_f: Command | None = None,
        joint_target_q: Command | None = None,
        joint_target_qd: Command | None = None,
        ctrl: Command | None = None,
        mocap_pos: ArrayLike | None = None,
        mocap_quat: ArrayLike | None = None,
        eq_active: ArrayLike | None = None,
        body_f: Command | None = None,
    ) -> Frame:
        """Advance every world by one control frame. A command that is left out keeps its last value.

        Args:
            joint_f: Joint torques [N·m or N], shape ``(worlds, dofs)`` or ``(dofs,)``, held over the substeps. The
                effort limit does not clamp them. This and the two targets may also be a dict by robot, by joint or by
                pattern, as in ``{"arm": targets, "dog/FL_hip": 0.1}``; dofs that are not named keep their last command.
                Targets of mimic joints that are not named follow those of their leaders.
            joint_target_q: Position targets of the drives [rad or m], same shapes.
            joint_target_qd: Velocity targets of the drives [rad/s or m/s], same shapes.
            ctrl: Controls of the actuators of MuJoCo models, shape ``(worlds, actuators)`` or ``(actuators,)``, or a
                dict likewise. Each is clamped to its ``ctrlrange``.
            mocap_pos: Where the mocap bodies of MuJoCo models are [m], shape ``(worlds, mocaps, 3)`` or
                ``(mocaps, 3)``, in the order of `mocap_names`.
            mocap_quat: Their quaternions (w, x, y, z), shape ``(worlds, mocaps, 4)`` or ``(mocaps, 4)``. One without
                direction is no rotation.
            eq_active: Whether equalities of MuJoCo models act, 0 or 1 or bool, shape ``(worlds, equalities)`` or
                ``(equalities,)``, in the order of `equality_names`.
            body_f: Force on each body at its centre of mass [N], then torque [N·m], in world axes, shape
                ``(worlds, bodies, 6)`` or ``(bodies, 6)``, or a dict of such by robot, by body or by pattern, as in
                ``{"arm/hand": (0, 0, -5, 0, 0, 0)}``. Bodies that are not named keep their last force. It needs
                ``launch(params=("body_f",))``.

        Returns:
            A frame of read-only views, which stays valid and unchanged until you drop it.

        Warns:
            TightloopWarning: Worlds faulted, or a value is most likely a mistake; each is reported once.

        Raises:
            CommandRefused: A shape, dtype or value is wrong; no world changed.
            FramesHeld: ``frames_held`` frames are alive already.
            LeaseHeld: Another client controls the daemon.
            LeaseLost: This client lost control of the daemon.
            DaemonLost: The daemon went away; its state is lost.
        """
        given = {
            "joint_f": joint_f,
            "joint_target_q": joint_target_q,
            "joint_target_qd": joint_target_qd,
            "ctrl": ctrl,
            "mocap_pos": mocap_pos,
            "mocap_quat": mocap_quat,
            "eq_active": eq_active,
            "body_f": body_f,
        }
        return commanded(self, self._client.step, given)

    def send(
        self,
        *,
        joint_f: Command | None = None,
        joint_target_q: Command | None = None,
        joint_target_qd: Command | None = None,
        ctrl: Command | None = None,
        mocap_pos: ArrayLike | None = None,
        mocap_quat: ArrayLike | None = None,
        eq_active: ArrayLike | None = None,
        body_f: Command | None = None,
    ) -> None:
        """Begin a step and return at once: the worlds advance while the caller continues, until `recv`.

        Until then every other command raises `CommandRefused` and changes nothing: a second ``send``, `step`, `reset`,
        `write`, `forward`, `snapshot`, `restore`, and reading or writing ``params``.

        Args:
            joint_f: As in `step`. The daemon's client copies all arrays, so you may overwrite them at once.
            joint_target_q: As in `step`.
            joint_target_qd: As in `step`.
            ctrl: As in `step`.
            mocap_pos: As in `step`.
            mocap_quat: As in `step`.
            eq_active: As in `step`.
            body_f: As in `step`.

        Raises:
            CommandRefused: A shape or dtype is wrong, or a step is in flight; nothing was sent. `recv` reports a wrong
                value, such as NaN. Other errors are those of `step`.
        """
        given = {
            "joint_f": joint_f,
            "joint_target_q": joint_target_q,
            "joint_target_qd": joint_target_qd,
            "ctrl": ctrl,
            "mocap_pos": mocap_pos,
            "mocap_quat": mocap_quat,
            "eq_active": eq_active,
            "body_f": body_f,
        }
        commanded(self, self._client.send, given)

    def recv(self) -> Frame:
        """Wait for the frame of the step that `send` began. After Ctrl-C it may be called again.

        Returns:
            The frame that `step` would have returned.

        Raises:
            CommandRefused: A value was wrong and no world changed, or no step was sent.
            LeaseLost: This client lost control of the daemon.
            DaemonLost: The daemon went away; its state is lost.
        """
        return self._client.recv()

    def reset(
        self,
        *,
        mask: ArrayLike | None = None,
        seed: int | Sequence[int] | NDArray[np.integer[Any]] | None = None,
        keyframe: str | int | None = None,
        joint_q: Command | None = None,
        joint_qd: Command | None = None,
    ) -> Frame:
        """Reset worlds to the scene's start or to a keyframe: state, ``time``, drive targets, and ``joint_f`` = 0.

        A reset also clears the fault of a faulted world (bits 1 and 8 of ``status``).

        Everything that `Scene.randomize` names is drawn again, parameters included; other parameters keep their values.
        A draw depends only on the world's index, its seed and its episode, which counts the resets since the world got
        its seed. It does not depend on the number of worlds, the precision or the threads. A launch draws episode 0 of
        seed 0. With ``launch(draws="seed")`` a draw does not depend on the world's index either.

        Args:
            mask: Worlds to reset, bool, shape ``(worlds,)``; all if left out.
            seed: New seed of these worlds, which start its episode 0: an int from 0 to 2**64 - 1 for all of them, or a
                sequence with one seed per world. With one int, worlds draw different values, except with
                ``draws="seed"``. If left out, the worlds start their next episode.
            keyframe: Keyframe of a MuJoCo model to write after the reset: its name, ``model/name``, or its place in
                `keyframe_names`. It sets positions, velocities, ``act``, ``ctrl`` and mocap bodies of the whole scene:
                what is not of that model is where the scene starts it, without draws. ``time`` begins at 0.
            joint_q: Joint positions instead of the scene's and of draws [rad or m], as in `write`; not with a keyframe.
            joint_qd: Joint velocities, likewise [rad/s or m/s].

        Returns:
            A frame at the new state.

        Raises:
            ArgumentError: There is no such keyframe or there are several, or joint positions stand beside one.
            TightloopError: As `step`.
        """
        worlds = None if mask is None else as_mask("mask", mask, self.worlds)
        seeds = None if seed is None else as_seed(seed, self.worlds)
        if keyframe is None:
            return called(self, self._client.reset, {"joint_q": joint_q, "joint_qd": joint_qd}, worlds, seeds)
        keyframes.check_alone(joint_q, joint_qd)
        states = keyframes.arrays(keyframes.find(self.info["keyframes"], keyframe))
        self._client.reset({}, worlds, seeds)
        return called(self, self._client.write, states, worlds, True)

    def write(
        self,
        *,
        joint_q: Command | None = None,
        joint_qd: Command | None = None,
        act: ArrayLike | None = None,
        ctrl: Command | None = None,
        mocap_pos: ArrayLike | None = None,
        mocap_quat: ArrayLike | None = None,
        eq_active: ArrayLike | None = None,
        mask: ArrayLike | None = None,
    ) -> Frame:
        """Set joint positions and velocities, and what else MuJoCo models begin with.

        Values that are left out and worlds outside the mask do not change. By name, mimic joints that a dict leaves out
        follow their leaders. An array is taken as it is.

        A faulted world stays faulted.

        Args:
            joint_q: Joint positions [rad or m], shape ``(worlds, coords)`` or ``(coords,)``, or a dict as in `step`.
            joint_qd: Joint velocities [rad/s or m/s], shape ``(worlds, dofs)`` or ``(dofs,)``, or such a dict.
            act: Activations of the actuators that `activation_names` lists, shape ``(worlds, activations)`` or
                ``(activations,)``.
            ctrl: Controls, which hold until the next `step` that gives others, shape ``(worlds, actuators)`` or
                ``(actuators,)``, or a dict as in `step`.
            mocap_pos: Positions of mocap bodies, likewise.
            mocap_quat: Quaternions of mocap bodies, likewise.
            eq_active: Whether equalities act, likewise.
            mask: Worlds to write, bool, shape ``(worlds,)``; all if left out.

        Returns:
            A frame at the new state. Raises as `step` does.
        """
        given = {
            "joint_q": joint_q,
            "joint_qd": joint_qd,
            "act": act,
            "ctrl": ctrl,
            "mocap_pos": mocap_pos,
            "mocap_quat": mocap_quat,
            "eq_active": eq_active,
        }
        worlds = None if mask is None else as_mask("mask", mask, self.worlds)
        return called(self, self._client.write, given, worlds, False)

    def forward(self) -> Frame:
        """Return a frame at the current state and commands without a step. Raises as `step` does."""
        return self._client.forward()

    def latest(self, timeout: float = 0.0) -> Frame | None:
        """Return the newest observer frame: the first ``info["watch_worlds"]`` worlds, whichever client steps them.

        An observer needs no control and costs 1 % at most. States come 4 to 60 times per second, and at pauses.

        Args:
            timeout: How long to wait for one [s].

        Returns:
            A frame of those worlds, whose ``state`` is a snapshot as bytes; None if this client has seen the newest.

        Raises:
            ArgumentError: ``timeout`` is not a number, or is below 0.
            FramesHeld: ``frames_held`` observer frames are alive already.
            DaemonLost: The daemon went away.
        """
        timeout = checks.number("latest: timeout", timeout, least=0.0, error=ArgumentError)
        return self._client.wait_newer(timeout) if timeout > 0.0 else self._client.latest()

    def controller(self) -> int | None:
        """Return the process id of the client in control, or None. `release` gives up control."""
        return self._client.controller()

    def release(self) -> None:
        """Release control for other clients. The next command takes it back, or raises `LeaseHeld`."""
        self._client.release()

    def snapshot(self) -> Snapshot:
        """Take a snapshot of all worlds; a run restored from it continues with the same bits.

        It holds state, commands, parameters, seed, episode, ``step`` and ``status`` of every world. It passes through
        a file in shared memory, or in the temporary folder on macOS and Windows.

        Raises:
            SnapshotError: There is not enough memory for it. Other errors are those of `step`.
        """
        with transfer_file(self.pid) as path:
            self._client.snapshot(path)
            return Snapshot(Path(path).read_bytes(), "snapshot")

    def restore(
        self,
        snapshot: Snapshot,
        *,
        worlds: ArrayLike | None = None,
        from_world: int | None = None,
    ) -> Frame:
        """Restore worlds from a snapshot: state, commands, parameters, seeds, ``step`` and ``status``.

        With the same commands, the run then repeats bit for bit what followed the snapshot, with any number of threads.
        Worlds that were faulted in the snapshot are faulted again; the fault of all others is cleared.

        Args:
            snapshot: A snapshot of the same scene and precision. Without ``from_world``, it must have as many worlds.
            worlds: Worlds of this simulation to restore, bool, shape ``(worlds,)``; all if left out.
            from_world: World of the snapshot that is copied into all these worlds. If left out, each world gets its
                own.

        Returns:
            A frame at the restored state.

        Raises:
            SnapshotError: The snapshot does not fit, or has no such world, or there is not enough memory; no world
                changed.
            CommandRefused: ``worlds`` has a wrong shape or dtype, or ``from_world`` is not a whole number.
                Other errors are those of `step`.
        """
        if not isinstance(snapshot, Snapshot):
            raise CommandRefused(f"restore: snapshot is {type(snapshot).__name__}; give a tightloop.Snapshot")
        if from_world is not None:
            from_world = checks.integer("restore: from_world", from_world, least=0, error=CommandRefused)
            snapshot._check_world(from_world)
        mask = None if worlds is None else as_mask("worlds", worlds, self.worlds)
        with transfer_file(self.pid, snapshot.to_bytes()) as path:
            return self._client.restore(path, mask, from_world)

    def copy_from(
        self, source: Sim | Snapshot | Frame | FrameCopy, world: int = 0, *, mask: ArrayLike | None = None
    ) -> Frame:
        """Copy one world of another simulation into worlds of this one, such as the robot's into those of a planner.

        The simulations may belong to different daemons, and to different processes by `attach`. Both must have the same
        scene, precision and varying parameters. The copy has the state, commands, parameters, seed, episode, ``step``
        and ``status``. Draws of noise differ between the worlds, since they depend on the world's index.

        Args:
            source: The other simulation. This client must control it, since the copy takes a snapshot. To copy from a
                simulation that another client controls, give the observer's frame of its `Sim.latest`. A `Snapshot`
                is valid too.
            world: Index of the world in ``source``.
            mask: Worlds of this simulation that get the copy, bool, shape ``(worlds,)``; all if left out.

        Returns:
            A frame at the copied state.

        Raises:
            ArgumentError: ``source`` is none of these, or has no such world.
            SnapshotError: The simulations differ in scene, precision or varying parameters; no world changed.
            LeaseHeld: Another client controls one of the simulations.
            CommandRefused: ``mask`` has a wrong shape or dtype, or a step is in flight. Other errors are those of
                `step`.
        """
        return plans.copy_world(self, source, world, mask)

    def rollout(
        self,
        commands: Mapping[str, Any] | None = None,
        fields: Sequence[str] | None = None,
        *,
        policy: Policy | str | os.PathLike[str] | None = None,
        frames: int | None = None,
        inputs: Mapping[str, ArrayLike] | None = None,
        memory: ArrayLike | None = None,
        start: Sim | Snapshot | Frame | FrameCopy | tuple[Any, int] | None = None,
        cost: Callable[[Any], NDArray[Any]] | None = None,
        out: Rollout | None = None,
    ) -> Rollout:
        """Step through a sequence of commands per world or run a policy, and collect fields or a cost.

        With a policy, the daemon evaluates it per world between control frames, and no frame waits for the client. It
        sees the frame before, as a client does.

        Each world runs its own sequence. Fields of a frame are copied, and its cost is computed, while the worlds
        already do the next step. The worlds stay at the end of the rollout. Commands that are left out keep their last
        value.

        Args:
            commands: Sequence of each command of `step`, by its name: an array ``(frames, worlds, columns)``, or
                ``(frames, columns)`` for identical commands, or a dict of such by robot, joint or pattern. With a
                policy they may be left out. Those of columns that the policy drives are added to its commands.
            fields: Fields to collect; those of the launch if left out, or none if there is a ``cost``. With a policy,
                also ``"action"``, within its bounds, and ``"observation"``, float32 ``(frames, worlds, values)``.
            policy: A `Policy`, or the path of its ONNX file if that says what the policy sees and drives.
            frames: Number of frames of a policy; that of the commands if left out.
            inputs: Values that the policy sees, by the name of its `Input` terms: ``(values,)`` for all, ``(frames,
                values)``, or ``(frames or 1, worlds, values)``.
            memory: `Rollout.memory` of the rollout before, if the policy continues it: last action, phase, history.
            start: What all worlds start from: a simulation or an observer's frame, whose world 0 counts, ``(source,
                world)`` for another world, or a `Snapshot`. A snapshot with one world counts for all worlds here. If
                left out, the worlds continue.
            cost: Function of a frame that returns the cost of each world, ``(worlds,)``. Its sum over the frames is
                `Rollout.cost`. With a policy it gets copies of frames, after they were computed. The function must not
                call this simulation, and must not keep the frame.
            out: A rollout with the same worlds, frames and fields, whose arrays are written again. A loop that gives
                the last result allocates no array.

        Returns:
            The arrays, and the faults of each world.

        Raises:
            ArgumentError: An argument is not valid, or ``out`` does not fit.
            UnknownField: Frames of this run do not carry the field.
            CommandRefused: A command is not valid, of the caller or the policy; the message names the frame. The worlds
                stay at the frame before.
            SnapshotError: ``start`` does not fit; no world changed. Other errors are those of `copy_from` and `step`.
        """
        asked = PolicyArguments(policy, frames, inputs, memory)
        run = rollouts.Run(self, commands, fields, cost, out, asked=asked)
        if start is not None:
            plans.begin_rollout(self, start)
        return run.go()

    @property
    def params(self) -> Params:
        """Model parameters that vary between worlds; see `tightloop.sim.params.Params`."""
        # a new object for each access: a cached one would form a reference cycle with the simulation
        return Params(self._client, self.info, lambda: self.snapshot().numbers, self._params_advice)

    @functools.cached_property
    def dynamics(self) -> Dynamics:
        """The scene's kinematics and dynamics as functions of a state. They change no world, and ignore `params`.

        Raises:
            SceneError: A robot's file cannot be read here, or has changed since the daemon read it.
        """
        return Dynamics.of_daemon(self.info)

    def forward_kinematics(self, joint_q: ArrayLike) -> NDArray[np.float64]:
        """Compute link frames at given joint positions; see `Dynamics.forward_kinematics`."""
        return self.dynamics.forward_kinematics(joint_q)

    def inverse_dynamics(
        self,
        joint_q: ArrayLike,
        joint_qd: ArrayLike | None = None,
        joint_qdd: ArrayLike | None = None,
        *,
        damping: bool = True,
    ) -> NDArray[np.float64]:
        """Compute joint forces for given accelerations and states; see `Dynamics.inverse_dynamics`."""
        return self.dynamics.inverse_dynamics(joint_q, joint_qd, joint_qdd, damping=damping)

    def ik(
        self,
        objectives: Reach | Posture | Sequence[Reach | Posture],
        *,
        joints: Sequence[str] | None = None,
        limits: bool = True,
    ) -> IkSolver:
        """Make a solver of inverse kinematics that runs in the daemon; see `tightloop.ik` for the arguments.

        Its problems are the worlds. They start at their present positions, and ``joint_q`` of the result has a row per
        world. Where no joint is a ball or free, send it as ``joint_target_q``.

        Raises:
            ArgumentError: An argument is not valid.
        """
        return IkSolver(IkOfDaemon(self._client, self.info), objectives, joints, limits)

    def rays(
        self,
        pnt: ArrayLike,
        vec: ArrayLike,
        *,
        geomgroup: ArrayLike | None = None,
        flg_static: bool = True,
        bodyexclude: ArrayLike = -1,
        frame: Frame | FrameCopy | None = None,
    ) -> RayHits:
        """Find what rays meet first of the geoms of MuJoCo models, as ``mj_ray`` does, in this process.

        Args:
            pnt: Origins in the world [m]. It and ``vec`` broadcast to ``(worlds, rays, 3)``: ``(rays, 3)`` counts for
                all worlds, ``(3,)`` for all rays.
            vec: Directions; their lengths are the units of the distances.
            geomgroup: Six flags, which groups of geoms count; all if left out.
            flg_static: Whether geoms of bodies that are welded to the world count.
            bodyexclude: Place in `body_names` of a body to pass through, or -1; also one per world or per ray.
            frame: A frame with ``body_q``, or with ``geom_xpos`` and ``geom_xmat``; that of `forward` if left out.

        Raises:
            ArgumentError: A shape, dtype or value is wrong, or a geom that counts is an SDF.
            SceneError: A model's file cannot be read here, or no model of the scene has geoms.
            UnknownField: The frame has no poses.
        """
        poses = ray_poses(self.forward() if frame is None else frame)
        options: dict[str, Any] = {"geomgroup": geomgroup, "flg_static": flg_static, "bodyexclude": bodyexclude}
        return self._ray_scene.cast(poses, pnt, vec, threads=self.threads, **options)

    @functools.cached_property
    def _ray_scene(self) -> Rays:
        firsts = {name: bodies.start for name, bodies in self.bodies.items()}
        return Rays(self.info["scene"], self.info["scene_folder"], firsts, len(self.info["body_names"]))

    def keep_on_gpu(self) -> Card:
        """Keep frames and commands on the GPU, too, until this client gives up control.

        From the next frame on, ``frame.torch("joint_q")`` returns a tensor of torch in the memory that the daemon
        writes, and ``frame.cuda("joint_q")`` an array for CuPy and JAX. Both are as valid as ``frame.joint_q``: they
        hold the frame, and stay unchanged until you drop them. Do not write to them. Earlier frames have none. After a
        call that fails, later frames have none either, until another call succeeds.

        Commands of `step` and `send` may then be arrays on the GPU, shape ``(worlds, columns)`` or ``(columns,)``:
        all but ``eq_active`` and ``body_f``. Nothing passes through the host; one that the daemon refuses or a recorder
        wants is read back first. Commands by tensor are not checked for likely mistakes.

        Work is ordered on the current stream of torch, or of CuPy where torch is not installed. If you use several
        streams, let the current one wait for the others before you drop a tensor or step.

        A frame whose tensors you dropped counts as held until the next command other than `recv`, since queued work may
        still read it. If JAX or another library had one by DLPack, that command first waits for the whole GPU.

        Returns:
            The card, with ``device``, the index of the CUDA device, and ``order``: ``"timelines"``, or ``"host: …"``
            with the reason why each step waits for the stream.

        Raises:
            GpuMemoryError: The worlds are on the CPU, the driver exports no memory, CUDA does not see that GPU, or the
                system is not Linux.
            MissingLibrary: ``cuda-bindings``, or both torch and CuPy, are not installed.
            LeaseHeld: Another client controls the daemon. Other errors are those of `step`.
        """
        library = card.library_for(self.info)
        self._client.land()  # with a step in flight the request is refused, and the card stays
        # from here on the daemon may write other memory than an earlier card maps
        self._card = None
        self._card = card.open_card(self.info, self._client, library)
        return self._card

    @property
    def timing(self) -> Timing:
        """How frames came since the launch, or since `restart_timing`.

        Raises:
            DaemonLost: The daemon ended.
        """
        return read_timing(self._client.timing(False))

    def restart_timing(self) -> Timing:
        """Return `timing`, and count anew.

        Raises:
            DaemonLost: The daemon ended.
        """
        return read_timing(self._client.timing(True))

    def picture(
        self,
        *,
        worlds: int | Sequence[int] = 1,
        camera: Any = None,
        size: tuple[int, int] = (640, 480),
        frame: Any = None,
    ) -> Image:
        """Return a picture of worlds, which a notebook shows and ``save`` writes.

        Args:
            worlds: How many worlds are drawn on a grid, the first ones; or a list of them.
            camera: ``"three-quarter"``, ``"front"``, ``"side"``, ``"top"``, ``"follow"``, or a `tightloop.view.Camera`.
                If left out, it follows a single world whose robot floats.
            size: Width and height [pixels].
            frame: A frame with ``body_q``; that of `forward` if left out.

        Raises:
            ArgumentError: A world, camera or size does not exist.
            UnknownField: The frame carries no ``body_q``.
            MissingLibrary: The extra ``view`` is not installed.
        """
        return notebook.simulation_picture(self, worlds=worlds, camera=camera, size=size, frame=frame)

    def view(self, *, port: int = 8080, worlds: int = 256, open: bool = False, hosts: Sequence[str] = ()) -> Viewer:
        """Open a browser viewer in a separate process, which ends with the simulation.

        Anyone who has the ``url`` of the viewer can also drive the simulation while no other client is in control.

        Args:
            port: Port of the page on this machine; the next free one if it is taken.
            worlds: Largest number of worlds to show, up to 1024; the daemon publishes its first ``watch_worlds``.
            open: Whether to open the page in a browser on this machine.
            hosts: Host names of the page besides ``localhost``, such as that of a notebook server's proxy.

        Returns:
            The viewer: its ``url``, and ``close()``.

        Raises:
            SimClosed: The simulation was closed.
            MissingLibrary: The extra ``view`` is not installed.
            LaunchError: The viewer did not start; the message has the reason.
        """
        if not self._end.alive:
            raise SimClosed("view: the simulation was closed; launch or attach again")
        viewer = Viewer(self.name, port=port, worlds=worlds, open=open, hosts=hosts)
        self._companions.append(viewer)
        return viewer

    def record(self, path: str | os.PathLike[str], *, fields: Sequence[str] = (), force: bool = False) -> Recording:
        """Record every command from now on into a file that ``tightloop replay``, ``view`` and ``film`` read.

        The recorder is a process of its own, as of ``tightloop record``. It ends with a ``with`` block or by `close`.

        Args:
            path: The file, such as ``"run.tlrec"``.
            fields: Fields to write as whole arrays; a replay that differs then prints both values.
            force: Whether to overwrite a file that is there.

        Raises:
            SimClosed: The simulation was closed.
            RecordingError: The file is there already or cannot be written, or frames have no such field.
        """
        if not self._end.alive:
            raise SimClosed("record: the simulation was closed; launch or attach again")
        recording = Recording(self.name, path, fields=fields, force=force)
        ended = [one for one in self._companions if isinstance(one, Recording) and one.closed]
        self._companions[:] = [one for one in self._companions if one not in ended] + [recording]
        return recording

    def close(self) -> None:
        """End the simulation: stop a launched daemon (after the last of its groups), or release an attached one.

        Frames stay valid.
        """
        self._end()

    def _own_attributes(self) -> list[str]:
        return [name for name in (*vars(self), *super()._own_attributes()) if name[0] != "_"]

    def _subject(self) -> str:
        return f"Sim `{self.name}`"

    def _instead(self, name: str) -> str:
        return "`write`, `params` and arguments of `step` change worlds, those of `launch` and the scene the rest"

    def __getattr__(self, name: str) -> Any:
        if of_frames := nearest(name, self.__dict__.get("fields", ())):
            there = ", ".join(f"sim.forward().{field}" for field in of_frames)
            raise UnknownAttribute(f"{self._subject()} has no attribute {name!r}; the frame of a call has: {there}")
        return super().__getattr__(name)

    def __reduce__(self) -> Any:
        raise ArgumentError(
            "a Sim cannot be copied or pickled: it holds a connection. Give the other process its name, for "
            f"tightloop.attach({self.name!r}), or make a simulation there"
        )

    def _repr_html_(self) -> str:
        return notebook.simulation_html(self.name, self.worlds, self.info)

    def __enter__(self) -> Sim:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        state = "" if self._end.alive else ", closed"
        return f"Sim({self.name!r}, worlds={self.worlds}, device={self.device!r}, pid={self.pid}{state})"
