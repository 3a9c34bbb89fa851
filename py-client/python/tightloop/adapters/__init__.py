"""Environments as the libraries of reinforcement learning want them; each module imports its own library.

| module | library | class or function | episodes go on |
|---|---|---|---|
| `tightloop.adapters.sb3` | Stable-Baselines3 | `Sb3VecEnv` | in the same step |
| `tightloop.adapters.rsl_rl` | rsl_rl 5 | `RslRlVecEnv` | in the same step |
| `tightloop.adapters.skrl` | skrl 2 | `SkrlEnv` | in the next step |
| `tightloop.adapters.torchrl` | torchrl | `TorchRlEnv` | when torchrl resets them |
| `tightloop.adapters.rllib` | RLlib | `register` | in the next step |

All take a `tightloop.env.VectorEnv`, or a task and what `VectorEnv` takes besides; `register` takes a task. What they
hand out belongs to the library, which may keep it or write into it: also where the environment has ``copy=False``.
"""
