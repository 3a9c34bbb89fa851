"""The tour `tightloop demo`: torques, targets, a grasp, many worlds, a trained policy."""
