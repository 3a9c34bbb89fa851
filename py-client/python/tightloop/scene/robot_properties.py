"""Properties of a robot with one entry per dof or coordinate, set by arrays, by single values, or by names."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop.arrays.written import PropertyArray
from tightloop.checks.arguments import Quaternion, Triple
from tightloop.checks.attributes import suggestion
from tightloop.errors import SceneError

#: How an entry was given: by itself, or by a value that is spread over several. A mimic joint follows its leader in the
#: second case.
_NAMED, _SPREAD = 1, 2
MODES = ("position", "velocity", "both")


class Owner(Protocol):
    """What properties need of a robot."""

    _own: dict[str, Any]
    _follows_pose: bool

    @property
    def name(self) -> str:
        """Name in the scene."""
        ...

    @property
    def pos(self) -> Triple:
        """Position of the frame."""
        ...

    @property
    def quat(self) -> Quaternion:
        """Orientation of the frame."""
        ...

    @property
    def floating(self) -> bool:
        """Whether a floating base comes first."""
        ...

    @property
    def dofs(self) -> int:
        """Number of dofs."""
        ...

    @property
    def dof_names(self) -> list[str]:
        """Names of the dofs."""
        ...

    @property
    def coord_names(self) -> list[str]:
        """Names of the coordinates."""
        ...

    @property
    def dof_driven(self) -> list[bool]:
        """Which dofs have a drive."""
        ...

    def file_values(self, name: str) -> Any:
        """Return the values of the file for a property."""
        ...

    def start_targets(self) -> list[float]:
        """Return the targets that hold the start position."""
        ...

    @property
    def _followers(self) -> list[tuple[str, str, float, float]]:
        """Mimic joints: name, leader, multiplier and offset."""
        ...

    def _changed(self, attribute: str) -> None: ...


class PerDof:
    """A property with one entry per dof; a single value is written to every dof with a drive."""

    entry = "dof"
    #: Entries of the floating base, which come first.
    base_size = 6

    def __init__(self, doc: str) -> None:
        self.__doc__ = doc

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def error(self, robot: Owner, problem: str) -> SceneError:
        return SceneError(f"robot `{robot.name}`: {self.name} {problem}")

    def names(self, robot: Owner) -> list[str]:
        return robot.dof_names

    def base(self, robot: Owner) -> int:
        """Return the number of entries of the floating base, which may be left out."""
        return self.base_size if robot.floating else 0

    def expected(self, robot: Owner) -> str:
        names, base = self.names(robot), self.base(robot)
        without = f", or {len(names) - base} without those of the floating base" if base else ""
        return (
            f"expected {len(names)}, one a {self.entry} ({some(names)}){without}, a single one for all, "
            "or a dict by name or pattern"
        )

    def named(self, robot: Owner, given: Mapping[str, Any]) -> dict[int, Any]:
        """Return values by entry. Names have priority over patterns, which are regular expressions for whole names."""
        names = self.names(robot)
        values: dict[int, Any] = {}
        pattern_of: dict[int, str] = {}
        for pattern, value in given.items():
            if not isinstance(pattern, str):
                raise self.error(robot, f"has the key {pattern!r}; give names or patterns")
            for place in [] if pattern in names else self._matches(robot, pattern):
                if place in pattern_of and values[place] != value:
                    both = f"{pattern_of[place]!r} and {pattern!r}"
                    raise self.error(robot, f"of {self.entry} `{names[place]}` has two values, by {both}; give one")
                values[place], pattern_of[place] = value, pattern
        return values | {names.index(name): value for name, value in given.items() if name in names}

    def _matches(self, robot: Owner, pattern: str) -> list[int]:
        names, base = self.names(robot), self.base(robot)
        try:
            found = [place for place, name in enumerate(names) if place >= base and re.fullmatch(pattern, name)]
        except re.error as problem:
            raise self.error(
                robot, f"has the key {pattern!r}, which is no pattern ({problem}); give names or regular expressions"
            ) from None
        if not found:
            near = suggestion(pattern, names)
            raise self.error(robot, f"has the key {pattern!r}, which no {self.entry} matches; {near}")
        return found


class Numbers(PerDof):
    """Real numbers, one per dof."""

    def __init__(
        self,
        doc: str,
        *,
        otherwise: str | None = None,
        signed: bool = True,
        limit: bool = False,
        follows: Callable[[float, float, float], float] | None = None,
    ) -> None:
        """Make a property.

        Args:
            doc: Its documentation.
            otherwise: Property that it has the values of if it is not set.
            signed: Whether values may be negative.
            limit: Whether values may be infinite.
            follows: What a mimic joint has, of its leader's value, its multiplier and its offset.
        """
        super().__init__(doc)
        self.otherwise, self.signed, self.limit, self.follows = otherwise, signed, limit, follows

    @overload
    def __get__(self, robot: None, owner: type) -> Numbers: ...
    @overload
    def __get__(self, robot: Owner, owner: type) -> NDArray[np.float64]: ...
    def __get__(self, robot: Owner | None, owner: type) -> Numbers | NDArray[np.float64]:
        if robot is None:
            return self

        def write(values: NDArray[Any], assigned: NDArray[np.bool_]) -> NDArray[Any]:
            self._set(robot, values, assigned.astype(int))
            return self.values(robot)

        return PropertyArray.of(lambda: self.values(robot), write, lambda problem: self.error(robot, problem))

    def values(self, robot: Owner) -> NDArray[np.float64]:
        """Return the values in force, in memory of their own."""
        own = robot._own.get(self.name)
        if own is None and self.otherwise is not None:
            own = robot.start_targets()
        return np.array(robot.file_values(self.name) if own is None else own, dtype=np.float64)

    def __set__(self, robot: Owner, values: ArrayLike | Mapping[str, float]) -> None:
        names = self.names(robot)
        if isinstance(values, Mapping):
            checked, weights = self.values(robot), np.zeros(len(names), int)
            for place, value in self.named(robot, values).items():
                checked[place] = self._reals(robot, value, f"of {self.entry} `{robot.name}/{names[place]}` ", ())
                weights[place] = _NAMED if names[place] in values else _SPREAD
        else:
            checked = self._complete(robot, values)
            weights = np.full(len(names), _SPREAD if np.ndim(values) == 0 else _NAMED)
        self._set(robot, checked, weights)

    def _set(self, robot: Owner, checked: NDArray[np.float64], weights: NDArray[Any]) -> None:
        """Check and keep values.

        Args:
            robot: The robot.
            checked: One value per entry.
            weights: How each of them was given: 0 not at all, `_NAMED`, or `_SPREAD` if one value is for several.
        """
        names = self.names(robot)
        for name, value in zip(names, checked, strict=True):
            if not (np.isfinite(value) or (self.limit and value == np.inf)):
                cure = "a finite number, or inf for no limit" if self.limit else "a finite number"
                raise self.error(robot, f"of {self.entry} `{robot.name}/{name}` is {value}; give {cure}")
            if value < 0.0 and not self.signed:
                raise self.error(
                    robot, f"of {self.entry} `{robot.name}/{name}` is {value}; give a number of at least 0"
                )
        if self.follows is not None:
            for name, leader, multiplier, offset in robot._followers:
                own, lead = names.index(name), names.index(leader)
                if weights[lead] and weights[own] != _NAMED:
                    checked[own] = self.follows(checked[lead], multiplier, offset)
        robot._own[self.name] = checked
        robot._changed(self.name)

    def _complete(self, robot: Owner, values: ArrayLike) -> NDArray[np.float64]:
        """Return one value per entry, of an array or a single value."""
        count, base = len(self.names(robot)), self.base(robot)
        given = self._reals(robot, values, "", ((count,), (count - base,), ()))
        checked = np.empty(count)
        if given.shape == (count,):
            checked[:] = given
        else:
            checked[:base], checked[base:] = self.of_base(robot), given
            if given.ndim == 0:
                alone = self.takes_single(robot)
                checked[base:][~alone[base:]] = 0.0
        return checked

    def _reals(self, robot: Owner, values: Any, of: str, shapes: tuple[tuple[int, ...], ...]) -> NDArray[Any]:
        try:
            given = np.asarray(values)
        except ValueError:
            raise self.error(
                robot, f"{of}is {values!r:.80}; give an array of real numbers, with rows of one length"
            ) from None
        if given.dtype.kind not in "fiu":
            raise self.error(robot, f"{of}is {values!r}; give real numbers")
        if given.shape not in (shapes or ((),)):
            got = f"{given.shape[0]} values" if given.ndim == 1 else f"shape {given.shape}"
            expected = self.expected(robot) if shapes else "give a single number"
            raise self.error(robot, f"{of}has {got}; {expected}")
        return given

    def of_base(self, robot: Owner) -> Sequence[float]:
        """Return the entries of a floating base that are left out."""
        return [0.0] * self.base(robot)

    def takes_single(self, robot: Owner) -> NDArray[np.bool_]:
        return np.array(robot.dof_driven, dtype=bool)


class Positions(Numbers):
    """One entry per position coordinate; a joint that turns freely has a quaternion."""

    entry = "coordinate"
    base_size = 7

    def names(self, robot: Owner) -> list[str]:
        return robot.coord_names

    def takes_single(self, robot: Owner) -> NDArray[np.bool_]:
        return np.ones(len(robot.coord_names), dtype=bool)

    def of_base(self, robot: Owner) -> Sequence[float]:
        return self.values(robot)[: self.base(robot)].tolist()

    def values(self, robot: Owner) -> NDArray[np.float64]:
        values = super().values(robot)
        if robot._follows_pose:
            values[:7] = (*robot.pos, *robot.quat)
        return values

    def _set(self, robot: Owner, checked: NDArray[np.float64], weights: NDArray[Any]) -> None:
        super()._set(robot, checked, weights)
        # a base that stands where `pos` and `quat` put it moves with them
        robot._follows_pose = robot.floating and [*robot._own[self.name][:7]] == [*robot.pos, *robot.quat]


class Modes(PerDof):
    """Drive laws, one per dof."""

    @overload
    def __get__(self, robot: None, owner: type) -> Modes: ...
    @overload
    def __get__(self, robot: Owner, owner: type) -> tuple[str, ...]: ...
    def __get__(self, robot: Owner | None, owner: type) -> Modes | tuple[str, ...]:
        return self if robot is None else robot._own.get(self.name) or tuple(robot.file_values(self.name))

    def __set__(self, robot: Owner, values: str | Sequence[str] | Mapping[str, str]) -> None:
        names, base = robot.dof_names, self.base(robot)
        if isinstance(values, Mapping):
            now = self.__get__(robot, type(robot))
            named = self.named(robot, values)
            modes = tuple(named.get(place, mode) for place, mode in enumerate(now))
        else:
            try:
                modes = (values,) * robot.dofs if isinstance(values, str) else tuple(values)
            except TypeError:
                raise self.error(robot, f"is {values!r}; {self.expected(robot)}") from None
            if base and len(modes) == robot.dofs - base:
                modes = ("position",) * base + modes
        if len(modes) != robot.dofs:
            raise self.error(robot, f"has {len(modes)} values; {self.expected(robot)}")
        for name, mode in zip(names, modes, strict=True):
            if mode not in MODES:
                choices = ", ".join(map(repr, MODES))
                raise self.error(robot, f"of dof `{robot.name}/{name}` is {mode!r}; choose one of {choices}")
        robot._own[self.name] = modes
        robot._changed(self.name)


def position(leader: float, multiplier: float, offset: float) -> float:
    """Return the position of a mimic joint at that of its leader."""
    return offset + multiplier * leader


def velocity(leader: float, multiplier: float, offset: float) -> float:
    """Return the velocity of a mimic joint at that of its leader."""
    return multiplier * leader


def some(names: list[str], most: int = 3) -> str:
    """Return the first names of a list."""
    return ", ".join(names[:most]) + (", …" if len(names) > most else "")
