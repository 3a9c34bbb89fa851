"""Inverse kinematics, dynamics without a simulation, rollouts and linearization."""
