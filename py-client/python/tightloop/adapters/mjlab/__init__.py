"""mjlab with tightloop's physics: its tasks, managers, sensors and scripts, on the CPU.

>>> from tightloop.adapters import mjlab
>>> mjlab.install()  # before mjlab is imported
>>> from mjlab.envs import ManagerBasedRlEnv

`python -m tightloop.mjlab train …` does that for mjlab's own scripts.
"""

from __future__ import annotations

from tightloop.adapters.mjlab.patching import VERSIONS, install

__all__ = ["VERSIONS", "install"]
