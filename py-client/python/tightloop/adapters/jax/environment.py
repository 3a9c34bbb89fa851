"""A task in programs of JAX."""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from tightloop import _core
from tightloop.adapters.environment import Given, adapted_environment, library
from tightloop.adapters.jax.programs import Program, Result, token_as_given, token_of
from tightloop.adapters.jax.seeds import seeds_of_key, shown, whole_seeds
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError, SimClosed

jax = library("jax", install="jax")
jnp = library("jax.numpy", install="jax")

#: Names in the infos of a step that are no values of the task.
_OURS = ("final_obs", "final_info", "fault")
#: Calls so far of a token that fits at any time.
_ANY = 2**32 - 1


@checked_calls
class JaxEnv:
    """A `VectorEnv` whose resets and steps are part of programs of JAX, under ``jax.jit``, ``lax.scan`` and the like.

    Worlds start their next episode in the same step, so a program has no branches for it. The worlds stay in the daemon
    and the episodes in this process, so `step` is not pure: a state that was used before is an error. Each step runs
    the task in Python, with the results of `VectorEnv.step`, bit for bit.

    Errors inside of a program are JAX's ``jax.errors.JaxRuntimeError``. Its text has the name of tightloop's exception
    and its message.

    Attributes:
        env: The `VectorEnv`.
        num_envs: Number of worlds.
        observation_size: Length of an observation.
        action_size: Length of an action.
        via: How programs call: ``"ffi"``, or ``"io_callback"``.
    """

    def __init__(self, env: Given, num_envs: int | None = None, *, via: str | None = None, **options: Any) -> None:
        """Adapt an environment of the mode ``SAME_STEP``, or make one for a task.

        Args:
            env: A `VectorEnv`, or a task.
            num_envs: Number of worlds, for a task.
            via: As of `JaxSim`.
            **options: Further arguments of `VectorEnv`, for a task.

        Raises:
            ArgumentError: The environment has another autoreset mode, or an argument is not valid.
            MissingLibrary: ``via="ffi"``, and this JAX has no foreign functions.
        """
        self._program = Program(via)
        self.via = self._program.via
        self.env = adapted_environment(env, num_envs, AutoresetMode.SAME_STEP, options)
        self.num_envs: int = self.env.num_envs
        (self.observation_size,), (self.action_size,) = (
            space.shape for space in (self.env.single_observation_space, self.env.single_action_space)
        )
        self._results = self._probed()
        name = type(getattr(self.env, "task", self.env)).__name__
        self._name = f"the environment of {name}"
        shapes = ", ".join(f"{result.name} {result.dtype}{list(result.shape)}" for result in self._results)
        #: Part of the name of each call: what else can make it.
        self._kind = f"{self._name} (action {[self.num_envs, self.action_size]}, {shapes})"
        self._number = _core.xla_function(_Weak(self), self._name)

    def reset(self, seed: Any, state: Any = None) -> tuple[Any, Any]:
        """Start episodes in all worlds. They depend on the seeds alone.

        Args:
            seed: A key of ``jax.random``, or a whole number from 0 to 2**32 - 1: then world i gets the seed
                ``seed + i``, as in `VectorEnv.reset`.
            state: The state that the last step returned, if the same program stepped before. It puts the reset behind
                that step.

        Returns:
            The state, and observations, shape ``(num_envs, observation_size)``.

        Raises:
            ArgumentError: The seed is neither, or ``state`` is no state.
        """
        token = token_of(self._number, _ANY) if state is None else token_as_given(state, "state", "reset()")
        state, (obs,) = self._program.call(
            self._call_name("reset"), (), self._results[:1], token, _seeds(seed, self.num_envs)
        )
        return state, obs

    def step(self, state: Any, action: Any) -> tuple[Any, Any, Any, Any, Any, dict[str, Any]]:
        """Advance all worlds by one control step, and start the next episode in worlds whose episode ended.

        Args:
            state: The state that the last call returned.
            action: Shape ``(num_envs, action_size)``, clipped to ``env.action_space``.

        Returns:
            ``state, obs, reward, terminated, truncated, info``, worlds first. ``info["final_obs"]`` has the last
            observation of episodes that ended in this step, and ``obs`` in other worlds. ``info["fault"]`` has the bits
            of ``status`` of faulted worlds. Further entries are ``"success"`` and `Task.metrics`, of the step before a
            new episode began, and ``"privileged"`` if the task has them.

        Raises:
            ArgumentError: The action has a wrong shape or type, ``state`` is no state, or JAX differentiates or batches
                the step.
        """
        action, shape = _array(action), (self.num_envs, self.action_size)
        is_real = any(jnp.issubdtype(action.dtype, kind) for kind in (jnp.floating, jnp.integer))
        if action.shape != shape or not is_real:
            raise ArgumentError(f"action: expected real numbers of shape {shape}; got {action.dtype} of {action.shape}")
        action = action.astype(jnp.float32)
        state, made = self._program.call(
            self._call_name("step"), ("action",), self._results, token_as_given(state, "state", "reset()"), action
        )
        obs, reward, terminated, truncated, *rest = made
        names = [result.name for result in self._results[4:]]
        return state, obs, reward, terminated, truncated, dict(zip(names, rest, strict=True))

    def close(self) -> None:
        """End the simulation."""
        self.env.close()

    def _probed(self) -> list[Result]:
        """Return what a step returns, found by a reset and a step."""
        obs, _ = self.env.reset(seed=0)
        obs, reward, terminated, truncated, infos = self.env.step(
            np.zeros((self.num_envs, self.action_size), np.float32)
        )
        named = {"obs": obs, "reward": reward, "terminated": terminated, "truncated": truncated, "final_obs": obs}
        named["fault"] = np.zeros(self.num_envs, np.uint32)
        # sums of rewards are there where an episode ends alone
        further = [name for name in infos if name[0] != "_" and "/" not in name and name not in _OURS]
        named.update({name: np.asarray(infos[name]) for name in further})
        return [
            Result(name, array.shape, np.dtype(jax.dtypes.canonicalize_dtype(array.dtype)))
            for name, array in named.items()
        ]

    def _call_name(self, call: str) -> str:
        """Return the name of a call in programs, which tells the environments that can make it from others."""
        return f"{call} of {self._kind}"

    def _called(self, call: str, given: list[NDArray[Any]]) -> list[NDArray[Any]]:
        """Make a call of a program.

        Raises:
            ArgumentError: The program was made for something else than this environment.
        """
        call, _, made_for = call.partition(" of ")
        if made_for != self._kind:
            raise ArgumentError(
                f"this token is of {self._kind if made_for else self._name}; the program was made for "
                f"{made_for or 'a JaxSim'}: give each call what the last call of the same object returned"
            )
        if call == "reset":
            obs, _ = self.env.reset(seed=given[0].tolist())
            return [_as_result(obs, self._results[0])]
        obs, reward, terminated, truncated, infos = self.env.step(given[0])
        made = {"obs": obs, "reward": reward, "terminated": terminated, "truncated": truncated, **infos}
        final = obs
        if "final_obs" in infos:
            ended = infos["_final_obs"]
            final = np.where(ended[:, None], infos["final_obs"], obs)
            for name, mine in infos["final_info"].items():
                if name[0] != "_" and name in made:
                    rows = ended.reshape(-1, *[1] * (np.ndim(mine) - 1))
                    made[name] = np.where(rows, mine, made[name])
        made["final_obs"] = final
        made.setdefault("fault", np.zeros(self.num_envs, np.uint32))
        return [_as_result(made[result.name], result) for result in self._results]


class _Weak:
    """The calls of an environment, which they do not keep alive."""

    def __init__(self, env: JaxEnv) -> None:
        self._env = weakref.ref(env)

    def __call__(self, call: str, given: list[NDArray[Any]]) -> list[NDArray[Any]]:
        env = self._env()
        if env is None:
            raise SimClosed("the JaxEnv of this program was dropped; keep it as long as the program runs")
        return env._called(call, given)


def _as_result(array: Any, result: Result) -> NDArray[Any]:
    return np.ascontiguousarray(array, result.dtype)


def _array(action: Any) -> Any:
    try:
        return jnp.asarray(action)
    except (TypeError, ValueError, OverflowError):
        raise ArgumentError(f"action is {action!r:.80}; give an array of real numbers") from None


def _seeds(seed: Any, count: int) -> Any:
    """Return a seed per world, uint32."""
    drawn = seeds_of_key(seed, count)
    if drawn is not None:
        return drawn
    first = whole_seeds(seed)
    if first is None or first.shape != ():
        cure = "give a key of jax.random, or a whole number from 0 to 2**32 - 1"
        raise ArgumentError(f"reset: seed is {shown(seed)}; {cure}")
    return first + jnp.arange(count, dtype=np.uint32)
