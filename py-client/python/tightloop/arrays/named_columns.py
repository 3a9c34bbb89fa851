"""Commands and states by name: single joints, and patterns of them, beside whole robots."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.arrays.inputs import as_array, real_numbers
from tightloop.checks.attributes import nearest
from tightloop.errors import CommandRefused

#: Neighbouring columns: the first of them, and their values, shape ``(worlds, columns)``.
Runs = list[tuple[int, NDArray[np.float64]]]
#: Name, first column, end, and columns of a floating base.
Place = tuple[str, int, int, int]
#: A mimic joint, its leader, and multiplier and offset of its position.
Follower = tuple[str, str, float, float]
#: What followers take from their leaders, and whether the offset belongs to it: forces they do not.
_FOLLOWED = {"joint_q": True, "joint_qd": False, "joint_target_q": True, "joint_target_qd": False}
#: Parts of a quaternion, which are only given together.
_QUATERNION = (".qx", ".qy", ".qz", ".qw")


def named_columns(
    field: str,
    given: Mapping[Any, Any],
    worlds: int,
    names: Sequence[str],
    robots: Sequence[Place],
    *,
    followers: Sequence[Follower] = (),
    parts: int = 1,
) -> Runs:
    """Return the columns that a dict gives, as runs of neighbours: first column, and array ``(worlds, columns)``.

    A key is a robot (``"arm"``), a full name (``"arm/joint1"``) or a pattern for full names (``"arm/.*_hip"``). The
    value of a robot may be a dict by the names within it. A full name counts before a pattern, and a pattern before
    the array of a whole robot.

    A mimic joint follows its leader where the dict gives the leader, and not the mimic joint by a key that counts as
    much. A pattern that matches both gives the leader.

    Args:
        field: Name of the argument, for messages.
        given: The dict.
        worlds: Number of worlds.
        names: Names of all columns.
        robots: The robots.
        followers: The mimic joints.
        parts: Columns of each name, 6 for forces on bodies.

    Raises:
        CommandRefused: A key means nothing, or a column has two values; or a shape or dtype is wrong.
    """
    places = {name: place for place, name in enumerate(names)}
    owners = {robot[0]: robot for robot in robots}
    columns: dict[int, tuple[int, Any, NDArray[Any]]] = {}  # rank of the key, the key, and the values

    def put(rank: int, key: str, place: int, values: NDArray[Any]) -> None:
        other = columns.get(place)
        if other is not None and other[0] == rank and not np.array_equal(other[2], values):
            both = f"{other[1]!r} and {key!r}"
            raise CommandRefused(f"{field} of `{names[place]}` has two values, by {both}; give one")
        if other is None or other[0] <= rank:
            columns[place] = rank, key, values

    def by_name(key: str, value: Any, prefix: str) -> None:
        full = prefix + key
        if full in places:
            put(2, key, places[full], _one(f"{field} of `{full}`", value, worlds, parts))
            return
        found = _matching(field, full, names, owners, inside=bool(prefix))
        values = _one(f"{field} of {key!r}", value, worlds, parts)
        for place in found:
            put(1, key, place, values)

    for key, value in given.items():
        if not isinstance(key, str):
            kind = _kind(field)
            raise CommandRefused(f"{field} has the key {key!r}; give names of robots or of {kind}, {_example(names)}")
        robot = owners.get(key)
        if robot is None:
            by_name(key, value, "")
        elif isinstance(value, Mapping):
            for own, part in value.items():
                if not isinstance(own, str):
                    raise CommandRefused(f"{field} of robot `{key}` has the key {own!r}; give names or patterns")
                by_name(own, part, f"{key}/")
        else:
            _, start, stop, base = robot
            if parts > 1:
                array = _bodies(f"{field} of `{key}`", value, worlds, stop - start, parts)
            else:
                array = as_array(field, key, value, worlds, stop - start, base=base)
            for column, place in enumerate(range(stop - array.shape[1], stop)):
                put(0, key, place, array[:, column])
    _check_quaternions(field, columns.keys(), names)
    if field in _FOLLOWED:
        _follow(columns, places, followers, has_offsets=_FOLLOWED[field])
    return _runs(columns, parts)


def _follow(
    columns: dict[int, tuple[int, Any, NDArray[Any]]],
    places: Mapping[str, int],
    followers: Sequence[Follower],
    *,
    has_offsets: bool,
) -> None:
    """Add the columns of mimic joints whose leader counts more; a pattern that matches both gives the leader."""
    for name, leader, multiplier, offset in followers:
        own, lead = columns.get(places[name]), columns.get(places[leader])
        if lead is not None and (own is None or own[0] < lead[0] or (own[0] == 1 and own[:2] == lead[:2])):
            rank, key, values = lead
            columns[places[name]] = rank, key, multiplier * values + (offset if has_offsets else 0.0)


def _one(what: str, value: Any, worlds: int, parts: int) -> NDArray[Any]:
    """Return the values of one name in each world, shape ``(worlds,)``, or ``(worlds, parts)`` of several parts."""
    if isinstance(value, Mapping):
        expected = "a number, or one per world" if parts == 1 else f"{parts} numbers"
        raise CommandRefused(f"{what} is {value!r:.80}; give {expected}")
    given = real_numbers(what, value)
    if parts > 1:
        if given.shape not in ((parts,), (worlds, parts)):
            raise CommandRefused(f"{what}: {_expected(worlds, (), parts)}; got {given.shape}")
        return np.broadcast_to(given.astype(np.float64), (worlds, parts))
    if given.shape not in ((), (1,), (worlds,), (worlds, 1)):
        raise CommandRefused(f"{what}: expected a number, or shape {(worlds,)}; got {given.shape}")
    return np.broadcast_to(given.reshape(-1).astype(np.float64), (worlds,))


def _bodies(what: str, value: Any, worlds: int, bodies: int, parts: int) -> NDArray[Any]:
    """Return the values of all bodies of a robot, shape ``(worlds, bodies, parts)``."""
    given = real_numbers(what, value)
    if bodies == 1 and given.shape in ((parts,), (worlds, parts)):  # a free body, or a robot of one link
        given = given.reshape(-1, 1, parts)
    if given.shape not in ((bodies, parts), (worlds, bodies, parts), (1, bodies, parts)):
        raise CommandRefused(f"{what}: {_expected(worlds, (bodies,), parts)}; got {given.shape}")
    return np.broadcast_to(given.astype(np.float64), (worlds, bodies, parts))


def _expected(worlds: int, bodies: tuple[int, ...], parts: int) -> str:
    alike, own = (*bodies, parts), (worlds, *bodies, parts)
    return f"expected shape {alike} for all worlds, or {own}: the force, then the torque"


def _kind(field: str) -> str:
    return "bodies" if field.startswith("body_") else "joints"


def _matching(
    field: str, pattern: str, names: Sequence[str], owners: Mapping[str, Place], *, inside: bool
) -> list[int]:
    """Return the columns of a pattern, those of floating bases left out."""
    if not names:
        raise CommandRefused(f"{field}: nothing of this scene takes it; leave it out")
    bases = {place for _, start, _, base in owners.values() for place in range(start, start + base)}
    try:
        found = [
            place for place, name in enumerate(names) if place not in bases and re.fullmatch(pattern, name) is not None
        ]
    except re.error as problem:
        raise CommandRefused(
            f"{field} has the key {pattern!r}, which is no pattern ({problem}); give names or regular expressions"
        ) from None
    if found:
        return found
    if not inside and "/" not in pattern:
        near = nearest(pattern, owners)
        joints = [name for name in names if name.rpartition("/")[2] == pattern]
        cure = f"did you mean `{(near or joints)[0]}`?" if near or joints else _there(owners)
        kind = _kind(field).capitalize()
        raise CommandRefused(f"{field}: no robot `{pattern}`; {cure} {kind} are named with it, {_example(names)}")
    robot = pattern.partition("/")[0]
    if robot not in owners:
        near = nearest(robot, owners)
        cure = f"did you mean `{near[0]}`?" if near else _there(owners)
        raise CommandRefused(f"{field} has the key {pattern!r}, and there is no robot `{robot}`; {cure}")
    own = [name for name in names if name.startswith(f"{robot}/")]
    near = nearest(pattern, own)
    cure = f"did you mean `{near[0]}`?" if near else f"there are: {', '.join(own[:20])}{', …' * (len(own) > 20)}"
    raise CommandRefused(f"{field} has the key {pattern!r}, which nothing matches; {cure}")


def _there(owners: Mapping[str, Place]) -> str:
    return f"there are: {', '.join(f'`{name}`' for name in owners)}."


def _example(names: Sequence[str]) -> str:
    return f"such as {names[-1]!r}" if names else "of which there are none"


def _check_quaternions(field: str, places: Collection[int], names: Sequence[str]) -> None:
    """Refuse a part of a quaternion."""
    for place in places:
        name = names[place]
        if field == "joint_q" and name.endswith(_QUATERNION):
            owner = name[: -len(_QUATERNION[0])]
            first = names.index(owner + _QUATERNION[0])
            if any(first + part not in places for part in range(len(_QUATERNION))):
                raise CommandRefused(f"{field} of `{name}` is a part of a quaternion; give `{owner}.qx` to `.qw`")


def _runs(columns: Mapping[int, tuple[int, Any, NDArray[Any]]], parts: int) -> Runs:
    """Join neighbouring columns."""
    runs: list[tuple[int, list[NDArray[Any]]]] = []
    for place in sorted(columns):
        if runs and place == runs[-1][0] + len(runs[-1][1]):
            runs[-1][1].append(columns[place][2])
        else:
            runs.append((place, [columns[place][2]]))
    joined = [(first * parts, np.stack(own, axis=1).reshape(len(own[0]), -1)) for first, own in runs]
    return [(first, np.ascontiguousarray(own, dtype=np.float64)) for first, own in joined]
