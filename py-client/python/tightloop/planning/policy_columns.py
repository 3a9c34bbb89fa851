"""Columns of what a policy sees and drives, by name, in the arrays of a simulation."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.arrays.frames import unknown_field
from tightloop.checks.attributes import suggestion
from tightloop.errors import ArgumentError
from tightloop.planning.policies import DRIVES, TERMS, Policy
from tightloop.planning.policy_terms import Clock, Drive, Gravity, Input, LastAction, Term, Values
from tightloop.sim.command_rows import COMMANDS

#: Names of the entries of an axis, in the description of a daemon.
_NAMES = {
    "coords": "coord_names",
    "dofs": "dof_names",
    "bodies": "body_names",
    "sites": "site_names",
    "actuators": "actuator_names",
    "contact_sensors": "contact_sensor_names",
}
#: Columns of a quaternion in a pose.
_QUATERNION = slice(3, 7)
#: Most that a bound can be, since JSON has no infinity.
_MOST = float(np.finfo(np.float32).max)


class Columns:
    """Looks up what a policy sees and drives in a simulation.

    Args:
        policy: The policy.
        info: `Sim.info`.

    Attributes:
        inputs: Names of the inputs that the policy sees, with their numbers of values.
    """

    def __init__(self, policy: Policy, info: Mapping[str, Any]) -> None:
        self._policy, self._info = policy, info
        self._fields = {field["name"]: field for field in info["fields"]}
        self._robots = {robot["name"]: robot for robot in info["robots"]}
        self.inputs: dict[str, int] = {}
        #: Whether names are those of a file, in which `*` alone stands for others.
        self._is_of_file = False

    def terms(self) -> list[dict[str, Any]]:
        """Return the terms as the daemon takes them.

        Raises:
            ArgumentError: There are none, or a name or size does not fit.
            UnknownField: Frames of this run do not carry a field.
        """
        policy = self._policy
        if policy.observe is None:
            raise ArgumentError(
                f"{policy.path} does not say what the policy sees; give tl.Policy(path, observe=[…], act=[…]), or "
                "write `observation_terms` into its metadata (examples/policy_file.py --task TASK)"
            )
        for term in policy.observe:
            if isinstance(term, Input) and self.inputs.setdefault(term.name, term.width) != term.width:
                raise ArgumentError(f"policy: input {term.name!r} has several widths; give one")
        self._is_of_file = TERMS in policy._read
        made = [self._term(index, term) for index, term in enumerate(policy.observe)]
        size = sum(size * term.history for (size, _), term in zip(made, policy.observe, strict=True))
        if size != policy.inputs:
            parts = ", ".join(
                f"{term.kind} {size * term.history}" for (size, _), term in zip(made, policy.observe, strict=True)
            )
            raise ArgumentError(
                f"policy: its terms have {size} values ({parts}), and {policy.path} takes {policy.inputs}; give those "
                "that it was trained with"
            )
        return [plain for _, plain in made]

    def drives(self) -> list[dict[str, Any]]:
        """Return what the action drives as the daemon takes it.

        Raises:
            ArgumentError: There is nothing, or a name or size does not fit.
        """
        policy = self._policy
        if policy.act is None:
            raise ArgumentError(
                f"{policy.path} does not say what the action drives; give tl.Policy(path, act=[tl.Drive(…)]), or write "
                "`action_drives` into its metadata (examples/policy_file.py --task TASK)"
            )
        self._is_of_file = DRIVES in policy._read
        made, first = [], 0
        for drive in policy.act:
            plain = self._drive(drive, first)
            if drive.values is None:
                first += len(plain["columns"])
            made.append(plain)
        used = {value for plain in made for value in plain["values"]}
        if max(used) >= policy.actions:
            raise ArgumentError(
                f"policy: act drives value {max(used)} of the action, and {policy.path} gives {policy.actions}; give "
                "as many joints"
            )
        return made

    def _term(self, index: int, term: Term) -> tuple[int, dict[str, Any]]:
        what = f"policy: term {index}"
        match term:
            case Values():
                columns = self._field(what, term.field, term.of, term.columns)
                turned = None if term.axes_of is None else self._axes(what, term.axes_of)
                if turned is not None and len(columns["places"]) % 3:
                    raise ArgumentError(
                        f"{what}: `{term.field}` has {len(columns['places'])} columns; give vectors of 3"
                    )
                source: Any = {"field": {"columns": columns, "turned_by": turned, "function": term.function}}
                size = len(columns["places"])
            case Gravity():
                source, size = {"gravity": self._axes(what, term.of)}, 3
            case Input():
                source, size = {"input": self._input(what, term.name)}, term.width
            case LastAction():
                source, size = "last_action", self._policy.actions
            case Clock():
                gate = None if term.runs_with is None else self._input(what, term.runs_with)
                step = 2.0 * np.pi * term.hz * self._info["dt"] * self._info["substeps"]
                source, size = {"clock": {"step": step, "input": gate}}, 2
            case _:
                raise ArgumentError(f"{what} is {type(term).__name__}; give one of tightloop.planning.policy_terms")
        low, high = (_each(f"{what}: {name}", getattr(term, name), size) for name in ("low", "high"))
        if not (low < high).all():
            raise ArgumentError(f"{what}: low {term.low} must be below high {term.high}")
        is_bounded = np.isfinite(low).any() or np.isfinite(high).any()
        return size, {
            "source": source,
            "minus": _unless(0.0, _each(f"{what}: minus", term.minus, size)),
            "scale": _unless(1.0, _each(f"{what}: scale", term.scale, size)),
            "clip": [np.clip(end, -_MOST, _MOST).tolist() for end in (low, high)] if is_bounded else None,
            "history": term.history,
        }

    def _drive(self, drive: Drive, first: int) -> dict[str, Any]:
        what = "policy: act"
        row = COMMANDS.get(drive.command)
        if row is None:
            raise ArgumentError(
                f"{what}: there is no command {drive.command!r:.80}; {suggestion(drive.command, COMMANDS)}"
            )
        columns = self._places(f"{what}: `{drive.command}`", row.axis, row.parts, drive.of)
        size = len(columns)
        if not columns:
            raise ArgumentError(f"{what}: `{drive.command}` has no columns; name joints, actuators or links in `of`")
        values = list(range(first, first + size)) if drive.values is None else [int(value) for value in drive.values]
        if len(values) != size or min(values, default=0) < 0:
            raise ArgumentError(f"{what}: values are {values}; give the value of the action of each of {size} columns")
        low, high = (_each(f"{what}: {name}", getattr(drive, name), size) for name in ("low", "high"))
        if not (low <= high).all():
            raise ArgumentError(f"{what}: low {drive.low} must not be above high {drive.high}")
        followers = []
        for name, leader, multiplier, offset in drive.followers:
            follower, lead = (self._place(f"{what}: followers", row.axis, row.parts, one) for one in (name, leader))
            if lead not in columns:
                raise ArgumentError(f"{what}: followers: {leader!r:.80} leads, and is not in `of`; name it there")
            followers.append((follower, columns.index(lead), float(multiplier), float(offset)))
        return {
            "command": drive.command,
            "columns": columns,
            "values": values,
            "scale": _each(f"{what}: scale", drive.scale, size).tolist(),
            "offset": _each(f"{what}: offset", drive.offset, size).tolist(),
            "low": [end if np.isfinite(end) else None for end in low.tolist()],
            "high": [end if np.isfinite(end) else None for end in high.tolist()],
            "followers": followers,
        }

    def _input(self, what: str, name: str) -> int:
        if name not in self.inputs:
            raise ArgumentError(f"{what}: no term is the input {name!r}; add Input({name!r}, width)")
        return [*self.inputs].index(name)

    def _field(self, what: str, name: str, of: Any, chosen: Any) -> dict[str, Any]:
        field = self._fields.get(name)
        if field is None:
            raise unknown_field(name, [*self._fields], [known["name"] for known in self._info["known_fields"]])
        if not field["dtype"].startswith("f"):
            raise ArgumentError(f"{what}: `{name}` is {field['dtype']}; give a field of real numbers")
        axis = field["axes"].strip("()").split(",")[1].strip()
        parts = int(np.prod(field["shape"][2:], dtype=int))
        if of is None:
            places = list(range(int(np.prod(field["shape"][1:], dtype=int))))
        else:
            places = self._places(f"{what}: `{name}`", axis, parts, of)
        if chosen is not None:
            bad = [column for column in chosen if not -len(places) <= column < len(places)]
            if bad:
                raise ArgumentError(f"{what}: `{name}` has {len(places)} columns here, and no column {bad[0]}")
            places = [places[column] for column in chosen]
        if not places:
            raise ArgumentError(f"{what}: `{name}` has no columns in this scene; leave the term out")
        return {"field": name, "places": places}

    def _axes(self, what: str, name: str) -> dict[str, Any]:
        """Columns of the quaternion of a floating robot or of a link."""
        robot = self._robots.get(name)
        if robot is None and not self._named(self._info["body_names"], name):
            robot = self._only_robot(name)
        if robot is None:
            return self._field(what, "body_q", name, range(_QUATERNION.start, _QUATERNION.stop))
        (first, stop), (first_dof, stop_dof) = robot["coords"], robot["dofs"]
        names = self._info["coord_names"][first:stop]
        if stop - first == stop_dof - first_dof or len(names) < _QUATERNION.stop:
            raise ArgumentError(f"{what}: robot {name!r} does not float; give one of its links")
        return self._field(what, "joint_q", robot["name"], range(_QUATERNION.start, _QUATERNION.stop))

    def _only_robot(self, name: str) -> dict[str, Any] | None:
        """The scene's only robot, which may have another name than in training."""
        alone = len(self._robots) == 1 and "/" not in name
        return next(iter(self._robots.values())) if alone else None

    def _place(self, what: str, axis: str, parts: int, name: str) -> int:
        """The only column of a name."""
        places = self._places(what, axis, parts, name)
        if len(places) != 1:
            raise ArgumentError(f"{what}: {name!r:.80} has {len(places)} columns; give the name of one joint")
        return places[0]

    def _places(self, what: str, axis: str, parts: int, of: Any) -> list[int]:
        """Columns of what has these names, in their order."""
        if axis not in _NAMES:
            raise ArgumentError(f"{what}: its {axis} have no names; give `columns`, and not `of`")
        names = self._info[_NAMES[axis]]
        if of is None:
            return list(range(len(names) * parts))
        found: list[int] = []
        for name in [of] if isinstance(of, str) else of:
            entries = self._entries(what, axis, names, name)
            twice = [entry for entry in entries if entry in found]
            if twice:
                raise ArgumentError(f"{what}: {names[twice[0]]!r} is given twice; name it once")
            found += entries
        return [entry * parts + part for entry in found for part in range(parts)]

    def _entries(self, what: str, axis: str, names: Sequence[str], name: str) -> list[int]:
        has_robots = axis in ("coords", "dofs", "bodies")
        robot = self._robots.get(name) if has_robots else None
        if robot is None and (found := self._named(names, name)):
            return found
        robot = robot or (self._only_robot(name) if has_robots else None)
        if robot is not None:
            return list(range(*robot[axis]))
        cure = suggestion(name, names) if names else "there are: none"
        raise ArgumentError(f"{what}: nothing of its {axis} is {name!r:.80} in this scene; {cure}")

    def _named(self, names: Sequence[str], name: str) -> list[int]:
        """Places of a full name, of the only one that ends so, or of a pattern for full names."""
        if name in names:
            return [names.index(name)]
        prefix, _, own = name.rpartition("/")
        ends = [place for place, full in enumerate(names) if full.rpartition("/")[2] == own]
        if len(ends) == 1 and (not prefix or len(self._robots) == 1):
            return ends
        if self._is_of_file:
            # a pattern of a stranger may take for ever
            return [place for place, full in enumerate(names) if _fits(name, full)] if "*" in name else []
        try:
            return [place for place, full in enumerate(names) if re.fullmatch(name, full)]
        except (re.error, RecursionError, OverflowError):
            return []


def _each(what: str, value: Any, size: int) -> NDArray[np.float64]:
    """One number for each value, rounded to single precision as the metadata is."""
    numbers = np.asarray(value, np.float64)
    if numbers.shape not in ((), (size,)):
        raise ArgumentError(f"{what} has {numbers.size} numbers; give one, or one for each of {size} values")
    return np.broadcast_to(numbers.astype(np.float32).astype(np.float64), (size,))


def _fits(pattern: str, name: str) -> bool:
    """Whether a name is the pattern, in which each ``*`` stands for any text; in time of their lengths."""
    first, *parts = pattern.split("*")
    last = parts.pop()
    end = len(name) - len(last)
    if not (name.startswith(first) and name.endswith(last)) or end < len(first):
        return False
    place = len(first)
    for part in parts:
        place = name.find(part, place, end)
        if place < 0:
            return False
        place += len(part)
    return True


def _unless(default: float, numbers: NDArray[np.float64]) -> list[float]:
    return [] if (numbers == default).all() else numbers.tolist()
