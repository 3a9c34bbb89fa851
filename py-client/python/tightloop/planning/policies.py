"""Policies from ONNX files, to be evaluated here or between the control frames of a rollout."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop import _core
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError
from tightloop.files import named as named_files
from tightloop.planning.policy_terms import Drive, Term, drives_of, terms_of

#: Most bytes of a policy's file.
_FILE_MAX = 1 << 30
#: Metadata that says what the policy sees, and what its action drives.
TERMS, DRIVES = "observation_terms", "action_drives"


@checked_calls
class Policy:
    """A multilayer perceptron from an ONNX file, with what it sees and what it drives.

    It has linear layers, activations, and constants that shift, scale or clip. Other operators are refused by name. An
    output that the policy does not need, such as a critic's, may have any.

    >>> rollout = sim.rollout(policy=tl.Policy("policy.onnx"), frames=500, inputs={"command": [0.5, 0.0, 0.0]})

    Attributes:
        path: The file.
        inputs: Number of values of an observation.
        actions: Number of values of an action.
        metadata: Texts of the file, by name.
        observe: Terms of the observation; None if neither the caller nor the file has any.
        act: What the action drives; likewise.
        clip: Lower and upper bounds of the action, shape ``(2, actions)``; None if it has none.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        observe: Sequence[Term] | None = None,
        act: Sequence[Drive] | Drive | None = None,
        clip: ArrayLike | None = None,
        output: str | None = None,
    ) -> None:
        """Read a policy.

        Args:
            path: The ONNX file.
            observe: Terms of the observation, in its order; those of the file's metadata ``observation_terms`` if left
                out.
            act: What the values of the action drive, in their order; likewise ``action_drives``.
            clip: Bounds of the action: a number for ±, ``(low, high)``, or such a pair of arrays ``(actions,)``; those
                of the metadata ``action_low`` and ``action_high`` if left out. ``numpy.inf`` for none.
            output: Output of the file with the actions; its first one if left out.

        Raises:
            ArgumentError: The file cannot be read, is no multilayer perceptron, or an argument is not valid.
        """
        self.path = checks.path("Policy: path", path, error=ArgumentError)
        if output is not None:
            output = checks.text("Policy: output", output, error=ArgumentError)
        try:
            with named_files.opened("a policy", self.path, ArgumentError, limit=_FILE_MAX) as file:
                data = file.read()
        except OSError as problem:
            raise ArgumentError(f"{self.path}: cannot be read: {problem.strerror}; give a policy as ONNX") from None
        try:
            self._network = _core.PolicyNetwork(data, os.fspath(self.path.parent), output)
        except ArgumentError as problem:
            raise ArgumentError(f"{self.path}: {problem}") from None
        self.inputs, self.actions = self._network.sizes
        self.metadata: dict[str, str] = dict(self._network.metadata)
        #: Keys of the metadata that were read
        self._read: set[str] = set()
        self.observe = self._parts("observe", observe, Term, TERMS, terms_of)
        self.act = self._parts("act", [act] if isinstance(act, Drive) else act, Drive, DRIVES, drives_of)
        self.clip = self._bounds(clip)

    def __call__(self, obs: ArrayLike) -> NDArray[np.float32]:
        """Return the actions for observations, with the bits that a rollout has, before bounds.

        Args:
            obs: Observations, shape ``(worlds, inputs)`` or ``(inputs,)``.

        Returns:
            Shape ``(worlds, actions)`` or ``(actions,)``.

        Raises:
            ArgumentError: The shape is another one, or the values are not real.
        """
        given = np.asarray(obs)
        if given.ndim not in (1, 2) or given.shape[-1] != self.inputs or given.dtype.kind not in "fiu":
            got = f"{given.dtype} of shape {given.shape}"
            raise ArgumentError(f"policy: obs is {got}; give real numbers of shape (worlds, {self.inputs})")
        rows = np.ascontiguousarray(given.reshape(-1, self.inputs), np.float32)
        return self._network.run(rows).reshape(*given.shape[:-1], self.actions)

    def __repr__(self) -> str:
        return f"Policy({os.fspath(self.path)!r}, {self._network!r})"

    def _parts(self, name: str, given: Any, kind: type[Any], key: str, read: Any) -> list[Any] | None:
        if given is None:
            text = self.metadata.get(key)
            if text is None:
                return None
            self._read.add(key)
            return read(f"{self.path}: metadata `{key}`", text)
        if isinstance(given, str) or not isinstance(given, Sequence) or not all(isinstance(x, kind) for x in given):
            raise ArgumentError(f"Policy: {name} is {given!r:.80}; give a list of {kind.__name__}s")
        if not given:
            raise ArgumentError(f"Policy: {name} is empty; give at least one {kind.__name__}")
        return list(given)

    def _bounds(self, given: Any) -> NDArray[np.float32] | None:
        what: Any = "Policy: clip"
        if given is None:
            ends = [self.metadata.get(name) for name in ("action_low", "action_high")]
            if None in ends:
                return None
            what = f"{self.path}: metadata `action_low` and `action_high`"
            given = [str(end).split(",") for end in ends]
        try:
            bounds = np.asarray(given, np.float32)
            if bounds.ndim == 0:
                bounds = np.stack([-bounds, bounds])
            bounds = np.broadcast_to(bounds if bounds.ndim == 2 else bounds[:, None], (2, self.actions))
        except (TypeError, ValueError, IndexError, OverflowError):
            bounds = np.full((2, self.actions), np.nan, np.float32)
        if not (bounds[0] <= bounds[1]).all():
            raise ArgumentError(f"{what} is {given!r:.80}; give (low, high), each a number or {self.actions} of them")
        return None if np.isinf(bounds).all() else np.ascontiguousarray(bounds)
