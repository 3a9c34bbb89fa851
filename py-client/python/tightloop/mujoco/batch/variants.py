"""The models of a batch: the one that was given, and variants of it with other values that are no parameters.

Most expanded fields are parameters of one simulation. Another timestep, integrator or size of a geom needs another
model. Such a variant has a simulation underneath for its members. A member that gets other values moves to another
variant; its row is the truth, so that it goes on from there.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import ArgumentError, LaunchError
from tightloop.mujoco.batch.bindings import Bindings
from tightloop.mujoco.batch.engine import Engine
from tightloop.mujoco.batch.expansions import Expansions
from tightloop.mujoco.batch.fields import Fields
from tightloop.mujoco.batch.layout import StateLayout
from tightloop.mujoco.batch.library import mujoco
from tightloop.mujoco.batch.selection import Selection
from tightloop.mujoco.batch.shapes import geoms_of_shapes
from tightloop.mujoco.batch.stepping import Stepping

Array = NDArray[Any]
#: The values that a variant has instead of the model's: names, types and bytes.
Key = tuple[tuple[str, str, bytes], ...]

#: Most models of a batch. Each has a simulation of its own underneath.
MODELS_MAX = 64
_BASE: Key = ()


class Variant:
    """A model, and what runs it.

    Args:
        model: The model.
        bindings: The rows of all simulations.
        fields: Fields of ``MjData``.
        expansions: Fields of all simulations.
        options: ``threads``, ``precision`` and ``device`` of the launch.
        forward: Whether fields are current after a step.
        key: The values that it has instead of the given model's.
        sims: Simulations that run it; all if left out.
    """

    def __init__(
        self,
        model: Any,
        bindings: Bindings,
        fields: Fields,
        expansions: Expansions,
        options: dict[str, Any],
        *,
        forward: bool,
        key: Key = _BASE,
        sims: Array | None = None,
    ) -> None:
        self.key = key
        layout = StateLayout(model)
        self.engine = Engine(model, layout, bindings, options, sims)
        self.expansions = expansions.over(model)
        self.stepping = Stepping(
            model, fields, layout, bindings, self.engine, expansions=self.expansions, forward=forward
        )
        self._model = model

    def params(self) -> dict[str, Array]:
        """Return the parameters of all simulations, of which the chosen ones have been checked."""
        self.engine.require(params=self.expansions.params())
        shapes: list[int] = []
        if self.expansions.needs_shapes:
            shapes = geoms_of_shapes(self._model, self.engine.sim.shape_names)
        return self.expansions.checked_values(shapes)


#: A call's share of a variant: its chosen simulations, and their parameters.
Part = tuple[Variant, Selection, dict[str, Array]]


class Variants:
    """Runs the calls of a batch on its models.

    Args:
        model: The batch's own copy of the given model.
        bindings: The rows of all simulations.
        fields: Fields of ``MjData``.
        expansions: Fields of all simulations.
        options: ``threads``, ``precision`` and ``device`` of a launch.
        forward: Whether fields are current after a step.

    Attributes:
        base: The given model.
    """

    def __init__(
        self,
        model: Any,
        bindings: Bindings,
        fields: Fields,
        expansions: Expansions,
        options: dict[str, Any],
        *,
        forward: bool,
    ) -> None:
        self._model, self._bindings, self._fields, self._expansions = model, bindings, fields, expansions
        self._options, self._forward = options, forward
        self._bound: list[str] = []
        self.base = self._made(model, _BASE)
        # variants by a number, and the number of each simulation's
        self._running = {0: self.base}
        self._last = 0
        self._home = np.zeros(len(bindings.rows), int)
        # bytes of expanded fields that homes were chosen for, and the simulations that were brought there
        self._seen: dict[str, Array] = {}
        self._known = np.zeros(len(bindings.rows), bool)

    @property
    def count(self) -> int:
        """Number of models."""
        return len(self._running)

    def add(self, name: str) -> None:
        """Fill a bound field from now on."""
        self._bound.append(name)
        for variant in self._running.values():
            variant.stepping.add(name)

    def close(self) -> None:
        """End all simulations."""
        for variant in self._running.values():
            variant.engine.close()

    def step(self, chosen: Selection, nstep: int, history: Array | None) -> None:
        """Advance simulations; see `Batch.step`."""
        frames = self.base.stepping.plan(nstep, has_history=history is not None)
        parts, failed = self._parts(chosen)
        for variant, sims, params in parts:
            variant.stepping.prepare_step(sims, params)
        for variant, sims, _ in parts:
            if history is None or len(sims) == len(chosen):
                variant.stepping.step(sims, frames, nstep, history)
                continue
            rows = np.empty((len(sims), *history.shape[1:]))
            variant.stepping.step(sims, frames, nstep, rows)
            history[np.searchsorted(chosen.indices, sims.indices)] = rows
        _raise(failed)

    def forward(self, chosen: Selection) -> None:
        """Fill bound fields; see `Batch.forward`."""
        parts, failed = self._parts(chosen)
        for variant, sims, params in parts:
            variant.stepping.prepare(sims, params)
        for variant, sims, _ in parts:
            variant.stepping.finish(sims)
        _raise(failed)

    def reset(self, chosen: Selection, keyframe: int) -> None:
        """Reset simulations; see `Batch.reset`."""
        parts, failed = self._parts(chosen)
        for variant, sims, params in parts:
            variant.stepping.prepare_reset(sims, params, keyframe)
        for variant, sims, _ in parts:
            variant.stepping.finish(sims)
        _raise(failed)

    def _parts(self, chosen: Selection) -> tuple[list[Part], dict[int, str]]:
        """Return the share of each variant, and what is wrong with the simulations whose model does not run."""
        failed = self._move(chosen)
        if len(self._running) == 1 and not failed:
            return [(self.base, chosen, self.base.params())], failed
        ids = np.setdiff1d(chosen.indices, list(failed))
        parts: list[Part] = []
        for number in np.unique(self._home[ids]).tolist():
            variant, sims = self._running[number], Selection(ids[self._home[ids] == number], len(self._home))
            variant.engine.substeps = self.base.engine.substeps
            parts.append((variant, sims, variant.params()))
        return parts, failed

    def _move(self, chosen: Selection) -> dict[int, str]:
        """Bring each chosen simulation to the variant with its values; return those whose model does not run."""
        fixed = self._expansions.fixed(chosen.indices)
        if not fixed and len(self._running) == 1:
            return {}
        keys = _keys(fixed, self._changed(chosen))
        groups: dict[Key, list[int]] = {}
        for at, key in keys.items():
            groups.setdefault(key, []).append(int(chosen.indices[at]))
        failed: dict[int, str] = {}
        groups = self._completed(groups, failed)
        self._check_count(groups)
        for key, sims in groups.items():
            failed |= self._place(key, np.array(sims))
        self._merge()
        return failed

    def _changed(self, chosen: Selection) -> Array:
        """Return the places of those chosen simulations whose expanded fields have changed since they were brought."""
        changed = ~self._known[chosen.ids]
        for name in self._expansions.names:
            array = self._expansions.of(name)
            given = np.ascontiguousarray(array[chosen.ids]).reshape(len(chosen), -1).view(np.uint8)
            if name not in self._seen:
                self._seen[name] = np.zeros((len(array), given.shape[1]), np.uint8)
                self._known[:], changed[:] = False, True
            changed |= (self._seen[name][chosen.ids] != given).any(axis=1)
            self._seen[name][chosen.ids] = given
        # until they are at home
        self._known[chosen.indices[changed]] = False
        return np.flatnonzero(changed)

    def _completed(self, groups: dict[Key, list[int]], failed: dict[int, str]) -> dict[Key, list[int]]:
        """Return groups by whole keys: a changed model may have fields that are no parameters of it."""
        whole: dict[Key, list[int]] = {}
        todo = list(groups.items())
        while todo:
            key, sims = todo.pop()
            if key == _BASE or any(variant.key == key for variant in self._running.values()):
                whole.setdefault(key, []).extend(sims)
                continue
            try:
                model = self._varied(key)
            except ValueError as error:
                failed |= dict.fromkeys(sims, str(error))
                continue
            fixed = self._expansions.over(model).fixed(np.array(sims))
            more: dict[Key, list[int]] = {}
            for at, extra in _keys(fixed, np.arange(len(sims))).items():
                more.setdefault(extra, []).append(sims[at])
            for extra, members in more.items():
                if extra == _BASE:
                    whole.setdefault(key, []).extend(members)
                else:
                    fields = {name: (name, kind, data) for name, kind, data in (*key, *extra)}
                    larger = tuple(fields[name] for name in sorted(fields))
                    assert larger != key, f"{sorted(fields)}: a model with these values does not have them"
                    todo.append((larger, members))
        return {key: sorted(sims) for key, sims in whole.items()}

    def _check_count(self, groups: dict[Key, list[int]]) -> None:
        home = self._home.copy()
        home[[sim for sims in groups.values() for sim in sims]] = -1
        keys = {self._running[number].key for number in np.unique(home).tolist() if number >= 0} | set(groups)
        if len(keys) > MODELS_MAX:
            names = dict.fromkeys(name for key in keys for name, _, _ in key)
            raise ArgumentError(
                f"{', '.join(names)}: {len(keys)} different models in one Batch, and each needs a simulation; give at "
                f"most {MODELS_MAX} different values, or make several batches"
            )

    def _place(self, key: Key, sims: Array) -> dict[int, str]:
        """Bring simulations to variants with a key; return those whose model does not run."""
        for number, variant in list(self._running.items()):
            if variant.key == key:
                # most are there, or were there before
                there = variant.engine.has(sims)
                self._bring(number, sims[there])
                sims = sims[~there]
        if not len(sims):
            return {}
        try:
            variant = self._opened(key, sims)
        except (ValueError, LaunchError, mujoco.FatalError) as error:
            return dict.fromkeys(sims.tolist(), str(error))
        self._last += 1
        self._running[self._last] = variant
        self._bring(self._last, sims)
        return {}

    def _bring(self, number: int, sims: Array) -> None:
        """Let simulations run at a variant, and end the variants without any."""
        moved = sims[self._home[sims] != number]
        for left in np.unique(self._home[moved]).tolist():
            gone = moved[self._home[moved] == left]
            self._home[gone] = number
            if left and left not in self._home:
                self._running.pop(left).engine.close()
            else:
                self._running[left].engine.dismiss(gone)
        self._running[number].engine.mark_stale(moved)
        self._known[sims] = True

    def _merge(self) -> None:
        """Where there are too many variants, let those with the same key become one."""
        if len(self._running) <= MODELS_MAX + 1:
            return
        numbers: dict[Key, list[int]] = {}
        for number, variant in self._running.items():
            numbers.setdefault(variant.key, []).append(number)
        for key, several in numbers.items():
            members = np.flatnonzero(np.isin(self._home, several))
            if len(several) > 1 and len(members):
                self._last += 1
                self._running[self._last] = self._opened(key, members)
                self._bring(self._last, members)

    def _made(self, model: Any, key: Key, sims: Array | None = None) -> Variant:
        given = (model, self._bindings, self._fields, self._expansions, self._options)
        return Variant(*given, forward=self._forward, key=key, sims=sims)

    def _varied(self, key: Key) -> Any:
        """Return the model with the values of a key."""
        model = copy.copy(self._model)
        for name, kind, data in key:
            holder = model if hasattr(model, name) else model.opt
            values = np.frombuffer(data, kind)
            if np.ndim(getattr(holder, name)):
                getattr(holder, name)[:] = values.reshape(getattr(holder, name).shape)
            else:
                setattr(holder, name, values[0].item())
        return model

    def _opened(self, key: Key, members: Array) -> Variant:
        """Return a variant that is launched, and fills the fields that are bound."""
        variant = self._made(self._varied(key), key, members)
        for name in self._bound:
            variant.stepping.add(name)
        variant.engine.require(params=variant.expansions.params())
        variant.engine.substeps = self.base.engine.substeps
        _ = variant.engine.sim
        return variant


def _keys(fixed: dict[str, tuple[Array, Array]], places: Array) -> dict[int, Key]:
    """Return the key of each of some places of `Expansions.fixed`."""
    named = sorted(fixed.items())
    return {
        at: tuple((name, values.dtype.str, values[at].tobytes()) for name, (needs, values) in named if needs[at])
        for at in places.tolist()
    }


def _raise(failed: dict[int, str]) -> None:
    """Report the first simulation whose model does not run, when the others are done."""
    if failed:
        sim = min(failed)
        raise RuntimeError(f"sim {sim}: {failed[sim]}")
