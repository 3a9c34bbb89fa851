"""Wrong values by kind of argument, and the public callables of the Python API with the kinds of their arguments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import tightloop as tl
from conftest import REPOSITORY, URDF
from tightloop import env, view

NAN, INF = float("nan"), float("inf")


class Thing:
    """A value of a type that nothing takes."""

    def __repr__(self) -> str:
        return "Thing()"


THING = Thing()
#: Positions of the arm and the cube.
START = np.array([*np.zeros(15), 1.0])
BALL = REPOSITORY / "examples/assets/cart/cart.xml"
UNIFORM = tl.Uniform(0.0, 1.0)

NUMBER = ("text", [1.0, 2.0], {}, 1j, NAN, THING, b"1")
FINITE = (*NUMBER, INF, -INF)
TRIPLE = (3.0, "abc", (1, 2), (1, 2, 3, 4), (1, NAN, 2), (1, INF, 2), ("a", "b", "c"), [[1, 2, 3]], {}, THING)
COUNT = (0, -1, 1.5, "3", NAN, [1], 2**70, THING, {})
NAME = ("", "a b", "a/b", 3, b"x", "-x", [], "ä", THING, 1.5)
TEXT = (3, b"x", [], {}, THING, 1.5, "a\0b")
NAMES = ("joint_q", 3, [3], [None], ["nonsense"], THING, [["joint_q"]], ["a,b"])
PATH = (3, b"x", [], "a\0b", "/nowhere/x.y", THING, 1.5)
FLAG = ("no", 2, [True], NAN, THING, "True", -1, {})
JOINTS = ("abc", 3, {3: UNIFORM}, {"nowhere": UNIFORM}, {"arm/nothing": UNIFORM}, {"arm": 1.0}, {"arm/": UNIFORM}, [1])
BODIES = ("abc", 3, {3: {}}, {"nowhere": {"x": UNIFORM}}, {"cube": {"up": UNIFORM}}, {"cube": {"x": 1.0}}, {"arm": {}})
MASK = (
    [1, 0],
    "abc",
    3,
    np.zeros(5, bool),
    np.zeros((2, 2), bool),
    np.array([1.0, 0.0]),
    THING,
    [[True], [True, False]],
)
#: Arrays of two worlds and 15 columns.
ARRAY = (
    "abc",
    THING,
    np.zeros(3),
    np.zeros((3, 15)),
    np.zeros((2, 14)),
    np.zeros((1, 2, 15)),
    np.full((2, 15), NAN),
    np.full(15, INF),
    np.full(15, 1j),
    np.zeros(15, bool),
    [[1.0], [1.0, 2.0]],
    [None] * 15,
    ["a"] * 15,
    b"abc",
)
COMMAND = (
    *ARRAY,
    np.zeros(9),
    {"nobody": np.zeros(9)},
    {"arm": np.zeros(8)},
    {3: np.zeros(9)},
    {"arm": "abc"},
    {"arm": None},
)
QUATERNION = (3.0, "abc", (0, 0, 1), (0, 0, 0, 0), (0, 0, 0, 2), (NAN, 0, 0, 1), (90, 0, 0, 1), {}, THING, ("a",) * 4)

KINDS: dict[str, tuple[Any, ...]] = {
    "number": FINITE,
    "positive": (*FINITE, 0.0, -1.0),
    "least 0": (*FINITE, -1.0),
    "at least 0 or inf": (*NUMBER, -1.0, -INF),
    "count": COUNT,
    "optional count": COUNT,
    "index": tuple(value for value in COUNT if value != 0),
    "triple": TRIPLE,
    "positive triple": (*TRIPLE, (0.0, 1, 1), (-1, 1, 1)),
    "quaternion": QUATERNION,
    "name": NAME,
    # of a daemon
    "label": ("", "a b", "a/b", 3, b"x", [], "ä", THING, 1.5),
    "text": TEXT,
    "names": NAMES,
    # the daemon knows which there are
    "list of names": NAMES[:4],
    "choice": ("nonsense", 3, [], "", THING, 1.5, b"max"),
    "path": PATH,
    "new file": (3, b"x", [], "a\0b", "/nowhere/x.toml", THING, 1.5),
    "flag": FLAG,
    "body": (3, "nowhere", THING, "arm", "arm/nowhere", [], "cube/x", 1.5),
    "collidable": (3, "nowhere", THING, "arm/nowhere", [], None, 1.5),
    "optional collidable": (3, "nowhere", THING, "arm/nowhere", [], "cube/x", 1.5),
    "inertia": (
        "abc",
        (1, 2),
        np.zeros((2, 3)),
        [[1, 2, 3], [4, 5, 6], [7, 8, 9]],
        (NAN, 1, 1),
        THING,
        ("a", "b", "c"),
    ),
    "scale": ("abc", (1, 2), 0.0, (1, 0, 1), NAN, THING, {}, (NAN, 1, 1)),
    "condim": (0, 2, 4, 6, 1.5, "3", THING, -1),
    "group": (1.5, "a", 2**40, THING, NAN, -(2**40)),
    "joints": JOINTS,
    "bodies": BODIES,
    "ranges": ("abc", 3, {3: UNIFORM}, {"shape_mu": 1.0}, {"shape_mu": {"cube": 0.5}}, {"shape_mu": {3: UNIFORM}}, [1]),
    "mask": MASK,
    "seed": (-1, 1.5, "abc", [1], 2**64, True, NAN, THING, [1, -1], [1, "a"]),
    "command": COMMAND,
    "coordinates": (*ARRAY, np.zeros(14), np.zeros(12)),
    # many states may have as many rows
    "velocities": (*ARRAY[:3], *ARRAY[4:]),
    "values": (*ARRAY[:8], "a", THING),
    "vectors": (
        "abc",
        THING,
        np.zeros(4),
        np.zeros((3, 3)),
        np.full(3, NAN),
        [None] * 3,
        np.zeros(3, bool),
        (0, INF, 0),
    ),
    "options": (
        {"mask": np.ones(2, bool)},
        {"reset_mask": [True, True]},
        {"reset_mask": np.zeros(2, bool)},
        3,
        "abc",
        [1],
    ),
    "actions": (
        "abc",
        np.zeros(3),
        np.zeros((3, 1)),
        np.zeros((2, 2)),
        [[None], [None]],
        THING,
        np.zeros((2, 1), complex),
    ),
    "fields": ("joint_q", 3, [3], ["nonsense"], THING, ["joint_q", "nonsense"]),
    "bounds": (
        "abc",
        3,
        {"nonsense": 1.0},
        {"joint_q": -1.0},
        {"joint_q": NAN},
        {"joint_qd": "fast"},
        {"joint_q": None},
        [1],
    ),
    "of dofs": (
        "abc",
        THING,
        np.zeros(8),
        np.zeros((2, 9)),
        np.full(9, NAN),
        np.full(9, 1j),
        [[1], [1, 2]],
        ["a"] * 9,
        [None] * 9,
        {"nothing": 1.0},
        {"(": 1.0},
        {3: 1.0},
        {"fr3_joint1": NAN},
        {"fr3_joint1": "a"},
        {"fr3_joint1": [1, 2]},
        {"fr3_joint.": 1.0, ".*joint1": 2.0},
    ),
    "modes": ("force", 3, ["position"], ["force"] * 9, THING, {"nothing": "both"}, {"fr3_joint1": "force"}, None),
    "order": ("abc", 3, [], ["nowhere"], [3], THING, ["fr3_joint1"] * 9, ["fr3_joint1"], None),
    "ordered": ("abc", THING, np.zeros(8), np.zeros((2, 15)), 3.0, [None] * 9, [[1.0], [1.0, 2.0]]),
    "dofs": ("arm/fr3_joint1", 3, [], [3], THING, [["arm/fr3_joint1"]]),
    "observed bound": ("abc", [1.0, 2.0, 3.0], THING, NAN),
    "scene": (3, "abc", THING, None, {}),
    "snapshot": (3, "abc", THING, None, b"abc"),
    "task": ("nothing", 3, THING, "file.py:Nothing", dict, "tightloop/Nothing-v0", None, []),
    "link": ("nowhere", 3, THING, None, "", b"x"),
    "camera": ("nowhere", 3, THING, []),
    "size": ((8, 8), "abc", 3, (640,), (640, 480, 1), (1.5, 480), (-1, 480), THING, ("a", "b")),
    "some worlds": (0, -1, 1.5, "abc", [5], [0.5], THING, []),
    "keyframe": ("nowhere", 3, THING, 1.5, -1),
    "frame": (3, "abc", THING, []),
    "hosts": ("localhost", [3], ["a b"], 3),
    "port": (0, -1, 70000, 1.5, "8080", THING),
    "model": ("/nowhere/x.xml", 3, THING, None, b"x"),
    "toml": (
        "<robot/>",
        "dt = 'a'",
        "nothing = 1",
        "dt = ",
        3,
        THING,
        b"x",
        "dt = -1.0\nsubsteps = 1",
        "[[robot]]\nname = 3",
    ),
    "bytes": (3, "abc", THING, b"", b"abc", b"\0" * 200),
}
#: Contact parameters of shapes.
SURFACE = {
    "mu": "least 0",
    "ke": "positive",
    "kd": "positive",
    "kf": "positive",
    "margin": "least 0",
    "gap": "least 0",
    "condim": "condim",
    "group": "group",
}
POSE = {"pos": "triple", "quat": "quaternion"}
SHAPE = POSE | {"body": "body", "name": "name", "density": "positive"} | SURFACE
COMMANDS = {name: "command" for name in ("joint_f", "joint_target_q", "joint_target_qd")}
#: Arguments that stand for something that no model of the scene has.
OF_MODELS = {name: "values" for name in ("ctrl", "mocap_pos", "mocap_quat", "eq_active")}


@dataclass(frozen=True)
class Call:
    """A callable, with arguments that are right, and the kinds of those that are tried wrong.

    Attributes:
        make: Returns the callable, from what the fixture made.
        kinds: Kind by argument.
        right: Arguments that are needed besides.
        left: Arguments that are not tried, with the reason.
    """

    make: Callable[[Any], Callable[..., Any]]
    kinds: Mapping[str, str]
    right: Mapping[str, Any] = field(default_factory=dict)
    left: Mapping[str, str] = field(default_factory=dict)


def of_scene(name: str, kinds: Mapping[str, str], /, **right: Any) -> Call:
    """A method of a scene, which is another one for each case."""
    return Call(lambda world: getattr(world.scene(), name), kinds, right)


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
    "Scene.add_capsule": of_scene(
        "add_capsule", SHAPE | {"radius": "positive", "half_height": "positive"}, radius=1.0, half_height=1.0
    ),
    "Scene.add_mesh": of_scene(
        "add_mesh",
        SHAPE | {"path": "path", "scale": "scale", "max_hull_vertices": "count", "convex_decomposition": "flag"},
        path="",  # a file of the fixture's
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
    "Scene.filter_contacts": of_scene("filter_contacts", {"a": "collidable", "b": "collidable"}, a="cube", b="cube"),
    "Scene.randomize": of_scene(
        "randomize",
        {"joint_q": "joints", "joint_qd": "joints", "body_q": "bodies", "body_qd": "bodies", "params": "ranges"},
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
    "Scene.load": of_scene("load", {"path": "path"}),
    "Scene.from_toml": of_scene("from_toml", {"text": "toml", "folder": "text"}, text="dt = 0.001\nsubsteps = 1"),
    "Scene.from_mujoco": of_scene(
        "from_mujoco",
        {"model": "model", "name": "name", "substeps": "count", "mesh_max_hull_vertices": "count"},
        model=BALL,
    ),
    "Scene.add_mujoco": of_scene(
        "add_mujoco", POSE | {"model": "model", "name": "name", "mesh_max_hull_vertices": "count"}, model=BALL
    ),
    "Robot.order": Call(lambda world: world.scene().robots["arm"].order, {"names": "order"}),
    "JointOrder.read": Call(lambda world: world.order.read, {"values": "ordered"}),
    "JointOrder.write": Call(lambda world: world.order.write, {"values": "ordered"}),
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
            "threads": "count",
            "fields": "fields",
            "params": "fields",
            "bounds": "bounds",
            "on_fault": "choice",
            "on_nan": "choice",
            "draws": "choice",
            "name": "label",
            "log": "new file",
            "frames_held": "count",
            "watch_worlds": "count",
        },
        {"scene": tl.Scene(), "worlds": 1},
    ),
    "attach": Call(lambda _: tl.attach, {"name": "label"}),
    "Sim.step": Call(lambda world: world.sim.step, COMMANDS | OF_MODELS | {"body_f": "values"}),
    "Sim.send": Call(
        lambda world: world.send,
        COMMANDS | OF_MODELS | {"body_f": "values"},
    ),
    "Sim.write": Call(
        lambda world: world.sim.write,
        {"joint_q": "coordinates", "joint_qd": "command", "act": "values", "mask": "mask"} | OF_MODELS,
    ),
    "Sim.reset": Call(lambda world: world.sim.reset, {"mask": "mask", "seed": "seed", "keyframe": "keyframe"}),
    "Sim.latest": Call(lambda world: world.sim.latest, {"timeout": "least 0"}),
    "Sim.restore": Call(lambda world: world.restore, {"snapshot": "snapshot", "worlds": "mask", "from_world": "index"}),
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
    "Sim.view": Call(
        lambda world: world.sim.view, {"port": "port", "worlds": "count", "open": "flag", "hosts": "hosts"}
    ),
    "Sim.picture": Call(
        lambda world: world.sim.picture,
        {"worlds": "some worlds", "camera": "camera", "size": "size", "frame": "frame"},
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
    "JointOrder": "Robot.order makes it",
    "Link": "Robot.link makes it",
    "RayHits": "Sim.rays makes it",
    "Robot": "Scene.add_urdf makes it",
    "Shape": "Scene.add_box makes it",
    "Sim": "launch makes it",
    "Site": "Scene.add_site makes it",
    "Snapshot": "Sim.snapshot makes it",
    "Surface": "types of keyword arguments",
}

KINDS |= {
    "steps": (0, -1, 1.5, "abc", NAN, True, THING, [1]),
    "env seed": (-1, 1.5, "abc", [1], 2**64, True, NAN, THING, [1, -1], [1, "a"]),
    "slots": (1, *COUNT),
    "single seed": (-1, 1.5, "abc", True, NAN, THING, [1]),
    "action": ("abc", np.zeros(2), np.zeros((1, 1)), [None], THING, np.zeros(1, complex)),
    "per dof": ("abc", [1.0, 2.0, 3.0], THING, NAN, [NAN], 1j, None),
    "elapsed": ("abc", np.zeros(3, int), THING, [1.5, 0.5], None),
}
ENV_CALLS: dict[str, Call] = {
    "VectorEnv": Call(
        lambda _: env.VectorEnv,
        {
            "task": "task",
            "num_envs": "count",
            "autoreset_mode": "choice",
            "copy": "flag",
            "slots": "slots",
            "device": "choice",
            "precision": "choice",
            "threads": "count",
            "max_episode_steps": "steps",
            "on_nan": "choice",
            "daemon": "label",
            "first_env": "index",
            "render_mode": "choice",
        },
        {"task": "CartPoleBalance"},
    ),
    "VectorEnv.reset": Call(lambda world: world.envs.reset, {"seed": "env seed", "options": "options"}),
    "VectorEnv.send": Call(lambda world: world.envs.send, {"actions": "actions"}),
    "VectorEnv.step": Call(lambda world: world.envs.step, {"actions": "actions"}),
    "Env": Call(lambda _: env.Env, {"task": "task"}),
    "Env.reset": Call(lambda world: world.single.reset, {"seed": "single seed", "options": "options"}),
    "Env.step": Call(lambda world: world.single.step, {"action": "action"}),
    "JointTorque": Call(
        lambda _: env.JointTorque,
        {"dofs": "dofs", "scale": "per dof", "hold": "flag"},
        {"dofs": ["arm/fr3_joint1"], "scale": 1.0},
    ),
    "JointTarget": Call(
        lambda _: env.JointTarget,
        {"dofs": "dofs", "scale": "per dof", "limit": "positive"},
        {"dofs": ["arm/fr3_joint1"], "scale": 1.0},
    ),
    "JointDelta": Call(
        lambda _: env.JointDelta, {"dofs": "dofs", "scale": "per dof"}, {"dofs": ["arm/fr3_joint1"], "scale": 1.0}
    ),
    "Gripper": Call(
        lambda _: env.Gripper,
        {"dofs": "dofs", "low": "number", "high": "number", "binary": "flag"},
        {"dofs": ["arm/fr3_joint1"], "low": 0.0, "high": 1.0},
    ),
    "EndEffectorDelta": Call(
        lambda _: env.EndEffectorDelta,
        {"site": "text", "dofs": "dofs", "pos_scale": "number", "rot_scale": "number"},
        {"site": "tip", "dofs": ["arm/fr3_joint1"], "pos_scale": 1.0},
    ),
    "Observed": Call(
        lambda _: env.Observed,
        {"name": "text", "low": "observed bound", "high": "observed bound", "size": "count", "unit": "text"},
        {"name": "angle", "low": -1.0, "high": 1.0},
    ),
    "make_groups": Call(
        lambda _: env.make_groups,
        {
            "task": "task",
            "num_envs": "count",
            "groups": "count",
            "device": "choice",
            "precision": "choice",
            "threads": "count",
        },
        {"task": "CartPoleBalance", "num_envs": 4},
    ),
}
ENV_LEFT = {
    "AutoresetMode": "gymnasium's",
    "Names": "environments make it",
    "Task": "users derive from it; test_env_tasks.py tries wrong ones",
    "Worlds": "environments make it",
}
VIEW_CALLS: dict[str, Call] = {
    "Film": Call(
        lambda _: view.Film,
        {
            "out": "path",
            "size": "size",
            "fps": "positive",
            "worlds": "some worlds",
            "world": "index",
            "camera": "camera",
            "kind": "choice",
            "contacts": "flag",
            "speed": "positive",
        },
    ),
    "film": Call(
        lambda _: view.film,
        {
            "out": "path",
            "seconds": "positive",
            "at": "least 0",
            "worlds": "some worlds",
            "world": "index",
            "camera": "camera",
        },
        {},
        {"progress": "a function of the caller's"},
    ),
    "Picture.render": Call(
        lambda world: world.picture.render,
        {"worlds": "some worlds", "camera": "camera", "world": "index", "contacts": "flag"},
        {},
        {name: "test_picture.py tries them" for name in ("shown", "ghost", "goals")},
    ),
    "Camera": Call(
        lambda _: view.Camera,
        {"position": "triple", "target": "triple", "fov": "positive", "up": "triple"},
        {"position": (1.0, 0.0, 0.0), "target": (0.0, 0.0, 0.0)},
    ),
}
VIEW_LEFT = {"Picture": "its parts are made by tightloop.view.parts"}
CALLS |= ENV_CALLS | VIEW_CALLS
SETTERS["VectorEnv"] = (lambda world: world.envs, {"elapsed": "elapsed"})
LEFT |= ENV_LEFT | VIEW_LEFT
