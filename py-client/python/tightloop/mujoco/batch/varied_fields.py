"""Model fields of joints, actuators, geoms and contact pairs as parameters of a simulation.

Each field becomes parameters by a function of the model, the field's values ``(n, ...)``, and the geom of each shape.
Another one finds values that no parameter can express.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tightloop.mujoco.batch.library import mujoco

Array = NDArray[Any]
Values = dict[str, Array]

#: Bound where there is none, as parameters have it.
_NO_LIMIT = 1e30
#: Kinds of joints with one dof.
AXES = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
#: Largest condim of contacts that have sliding friction alone.
_SLIDING = 3
#: Columns of ``geom_friction`` as parameters: of sliding, torsion and rolling.
_FRICTIONS = ("shape_mu", "shape_mu_torsional", "shape_mu_rolling")
#: Least coefficient of friction (MuJoCo: ``mjMINMU``).
_MU_MIN = 1e-5
#: Place of the power in ``solimp``.
_POWER = 4


class Field(NamedTuple):
    """How a model field becomes parameters."""

    #: The parameters that must vary, of a model.
    params: Callable[[Any], tuple[str, ...]]
    #: Their values ``(n, columns)``, of a model, values of the field ``(n, ...)`` and the geom of each shape.
    values: Callable[[Any, Array, list[int]], Values]
    #: Of a model and values of the field: which elements no parameter expresses, a mask of the same shape.
    wrong: Callable[[Any, Array], Array] = lambda model, array: np.zeros(array.shape, bool)
    #: What is wrong with these, after the name of the field.
    problem: str = ""


def _axes(model: Any) -> Array:
    return np.isin(model.jnt_type, AXES)


def _references(model: Any, qpos0: Array, shapes: list[int]) -> Values:
    """References of hinges and slides; those of other joints act in resets alone."""
    joints = _axes(model)
    references = np.zeros((len(qpos0), model.nv))
    references[:, model.jnt_dofadr[joints]] = qpos0[:, model.jnt_qposadr[joints]]
    return {"joint_ref": references}


def _ranges(model: Any, ranges: Array, shapes: list[int]) -> Values:
    bounded = np.asarray(model.jnt_limited).astype(bool) & _axes(model)
    ends = np.empty((len(ranges), 2, model.nv))
    ends[:, 0], ends[:, 1] = -_NO_LIMIT, _NO_LIMIT
    ends[:, :, model.jnt_dofadr[bounded]] = np.swapaxes(ranges[:, bounded], 1, 2)
    return {"joint_limit_lower": ends[:, 0], "joint_limit_upper": ends[:, 1]}


def _moved_balls(model: Any, ranges: Array) -> Array:
    balls = np.asarray(model.jnt_limited).astype(bool) & ~_axes(model)
    return (ranges != model.jnt_range.astype(ranges.dtype)) & balls[:, None]


def _forceranges(model: Any, ranges: Array, shapes: list[int]) -> Values:
    limited = np.asarray(model.actuator_forcelimited).astype(bool)
    bounds = np.broadcast_to(np.array([-_NO_LIMIT, _NO_LIMIT]), ranges.shape).copy()
    bounds[:, limited] = ranges[:, limited]
    return {"actuator_forcerange": bounds}


def _gravcomp(model: Any, shares: Array, shapes: list[int]) -> Values:
    return {"body_gravcomp": shares.astype(np.float64)}


def _frictions(model: Any) -> tuple[str, ...]:
    """Return the parameters that ``geom_friction`` becomes."""
    turns = (np.asarray(model.geom_condim) > _SLIDING).any()
    return _FRICTIONS if turns else _FRICTIONS[:1]


def _friction(model: Any, friction: Array, shapes: list[int]) -> Values:
    columns = friction[:, shapes].astype(np.float64)
    return {name: columns[..., column] for column, name in enumerate(_frictions(model))}


def _solref(model: Any, solref: Array, shapes: list[int]) -> Values:
    return {"shape_solref": solref[:, shapes].astype(np.float64)}


def _solimp(model: Any, solimp: Array, shapes: list[int]) -> Values:
    return {"shape_solimp": solimp[:, shapes].astype(np.float64)}


def _other_powers(model: Any, solimp: Array) -> Array:
    differs = solimp != model.geom_solimp.astype(solimp.dtype)
    differs[..., :_POWER] = False
    return differs


def _pair_friction_params(model: Any) -> tuple[str, ...]:
    return ("pair_friction",) if model.npair else ()


def _pair_friction(model: Any, friction: Array, shapes: list[int]) -> Values:
    return {name: friction[..., [0, 2, 3]].astype(np.float64) for name in _pair_friction_params(model)}


def _other_ratios(model: Any, friction: Array) -> Array:
    """Return which pairs have another ratio of the two tangents than the model, up to rounding."""
    slides, rolls = np.asarray(model.pair_dim) > 1, np.asarray(model.pair_dim) > _SLIDING + 1
    differs = np.zeros(friction.shape[:-1], bool)
    for counts, first in ((slides, 0), (rolls, 3)):
        fixed, given = (
            np.maximum(values[..., first + 1], _MU_MIN) / np.maximum(values[..., first], _MU_MIN)
            for values in (model.pair_friction, friction)
        )
        differs |= counts & (np.abs(given - fixed) > 4 * np.finfo(friction.dtype).eps * fixed)
    return np.repeat(differs[..., None], friction.shape[-1], axis=-1)


#: Fields by their names.
FIELDS = {
    "qpos0": Field(lambda model: ("joint_ref",), _references),
    "jnt_range": Field(
        lambda model: ("joint_limit_lower", "joint_limit_upper"),
        _ranges,
        _moved_balls,
        "of a ball joint cannot differ from the model's; write those of hinges and slides only",
    ),
    "actuator_forcerange": Field(lambda model: ("actuator_forcerange",), _forceranges),
    "body_gravcomp": Field(lambda model: ("body_gravcomp",), _gravcomp),
    "geom_friction": Field(_frictions, _friction),
    "geom_solref": Field(lambda model: ("shape_solref",), _solref),
    "geom_solimp": Field(
        lambda model: ("shape_solimp",),
        _solimp,
        _other_powers,
        "has another power than the model's; write its other columns only",
    ),
    "pair_friction": Field(
        _pair_friction_params,
        _pair_friction,
        _other_ratios,
        "of the two tangents has another ratio than the model's; multiply both by the same",
    ),
}
#: Fields whose values are of geoms, of which a simulation has shapes.
GEOM_FIELDS = ("geom_friction", "geom_solref", "geom_solimp")
