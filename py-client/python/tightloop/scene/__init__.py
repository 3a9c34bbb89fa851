"""What users describe: robots, bodies, shapes, sensors, and the options of their scene."""
