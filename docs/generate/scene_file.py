"""Keys of scene files: names, types and meaning from the structs that parse them, defaults from the parser itself."""

from __future__ import annotations

import json
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from generate import rust
from generate.tables import table
from tightloop import _core

CONFIG = "sim-daemon/src/config"

# Beside `dt` and `substeps`, which every file has.
HEAD = "dt = 0.002\nsubsteps = 8\n"


@dataclass(frozen=True)
class Table:
    """A table of a scene file."""

    heading: str
    source: str
    struct: str
    path: tuple[str, ...]  # of the table in the file; () is the file itself
    least: str  # the smallest one, for its defaults
    example: str  # what stands on the page
    text: str = ""


TABLES = (
    Table(
        "The file itself",
        "scene.rs",
        "SceneFile",
        (),
        "",
        'gravity = [0, 0, -3.7]\nparams = ["shape_mu"]\ncontacts_max = 16\n',
        "The tables below follow these keys.",
    ),
    Table(
        "[solver]",
        "scene.rs",
        "SolverTable",
        ("solver",),
        "[solver]\n",
        '[solver]\niterations = 50\ncone = "pyramidal"\nimpratio = 10\n',
        "MuJoCo's options of the same names.",
    ),
    Table(
        "[[robot]]",
        "robots.rs",
        "RobotTable",
        ("robot",),
        '[[robot]]\nurdf = "a.urdf"\n',
        '[[robot]]\nname = "left"\nurdf = "examples/assets/fr3/fr3_franka_hand.urdf"\npos = [0, 0.5, 0]\n'
        "joint_target_ke = [4500, 4500, 3500, 3500, 2000, 2000, 2000, 100, 100]\njoint_target_kd = 200\n"
        'joint_effort_limit = [87, 87, 87, 87, 12, 12, 12, inf, inf]\njoint_target_mode = "position"\nmu = 0.8\n',
        "A list is in the order of the file's joints.",
    ),
    Table(
        "[[mujoco]]",
        "mujoco.rs",
        "MujocoTable",
        ("mujoco",),
        '[[mujoco]]\nname = "m"\nmodel = "m.safetensors"\n',
        '[[mujoco]]\nname = "cart"\nmodel = "examples/assets/cart/cart.safetensors"\n',
        "`Scene.save` and `tightloop.mujoco.export` write such files. They do not set the options of the scene.",
    ),
    Table(
        "[[body]]",
        "bodies.rs",
        "BodyTable",
        ("body",),
        '[[body]]\nname = "a"\n',
        '[[body]]\nname = "ball"\npos = [0, 0, 1]\nmass = 0.2\n\n'
        '[[shape]]\nbody = "ball"\ntype = "sphere"\nradius = 0.04\n',
    ),
    Table(
        "[[shape]]",
        "shapes.rs",
        "ShapeTable",
        ("shape",),
        '[[shape]]\ntype = "plane"\n',
        '[[shape]]\ntype = "plane"\nmu = 0.7\n\n'
        '[[shape]]\nname = "post"\ntype = "cylinder"\nradius = 0.05\nhalf_height = 0.5\npos = [1, 0, 0.5]\n',
    ),
    Table(
        "[[site]]",
        "sensors.rs",
        "SiteTable",
        ("site",),
        '[[site]]\nname = "a"\n',
        '[[robot]]\nname = "arm"\nurdf = "examples/assets/fr3/fr3_franka_hand.urdf"\n\n'
        '[[site]]\nname = "tcp"\nbody = "arm/fr3_hand"\npos = [0, 0, 0.1034]\n',
        "Sites give the fields `site_q`, `site_qd`, `gyro`, `accelerometer` and `site_inverse_jacobian`.",
    ),
    Table(
        "[[contact_sensor]]",
        "sensors.rs",
        "ContactSensorTable",
        ("contact_sensor",),
        '[[contact_sensor]]\nname = "a"\nof = "b"\n',
        '[[shape]]\nname = "ground"\ntype = "plane"\n\n[[body]]\nname = "foot"\npos = [0, 0, 0.1]\n\n'
        '[[shape]]\nbody = "foot"\ntype = "sphere"\nradius = 0.05\n\n'
        '[[contact_sensor]]\nname = "step"\nof = "foot"\nagainst = "ground"\n',
        "The field `contact_sensor` holds their forces.",
    ),
    Table(
        "[[height_scan]]",
        "sensors.rs",
        "HeightScanTable",
        ("height_scan",),
        '[[height_scan]]\nname = "a"\ncounts = [1, 1]\nspacing = [0.1, 0.1]\n',
        '[[shape]]\nname = "ground"\ntype = "plane"\n\n[[body]]\nname = "foot"\npos = [0, 0, 0.1]\n\n'
        '[[shape]]\nbody = "foot"\ntype = "sphere"\nradius = 0.05\n\n'
        '[[height_scan]]\nname = "below"\nbody = "foot"\ncounts = [17, 11]\nspacing = [0.1, 0.1]\n',
        "The field `height_scan` holds how high the frame is above the ground.",
    ),
    Table(
        "[[camera]]",
        "cameras.rs",
        "CameraTable",
        ("camera",),
        '[[camera]]\nname = "a"\nwidth = 8\nheight = 8\n',
        '[[robot]]\nname = "arm"\nurdf = "examples/assets/fr3/fr3_franka_hand.urdf"\n\n'
        '[[camera]]\nname = "wrist"\nbody = "arm/fr3_hand"\npos = [0.05, 0, 0]\nwidth = 64\nheight = 64\nfov = 1.2\n',
        "Images are fields of frames: `wrist_depth`, `wrist_segmentation` and `wrist_rgb`.",
    ),
    Table(
        "[randomize]",
        "randomize.rs",
        "RandomizeTable",
        ("randomize",),
        "[randomize]\n",
        '[[body]]\nname = "cube"\npos = [0, 0, 0.05]\n\n[[shape]]\nbody = "cube"\ntype = "box"\n'
        'half_extents = [0.02, 0.02, 0.02]\n\n[[shape]]\nname = "ground"\ntype = "plane"\nmu = 0.2\n\n'
        "[randomize.body_q]\ncube = { x = { uniform = [-0.05, 0.05] }, yaw = { normal = [0, 0.3] } }\n\n"
        "[randomize.params]\nshape_mu = { cube = { uniform = [0.2, 1.0] } }\n",
        "A distribution is `{ uniform = [low, high] }` or `{ normal = [mean, standard deviation] }`. "
        "Draws depend only on seed, world and episode. Parameters with a range vary between worlds.",
    ),
)
# Words that a key may be, and which key of which table.
WORDS = (
    ("scene.rs", "CombineName", "The file itself", "friction_combine"),
    ("scene.rs", "ConeName", "[solver]", "cone"),
    ("robots.rs", "ModeName", "[[robot]]", "joint_target_mode"),
    ("shapes.rs", "ShapeName", "[[shape]]", "type"),
    ("randomize.rs", "DistributionTable", "[randomize]", "distributions"),
)
TYPES = {
    "Number": "number",
    "usize": "whole number",
    "i32": "whole number",
    "[usize; 2]": "2 whole numbers",
    "bool": "`true` or `false`",
    "String": "text",
    "PathBuf": "path",
    "[Number; 2]": "2 numbers",
    "[Number; 3]": "3 numbers",
    "[Number; 4]": "4 numbers",
    "[[Number; 3]; 3]": "3 × 3 numbers",
    "Vec<usize>": "list of whole numbers",
    "Vec<String>": "list of text",
    "Vec<PathBuf>": "list of paths",
    "Vec<[String; 2]>": "list of pairs of text",
    "PerDof<Number>": "number, or a list",
    "PerDof<ModeName>": "word, or a list",
    "CombineName": "word",
    "ConeName": "word",
    "SeesName": "word",
    "ShapeName": "word",
    "Named<DistributionTable>": "distributions by name",
    "Named<Named<DistributionTable>>": "distributions by name and part",
    "Named<ParamTable>": "distributions, by name where it has several numbers",
    "SolverTable": "table",
    "RandomizeTable": "table",
}


def keys(of: Table) -> list[rust.Item]:
    """The keys of a table, as its struct has them."""
    return rust.listing(f"{CONFIG}/{of.source}", of.struct).items


def words(source: str, enum: str) -> list[rust.Item]:
    """What a key that is a word may be."""
    return rust.listing(f"{CONFIG}/{source}", enum).items


def parts() -> dict[str, str]:
    """Parts of the page `reference/scene-file.md`."""
    texts = list[str]()
    for shown in TABLES:
        struct = rust.listing(f"{CONFIG}/{shown.source}", shown.struct)
        defaults = _defaults(shown)
        rows = [
            [f"`{key.name}`", _type(key.type), *_default(key, struct.serde, defaults)]
            for key in struct.items
            if not key.type.startswith("Vec<") or not key.type.endswith("Table>")  # tables of their own
        ]
        texts.append(f"## {shown.heading}\n\n{struct.doc} {shown.text}\n")
        texts.append(table(["key", "type", "default", "meaning"], rows))
        for source, enum, heading, key in WORDS:
            if heading == shown.heading:
                texts.append(table([key, "meaning"], [[f"`{word.name}`", word.doc] for word in words(source, enum)]))
        texts.append(f"```toml\n{shown.example}```\n")
    return {"tables": "\n".join(texts)}


def _type(type_: str) -> str:
    inner = type_.removeprefix("Option<").removesuffix(">") if type_.startswith("Option<") else type_
    if inner not in TYPES:
        raise LookupError(f"{__file__}: TYPES has no words for {inner}")
    return TYPES[inner]


def _default(key: rust.Item, struct: str, defaults: dict[str, Any]) -> tuple[str, str]:
    """What a key is that is left out, and its meaning without that."""
    said = re.fullmatch(r"(.*); left out, (.*?)( \[[^\]]*\])?\.", key.doc)
    if "default" not in key.serde and "default" not in struct:
        return "required", key.doc
    if key.name in defaults:
        value = defaults[key.name]
        return "its defaults" if isinstance(value, dict) else f"`{json.dumps(value)}`", key.doc
    if said is None:
        return "none", key.doc
    return said.group(2), f"{said.group(1)}{said.group(3) or ''}."


def _defaults(of: Table) -> dict[str, Any]:
    """What the parser puts where the smallest table says nothing."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.toml"
        file.write_text(HEAD + of.least)
        read = json.loads(_core.load_scene(str(file)))
    for key in of.path:
        read = read.get(key, {})
    return read[0] if isinstance(read, list) else read
