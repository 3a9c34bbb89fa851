"""Models from MuJoCo: see `tightloop.Scene.from_mujoco`. The package `mujoco` reads and compiles MJCF."""
