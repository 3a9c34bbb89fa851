"""A tour of what tightloop does, `tightloop demo`: torques, targets, a grasp, many worlds, a trained policy."""
