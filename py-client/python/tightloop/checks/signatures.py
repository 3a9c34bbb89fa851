"""Calls with wrong arguments: the error names the argument and what the call takes.

Python's own `TypeError` of a wrong call has neither. It is raised before the function runs, so a caller has to catch
it: `checked_calls` wraps functions, and costs about 50 ns a call.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from types import FunctionType
from typing import TYPE_CHECKING, Any, TypeVar, cast

from tightloop.checks.attributes import nearest
from tightloop.errors import SignatureError

if TYPE_CHECKING:
    from inspect import Parameter

Checked = TypeVar("Checked", bound=Callable[..., Any])


def checked_calls(thing: Checked) -> Checked:
    """Make wrong arguments of a function, or of a class and its public methods, a `SignatureError`.

    Methods that the class inherits stay as they are.
    """
    if isinstance(thing, type):
        for name, member in [*vars(thing).items()]:
            if name.startswith("_") and name != "__init__":
                continue
            if isinstance(member, FunctionType):
                setattr(thing, name, _wrapped(member))
            elif isinstance(member, classmethod | staticmethod):
                setattr(thing, name, type(member)(_wrapped(member.__func__)))
        return cast("Checked", thing)
    return _wrapped(thing)


def with_arguments(*names: str) -> Callable[[Checked], Checked]:
    """Name the keyword arguments that a function takes as ``**``, so that `checked_calls` refuses all others."""

    def named(function: Checked) -> Checked:
        setattr(function, _FURTHER, names)
        return function

    return named


def unknown_argument(call: str, name: str, accepted: Sequence[str]) -> SignatureError:
    """Return the error of a keyword argument that a call does not take."""
    return SignatureError(
        f"{call}: {_unknown(call.partition(' ')[0], [name], accepted)} It takes {', '.join(accepted) or 'none'}"
    )


def add_hints(call: str, hints: Mapping[str, str]) -> None:
    """Say what to do instead of giving arguments that a call does not take; ``{}`` stands for the argument."""
    _HINTS.setdefault(call, {}).update(hints)


_FURTHER = "_further_arguments"
_NO_WINDOW = "a simulation has no window: `sim.view()` opens a viewer, and `sim.picture()` draws"
_OF_LAUNCH = "it is an argument of `tightloop.launch`"
_OF_SCENE = "it is an argument of `tightloop.Scene`"
_OF_ROBOT = "set it on the robot that the call returns, as in `robot.{} = …`"
_SEED = "`sim.reset(seed=…)` sets it after the launch"
_HALF = "`half_height` is half the length of its straight part"
_HALVES = "`half_extents` are half of each edge"
#: What to do instead of giving arguments that calls of other libraries have, by the call's name.
_HINTS = {
    "add_urdf": {
        **dict.fromkeys(
            (
                "joint_q",
                "joint_target_q",
                "joint_target_qd",
                "joint_target_mode",
                "joint_target_ke",
                "joint_target_kd",
                "joint_effort_limit",
                "joint_limit_ke",
                "joint_limit_kd",
                "joint_armature",
            ),
            _OF_ROBOT,
        ),
        "armature": _OF_ROBOT.format("joint_armature"),
        "damping": _OF_ROBOT.format("joint_target_kd"),
        "initial_joint_q": _OF_ROBOT.format("joint_q"),
        "qpos": _OF_ROBOT.format("joint_q"),
        "stiffness": _OF_ROBOT.format("joint_target_ke"),
    },
    "add_box": dict.fromkeys(("size", "extents", "dimensions"), _HALVES),
    "add_capsule": dict.fromkeys(("length", "height"), _HALF),
    "add_cylinder": dict.fromkeys(("length", "height"), "`half_height` is half its length"),
    "add_ellipsoid": dict.fromkeys(("radius", "size", "half_extents"), "`radii` are its half lengths along its axes"),
    "add_ground": dict.fromkeys(("pos", "height"), "`z` is its height"),
    "launch": {
        "dt": _OF_SCENE,
        "gravity": _OF_SCENE,
        "gui": _NO_WINDOW,
        "headless": f"leave it out: {_NO_WINDOW}",
        "random_seed": _SEED,
        "render": _NO_WINDOW,
        "render_mode": _NO_WINDOW,
        "seed": _SEED,
        "substeps": _OF_SCENE,
        "timestep": f"`dt` {_OF_SCENE.removeprefix('it ')}",
        "viewer": _NO_WINDOW,
    },
    **{call: dict.fromkeys(("worlds", "world"), "`mask` has True for the worlds meant") for call in ("reset", "write")},
    "Scene": {
        "device": _OF_LAUNCH,
        "headless": f"leave it out: {_NO_WINDOW}",
        "num_envs": f"`worlds` {_OF_LAUNCH.removeprefix('it ')}",
        "num_worlds": f"`worlds` {_OF_LAUNCH.removeprefix('it ')}",
        "seed": _SEED,
        "worlds": _OF_LAUNCH,
    },
    "environment": {"seed": "`envs.reset(seed=…)` sets it", "headless": "leave it out, and `render_mode` too"},
}
#: What makes objects of classes that nobody calls.
_MADE_BY = {
    "Sim": "`tightloop.launch` and `tightloop.attach`",
    "Groups": "`tightloop.launch(groups=…)` and `tightloop.attach`",
    "Robot": "`Scene.add_urdf` and `Scene.load`",
    "JointOrder": "calls of `Robot.order`",
    "Params": "the properties `Sim.params`",
    "Snapshot": "`Sim.snapshot` and `Snapshot.load`",
}


def _wrapped(function: Any) -> Any:
    @functools.wraps(function)
    def call(*given: Any, **named: Any) -> Any:
        try:
            return function(*given, **named)
        except TypeError as problem:
            # an error of the function's own has a frame of it
            if problem.__traceback__ is None or problem.__traceback__.tb_next is not None:
                raise
        raise _explained(function, given, named)

    if not hasattr(function, _FURTHER):
        return call
    code, further = function.__code__, getattr(function, _FURTHER)
    known = {*code.co_varnames[: code.co_argcount + code.co_kwonlyargcount], *further}

    @functools.wraps(function)
    def call_with_further(*given: Any, **named: Any) -> Any:
        if named.keys() - known:
            raise _explained(function, given, named)
        return call(*given, **named)

    return call_with_further


def _explained(function: FunctionType, given: Sequence[Any], named: Mapping[str, Any]) -> SignatureError:
    """Return the error of a call that does not fit the function."""
    import inspect  # 10 ms, which only a wrong call needs

    parameters = [*inspect.signature(function).parameters.values()]
    call = function.__qualname__
    if parameters and parameters[0].name in ("self", "cls") and given:
        owner = given[0] if isinstance(given[0], type) else type(given[0])
        method = function.__name__
        call = call.removesuffix(".__init__") if method == "__init__" else f"{owner.__name__}.{method}"
        parameters, given = parameters[1:], given[1:]
    if function.__name__ == "__init__" and call in _MADE_BY:
        return SignatureError(f"{call}: {_MADE_BY[call]} make it; call those")
    further = getattr(function, _FURTHER, ())
    parameters = [one for one in parameters if one.kind not in (one.VAR_POSITIONAL, one.VAR_KEYWORD)]
    parameters += [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None) for name in further]
    return SignatureError(f"{call}: {_problem(call.rpartition('.')[2], parameters, given, named)}")


def _problem(call: str, parameters: Sequence[Parameter], given: Sequence[Any], named: Mapping[str, Any]) -> str:
    """Return what is wrong with a call, and the cure."""
    places = [parameter.name for parameter in parameters if parameter.kind is parameter.POSITIONAL_OR_KEYWORD]
    names = [parameter.name for parameter in parameters if parameter.kind is parameter.KEYWORD_ONLY]
    accepted = [*places, *names]
    takes = f"The call is {call}({', '.join(_shown(parameters))})"
    if unknown := [name for name in named if name not in accepted]:
        return f"{_unknown(call, unknown, accepted)} {takes}"
    if len(given) > len(places):
        free = [name for name in names if name not in named]
        most = " and ".join(f"`{name}`" for name in places) or "no argument"
        if not accepted:
            return f"it takes no argument and got {len(given)}; call {call}()"
        cure = f"give the others by name, such as {free[0]}=…" if free else "leave the others out"
        return f"it takes {most} without a name and got {len(given)}; {cure}. {takes}"
    if twice := [name for name in places[: len(given)] if name in named]:
        return f"`{twice[0]}` is given twice, by place and by name; leave one of them out"
    needed = [parameter.name for parameter in parameters if parameter.default is parameter.empty]
    missing = [name for name in needed if name not in places[: len(given)] and name not in named]
    lacks = " and ".join(f"`{name}`" for name in missing)
    return (
        f"{lacks} {'is' if len(missing) == 1 else 'are'} missing; give {'it' if len(missing) == 1 else 'them'}. {takes}"
    )


def _unknown(call: str, names: Sequence[str], accepted: Sequence[str]) -> str:
    """Return that there are no such arguments, and which may be meant."""
    hints = [_HINTS[call][name].format(name) for name in names if name in _HINTS.get(call, ())]
    if hints:
        return f"there is no argument {' and '.join(f'`{name}`' for name in names)}; {', and '.join(hints)}."
    meant = [f"`{near}`" for name in names for near in nearest(name, accepted)]
    cure = f"did you mean {' or '.join(dict.fromkeys(meant))}?" if meant else "leave it out."
    return f"there is no argument {' and '.join(f'`{name}`' for name in names)}; {cure}"


def _shown(parameters: Sequence[Parameter]) -> list[str]:
    """Return the arguments as a call has them, optional ones with an ellipsis."""
    shown = [one.name + ("" if one.default is one.empty else "=…") for one in parameters]
    by_place = [one for one in parameters if one.kind is one.POSITIONAL_OR_KEYWORD]
    return [*shown[: len(by_place)], *(["*", *shown[len(by_place) :]] if len(by_place) < len(shown) else [])]
