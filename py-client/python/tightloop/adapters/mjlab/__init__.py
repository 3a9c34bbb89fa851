"""mjlab with tightloop's physics: its tasks, managers, sensors and scripts, on the CPU.

>>> from tightloop.adapters.mjlab import install
>>> install()  # before an environment is made
>>> from mjlab.envs import ManagerBasedRlEnv

`python -m tightloop.mjlab train …` does that for mjlab's own scripts.
"""

from __future__ import annotations

from tightloop.adapters.mjlab.patching import VERSIONS, install

__all__ = ["VERSIONS", "install"]
