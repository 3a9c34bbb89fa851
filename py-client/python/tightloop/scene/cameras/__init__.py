"""Cameras: their properties, and the checks of those that are added."""
