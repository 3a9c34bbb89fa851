"""The shards of an environment: how they start, answer, and start again."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from tightloop.adapters.shard import ShardInfo
from tightloop.checks import arguments as checks
from tightloop.errors import ArgumentError, DaemonLost, LaunchError, TightloopError

#: Pause after a shard that could not start, so that a broken node is not asked all the time [s].
_RETRY_SECONDS = 1.0


@dataclass(frozen=True)
class Lost:
    """The answer of a shard that went away; ``reason`` says how."""

    reason: str


class Fleet(Protocol):
    """Processes with a `Shard` each, on any machines.

    Attributes:
        needs: What a process needs, for messages, such as ``{"CPU": 1}``.
    """

    needs: str

    def start(self, shard: int) -> None:
        """Start the process of a shard, in place of one that may still run; return at once."""
        ...

    def call(self, shard: int, method: str, *arguments: Any) -> Any:
        """Call a method of a shard, and return what `answers` takes; calls of a shard run in order."""
        ...

    def answers(self, calls: Sequence[Any], timeout: float) -> list[Any]:
        """Wait for calls at most ``timeout`` seconds; return their results, or `Lost` for those without one."""
        ...

    def stop(self, shard: int) -> None:
        """End the process of a shard at once; its calls are lost."""
        ...

    def close(self) -> None:
        """Close the environments of all shards, and end their processes."""
        ...


class Shards:
    """Calls the shards of an environment, and starts those that are lost.

    Attributes:
        rows: The worlds of each shard, as slices.
        infos: What each shard reported when it started.
    """

    def __init__(
        self,
        fleet: Fleet,
        rows: Sequence[slice],
        task: Any,
        options: Mapping[str, Any],
        *,
        launch_timeout: float,
        step_timeout: float,
    ) -> None:
        """Prepare shards, and start none.

        Args:
            fleet: Their processes.
            rows: The worlds of each shard.
            task: As of `VectorEnv`.
            options: Further arguments of `VectorEnv` in each process.
            launch_timeout: Longest time until shards have started [s].
            step_timeout: Time after which a shard without an answer is lost [s].

        Raises:
            ArgumentError: A time is not a number above 0.
        """
        self.rows, self.infos = list(rows), dict[int, ShardInfo]()
        # what the others are compared with, also after it has gone
        self._first: ShardInfo | None = None
        self._fleet, self._task, self._options = fleet, task, dict(options)
        self._launch_timeout = checks.number("launch_timeout", launch_timeout, above=0.0, error=ArgumentError)
        self._step_timeout = checks.number("step_timeout", step_timeout, above=0.0, error=ArgumentError)

    def launch(
        self, waiting: Mapping[int, str], begin: Callable[[int], tuple[Any, ...]] | None = None
    ) -> dict[int, Any]:
        """Start shards, and call a method of each; returns its results.

        Args:
            waiting: Shards, and why each does not run.
            begin: Returns the name of the method and its arguments; nothing is called if left out.

        Raises:
            LaunchError: A shard did not start in time, or differs from the others.
        """
        deadline, results = time.monotonic() + self._launch_timeout, {}
        while True:
            for shard in waiting:
                self._fleet.start(shard)
            try:
                started, lost = self._open(waiting, begin, deadline)
            except BaseException:
                # without an environment they could answer no call
                for shard in waiting:
                    self._fleet.stop(shard)
                raise
            results |= started
            if not lost:
                return results
            for shard in lost:
                self._fleet.stop(shard)
            if time.monotonic() + _RETRY_SECONDS > deadline:
                shard, reason = next(iter(lost.items()))
                raise LaunchError(
                    f"{self.worlds(shard)}: no process started for them within {self._launch_timeout:g} s ({reason}). "
                    f"It needs {self._fleet.needs}: add a node that has it free, or give a larger launch_timeout"
                )
            waiting = lost
            time.sleep(_RETRY_SECONDS)

    def _open(
        self, shards: Mapping[int, str], begin: Callable[[int], tuple[Any, ...]] | None, deadline: float
    ) -> tuple[dict[int, Any], dict[int, str]]:
        """Make the environments of shards that were started, and call a method of each, as `launch` does."""
        counts = {shard: self.rows[shard].stop - self.rows[shard].start for shard in shards}
        opens = {shard: ("open", self._task, count, self._options) for shard, count in counts.items()}
        started, lost = self.ask(opens, deadline - time.monotonic())
        self._check_alike(started)
        self.infos |= started
        if begin is not None:
            started, lost_later = self.ask({shard: begin(shard) for shard in started}, deadline - time.monotonic())
            lost |= lost_later
        return started, lost

    def send(self, calls: Mapping[int, tuple[Any, ...]]) -> dict[int, Any]:
        """Call a method of each shard in ``calls``, and return what `receive` takes."""
        return {shard: self._fleet.call(shard, *call) for shard, call in calls.items()}

    def receive(self, sent: Mapping[int, Any], timeout: float | None = None) -> dict[int, Any]:
        """Wait for the answers of calls, for ``step_timeout`` if no time is given."""
        seconds = self._step_timeout if timeout is None else max(timeout, 0.0)
        return dict(zip(sent, self._fleet.answers(list(sent.values()), seconds), strict=True))

    def sorted(self, answers: Mapping[int, Any]) -> tuple[dict[int, Any], dict[int, str]]:
        """Return the results of shards, and why others were lost; raise the first error of a shard."""
        results, lost = {}, {}
        for shard, answer in answers.items():
            if isinstance(answer, Lost):
                lost[shard] = answer.reason
            elif isinstance(answer, DaemonLost):
                lost[shard] = str(answer)
            elif isinstance(answer, TightloopError):
                place = f" on {self.infos[shard].place}" if shard in self.infos else ""
                where = f"of {self.worlds(shard)}, which this counts from 0{place}"
                raise type(answer)(f"{answer} ({where})") from answer
            else:
                results[shard] = answer
        return results, lost

    def ask(
        self, calls: Mapping[int, tuple[Any, ...]], timeout: float | None = None
    ) -> tuple[dict[int, Any], dict[int, str]]:
        """Call a method of each shard in ``calls``, wait, and return results and losses, as `sorted` does."""
        return self.sorted(self.receive(self.send(calls), timeout))

    def ask_all(self, method: str, arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Call a method of every shard; returns its results in order.

        Raises:
            DaemonLost: A shard went away.
        """
        results, lost = self.ask({shard: (method, *given) for shard, given in enumerate(arguments)})
        for shard, reason in lost.items():
            raise DaemonLost(f"{method}: {self.worlds(shard)} were lost: {reason}; the next step starts them again")
        return [results[shard] for shard in range(len(self.rows))]

    def worlds(self, shard: int) -> str:
        """Return the worlds of a shard, for messages."""
        rows = self.rows[shard]
        return f"worlds {rows.start} to {rows.stop - 1}"

    def close(self) -> None:
        """End all shards."""
        self._fleet.close()

    def _check_alike(self, started: Mapping[int, ShardInfo]) -> None:
        """Check that shards run the same version and the same scene."""
        for info in started.values():
            first = self._first = self._first or info
            if (info.version, info.model_hash) != (first.version, first.model_hash):
                raise LaunchError(
                    f"{info.place} has tightloop {info.version} and model {info.model_hash}, another node "
                    f"{first.version} and {first.model_hash}; install the same tightloop, task and robot files on all"
                )
