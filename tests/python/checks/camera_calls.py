"""Kinds of the arguments of `Scene.add_camera`, besides its pose."""

CAMERA = {
    "width": "count",
    "height": "count",
    "fov": "positive",
    "body": "body",
    "near": "positive",
    "far": "positive",
    "every": "count",
    "worlds": "worlds of a camera",
    "target": "triple",
    "focal": "positive pair",
    "center": "pair",
    "sees": "choice",
    "depth_noise": "noise",
    "mujoco": "label",
    "name": "name",
}
