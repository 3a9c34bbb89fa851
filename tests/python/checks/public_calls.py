"""The public callables of the Python API with the kinds of their arguments, and the properties that can be set."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from camera_calls import CAMERA
from public_call import Call
from public_env_calls import DATASET_CALLS, DATASET_LEFT, ENV_CALLS, ENV_LEFT, VIEW_CALLS, VIEW_LEFT
from wrong_values import BALL, COMMANDS, OF_MODELS, POSE, SHAPE, START, SURFACE

import tightloop as tl
from conftest import URDF


def of_scene(name: str, kinds: Mapping[str, str], /, **right: Any) -> Call:
    """A method of a scene, which is another one for each case."""
    return Call(lambda world: getattr(world.scene(), name), kinds, right)


def with_arm() -> tl.Scene:
    """A scene of an arm alone."""
    scene = tl.Scene()
    scene.add_urdf(URDF, name="arm")
    return scene


MANY = "any values: a set of names that only a few models have; tests/python/mujoco tries them"
CALLS: dict[str, Call] = {
    "Scene": Call(
        lambda _: tl.Scene,
        {
            "dt": "positive",
            "substeps": "count",
            "gravity": "triple",
            "contacts_max": "optional count",
            "rows_max": "optional count",
            "params": "list of names",
            "command_delay_max": "optional count",
            "friction_combine": "choice",
        },
    ),
    "Scene.add_urdf": of_scene(
        "add_urdf",
        POSE
        | SURFACE
        | {
            "path": "path",
            "name": "name",
            "floating": "flag",
            "self_collisions": "flag",
            "strict": "flag",
            "mesh_max_hull_vertices": "count",
            "convex_decomposition": "flag",
            "collada_up_axis": "flag",
            "package_dirs": "names",
        },
        path=URDF,
        name="other",
    ),
    "Scene.add_box": of_scene("add_box", SHAPE | {"half_extents": "positive triple"}, half_extents=(1, 1, 1)),
    "Scene.add_sphere": of_scene("add_sphere", SHAPE | {"radius": "positive"}, radius=1.0),
    "Scene.add_cylinder": of_scene(
        "add_cylinder", SHAPE | {"radius": "positive", "half_height": "positive"}, radius=1.0, half_height=1.0
    ),
    "Scene.add_ellipsoid": of_scene("add_ellipsoid", SHAPE | {"radii": "positive triple"}, radii=(1, 1, 1)),
    "Scene.add_capsule": of_scene(
        "add_capsule", SHAPE | {"radius": "positive", "half_height": "positive"}, radius=1.0, half_height=1.0
    ),
    "Scene.add_mesh": of_scene(
        "add_mesh",
        SHAPE | {"path": "path", "scale": "scale", "max_hull_vertices": "count", "convex_decomposition": "flag"},
        path="",  # a file of the fixture's
    ),
    "Scene.add_hfield": of_scene(
        "add_hfield",
        POSE | SURFACE | {"elevation": "elevation", "size": "positive pair", "base": "positive", "name": "name"},
        elevation=np.zeros((4, 4)),
        size=(1.0, 1.0),
    ),
    "Scene.add_plane": of_scene("add_plane", POSE | SURFACE | {"name": "name"}),
    "Scene.add_ground": of_scene("add_ground", SURFACE | {"z": "number", "name": "name"}),
    "Scene.add_table": of_scene("add_table", SURFACE | {"name": "name"}),
    "Scene.add_cube": of_scene("add_cube", POSE | SURFACE | {"name": "name"}, name="other"),
    "Scene.add_body": of_scene(
        "add_body",
        POSE | {"mass": "positive", "com": "triple", "inertia": "inertia", "fixed": "flag", "name": "name"},
        mass=1.0,
    ),
    "Scene.add_site": of_scene(
        "add_site", POSE | {"body": "body", "relative_to": "body", "damping": "positive", "name": "name"}
    ),
    "Scene.add_contact_sensor": of_scene(
        "add_contact_sensor", {"of": "collidable", "name": "name", "against": "optional collidable"}, of="cube"
    ),
    "Scene.add_height_scan": of_scene(
        "add_height_scan",
        {
            "body": "body",
            "pos": "triple",
            "size": "positive pair",
            "shape": "pair of counts",
            "reach": "positive",
            "name": "name",
        },
    ),
    "Scene.add_camera": of_scene("add_camera", POSE | CAMERA, width=8, height=8),
    "Scene.filter_contacts": of_scene("filter_contacts", {"a": "collidable", "b": "collidable"}, a="cube", b="cube"),
    "Scene.randomize": of_scene(
        "randomize",
        {
            "joint_q": "joints",
            "joint_qd": "joints",
            "body_q": "bodies",
            "body_qd": "bodies",
            "params": "ranges",
            "cameras": "bodies",
        },
    ),
    "Scene.solver": of_scene(
        "solver",
        {
            "iterations": "count",
            "ls_iterations": "count",
            "tolerance": "least 0",
            "cone": "choice",
            "impratio": "positive",
        },
    ),
    "Scene.save": of_scene("save", {"path": "new file"}),
    "Scene.to_mujoco": of_scene("to_mujoco", {"path": "new file"}),
    "Scene.load": of_scene("load", {"path": "path"}),
    "Scene.from_toml": of_scene("from_toml", {"text": "toml", "folder": "text"}, text="dt = 0.001\nsubsteps = 1"),
    "Scene.from_mujoco": of_scene(
        "from_mujoco",
        {
            "model": "model",
            "name": "name",
            "substeps": "count",
            "mesh_max_hull_vertices": "count",
            "without": "names",
        },
        model=BALL,
    ),
    "Scene.add_mujoco": of_scene(
        "add_mujoco",
        POSE | {"model": "model", "name": "name", "mesh_max_hull_vertices": "count", "without": "names"},
        model=BALL,
    ),
    "Robot.order": Call(lambda world: world.scene().robots["arm"].order, {"names": "order"}),
    "JointOrder.read": Call(lambda world: world.order.read, {"values": "ordered"}),
    "JointOrder.write": Call(lambda world: world.order.write, {"values": "ordered"}),
    "Robot.add_position_actuators": Call(
        lambda world: world.scene().robots["arm"].add_position_actuators,
        {"joints": "joint names", "stiffness": "positive", "damping": "least 0", "effort_limit": "positive or inf"},
        {"stiffness": 1.0, "damping": 1.0},
    ),
    "Robot.link": Call(lambda world: world.scene().robots["arm"].link, {"name": "link"}),
    "Uniform": Call(lambda _: tl.Uniform, {"low": "number", "high": "number"}, {"low": 0.0, "high": 1.0}),
    "Normal": Call(lambda _: tl.Normal, {"mean": "number", "std": "least 0"}, {"mean": 0.0, "std": 1.0}),
    "Dynamics": Call(lambda _: tl.Dynamics, {"scene": "scene"}),
    "Dynamics.forward_kinematics": Call(lambda world: world.dynamics.forward_kinematics, {"joint_q": "coordinates"}),
    "Dynamics.body_velocity": Call(
        lambda world: world.dynamics.body_velocity,
        {"joint_q": "coordinates", "joint_qd": "velocities"},
        {"joint_q": START, "joint_qd": np.zeros(15)},
    ),
    "Dynamics.body_jacobian": Call(lambda world: world.dynamics.body_jacobian, {"joint_q": "coordinates"}),
    "Dynamics.mass_matrix": Call(lambda world: world.dynamics.mass_matrix, {"joint_q": "coordinates"}),
    "Dynamics.inverse_dynamics": Call(
        lambda world: world.dynamics.inverse_dynamics,
        {"joint_q": "coordinates", "joint_qd": "velocities", "joint_qdd": "velocities", "damping": "flag"},
        {"joint_q": START},
    ),
    "launch": Call(
        lambda _: tl.launch,
        {
            "scene": "scene",
            "worlds": "count",
            "groups": "count",
            "device": "choice",
            "precision": "choice",
            "cpu_bits": "flag",
            "threads": "count",
            "fields": "fields",
            "params": "fields",
            "bounds": "bounds",
            "on_fault": "choice",
            "on_nan": "choice",
            "draws": "choice",
            "outputs_at": "choice",
            "name": "label",
            "log": "new file",
            "frames_held": "count",
            "watch_worlds": "count",
            "realtime": "positive",
        },
        {"scene": tl.Scene(), "worlds": 1},
    ),
    "RealTime": Call(
        lambda _: tl.RealTime,
        {
            "factor": "positive",
            "late": "choice",
            "command_timeout": "positive",
            "cores": "cores",
            "priority": "priority",
            "lock_memory": "flag",
        },
    ),
    "attach": Call(lambda _: tl.attach, {"name": "label", "timeout": "at least 0 or inf"}, {"name": "nowhere"}),
    "Sim.step": Call(lambda world: world.sim.step, COMMANDS | OF_MODELS | {"body_f": "values"}),
    "Sim.send": Call(
        lambda world: world.send,
        COMMANDS | OF_MODELS | {"body_f": "values"},
    ),
    "Sim.write": Call(
        lambda world: world.sim.write,
        {"joint_q": "coordinates", "joint_qd": "command", "act": "values", "mask": "mask"} | OF_MODELS,
    ),
    "Sim.reset": Call(
        lambda world: world.sim.reset,
        {"mask": "mask", "seed": "seed", "keyframe": "keyframe", "joint_q": "coordinates", "joint_qd": "command"},
    ),
    "Sim.latest": Call(lambda world: world.sim.latest, {"timeout": "least 0"}),
    "Sim.restore": Call(lambda world: world.restore, {"snapshot": "snapshot", "worlds": "mask", "from_world": "index"}),
    "Sim.copy_from": Call(
        lambda world: world.sim.copy_from,
        {"source": "snapshot", "world": "index", "mask": "mask"},
    ),
    "Sim.forward_kinematics": Call(lambda world: world.sim.forward_kinematics, {"joint_q": "coordinates"}),
    "Sim.inverse_dynamics": Call(
        lambda world: world.sim.inverse_dynamics,
        {"joint_q": "coordinates", "joint_qd": "velocities", "joint_qdd": "velocities", "damping": "flag"},
        {"joint_q": START},
    ),
    "Sim.rays": Call(
        lambda world: world.sim.rays,
        {},
        {},
        {name: MANY for name in ("pnt", "vec", "geomgroup", "flg_static", "bodyexclude", "frame")},
    ),
    "Sim.ik": Call(
        lambda world: world.sim.ik,
        {"objectives": "daemon objectives", "joints": "names", "limits": "flag"},
        {"objectives": tl.Reach("arm/fr3_hand")},
    ),
    "Sim.view": Call(
        lambda world: world.sim.view, {"port": "port", "worlds": "count", "open": "flag", "hosts": "hosts"}
    ),
    "Sim.record": Call(
        lambda world: world.sim.record,
        {"path": "new file", "fields": "list of names", "force": "flag"},
        {"path": "/nowhere/run.tlrec"},
    ),
    "Sim.picture": Call(
        lambda world: world.sim.picture,
        {"worlds": "some worlds", "camera": "camera", "size": "size", "frame": "frame"},
    ),
    "Sim.rollout": Call(
        lambda world: world.sim.rollout,
        {},
        {},
        {
            name: "forms of its own: test_rollout.py tries them"
            for name in ("commands", "fields", "start", "cost", "out")
        }
        | {
            name: "forms of its own: test_policy_rollout.py tries them"
            for name in ("policy", "frames", "inputs", "memory")
        },
    ),
    "Policy": Call(
        lambda _: tl.Policy,
        {},
        {},
        {
            name: "forms of its own: test_policy_rollout.py tries them"
            for name in ("path", "observe", "act", "clip", "output")
        },
    ),
    "Drive": Call(
        lambda _: tl.Drive,
        {},
        {},
        {
            name: "forms of its own: test_policy_rollout.py tries them"
            for name in ("command", "of", "scale", "offset", "low", "high", "values", "followers")
        },
    ),
    "ik": Call(
        lambda _: tl.ik,
        {"scene": "scene", "objectives": "objectives", "joints": "names", "limits": "flag"},
        {"scene": with_arm(), "objectives": tl.Reach("arm/fr3_hand")},
    ),
    "Reach": Call(
        lambda _: tl.Reach,
        {
            "frame": "text",
            "position": "points",
            "orientation": "quaternions",
            "position_weight": "weights",
            "orientation_weight": "weights",
            "relative_to": "text",
        },
        {"frame": "arm/fr3_hand"},
    ),
    "Posture": Call(lambda _: tl.Posture, {"joint_q": "rows", "weight": "posture weight"}),
    "IkSolver.solve": Call(
        lambda world: world.ik.solve,
        {
            "position": "points",
            "orientation": "quaternions",
            "joint_q": "coordinates",
            "iterations": "count",
            "restarts": "index",
            "tolerance": "positive pair",
            "seed": "seed",
            "precision": "choice",
            "threads": "count",
        },
        {"position": (0.4, 0.0, 0.4), "orientation": (1.0, 0.0, 0.0, 0.0)},
    ),
    "linearize": Call(
        lambda _: tl.linearize,
        {"eps": "positive", "centered": "flag", "sensors": "flag"},
        {},
        dict.fromkeys(
            ("sim", "worlds", "controls", "commands", "states", "planner"),
            "forms of its own: tests/python/mujoco/models/test_linearize.py tries them",
        ),
    ),
    "Params.write": Call(
        lambda world: world.sim.params.write, {"gravity": "vectors", "shape_mu": "values", "mask": "mask"}
    ),
    "Snapshot.from_bytes": Call(lambda _: tl.Snapshot.from_bytes, {"data": "bytes"}),
    "Snapshot.load": Call(lambda _: tl.Snapshot.load, {"path": "path"}),
    "Snapshot.save": Call(lambda world: world.snapshot.save, {"path": "new file"}),
}
#: Properties, by class, and how to get an object of it.
SETTERS: dict[str, tuple[Callable[[Any], Any], dict[str, str]]] = {
    "Scene": (
        lambda world: world.scene(),
        {
            "dt": "positive",
            "substeps": "count",
            "gravity": "triple",
            "contacts_max": "optional count",
            "rows_max": "optional count",
            "params": "list of names",
            "command_delay_max": "optional count",
            "friction_combine": "choice",
        },
    ),
    "Robot": (
        lambda world: world.scene().robots["arm"],
        POSE
        | {
            "joint_q": "of dofs",
            "joint_target_q": "of dofs",
            "joint_target_qd": "of dofs",
            "joint_target_mode": "modes",
            "joint_target_ke": "of dofs",
            "joint_target_kd": "of dofs",
            "joint_effort_limit": "of dofs",
            "joint_limit_ke": "of dofs",
            "joint_limit_kd": "of dofs",
            "joint_armature": "of dofs",
            "self_collisions": "flag",
        },
    ),
    "Body": (
        lambda world: world.scene().bodies["cube"],
        POSE | {"mass": "positive", "com": "triple", "inertia": "inertia", "fixed": "flag"},
    ),
    "Params": (lambda world: world.sim.params, {"gravity": "vectors", "shape_mu": "values"}),
}
#: Public names that are not called with arguments of a user's, and why.
LEFT = {
    "Body": "Scene.add_body makes it",
    "ContactSensor": "Scene.add_contact_sensor makes it",
    "Frame": "Sim.step makes it",
    "FrameCopy": "Frame.copy makes it",
    "Groups": "launch makes it",
    "IkResult": "IkSolver.solve makes it",
    "IkSolver": "ik makes it",
    "JointOrder": "Robot.order makes it",
    "Linearization": "linearize makes it",
    "Link": "Robot.link makes it",
    "RayHits": "Sim.rays makes it",
    "Robot": "Scene.add_urdf makes it",
    "Recording": "Sim.record makes it",
    "Rollout": "Sim.rollout makes it",
    "Shape": "Scene.add_box makes it",
    "Sim": "launch makes it",
    "Site": "Scene.add_site makes it",
    "Snapshot": "Sim.snapshot makes it",
    "Timing": "Sim.timing makes it",
    "Surface": "types of keyword arguments",
}

CALLS |= ENV_CALLS | VIEW_CALLS | DATASET_CALLS
SETTERS["VectorEnv"] = (lambda world: world.envs, {"elapsed": "elapsed"})
LEFT |= ENV_LEFT | VIEW_LEFT | DATASET_LEFT
