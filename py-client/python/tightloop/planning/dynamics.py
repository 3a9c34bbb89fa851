"""Kinematics and dynamics of a scene at given states, without a simulation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop import _core
from tightloop.arrays.inputs import reals
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError, SceneError
from tightloop.scene.scene import Scene

Array = NDArray[np.float64]


@checked_calls
class Dynamics:
    """A scene's kinematics and dynamics as functions, computed in this process and in double precision.

    `Sim.dynamics` is that of a running simulation. Arguments hold one state, ``(coords,)``, or many, ``(n, coords)``,
    such as a frame's ``joint_q``; results have the same leading axis. An argument of one state broadcasts to many.

    Args:
        scene: The scene; later changes to it have no effect.

    Attributes:
        dof_names: ``robot/joint`` of each dof.
        coord_names: ``robot/joint`` of each coordinate.
        body_names: ``robot/link`` of each body.

    Raises:
        ArgumentError: ``scene`` is not a `Scene`.
        SceneError: The scene is not valid.
    """

    def __init__(self, scene: Scene) -> None:
        if not isinstance(scene, Scene):
            raise ArgumentError(f"Dynamics: scene is {type(scene).__name__}; give a tightloop.Scene")
        self._take(_core.Dynamics(scene.to_toml(), "/"))

    @classmethod
    def of_daemon(cls, info: dict[str, Any]) -> Dynamics:
        """Make the dynamics of a running simulation.

        Args:
            info: The daemon's description of itself, `Sim.info`.

        Raises:
            SceneError: A robot's file cannot be read here, or has changed since the daemon read it.
        """
        core = _core.Dynamics(info["scene"], info["scene_folder"])
        if core.model_hash != info["model_hash"]:
            raise SceneError(f"the files of simulation `{info['name']}` have changed since it started; launch it again")
        dynamics = cls.__new__(cls)
        dynamics._take(core)
        return dynamics

    def _take(self, core: _core.Dynamics) -> None:
        self._core = core
        self.dof_names, self.coord_names, self.body_names = core.names

    @property
    def model_hash(self) -> int:
        """Hash of the scene's model, to compare with ``sim.info["model_hash"]``."""
        return self._core.model_hash

    def forward_kinematics(self, joint_q: ArrayLike) -> Array:
        """Compute link frames in the world: position [m], then quaternion (x, y, z, w).

        Args:
            joint_q: Joint positions [rad or m], shape ``(coords,)`` or ``(n, coords)``.

        Returns:
            Shape ``(bodies, 7)`` or ``(n, bodies, 7)``.

        Raises:
            ArgumentError: A shape, dtype or value is wrong.
        """
        return self._evaluate("body_q", (len(self.body_names), 7), joint_q, None)

    def body_velocity(self, joint_q: ArrayLike, joint_qd: ArrayLike) -> Array:
        """Compute the velocity of each link's centre of mass [m/s], then its angular velocity [rad/s], in world axes.

        Args:
            joint_q: Joint positions [rad or m], shape ``(coords,)`` or ``(n, coords)``.
            joint_qd: Joint velocities [rad/s or m/s], shape ``(dofs,)`` or ``(n, dofs)``.

        Returns:
            Shape ``(bodies, 6)`` or ``(n, bodies, 6)``. Raises as `forward_kinematics` does.
        """
        return self._evaluate("body_qd", (len(self.body_names), 6), joint_q, joint_qd)

    def body_jacobian(self, joint_q: ArrayLike) -> Array:
        """Compute the Jacobian J of `body_velocity`, such that `body_velocity` is ``J @ joint_qd``.

        Args:
            joint_q: Joint positions [rad or m], shape ``(coords,)`` or ``(n, coords)``.

        Returns:
            Shape ``(bodies, 6, dofs)`` or ``(n, bodies, 6, dofs)``. Raises as `forward_kinematics` does.
        """
        return self._evaluate("body_jacobian", (len(self.body_names), 6, len(self.dof_names)), joint_q, None)

    def mass_matrix(self, joint_q: ArrayLike) -> Array:
        """Compute the joint-space inertia with armature [kg·m², kg·m or kg].

        Args:
            joint_q: Joint positions [rad or m], shape ``(coords,)`` or ``(n, coords)``.

        Returns:
            Shape ``(dofs, dofs)`` or ``(n, dofs, dofs)``. Raises as `forward_kinematics` does.
        """
        return self._evaluate("mass_matrix", (len(self.dof_names), len(self.dof_names)), joint_q, None)

    def inverse_dynamics(
        self,
        joint_q: ArrayLike,
        joint_qd: ArrayLike | None = None,
        joint_qdd: ArrayLike | None = None,
        *,
        damping: bool = True,
    ) -> Array:
        """Compute the joint forces for an acceleration, ``M q̈ + c + d q̇``; with positions alone, those that hold them.

        Sent as ``joint_f``, they accelerate the joints by ``joint_qdd`` if no drive, dry friction, limit, mimic joint
        or contact acts. ``M`` includes the armature, ``c`` are Coriolis, centrifugal and gravity forces
        (``bias_force``), and ``d`` is the joint damping. The result includes the wrench of a floating base.

        Args:
            joint_q: Joint positions [rad or m], shape ``(coords,)`` or ``(n, coords)``.
            joint_qd: Joint velocities [rad/s or m/s], shape ``(dofs,)`` or ``(n, dofs)``; zero if left out.
            joint_qdd: Joint accelerations [rad/s² or m/s²], same shapes; zero if left out.
            damping: Whether to include ``d q̇``; without it, the result is that of the recursive Newton-Euler algorithm
                (Featherstone 2008, section 5.3).

        Returns:
            Joint forces [N·m or N], shape ``(dofs,)`` or ``(n, dofs)``. Raises as `forward_kinematics` does.
        """
        dofs = len(self.dof_names)
        many, q, qd, qdd = self._states(joint_q, joint_qd, joint_qdd)
        forces = self._core.inverse_dynamics(
            q, qd, qdd, checks.flag("inverse_dynamics: damping", damping, error=ArgumentError)
        )
        return forces.reshape((*many, dofs))

    def _evaluate(self, field: str, shape: tuple[int, ...], joint_q: ArrayLike, joint_qd: ArrayLike | None) -> Array:
        many, q, qd, _ = self._states(joint_q, joint_qd, None)
        values = self._core.evaluate(field, q, qd)
        if not self.coord_names:  # a scene without coordinates has one state
            return np.broadcast_to(values.reshape(shape), (*many, *shape)).copy()
        return values.reshape((*many, *shape))

    def _states(
        self, joint_q: ArrayLike, joint_qd: ArrayLike | None, joint_qdd: ArrayLike | None
    ) -> tuple[tuple[int, ...], Array, Array, Array]:
        """Return the leading axis, if any, and the flat arrays; those left out are empty."""
        coords, dofs = len(self.coord_names), len(self.dof_names)
        given = [_numbers("joint_q", joint_q, coords)]
        given += [
            _numbers(name, value, dofs)
            for name, value in (("joint_qd", joint_qd), ("joint_qdd", joint_qdd))
            if value is not None
        ]
        counts = {array.shape[0] for array in given if array.ndim == 2}
        if len(counts) > 1:
            raise ArgumentError(f"arrays of {' and '.join(map(str, sorted(counts)))} states; give all of one number")
        if counts == {0}:
            raise ArgumentError("arrays of 0 states; give at least one")
        many = tuple(counts)
        flat = iter([np.array(np.broadcast_to(array, (*many, array.shape[-1]))).reshape(-1) for array in given])
        nothing = np.empty(0)
        q = next(flat)
        qd = nothing if joint_qd is None else next(flat)
        return many, q, qd, nothing if joint_qdd is None else next(flat)


def _numbers(name: str, value: ArrayLike, columns: int) -> Array:
    array = reals(name, value)
    if array.ndim not in (1, 2) or array.shape[-1] != columns:
        raise ArgumentError(f"{name} has shape {array.shape}; give ({columns},), or (n, {columns}) for many states")
    return array.astype(np.float64)
