"""Spatial tendons of MuJoCo models in pictures: their paths, and the capsules that show them."""
