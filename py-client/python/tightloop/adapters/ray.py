"""Adapter to Ray: the worlds of one vector environment on the nodes of a Ray cluster.

>>> import ray
>>> from tightloop.adapters.ray import RayVectorEnv
>>> ray.init(address="auto")
>>> env = RayVectorEnv("FrankaReach", 3072, actors=3, num_cpus=16)
>>> obs, _ = env.reset(seed=0)
>>> obs, reward, terminated, truncated, infos = env.step(env.action_space.sample())
"""

from __future__ import annotations

import os
import pickle
from collections.abc import Mapping, Sequence
from typing import Any

from gymnasium.vector import AutoresetMode

from tightloop.adapters.environment import library
from tightloop.adapters.gathering import ranges
from tightloop.adapters.shard import Shard
from tightloop.adapters.shards import Lost
from tightloop.adapters.spread import SpreadVectorEnv
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.env.evaluation.results import OnNan
from tightloop.env.task import Task
from tightloop.errors import ArgumentError, SimClosed

ray = library("ray", install="ray")

#: Time that daemons have to end when an environment is closed; then their actors are killed [s].
_CLOSE_SECONDS = 10.0
#: Size of the pieces in which calls and results cross. Ray sends what is below 100 KiB inside its messages; through the
#: object stores of two nodes, 434 KB took 4.7 ms instead of 1.1 ms [bytes].
_PIECE_BYTES = 64_000
#: Arguments of `VectorEnv` that shards of a cluster cannot have.
_REFUSED = {
    "daemon": "each actor launches a daemon of its own",
    "render_mode": "a VectorEnv on one machine renders",
}


@checked_calls
class RayVectorEnv(SpreadVectorEnv):
    """A task in many worlds, spread over the actors of a Ray cluster, as one `gymnasium.vector.VectorEnv`.

    Each actor launches a daemon on its node and steps a contiguous range of the worlds. Results arrive in the order of
    the worlds. With the same seeds they are those of one `VectorEnv` with all worlds, bit for bit, if all nodes compute
    on the same kind of device.

    An actor that dies is started again, on any node with free resources, and so is one whose daemon or node dies.
    ``infos["restarted"]`` marks its worlds in that step: their episodes are truncated, and new ones begin. The other
    worlds go on.

    The adapters of Stable-Baselines3, rsl_rl, skrl and torchrl take it in place of a `VectorEnv`.
    """

    def __init__(
        self,
        task: Task | type[Task] | str,
        num_envs: int,
        *,
        actors: int | None = None,
        num_cpus: float = 1,
        actor_options: Mapping[str, Any] | None = None,
        launch_timeout: float = 120.0,
        step_timeout: float = 60.0,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        copy: bool = True,
        slots: int = 2,
        device: str = "auto",
        precision: str | None = None,
        threads: int | None = None,
        max_episode_steps: float | None = None,
        on_nan: OnNan = "raise",
        first_env: int = 0,
        **options: Any,
    ) -> None:
        """Start the actors and their daemons. Ray connects to a cluster first if it is not initialized.

        Args:
            task: As of `VectorEnv`. A file of a task, its robots and the module of its class must exist on every node.
            num_envs: Number of all worlds.
            actors: Number of actors; if left out, one per node that has ``num_cpus``.
            num_cpus: CPUs that Ray reserves for an actor.
            actor_options: Further options of Ray's actors, such as ``{"num_gpus": 1}`` or ``{"resources": {…}}``.
                Ray spreads actors over the nodes unless they say otherwise.
            launch_timeout: Longest time until actors have started, also those started again [s].
            step_timeout: Time after which an actor that does not answer is killed and started again [s].
            autoreset_mode: As of `VectorEnv`.
            copy: As of `VectorEnv`.
            slots: As of `VectorEnv`.
            device: As of `VectorEnv`, on each node. ``"auto"`` counts the worlds of one actor.
            precision: As of `VectorEnv`.
            threads: Largest number of threads of a step in an actor; ``num_cpus`` if left out.
            max_episode_steps: As of `VectorEnv`.
            on_nan: As of `VectorEnv`.
            first_env: As of `VectorEnv`.
            **options: Arguments of the task's class.

        Raises:
            ArgumentError: An argument is not valid; the message names it.
            LaunchError: An actor could not start in time. Other errors are those of `VectorEnv`.

        After a shutdown of Ray every call but `close` raises `SimClosed`.
        """
        for name, why in _REFUSED.items():
            if name in options:
                raise ArgumentError(f"{name}: {why}; leave it out")
        num_envs = checks.integer("num_envs", num_envs, error=ArgumentError)
        num_cpus = checks.number("num_cpus", num_cpus, least=0.0, error=ArgumentError)
        more = _actor_options(actor_options)
        threads = max(1, int(num_cpus)) if threads is None else threads
        checks.integer("threads", threads, error=ArgumentError)
        if actors is not None and checks.integer("actors", actors, error=ArgumentError) > num_envs:
            raise ArgumentError(f"actors is {actors} for {num_envs} environments; give at most one per environment")
        if not ray.is_initialized():
            ray.init()
        if actors is None:
            actors = min(_nodes_with(num_cpus), num_envs)
        super().__init__(
            task,
            num_envs,
            actors,
            _Actors(actors, {"scheduling_strategy": "SPREAD", "num_cpus": num_cpus, **more}),
            autoreset_mode=autoreset_mode,
            copy=copy,
            slots=slots,
            max_episode_steps=max_episode_steps,
            first_env=first_env,
            launch_timeout=launch_timeout,
            step_timeout=step_timeout,
            env_options={"device": device, "precision": precision, "threads": threads, "on_nan": on_nan},
            task_options=options,
        )


class _Actors:
    """The actors of an environment; those that `RayVectorEnv` starts again replace others at the same index."""

    def __init__(self, count: int, options: Mapping[str, Any]) -> None:
        needs = {"CPU": options["num_cpus"], "GPU": options.get("num_gpus", 0), **options.get("resources", {})}
        self.needs = f"{ {name: amount for name, amount in needs.items() if amount} }"
        # a call is never repeated: its worlds have moved on, or are lost
        self._kind = ray.remote(_NodeShard).options(**options, max_restarts=0, max_task_retries=0)
        self._session = ray.get_runtime_context().get_worker_id()  # of this connection to a cluster
        self._actors: list[Any] = [None] * count
        self._largest = [0] * count  # answer of each shard [bytes]

    def start(self, shard: int) -> None:
        self._check_connected()
        self.stop(shard)
        self._actors[shard] = self._kind.remote()

    def call(self, shard: int, method: str, *arguments: Any) -> Any:
        self._check_connected()
        actor, sent = self._actors[shard], ray.cloudpickle.dumps(arguments)
        if actor is None:
            return Lost("it did not start")
        # as many pieces as the largest answer so far needs; a larger one has larger pieces, which is slower
        count = _pieces_of(self._largest[shard])
        parts = actor.call.options(num_returns=count).remote(method, count, *_cut(sent, _pieces_of(len(sent))))
        return shard, [parts] if count == 1 else parts

    def answers(self, calls: Sequence[Any], timeout: float) -> list[Any]:
        self._check_connected()
        parts = [part for call in calls if not isinstance(call, Lost) for part in call[1]]
        ready = set(ray.wait(parts, num_returns=len(parts), timeout=timeout)[0]) if parts else set()
        late = Lost(f"it did not answer within {timeout:.3g} s")
        return [
            call if isinstance(call, Lost) else self._answer(*call) if ready.issuperset(call[1]) else late
            for call in calls
        ]

    def _answer(self, shard: int, parts: Sequence[Any]) -> Any:
        """Return the result of a call, or `Lost`; an error of the task's own code is raised."""
        try:
            answer = b"".join(ray.get(parts))
        except ray.exceptions.RayTaskError:
            raise
        except (ray.exceptions.LocalRayletDiedError, ray.exceptions.RuntimeEnvSetupError):
            raise  # the node of this process, or options that no actor can start with
        except ray.exceptions.RayError as problem:
            return Lost(f"{type(problem).__name__}: {str(problem).splitlines()[0]}")
        self._largest[shard] = max(self._largest[shard], len(answer))
        return pickle.loads(answer)

    def stop(self, shard: int) -> None:
        actor, self._actors[shard] = self._actors[shard], None
        if actor is not None:
            ray.kill(actor)

    def close(self) -> None:
        # Ray has ended the actors, if it was shut down before the environment
        if not self._is_connected():
            return
        closing = [actor.close.remote() for actor in self._actors if actor is not None]
        if closing:
            ray.wait(closing, num_returns=len(closing), timeout=_CLOSE_SECONDS)
        for shard in range(len(self._actors)):
            self.stop(shard)

    def _is_connected(self) -> bool:
        return ray.is_initialized() and ray.get_runtime_context().get_worker_id() == self._session

    def _check_connected(self) -> None:
        """Refuse calls after a shutdown of Ray: its functions would silently start another cluster."""
        if not self._is_connected():
            raise SimClosed("Ray was shut down, and the actors with it; close this environment, and make another one")


class _NodeShard(Shard):
    """A shard that knows its node, and whose calls cross in pieces."""

    def call(self, method: str, count: int, *pieces: bytes) -> bytes | list[bytes]:
        """Call a method with pickled arguments in pieces; returns its pickled result in ``count`` pieces."""
        answer = pickle.dumps(getattr(self, method)(*pickle.loads(b"".join(pieces))), protocol=pickle.HIGHEST_PROTOCOL)
        return answer if count == 1 else _cut(answer, count)

    def pid(self) -> int:
        """Return the number of the process."""
        return os.getpid()

    def place(self) -> str:
        return f"node {ray.get_runtime_context().get_node_id()} ({ray.util.get_node_ip_address()})"


def _pieces_of(size: int) -> int:
    """Return the number of pieces in which bytes are sent."""
    return max(1, -(-size // _PIECE_BYTES))


def _cut(data: bytes, count: int) -> list[bytes]:
    """Return bytes in pieces of about the same size."""
    return [data[rows] for rows in ranges(len(data), count)]


def _actor_options(given: Mapping[str, Any] | None) -> dict[str, Any]:
    """Check options of Ray's actors.

    Raises:
        ArgumentError: They are no dict, or one is set elsewhere.
    """
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise ArgumentError(f"actor_options is {given!r}; give a dict, such as {{'num_gpus': 1}}")
    for name, cure in (("num_cpus", "give num_cpus itself"), ("max_restarts", "lost actors are always started again")):
        if name in given:
            raise ArgumentError(f"actor_options has {name!r}; leave it out: {cure}")
    return dict(given)


def _nodes_with(cpus: float) -> int:
    """Return the number of nodes with as many CPUs.

    Raises:
        ArgumentError: There is none.
    """
    most = [node["Resources"].get("CPU", 0.0) for node in ray.nodes() if node["Alive"]]
    count = sum(has >= cpus for has in most)
    if not count:
        raise ArgumentError(f"num_cpus is {cpus:g}, and no node of the cluster has more than {max(most):g}; give less")
    return count
