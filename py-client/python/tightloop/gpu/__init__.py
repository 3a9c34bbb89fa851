"""Frames and commands in device memory, for torch, CuPy and JAX."""
