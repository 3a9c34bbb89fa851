"""tightloop in JAX: simulations and environments inside of programs that ``jax.jit`` compiles.

>>> import jax, tightloop as tl
>>> from tightloop.adapters.jax import JaxSim
>>> sim = JaxSim(tl.launch(scene, worlds=64), fields=("joint_q", "joint_qd"))
>>> run = jax.jit(lambda token, targets: jax.lax.scan(lambda t, x: sim.step(t, joint_target_q=x), token, targets))
>>> token, frames = run(sim.token(), targets)  # targets (steps, worlds, dofs), frames.joint_q (steps, worlds, coords)

`JaxSim` steps a simulation, `JaxEnv` a task, and `views` shows a frame as arrays of JAX without a copy. Programs run on
the CPU, and call tightloop through XLA's foreign function interface.
"""

from __future__ import annotations

from tightloop.adapters.jax.environment import JaxEnv
from tightloop.adapters.jax.simulation import JaxSim, views

__all__ = ["JaxEnv", "JaxSim", "views"]
