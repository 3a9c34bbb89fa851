"""The package ``mujoco``, which an extra of tightloop installs."""

from __future__ import annotations

from typing import Any

from tightloop.optional_imports import optional_import

#: The package. Its types are made at run time, so type checkers do not know them.
mujoco: Any = optional_import(
    "mujoco",
    'a Batch needs `{}`: run `pip install "./py-client[mujoco]"` in the repository, or from a wheel with [mujoco]',
)
