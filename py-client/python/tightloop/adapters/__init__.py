"""Adapters of environments to reinforcement-learning libraries; each module imports its own library.

| module | library | class or function | next episode starts |
|---|---|---|---|
| `tightloop.adapters.sb3` | Stable-Baselines3 | `Sb3VecEnv` | in the same step |
| `tightloop.adapters.rsl_rl` | rsl_rl 5 | `RslRlVecEnv` | in the same step |
| `tightloop.adapters.skrl` | skrl 2 | `SkrlEnv` | in the next step |
| `tightloop.adapters.torchrl` | torchrl | `TorchRlEnv` | when torchrl resets them |
| `tightloop.adapters.rllib` | RLlib | `register` | in the next step |
| `tightloop.adapters.jax` | JAX | `JaxEnv` and `JaxSim`, inside of programs | in the same step |
| `tightloop.adapters.ray` | Ray | `RayVectorEnv`, a vector environment over the nodes of a cluster | as asked for |
| `tightloop.adapters.torchrun` | torchrun | `Rank`, with the share of the worlds of a process | as asked for |

`tightloop.adapters.mjlab` is the other way round: mjlab's own tasks on tightloop's physics.

The first four take a `tightloop.env.VectorEnv` or a `RayVectorEnv`, or a task and further arguments of `VectorEnv`.
`register` takes a task. They return copies, which the library may keep or overwrite, also if the environment has
``copy=False``.

The first four set torch's threads to 1, since several would take cores from the simulation. Their argument
``torch_threads`` sets another number, and ``torch_threads=None`` changes nothing. Ray sets the threads of RLlib's
workers itself.
"""
