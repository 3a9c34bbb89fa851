"""Ranges of worlds, and the results of their shards as those of one environment."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from tightloop.adapters.shard import ShardStart, ShardStep


def ranges(worlds: int, parts: int) -> list[slice]:
    """Return contiguous ranges of worlds, one per part; the first ones have one world more if they cannot be equal.

    Args:
        worlds: Number of worlds, at least ``parts``.
        parts: Number of ranges.
    """
    ends = [part * (worlds // parts) + min(part, worlds % parts) for part in range(parts + 1)]
    return [slice(first, last) for first, last in pairwise(ends)]


def gather_infos(parts: Iterable[tuple[slice, Mapping[str, Any]]], worlds: int) -> dict[str, Any]:
    """Return the infos of all worlds.

    A shard leaves out names that concern none of its worlds, such as ``"fault"``. Those rows are zero, and False in the
    mask ``"_fault"``.

    Args:
        parts: The worlds of a shard, and its infos.
        worlds: Number of all worlds.
    """
    given = [(rows, infos) for rows, infos in parts if infos]
    gathered: dict[str, Any] = {}
    for name in dict.fromkeys(name for _, infos in given for name in infos):
        mine = [(rows, infos[name]) for rows, infos in given if name in infos]
        if isinstance(mine[0][1], Mapping):
            gathered[name] = gather_infos(mine, worlds)
            continue
        whole = np.zeros((worlds, *mine[0][1].shape[1:]), mine[0][1].dtype)
        for rows, values in mine:
            whole[rows] = values
        gathered[name] = whole
    return gathered


def cut_off(
    mode: AutoresetMode,
    start: ShardStart,
    cut: NDArray[np.bool_],
    last_obs: NDArray[Any],
    last_privileged: NDArray[Any] | None,
) -> ShardStep:
    """Return the step of a shard that was lost and restarted: its episodes are truncated.

    Args:
        mode: The autoreset mode.
        start: What the restarted shard began with.
        cut: Worlds whose episodes were running, bool, shape ``(worlds,)``. Those of others had ended a step before.
        last_obs: Last observations that were received, shape ``(worlds, size)``.
        last_privileged: Last privileged observations, likewise; None without any.
    """
    obs, infos, everywhere = start.obs, dict(start.infos), np.ones(len(cut), np.bool_)
    if mode is AutoresetMode.SAME_STEP:
        infos |= {"final_obs": np.array(last_obs), "_final_obs": cut, "_final_info": cut, "final_info": {}}
        if last_privileged is not None:
            infos["final_info"] = {"privileged": np.array(last_privileged), "_privileged": cut}
    else:
        # infos of a start are of worlds that begin an episode now
        infos = {name: value & ~cut if name[0] == "_" else value for name, value in infos.items()}
        obs = np.where(cut[:, None], last_obs, obs)
        if last_privileged is not None:
            infos |= {
                "privileged": np.where(cut[:, None], last_privileged, infos["privileged"]),
                "_privileged": everywhere,
            }
    infos |= {"restarted": everywhere, "_restarted": everywhere}
    reward, none = np.zeros(len(cut), obs.dtype), np.zeros(len(cut), np.bool_)
    return ShardStep(obs, reward, none, cut, infos, start.level)


def seeds_after_restart(seeds: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return the seeds of worlds that begin again, shape ``(worlds,)``: a function of their seeds before."""
    return np.array([np.random.SeedSequence([int(seed), 1]).generate_state(1, np.uint64)[0] for seed in seeds])
