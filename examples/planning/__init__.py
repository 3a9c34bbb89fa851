"""Parts of examples/mpc.py: problems and planners."""
