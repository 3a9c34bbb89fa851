"""Episodes of a recording: each world from a reset, or from the recording's beginning, to the next one.

A replay gives frames of all worlds, one after the other. A step of a world leads from the frame before to its own: the
observation is of the frame before, the action is the command that the step held.
"""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop import _core
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.datasets.choices import FIELDS, Layout, layout
from tightloop.datasets.images import check_image, image_kind
from tightloop.errors import ArgumentError
from tightloop.scene.scene import Scene

Array = NDArray[Any]


# Bits of `status` of a world that is frozen.
_FAULTED = 1 | 8
# Worlds whose arrays are gathered together: few, since images are large.
_WORLDS_AT_ONCE = 32


@dataclass
class _Frame:
    """A frame of the worlds that are exported.

    Attributes:
        arrays: Fields, worlds first.
        is_step: Whether it is a control frame after the frame before.
        count: Control frames since the recording's beginning.
    """

    arrays: dict[str, Array]
    is_step: bool
    count: int


@dataclass(frozen=True)
class Episode:
    """One world from its start to its end.

    Attributes:
        index: Number of the episode in the dataset.
        world: World of the recording.
        begin: Time of the first observation since the recording's beginning [s].
        times: Time of each observation since the first one [s], ``(steps,)``.
        observations: Fields before each step, ``(steps, …)``.
        next_observations: Fields after each step, ``(steps, …)``.
        actions: Commands of each step, ``(steps, columns)``.
        states: Positions and velocities before each step, ``(steps, columns)``.
        rewards: Reward of each step, ``(steps,)``.
        dones: Whether a step is the last one, ``(steps,)``.
        ends: Whether the episode ended, such as by a reset; otherwise the recording did.
    """

    index: int
    world: int
    begin: float
    times: NDArray[np.float64]
    observations: Mapping[str, Array]
    next_observations: Mapping[str, Array]
    actions: Array
    states: Array
    rewards: NDArray[np.float32]
    dones: NDArray[np.bool_]
    ends: bool

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.actions)


#: A function of an episode, or an array for each episode.
PerStep = Callable[[Episode], ArrayLike] | Sequence[ArrayLike]


@checked_calls
def episodes(
    recording: str | os.PathLike[str],
    *,
    fields: Sequence[str] = FIELDS,
    action: str | Sequence[str] | None = None,
    joints: Sequence[str] | None = None,
    worlds: int | Sequence[int] | None = None,
    fps: float | None = None,
    min_steps: int = 1,
    cameras: Scene | None = None,
) -> Iterator[Episode]:
    """Replay a recording, and return its episodes as they end.

    An episode ends with a reset of its world, a fault, a restored snapshot, a gap or the recording. It is kept in
    memory until then.

    Args:
        recording: Path of the recording.
        fields: Fields of the observations.
        action: Command or commands that are the action; those that the first step with commands sent if left out.
        joints: Names or patterns, such as ``"arm/*"``, of the joints or actuators whose commands are the action; all
            but the dofs of free bodies if left out.
        worlds: How many worlds, the first ones; or a list of them; all if left out.
        fps: Frames per second, of which the control rate is a multiple. The first command of a frame is its action.
        min_steps: Fewest steps of an episode; shorter ones are left out.
        cameras: A scene whose cameras see the replay, besides those of the recorded scene. Nothing else of it counts.

    Raises:
        ArgumentError: An argument is not valid; the message names it.
        RecordingError: The recording cannot be read.
        UnknownField: There is no such field.
    """
    chosen = layout(recording, fields=fields, action=action, joints=joints, worlds=worlds, fps=fps, cameras=cameras)
    least = checks.integer("episodes: min_steps", min_steps, least=1, error=ArgumentError)
    return Reader(recording, chosen, least).episodes()


def with_rewards(episode: Episode, rewards: PerStep | None, dones: PerStep | None) -> Episode:
    """Return an episode with rewards and ends of the user's.

    Raises:
        ArgumentError: They are not of the episode's length, or missing.
    """
    changes: dict[str, Array] = {}
    if rewards is not None:
        changes["rewards"] = _per_step("rewards", rewards, episode).astype(np.float32)
    if dones is not None:
        changes["dones"] = _per_step("dones", dones, episode).astype(bool)
    return dataclasses.replace(episode, **changes) if changes else episode


def _per_step(what: str, given: PerStep, episode: Episode) -> Array:
    if callable(given):
        values = given(episode)
    elif not isinstance(given, Sequence | np.ndarray):
        raise ArgumentError(f"export: {what} is {given!r:.80}; give a function, or an array for each episode")
    elif episode.index < len(given):
        values = given[episode.index]
    else:
        raise ArgumentError(f"export: {what} has {len(given)} arrays, and there are more episodes; give one for each")
    array = np.asarray(values)
    if array.shape != (episode.steps,):
        raise ArgumentError(
            f"export: {what} of episode {episode.index} has shape {array.shape}; give {(episode.steps,)}, one per step"
        )
    return array


class Reader:
    """Replays a recording, and cuts its worlds into episodes.

    Attributes:
        note: A note on the replay, or None.
        frames: Control frames that were replayed so far.
    """

    def __init__(self, recording: str | os.PathLike[str], chosen: Layout, min_steps: int) -> None:
        self._layout, self._min_steps = chosen, min_steps
        path = checks.path("export: recording", recording, error=ArgumentError)
        self._worlds = np.asarray(chosen.worlds)
        cameras = json.dumps([camera.table() for camera in chosen.cameras])
        count = int(self._worlds.max()) + 1
        self._playback = _core.Playback(path, count, chosen.replayed, starts=True, cameras=cameras)
        self.note = self._playback.note
        self.frames = 0
        # the frames that open episodes need, and the number of the first one
        self._kept: list[_Frame] = []
        self._first = 0
        # frame in which the episode of a world begins, -1 where it has none
        self._begins = np.full(len(self._worlds), -1)
        self._index = 0

    @property
    def end(self) -> str | None:
        """Why the recording ended, once all episodes are read."""
        return self._playback.end

    def episodes(self) -> Iterator[Episode]:
        """Return the episodes in the order in which they end.

        Raises:
            RecordingError: The file cannot be read further.
        """
        everywhere = np.full(len(self._worlds), True)
        steps, faulted = np.zeros(0, np.uint64), ~everywhere
        while (arrays := self._playback.next()) is not None:
            shows = self._playback.shows
            frame = _Frame({name: array[self._worlds] for name, array in arrays.items()}, shows == "step", self.frames)
            before, steps = steps, frame.arrays["step"]
            had_faulted, faulted = faulted, frame.arrays["status"] & _FAULTED != 0
            last = self._first + len(self._kept) - 1
            if shows == "start" or last < 0:
                ended = begun = everywhere
            elif shows == "step":
                # a frozen world ends; one that the run put back to its start begins anew, a step behind that
                ended = (steps != before + 1) | had_faulted
                begun = ended & ((steps != before) | (steps == 0))
            else:
                ended = begun = steps != before
            yield from self._close(ended & (self._begins >= 0), last, ends=shows != "start")
            self.frames += frame.is_step
            frame.count = self.frames
            self._kept.append(frame)
            self._begins[ended] = -1
            self._begins[begun] = last + 1
            self._forget()
        yield from self._close(self._begins >= 0, self._first + len(self._kept) - 1, ends=False)

    def _forget(self) -> None:
        """Drop frames that no open episode has."""
        last = self._first + len(self._kept) - 1
        drop = int(self._begins[self._begins >= 0].min(initial=last)) - self._first
        # not for every frame: it moves all that are kept
        if drop > len(self._kept) // 2:
            del self._kept[:drop]
            self._first += drop

    def _close(self, which: NDArray[np.bool_], last: int, *, ends: bool) -> Iterator[Episode]:
        """Return the episodes of worlds that end with frame ``last``."""
        every = self._layout.every
        for begin in np.unique(self._begins[which]):
            frames = self._kept[begin - self._first : last + 1 - self._first]
            after = [place for place, frame in enumerate(frames) if frame.is_step and place > 0]
            if len(after) < self._min_steps:
                continue
            taken = after[::every]
            # the last frame of the dataset may be shorter than the others
            following = [*after[every - 1 :: every], *after[-1:]][: len(taken)]
            places = np.flatnonzero(which & (self._begins == begin))
            for chunk in np.array_split(places, -(-len(places) // _WORLDS_AT_ONCE)):
                blocks = {
                    name: np.stack([frame.arrays[name][chunk] for frame in frames]) for name in self._layout.replayed
                }
                for place, world in enumerate(chunk):
                    arrays = {name: block[:, place] for name, block in blocks.items()}
                    yield self._episode(
                        arrays,
                        taken,
                        following,
                        world=self._layout.worlds[world],
                        begin=frames[taken[0] - 1].count * self._layout.period,
                        ends=ends,
                    )

    def _episode(
        self,
        arrays: Mapping[str, Array],
        taken: Sequence[int],
        following: Sequence[int],
        *,
        world: int,
        begin: float,
        ends: bool,
    ) -> Episode:
        chosen, count = self._layout, len(taken)
        before = [place - 1 for place in taken]
        for field in chosen.fields:
            if image_kind(field) is not None:
                check_image(field, arrays[field])
        actions = [
            arrays[name][taken].reshape(count, -1)[:, chosen.action_places[name]] for name in chosen.action_fields
        ]
        states = [arrays[name][before].reshape(count, -1) for name in chosen.state_fields]
        dones = np.zeros(count, bool)
        dones[-1] = True
        self._index += 1
        return Episode(
            index=self._index - 1,
            world=world,
            begin=begin,
            times=np.arange(count, dtype=np.float64) * (chosen.every * chosen.period),
            observations={field: arrays[field][before] for field in chosen.fields},
            next_observations={field: arrays[field][following] for field in chosen.fields},
            actions=np.concatenate(actions, axis=1),
            states=np.concatenate(states, axis=1),
            rewards=np.zeros(count, np.float32),
            dones=dones,
            ends=ends,
        )
