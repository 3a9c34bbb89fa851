"""Parts of examples/mpc.py and examples/sysid.py: problems, planners, and the identification of parameters."""
