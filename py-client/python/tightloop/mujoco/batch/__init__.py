"""`Batch`: many simulations of one MuJoCo model, with the interface of PyPI's ``mjbatch``."""

from __future__ import annotations

from tightloop.mujoco.batch.simulations import Batch
from tightloop.mujoco.batch.views import Actuator, Body, Joint, Site

__all__ = ["Actuator", "Batch", "Body", "Joint", "Site"]
