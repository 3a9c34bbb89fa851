"""Wrong values of arguments of the Python API, by kind."""

from __future__ import annotations

from typing import Any

import numpy as np

import tightloop as tl
from conftest import REPOSITORY

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
#: Three columns of one problem or many.
POINTS = (
    "abc",
    THING,
    np.full(3, 1j),
    np.zeros(2),
    np.zeros((2, 5)),
    np.zeros((1, 2, 3)),
    np.full(3, NAN),
    np.zeros((0, 3)),
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
    "positive or inf": (*NUMBER, 0.0, -1.0, -INF),
    "at least 0 or inf": (*NUMBER, -1.0, -INF),
    "count": COUNT,
    "optional count": COUNT,
    "cores": ("1", 3, [1.5], [-1], ["a"], [None], THING),
    "priority": (*COUNT, 100),
    "index": tuple(value for value in COUNT if value != 0),
    "triple": TRIPLE,
    "positive triple": (*TRIPLE, (0.0, 1, 1), (-1, 1, 1)),
    "worlds of a camera": ((), (-1,), (1.5,), ("a",), "ab", 3, (2**70,), [[1]], [True], THING, NAN),
    "pair": ((1, NAN), (1, INF), (1, 2, 3), (1,), "ab", 3, THING),
    "noise": ((0.0, -1.0), (1, NAN), (1, INF), (1, 2, 3), (1,), "ab", 3, THING, (0.0, 1e9)),
    "positive pair": ((0.0, 1), (1, -1), (1, NAN), (1, INF), (1, 2, 3), (1,), "ab", 3, THING),
    "pair of counts": ((0, 3), (3, -1), (1.5, 2), (1, 2, 3), (1,), "ab", 3, THING, (2**40, 2)),
    "interval": ((2.0, 1.0), (0.0, 1.0), (1.0, NAN), (1.0, INF), (1.0,), (1.0, 2.0, 3.0), 3.0, "ab", THING),
    "elevation": (np.zeros(4), np.zeros((1, 4)), np.full((3, 3), NAN), np.full((3, 3), INF), 3.0, THING, "nowhere.npy"),
    "quaternion": QUATERNION,
    "name": NAME,
    # of a daemon
    "label": ("", "a b", "a/b", 3, b"x", [], "ä", THING, 1.5),
    "text": TEXT,
    "names": NAMES,
    "joint names": ("nowhere", "(", "", 3, b"x", [], [3], ["fr3_joint1", "nowhere"], None, THING),
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
    "objectives": ("arm/fr3_hand", 3, [], [3], None, THING, tl.Posture(), [tl.Reach("nowhere")]),
    # the daemon knows the frames, and refuses others with the first problems
    "daemon objectives": ("arm/fr3_hand", 3, [], [3], None, THING, tl.Posture()),
    "points": POINTS,
    "rows": ("abc", THING, 3.0, np.full(3, 1j), np.zeros((1, 2, 3)), np.full(3, NAN), np.zeros((0, 3))),
    "quaternions": (*POINTS[:3], np.zeros(3), np.zeros(4), np.ones((2, 4)), np.full(4, NAN)),
    "weights": (-1.0, NAN, INF, "abc", (1, 2), (1, 2, -1), (1, NAN, 2), THING, 1j),
    "posture weight": (-1.0, 0.0, NAN, INF, "abc", [[1.0]], [1.0, -1.0], THING, 1j),
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
    "optional scene": (3, "abc", THING, {}),
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

KINDS |= {
    "steps": (0, -1, 1.5, "abc", NAN, True, THING, [1]),
    "env seed": (-1, 1.5, "abc", [1], 2**64, True, NAN, THING, [1, -1], [1, "a"]),
    "slots": (1, *COUNT),
    "single seed": (-1, 1.5, "abc", True, NAN, THING, [1]),
    "action": ("abc", np.zeros(2), np.zeros((1, 1)), [None], THING, np.zeros(1, complex)),
    "per dof": ("abc", [1.0, 2.0, 3.0], THING, NAN, [NAN], 1j, None),
    "actuators": ("abc", 1.0, [[1.0]], THING, [NAN], [], 1j, None),
    "action ranges": ("abc", [1.0], [(1.0, -1.0)], [(NAN, 1.0)], [(1.0,), (1.0, 2.0)], THING, 1j, None),
    "elapsed": ("abc", np.zeros(3, int), THING, [1.5, 0.5], None),
}
