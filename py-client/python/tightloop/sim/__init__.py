"""A running simulation: its start, its connection, and what reads and changes it."""
