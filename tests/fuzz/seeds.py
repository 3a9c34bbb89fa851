"""Make the seeds of the fuzz targets: `python tests/fuzz/seeds.py`.

Seeds are small inputs that reach far into a reader. Inputs that once broke one have names that begin with `fault_`, and
stay as they are.
"""

import json
import struct
from collections.abc import Sequence
from pathlib import Path

import mesh_seeds
import onnx_seeds

FUZZ = Path(__file__).parent
ROOT = FUZZ.parent.parent
# words of a row of a field table, and bytes of a line
ROW_WORDS, LINE = 12, 64
# types of entries of an array: code and bytes
F32, F64, U64, U8 = (1, 4), (2, 8), (5, 8), (6, 1)


def write(target: str, name: str, data: bytes | str) -> None:
    """Write a seed."""
    folder = FUZZ / "corpus" / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(data.encode() if isinstance(data, str) else data)


def lock_lines() -> None:
    """Lines of lock files."""
    write("beacon", "starting", "tightloop starting\n")
    write("beacon", "alone", "tightloop 5 1234 00000000deadbeef\n")
    write("beacon", "groups", "tightloop 5 1234 00000000deadbeef 4\n")


def control() -> None:
    """Requests and answers, one of each."""
    percentiles = dict.fromkeys(("mean", "p50", "p99", "p999", "worst"), 1.5)
    timing = dict.fromkeys(("frames", "missed", "late", "skipped"), 3)
    timing |= dict.fromkeys(("period", "lateness", "latency", "busy"), percentiles)
    messages = {
        "describe": "Describe",
        "acquire": {"Acquire": {"pid": 7}},
        "release": {"Release": {"epoch": 1}},
        "heartbeat": {"Heartbeat": {"epoch": 1}},
        "device_memory": {"DeviceMemory": {"epoch": 1}},
        "journal": {"Journal": {"observed": 5}},
        "timing": {"Timing": {"clear": True}},
        "shutdown": "Shutdown",
        "controller_answer": {"Controller": {"pid": None}},
        "held_answer": {"Held": {"pid": 9}},
        "memory_answer": {"NoMemory": {"free": 1, "needed": 2}},
        "journal_answer": {"Journal": {"journal": 3, "port": [1, 2]}},
        "timing_answer": {"Timing": timing},
        "refused_answer": {"Refused": {"reason": "no"}},
    }
    for name, message in messages.items():
        write("control", name + ".json", json.dumps(message))


def description() -> None:
    """A daemon with four worlds of a cart-pole."""
    dofs = ["cartpole/slider", "cartpole/hinge"]
    field = {"name": "joint_q", "dtype": "f32", "shape": [4, 2], "unit": "m", "doc": "Positions."}
    field["axes"] = "(worlds, coords)"
    effort = {"name": "joint_f", "columns": 2, "unit": "N", "doc": "Forces."}
    position = {"name": "joint_q", "columns": 2, "unit": "m", "doc": "Positions."}
    robot = {"name": "cartpole", "dofs": [0, 2], "coords": [0, 2], "bodies": [0, 1], "actuators": [0, 0]}
    robot["is_mujoco"] = False
    key = {name: [0.0] for name in ("joint_q", "joint_qd", "act", "ctrl", "mocap_pos", "mocap_quat")}
    daemon = {
        "protocol": 5,
        "release": "0.1.0",
        "name": "cartpole",
        "session": 1,
        "pid": 2,
        "worlds": 4,
        "group": 0,
        "groups": 1,
        "first_world": 0,
        "device": "cpu",
        "adapter": "",
        "delivery": "direct",
        "precision": "f32",
        "threads": 2,
        "dt": 0.002,
        "substeps": 4,
        "gravity": [0.0, 0.0, -9.81],
        "dof_names": dofs,
        "coord_names": dofs,
        "body_names": ["cartpole/cart"],
        "shape_names": [],
        "site_names": [],
        "contact_sensor_names": [],
        "actuator_names": [],
        "keyframes": [{"name": "cartpole/home", **key}],
        "robots": [robot],
        "followers": [{"name": "a", "leader": "b", "multiplier": 1.0, "offset": 0.0}],
        "fields": [field],
        "known_fields": [field],
        "commands": [effort],
        "writes": [position],
        "params": [{"place": None, "info": effort}],
        "scene": "",
        "scene_folder": "/",
        "model_hash": 3,
        "notes": [],
        "warnings": ["a"],
        "driven": [1, 4],
        "angle_range": [None, [-1.0, 1.0]],
        "frames_held": 4,
        "watch_worlds": 4,
        "watch_state_bytes": 64,
        "joint_q_max": None,
        "joint_qd_max": 1000.0,
        "on_fault": "freeze",
        "on_nan": "refuse",
        "draws": "world",
        "outputs_at": "frame",
        "cpu_bits": False,
        "pace": {"realtime": 1.0, "period_ns": 1000, "late": "hold", "command_timeout_ns": None},
        "state_bytes": 64,
        "schema": 0,
    }
    write("description", "daemon.json", json.dumps(daemon, indent=1) + "\n")


def sample(arrays: Sequence[tuple[str, tuple[int, int], list[int], bytes]]) -> bytes:
    """Lay out a field table with its arrays."""
    offset = -(-len(arrays) * ROW_WORDS * 8 // LINE) * LINE
    table, data = b"", b""
    for name, (code, _), shape, entries in arrays:
        axes = shape + [0] * (4 - len(shape))
        numbers = (code | len(shape) << 32, *axes, 0, offset + len(data), len(entries))
        table += name.encode().ljust(32, b"\0") + struct.pack("<8Q", *numbers)
        data += entries + bytes(-len(entries) % LINE)
    return table + bytes(offset - len(table)) + data


def samples() -> None:
    """Field tables, commands and heads of entries."""
    floats = ("joint_f", F32, [4, 2], struct.pack("<8f", *range(8)))
    doubles = ("joint_q", F64, [4, 2], struct.pack("<8d", *range(8)))
    mask = ("mask", U8, [4], b"\1\0\1\0")
    seed = ("seed", U64, [1], struct.pack("<Q", 7))
    device = ("on_device", U64, [2], struct.pack("<2Q", 7, 1))
    cases = {
        "step": (1, [floats]),
        "reset": (2, [seed, mask]),
        "write": (3, [doubles, mask]),
        "forward": (4, []),
        "snapshot": (5, [("path", U8, [6], b"a.snap")]),
        "restore": (6, [("path", U8, [6], b"a.snap"), ("from_world", U64, [1], struct.pack("<Q", 2)), mask]),
        "on_device": (1, [floats, device]),
        "on_device_alone": (1, [device]),
    }
    for name, (operation, arrays) in cases.items():
        payload = sample(arrays)
        write("command", name, bytes((operation, len(arrays))) + payload)
        write("table", name, bytes((len(arrays),)) + payload)
    write("journal", "state", struct.pack("<8Q", 1, 0, 256, 64, 0, 0, 0, 192))
    write("journal", "step", struct.pack("<8Q", 1, 1, 192, 0, 64, 1 | 1 << 32, 8, 384))
    write("journal", "end", struct.pack("<8Q", 1, 2, 10, 0, 0, 2**32 - 1, 0, 64))


def policies() -> None:
    """Write policies, those included that a reader must refuse."""
    for name, data in onnx_seeds.files().items():
        write("onnx", name, data)


def meshes() -> None:
    """Write a tetrahedron in each format."""
    for (target, name), data in mesh_seeds.files().items():
        write(target, name, data)


def robots() -> None:
    """The robots of the reader's tests, and one with a mesh."""
    tests = ROOT / "sim-core" / "model" / "tests"
    for file in (tests / "refused" / "everything.urdf", tests / "malformed" / "base.urdf"):
        write("urdf", file.name, file.read_bytes())
    cartpole = ROOT / "py-client" / "python" / "tightloop" / "assets" / "cartpole.urdf"
    write("urdf", cartpole.name, cartpole.read_bytes())
    shape = '<geometry><mesh filename="mesh.obj" scale="1 1 -1"/></geometry>'
    write(
        "urdf",
        "mesh.urdf",
        f'<robot name="a"><link name="b"><visual>{shape}</visual><collision>{shape}</collision></link>'
        '<link name="c"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="j" type="continuous"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/>'
        '<mimic joint="k" multiplier="2"/></joint><link name="d"/><joint name="k" type="prismatic"><parent link="c"/>'
        '<child link="d"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        '<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="j"/></transmission>'
        "</robot>\n",
    )


def mujoco() -> None:
    """Each model as it is, one change of each kind, and a file that has its format alone."""
    for base, name in enumerate(("cart", "passive", "sensors", "machine")):
        write("mujoco_arrays", name, bytes((base,)))
        changes = [struct.pack("<HBBh", 40 * action + base, action, 3, 300) for action in range(8)]
        for action, change in enumerate(changes):
            write("mujoco_arrays", f"{name}_{action}", bytes((base,)) + change)
    header = b'{"format":{"dtype":"I32","shape":[1],"data_offsets":[0,4]}}'
    write("mujoco_file", "format", struct.pack("<Q", len(header)) + header + struct.pack("<i", 1))


def programs() -> None:
    """Choices of random code: a ramp, and one kind of step only."""
    write("program", "ramp", bytes(range(200)))
    for kind in (0, 2, 4, 9):
        write("program", f"kind_{kind}", bytes((kind, 5, 3, 1, 2, 7)) * 30)


CUBE = """dt = 0.002
substeps = 2

[[shape]]
name = "ground"
type = "plane"

[[shape]]
name = "box"
type = "box"
half_extents = [0.1, 0.1, 0.1]
body = "cube"
density = 400.0

[[robot]]
name = "cartpole"
urdf = "robot.urdf"
pos = [0.0, 2.0, 3.0]

[[body]]
name = "cube"
pos = [0.0, 0.0, 0.2]
"""
EVERYTHING = """dt = 0.002
substeps = 2
gravity = [0.0, 0.0, "inf"]
params = ["gravity", "shape_mu"]
contacts_max = 10
rows_max = 40
friction_combine = "mean"
contact_filters = [["cartpole", "cube"]]

[solver]
iterations = 5
cone = "pyramidal"

[[robot]]
name = "cartpole"
urdf = "robot.urdf"
joint_q = [0.1, 0.2]
joint_target_ke = 100.0
floating = true

[[body]]
name = "cube"
pos = [0.0, 0.0, 0.2]

[[shape]]
name = "ball"
type = "sphere"
radius = 0.1
body = "cube"

[[site]]
name = "tip"
body = "cartpole/pole"
pos = [0.0, 0.0, 1.0]

[[contact_sensor]]
name = "touch"
shapes = ["cube/ball"]

[[camera]]
name = "eye"
body = "cartpole/pole"
pos = [0.0, -1.0, 0.5]
width = 16
height = 8
fov = 1.2
every = 2
worlds = [0]
depth_noise = [0.01, 0.002]

[randomize.cameras]
eye = { x = { uniform = [-0.1, 0.1] }, focal = { normal = [0.0, 0.1] } }
"""


def scenes() -> None:
    """Scenes of the cart-pole, as TOML and as JSON."""
    write("scene", "cube.toml", CUBE)
    write("scene", "everything.toml", EVERYTHING)
    robot = {"name": "cartpole", "urdf": "robot.urdf", "joint_q": ["inf", 0]}
    write("scene", "robot.json", json.dumps({"dt": 0.002, "substeps": 1, "robot": [robot]}))


def record(kind: int, words: bytes) -> bytes:
    """A record of a recording."""
    return struct.pack("<2Q", kind, len(words) // 8) + words


def recordings() -> None:
    """Records of each kind."""
    text = b"{}".ljust(8, b"\0")
    head = record(1, struct.pack("<Q", 2) + text) + record(2, struct.pack("<Q", 2) + text)
    payload = sample([("joint_f", F32, [2, 2], struct.pack("<4f", *range(4)))])
    digests = struct.pack("<2I", 1, 2)
    command = struct.pack("<4Q", 1 | 1 << 32, len(payload) // 8, 2, 0) + payload + digests
    write("recording", "records", head + record(3, command) + record(4, struct.pack("<Q", 3)))
    write("recording", "end", head + record(5, struct.pack("<Q", 3) + b"end".ljust(8, b"\0")))
    block = (ROOT / "tests" / "data" / "recorded" / "lesson.tlrec").read_bytes()[:4000]
    write("recording", "cut.tlrec", block)


def replays() -> None:
    """Recordings whose heads are changed, with steps, resets, gaps and ends."""
    efforts = sample([("joint_f", F32, [2, 8], struct.pack("<16f", *range(16)))])
    step = bytes((0, 1, 1, 10, len(efforts) // 8)) + efforts
    seed = sample([("seed", U64, [1], struct.pack("<Q", 7)), ("mask", U8, [2], b"\1\0")])
    reset = bytes((0, 2, 2, 10, len(seed) // 8)) + seed
    forward, gap, state, end = bytes((0, 4, 0, 10, 0)), b"\3\0\0\0\1" + bytes(8), b"\4\0\0\0\0", b"\6\0\0\0\0"
    write("replay", "compared", b"{}\0\0" + step + end)
    write("replay", "shown", b"{}\0\1" + step + reset + forward + end)
    write("replay", "gap", b"{}\0\1" + step + gap + step + state + step)
    write("replay", "gap_compared", b"{}\0\0" + gap + step + state + gap)
    write("replay", "no_state", b"{}\0\2" + step)
    changes = {"worlds": 3, "draws": "world", "precision": "f64", "on_fault": "reset", "joint_qd_max": 5}
    write("replay", "head", json.dumps(changes).encode() + b"\0\1" + step)
    write("replay", "scene", json.dumps({"scene": CUBE.replace("robot.urdf", "none.urdf")}).encode() + b"\0\1" + step)


def applied() -> None:
    """Commands for two worlds of eight dofs, and a snapshot's head."""
    efforts = ("joint_f", F32, [2, 8], struct.pack("<16f", *range(16)))
    positions = ("joint_q", F32, [2, 9], struct.pack("<18f", *(0, 0, 0, 0, 0.2, 0, 0, 0, 1) * 2))
    mask = ("mask", U8, [2], b"\1\0")
    seed = ("seed", U64, [1], struct.pack("<Q", 7))
    for name, operation, arrays in (
        ("step", 1, [efforts]),
        ("reset", 2, [seed, mask]),
        ("write", 3, [positions, mask]),
        ("forward", 4, []),
    ):
        write("command_applied", name, bytes((operation, len(arrays))) + sample(arrays))
    gravity = ("gravity", F32, [2, 3], struct.pack("<6f", 0, 0, -1, 0, 0, 1))
    delay = ("command_delay", F32, [2, 1], struct.pack("<2f", 1, 0))
    write("command_applied", "parameters", bytes((3, 3)) + sample([gravity, delay, mask]))
    targets = ("joint_target_q", F32, [2, 8], struct.pack("<16f", *range(16)))
    write("command_applied", "two", bytes((1, 2)) + sample([efforts, targets]))
    head = b"tlsnap\r\n" + struct.pack("<2I2Q2I", 1, 0, 0, 2, 60, 4)
    write("snapshot", "head", head + bytes(2 * (28 + 4 * 60)))
    write("snapshot", "same", bytes(600))
    stored = (ROOT / "tests" / "data" / "recorded" / "machine_start.tlsnap").read_bytes()
    write("snapshot", "machine.tlsnap", stored)


def questions() -> None:
    """Questions of inverse kinematics and of rollouts."""
    reach = {"frame": "cartpole/pole", "relative_to": None}
    reach |= {"position_weight": [1, 1, 1], "orientation_weight": [0, 0, 0]}
    task = {"reaches": [reach], "moves": [True] * 8, "limits": True, "posture_weight": [0.1] * 8}
    ik = {"task": task, "count": 2, "lengths": [0, 0, 6, 0], "iterations": 5, "restarts": 1, "seed": 1}
    ik |= {"tolerance": [1e-3, 1e-2], "double": False, "threads": 1}
    text = json.dumps(ik, separators=(",", ":")).encode()
    write("ik", "two_targets", text + b"\0" + struct.pack("<6d", 0.1, 2, 3.5, -0.1, 2, 3.5))
    columns = {"field": "joint_q", "places": [0, 1]}
    field_term = {"source": {"field": {"columns": columns, "turned_by": None, "function": "sin"}}}
    terms = [field_term, {"source": "last_action"}, {"source": {"input": 0}}]
    terms.append({"source": {"clock": {"step": 0.1, "input": None}}})
    for term in terms:
        term |= {"minus": [], "scale": [], "clip": None, "history": 1}
    drive = {"command": "joint_f", "columns": [0], "values": [0], "scale": [1], "offset": [0]}
    drive |= {"low": [None], "high": [1], "followers": []}
    sequence = {"frames": 1, "worlds": 2, "columns": 1}
    question = {
        "frames": 2,
        "first": 0,
        "size": 6,
        "layers": [{"linear": {"inputs": 6, "outputs": 1}}, "tanh"],
        "terms": terms,
        "clip": [[-1], [1]],
        "drives": [drive],
        "inputs": [sequence],
        "commands": [{"command": "joint_f", "first": 1, "values": sequence}],
        "fields": ["joint_q"],
        "collects": [True, True],
        "lengths": [7, 0, 2, 2],
    }
    text = json.dumps(question, separators=(",", ":")).encode()
    write("rollout", "policy", text + b"\0" + struct.pack("<11d", *([0.5] * 11)))


if __name__ == "__main__":
    lock_lines()
    control()
    description()
    samples()
    policies()
    meshes()
    robots()
    mujoco()
    programs()
    scenes()
    recordings()
    replays()
    applied()
    questions()
