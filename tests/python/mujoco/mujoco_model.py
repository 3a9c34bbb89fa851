"""A tightloop scene as MuJoCo sees it: the same URDF files, read by MuJoCo, with the scene's drives, limits and poses.

Both sides solve to the end (tolerance 0, 100 iterations), since MuJoCo's default termination alone moves accelerations
by up to 1e-6.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import mujoco.rollout
import numpy as np
from numpy.typing import NDArray

import tightloop as tl

Array = NDArray[np.float64]

ITERATIONS = 100
# Joint limits in force space: Newton's limit_ke, limit_kd, and the largest impedance of the default solimp
LIMIT_KE, LIMIT_KD, IMPEDANCE_MAX = 1e4, 10.0, 0.95
# A motion is chaotic once a start so far away has moved so much [rad or m]
PERTURBATION, CHAOS = 1e-12, 1e-9

# Motions that leave all bounds count as chaotic; MuJoCo would write a log into the working directory about each
mujoco.set_mju_user_warning(lambda _: None)

# Fixed links stay bodies, and figures stay as they are written
COMPILER = '<mujoco><compiler discardvisual="false" fusestatic="false" balanceinertia="{balance}"/></mujoco>'


@dataclass
class Rows:
    """Constraint rows of one world: equalities by follower, frictions and limits by dof."""

    J: Array
    D: Array
    aref: Array
    force: Array


@dataclass
class Evaluation:
    """What MuJoCo makes of states; worlds first."""

    mass_matrix: Array
    bias_force: Array
    joint_qdd: Array
    body_q: Array
    rows: list[Rows]
    drive: Array
    energy: Array
    """Potential, then kinetic, of the bodies that move."""


@dataclass
class Commands:
    """Forces and targets, each ``(worlds, frames, dofs)``, held over the steps of a frame."""

    joint_f: Array
    joint_target_q: Array
    joint_target_qd: Array

    def at(self, frame: int) -> dict[str, Array]:
        """Those of a frame, as `tl.Sim.step` takes them."""
        return {name: np.ascontiguousarray(values[:, frame]) for name, values in vars(self).items()}


class MujocoModel:
    """MuJoCo's model of a scene, with names and order of dofs and bodies as MuJoCo has them."""

    def __init__(self, scene: tl.Scene, *, balance_inertia: bool = False) -> None:
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        option = spec.option
        option.timestep = scene.dt
        option.gravity = scene.gravity
        option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        option.solver = mujoco.mjtSolver.mjSOL_NEWTON
        option.iterations, option.ls_iterations = ITERATIONS, ITERATIONS
        option.tolerance = 0.0
        option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        option.impratio = 1000.0
        # A start that is far outside its limits is no reason to start again
        option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
        option.enableflags = mujoco.mjtEnableBit.mjENBL_ENERGY
        for robot in scene.robots.values():
            text = robot.urdf.read_text()
            head = text.index(">", text.index("<robot")) + 1
            compiler = COMPILER.format(balance=str(balance_inertia).lower())
            child = mujoco.MjSpec.from_string(text[:head] + compiler + text[head:])
            x, y, z, w = robot.quat
            frame = spec.worldbody.add_frame(pos=robot.pos, quat=(w, x, y, z))
            spec.attach(child, prefix=f"{robot.name}/", frame=frame)
            for dof, name in enumerate(robot.joint_names):
                drive(spec, robot, dof, f"{robot.name}/{name}")
        self.model = model = spec.compile()
        self.dofs = model.nv
        self.dof_names = [model.joint(joint).name for joint in range(model.njnt)]
        self.body_names = [model.body(body).name for body in range(1, model.nbody)]
        self.slides = model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE
        self._set_effort(np.concatenate([robot.joint_effort_limit for robot in scene.robots.values()]))
        limits_in_force_space(model)
        flatten_mimics(model)
        self.followers = model.eq_obj1id.copy()
        self.data = mujoco.MjData(model)

    def _set_effort(self, limit: Array) -> None:
        # after compiling, which refuses a limit of 0
        self.model.jnt_actfrclimited = np.isfinite(limit)
        self.model.jnt_actfrcrange = np.where(np.isfinite(limit), limit, 0.0)[:, None] * [-1, 1]

    def evaluate(self, q: Array, qd: Array, joint_f: Array, target_q: Array, target_qd: Array) -> Evaluation:
        """Forward dynamics of every world's state; all arguments ``(worlds, dofs)``."""
        model, data = self.model, self.data
        out: dict[str, list] = {name: [] for name in Evaluation.__annotations__}
        for world in range(len(q)):
            mujoco.mj_resetData(model, data)
            data.qpos[:], data.qvel[:] = q[world], qd[world]
            data.qfrc_applied[:] = joint_f[world]
            data.ctrl[:] = interleaved(target_q[world], target_qd[world])
            mujoco.mj_forward(model, data)
            mass_matrix = np.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, mass_matrix)
            out["mass_matrix"].append(mass_matrix)
            out["bias_force"].append(data.qfrc_bias.copy())
            out["joint_qdd"].append(data.qacc.copy())
            out["body_q"].append(np.hstack([data.xpos[1:], np.roll(data.xquat[1:], -1, axis=1)]))
            out["drive"].append(data.qfrc_actuator.copy())
            # MuJoCo counts static bodies, which are not fused here: their potential energy never changes
            static = np.flatnonzero(model.body_weldid == 0)
            still = model.body_mass[static] @ (data.xipos[static] @ model.opt.gravity)
            out["energy"].append(data.energy + np.array([still, 0.0]))
            order = np.r_[np.argsort(self.followers), len(self.followers) : data.nefc].astype(int)
            jacobian = data.efc_J.reshape(-1, model.nv) if data.nefc else np.zeros((0, model.nv))
            rows = (jacobian, data.efc_D, data.efc_aref, data.efc_force)
            out["rows"].append(Rows(*(values[order].copy() for values in rows)))
        return Evaluation(**{name: values if name == "rows" else np.array(values) for name, values in out.items()})

    def trajectory(self, q: Array, qd: Array, commands: Commands, substeps: int) -> tuple[Array, Array]:
        """Positions and velocities after each frame, each ``(worlds, frames, dofs)``."""
        size = mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        n = self.dofs
        assert size == 1 + 2 * n, "time, positions, velocities"
        start = np.hstack([np.zeros((len(q), 1)), q, qd])
        drives = interleaved(commands.joint_target_q, commands.joint_target_qd)
        control = np.concatenate([drives, commands.joint_f], axis=2).repeat(substeps, axis=1)
        spec = mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_QFRC_APPLIED
        state, _ = mujoco.rollout.rollout(self.model, self.data, start, control, control_spec=int(spec))
        ends = state[:, substeps - 1 :: substeps]
        return ends[:, :, 1 : 1 + n], ends[:, :, 1 + n :]

    def calm_frames(
        self, positions: Array, q: Array, qd: Array, commands: Commands, substeps: int
    ) -> NDArray[np.int64]:
        """For how many frames the motion through these positions is not chaotic, by MuJoCo alone. ``(worlds,)``"""
        nudge = PERTURBATION * np.random.default_rng(0).choice([-1.0, 1.0], q.shape)
        nudged, _ = self.trajectory(q + nudge, qd, commands, substeps)
        # what is not a number is far away, too
        chaotic = ~(np.abs(nudged - positions).max(axis=2) <= CHAOS)
        return np.where(chaotic.any(axis=1), chaotic.argmax(axis=1), positions.shape[1])


def interleaved(target_q: Array, target_qd: Array) -> Array:
    """Controls in the order of the actuators: position, velocity, dof by dof."""
    return np.stack([target_q, target_qd], axis=-1).reshape(*target_q.shape[:-1], -1)


def drive(spec: mujoco.MjSpec, robot: tl.Robot, dof: int, name: str) -> None:
    """Armature, and two actuators for a joint of one dof: one pulls to the position target, one to the velocity's."""
    spec.joint(name).armature = robot.joint_armature[dof]
    mode, ke, kd = robot.joint_target_mode[dof], robot.joint_target_ke[dof], robot.joint_target_kd[dof]
    spring = ke if mode != "velocity" else 0.0
    follows = kd if mode != "position" else 0.0
    for gain, bias in ((spring, (0, -spring, 0)), (follows, (0, 0, -kd))):
        actuator = spec.add_actuator(trntype=mujoco.mjtTrn.mjTRN_JOINT, target=name)
        actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        actuator.gainprm[0], actuator.biasprm[:3] = gain, bias


def limits_in_force_space(model: mujoco.MjModel) -> None:
    """Softness of the joint limits from Newton's limit_ke and limit_kd."""
    f = model.dof_invweight0[model.jnt_dofadr] * (1 - IMPEDANCE_MAX)
    model.jnt_solref[:, 0] = 2 / (LIMIT_KD * f)
    model.jnt_solref[:, 1] = LIMIT_KD * f / 2 * np.sqrt(1 / (LIMIT_KE * f))


def flatten_mimics(model: mujoco.MjModel) -> None:
    """MuJoCo ties a follower of a follower to it; the project ties both to the first leader."""
    by_follower = {model.eq_obj1id[row]: row for row in range(model.neq)}
    for row in range(model.neq):
        while (leading := by_follower.get(model.eq_obj2id[row])) is not None:
            offset, ratio = model.eq_data[row, :2]
            model.eq_data[row, :2] = offset + ratio * model.eq_data[leading, 0], ratio * model.eq_data[leading, 1]
            model.eq_obj2id[row] = model.eq_obj2id[leading]
