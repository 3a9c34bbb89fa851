"""``python -m tightloop.train TASK``: trains a policy by proximal policy optimisation.

It runs ``examples/ppo.py``, which the wheel carries; ``python -m tightloop.examples copy ppo`` copies it to change it.
"""
