"""The randomization of a scene: the distributions that a reset draws from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tightloop import _core
from tightloop.checks import arguments as checks
from tightloop.checks.attributes import nearest, suggestion
from tightloop.checks.signatures import add_hints, checked_calls
from tightloop.errors import SceneError
from tightloop.scene.add_sensors import SceneSensors
from tightloop.scene.distributions import Distribution, Normal, Uniform, from_table
from tightloop.scene.robot import Robot

_POSE = ("x", "y", "z", "roll", "pitch", "yaw")
_VELOCITY = ("vx", "vy", "vz", "wx", "wy", "wz")
#: Parts as they are called elsewhere.
_PARTS_MEANT = {"rx": ["roll"], "ry": ["pitch"], "rz": ["yaw"], "theta": ["yaw"], "heading": ["yaw"]}

_PARAM = 'it is a parameter: randomize(params={{"{}": {{…: tightloop.Uniform(…)}}}})'
add_hints("randomize", dict.fromkeys(_core.param_names(), _PARAM))

Offsets = Mapping[str, Distribution]
BodyOffsets = Mapping[str, Mapping[str, Distribution]]
ParamRanges = Mapping[str, Distribution | Mapping[str, Distribution]]


@checked_calls
class SceneRandomization(SceneSensors):
    """Mixin of `Scene` with its randomization."""

    __slots__ = ("_offsets",)

    def __init__(self) -> None:
        super().__init__()
        self._offsets: dict[str, dict[str, Any]] = {}

    def randomize(
        self,
        *,
        joint_q: Offsets | None = None,
        joint_qd: Offsets | None = None,
        body_q: BodyOffsets | None = None,
        body_qd: BodyOffsets | None = None,
        params: ParamRanges | None = None,
    ) -> None:
        """Randomize start states and parameters of worlds, at launch and at each `Sim.reset`.

        A draw of the state is an offset from the scene's start. A draw of a parameter replaces the scene's value, and
        is no factor of it. Only ``body_mass_scale`` is one: it multiplies mass and inertia of a link. `Sim.reset` says
        what a draw depends on.

        >>> scene.randomize(
        ...     joint_q={"arm": tl.Uniform(-0.1, 0.1), "arm/fr3_joint4": tl.Normal(0.0, 0.02)},
        ...     body_q={"cube": {"x": tl.Uniform(-0.05, 0.05), "yaw": tl.Uniform(-3.14, 3.14)}},
        ...     params={
        ...         "shape_mu": {"cube/box": tl.Uniform(0.1, 1.0)},
        ...         "body_mass_scale": {"cube": tl.Uniform(0.8, 1.2)},  # factors; body_mass takes kilograms
        ...         "gravity": {"z": tl.Normal(-9.81, 0.1)},
        ...     },
        ... )

        Args:
            joint_q: `Uniform` or `Normal` offsets of joint positions [rad or m], by ``"robot/joint"``, by
                ``"robot/joint.part"`` for a joint with several dofs, or by ``"robot"`` for all its joints. The more
                specific name has priority, in any order. Limits clamp the position. A mimic joint follows its leader,
                and only the leader's limits apply. A ball joint rotates by a rotation vector in the child's axes.
            joint_qd: Distributions of joint velocities [rad/s or m/s], by the same names.
            body_q: Offsets of the poses of free bodies (``"cube"``), floating robots (``"dog"``) and floating joints
                (``"robot/joint"``): ``x``, ``y``, ``z`` [m] along the world's axes; ``roll``, ``pitch``, ``yaw`` [rad]
                about the world's fixed x, y, z axes in that order, through the frame's origin, after the start
                orientation.
            body_qd: Their velocities in world axes: ``vx``, ``vy``, ``vz`` [m/s] of the centre of mass (of all links
                fixed to the body, as in ``joint_qd`` of a frame), ``wx``, ``wy``, ``wz`` [rad/s].
            params: Parameters by name, as `launch` lists them, each with distributions by name: ``"robot"`` or a body
                for all its values, ``"robot/joint"``, ``"robot/link"``, a shape as in `Sim.shape_names`; ``x``, ``y``,
                ``z`` of gravity. A parameter with one value per world takes a distribution directly. The more specific
                name has priority. These parameters vary without being named at launch. `Sim.params` reads them; values
                that it writes last until the world's next reset. Draws below a parameter's minimum become the minimum.
                ``body_f`` cannot be drawn. Delays are clamped to ``Scene.command_delay_max`` and rounded up to whole
                substeps.

        A later call adds to earlier ones, and replaces the distributions that it names again.

        Raises:
            SceneError: A name does not exist in the scene, or a value is not a distribution; nothing changed. `launch`
                checks names and values of ``params``, when all shapes are known.
        """
        given = {
            "joint_q": self._joints("joint_q", joint_q),
            "joint_qd": self._joints("joint_qd", joint_qd),
            "body_q": self._bodies("body_q", body_q, _POSE),
            "body_qd": self._bodies("body_qd", body_qd, _VELOCITY),
            "params": _ranges(params),
        }
        self._changed("randomize")
        for field, tables in given.items():
            if tables:
                old = self._offsets.setdefault(field, {})
                for name, table in tables.items():
                    parts = old.get(name, {})
                    old[name] = table if _is_alone(table) or _is_alone(parts) else parts | table

    def _joints(self, field: str, offsets: Offsets | None) -> dict[str, Any]:
        tables = {}
        for name, distribution in _items(f"randomize: {field}", offsets):
            what = f"randomize: {field} of {name!r}"
            self._check_joint(what, name)
            tables[name] = _table(what, distribution)
        return tables

    def _check_joint(self, what: str, name: str) -> None:
        robot, _, joint = name.partition("/")
        if robot in self.bodies:
            raise SceneError(f"{what}: it is a body; give body_q or body_qd")
        found = self._robot(what, robot)
        kinds, leaders = found.joint_types, found.joint_leaders
        own = [joint for joint, kind in kinds.items() if kind != "floating" and joint not in leaders]
        _check_complete(what, name)
        if not joint:
            if not own:
                raise SceneError(f"{what}: it has no joints but floating and following ones")
            return
        parts = [dof for dof in found.dof_names if dof.rpartition(".")[0] in kinds]
        owner = joint if joint in kinds else joint.rpartition(".")[0] if joint in parts else None
        if owner is None:
            raise SceneError(f"{what}: there is no joint {joint!r}; {_meant(joint, [*kinds])}")
        if owner in leaders:
            leader = leaders[owner]
            raise SceneError(f"{what}: it follows `{leader}`; give `{robot}/{leader}` the distribution")
        if owner not in own:
            raise SceneError(f"{what}: it is a floating joint; give body_q or body_qd")

    def _bodies(self, field: str, offsets: BodyOffsets | None, parts: tuple[str, ...]) -> dict[str, Any]:
        tables = {}
        for name, given in _items(f"randomize: {field}", offsets):
            what = f"randomize: {field} of {name!r}"
            self._check_body(what, name)
            tables[name] = {}
            for part, distribution in _items(what, given):
                if part not in parts:
                    near = "".join(
                        f"did you mean `{other}`? " for other in _PARTS_MEANT.get(part, ()) if other in parts
                    )
                    raise SceneError(f"{what}: there is no part {part!r}; {near}use {', '.join(parts)}")
                tables[name][part] = _table(f"{what}, {part}", distribution)
        return tables

    def _check_body(self, what: str, name: str) -> None:
        if name in self.bodies:
            if self.bodies[name].fixed:
                raise SceneError(f"{what}: it is fixed; make it with fixed=False, or leave it out")
            return
        robot, _, joint = name.partition("/")
        kinds = self._robot(what, robot).joint_types
        _check_complete(what, name)
        floating = [joint for joint, kind in kinds.items() if kind == "floating"]
        if not floating:
            raise SceneError(f"{what}: it does not move freely; add the robot with add_urdf(floating=True)")
        if joint not in floating and ("/" in name or len(floating) > 1):
            names = [f"{robot}/{joint}" for joint in floating]
            raise SceneError(f"{what}: name one of the floating joints: {_some(names)}")

    def _robot(self, what: str, name: str) -> Robot:
        if name not in self.robots:
            raise SceneError(
                f"{what}: there is no robot or body {name!r}; {_meant(name, [*self.robots, *self.bodies])}"
            )
        return self.robots[name]

    def _load_offsets(self, tables: Mapping[str, Mapping[str, Any]]) -> None:
        """Load the distributions of a scene file."""
        fields: dict[str, Any] = {}
        for field, named in tables.items():
            fields[field] = {
                name: from_table(table)
                if _is_alone(table)
                else {part: from_table(of_part) for part, of_part in table.items()}
                for name, table in named.items()
            }
        self.randomize(**fields)


def _is_alone(table: Mapping[str, Any]) -> bool:
    """Return whether this is the table of one distribution, not tables by name."""
    return any(isinstance(value, list) for value in table.values())


def _check_complete(what: str, name: str) -> None:
    if name.endswith("/"):
        robot = name.rstrip("/")
        raise SceneError(f"{what}: the name is incomplete; give {robot!r} for the whole, or the joint after the slash")


def _ranges(params: ParamRanges | None) -> dict[str, Any]:
    tables = {}
    for param, given in _items("randomize: params", params):
        what = f"randomize: params, {param}"
        if param not in (known := _core.param_names()):
            raise SceneError(
                f"randomize: params has {param!r}, and there is no such parameter; {suggestion(param, known)}"
            )
        if isinstance(given, Uniform | Normal):
            tables[param] = given.table()
        else:
            named = _items(what, given)
            if not named:
                raise SceneError(f"{what} is {given!r}; give distributions by name")
            tables[param] = {name: _table(f"{what} of {name!r}", distribution) for name, distribution in named}
    return tables


def _items(what: str, given: Any) -> list[tuple[str, Any]]:
    if given is None:
        return []
    if not isinstance(given, Mapping):
        raise SceneError(f"{what} is {given!r}; give a dict of distributions by name")
    for name in given:
        if not isinstance(name, str):
            raise SceneError(f"{what} has the key {name!r}; give names")
        checks.text(f"{what}: a name", name)
    return list(given.items())


def _table(what: str, distribution: Any) -> dict[str, list[float]]:
    if not isinstance(distribution, Uniform | Normal):
        raise SceneError(f"{what} is {distribution!r}; give a tightloop.Uniform or a tightloop.Normal")
    return distribution.table()


def _meant(name: str, known: list[str]) -> str:
    """Return the nearest names, or those that there are."""
    near = nearest(name, known)
    return f"did you mean {' or '.join(f'`{other}`' for other in near)}?" if near else f"there are: {_some(known)}"


def _some(names: list[str]) -> str:
    return ", ".join(names[:20]) + (", …" if len(names) > 20 else "") if names else "none"
