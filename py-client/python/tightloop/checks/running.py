"""Changes of a scene after its launch, which its simulations do not see: each scene tells of the first one."""

from __future__ import annotations

import weakref
from typing import Any

from tightloop.checks import advice

# How a running simulation is changed instead; {name} is that of the robot or body.
_PARAM = 'write sim.params.{attribute}, which params=("{attribute}",) at the launch lets vary'
_WRITE = 'call sim.write({attribute}={{"{name}": …}})'
_STEP = 'call sim.step({attribute}={{"{name}": …}})'
_INSTEAD = {
    "gravity": _PARAM,
    "inertia": _PARAM.replace("{attribute}", "body_inertia"),
    "joint_armature": _PARAM,
    "joint_effort_limit": _PARAM,
    "joint_q": _WRITE,
    "joint_target_kd": _PARAM,
    "joint_target_ke": _PARAM,
    "joint_target_q": _STEP,
    "joint_target_qd": _STEP,
    "mass": _PARAM.replace("{attribute}", "body_mass"),
    "pos": _WRITE.replace("{attribute}", "joint_q"),
    "quat": _WRITE.replace("{attribute}", "joint_q"),
}


class Running:
    """The simulations that were launched from a scene. Copies of the scene have none."""

    def __init__(self) -> None:
        self._sims: weakref.WeakSet[Any] = weakref.WeakSet()
        self._told = False

    def add(self, sim: Any) -> None:
        """Remember a simulation."""
        self._sims.add(sim)
        self._told = False

    def tell(self, subject: str, attribute: str, name: str = "", *, moves: bool = True) -> None:
        """Warn that a change does not reach simulations, if there are any.

        Args:
            subject: What changes, for the message.
            attribute: Its attribute, or what was called.
            name: Its name in the arrays of a simulation.
            moves: Whether it has entries in ``joint_q``.
        """
        if self._told or not (running := [sim.name for sim in self._sims if sim._end.alive]):
            return
        self._told = True
        cure = _INSTEAD.get(attribute, "")
        if not cure or (attribute in ("pos", "quat") and not moves):
            is_call = attribute.startswith("add_") or attribute in ("randomize", "solver")
            cure = f"{'call' if is_call else 'set'} it before the launch"
        cure = cure.format(attribute=attribute, name=name)
        advice.warn(
            f"{subject}: `{attribute}` changes the scene after the launch of `{running[0]}`, which keeps what it had. "
            f"For that simulation, {cure}. The next launch has the change",
            cause=f"{subject}: `{attribute}` changes the scene after the launch",
        )

    def __deepcopy__(self, memo: Any) -> Running:
        return Running()

    def __reduce__(self) -> Any:
        return Running, ()
