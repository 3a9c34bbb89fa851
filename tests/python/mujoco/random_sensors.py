"""Random sensors for random MuJoCo models."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

FRAMES = ("framepos", "framequat", "framexaxis", "frameyaxis", "framezaxis", "framelinvel", "frameangvel")
ACCELERATIONS = ("framelinacc", "frameangacc")
ON_SITES = ("rangefinder", "accelerometer", "velocimeter", "gyro", "force", "torque", "magnetometer")
ON_BODIES = ("subtreecom", "subtreelinvel", "subtreeangmom")
LIMITS = ("limitpos", "limitvel", "limitfrc")
#: Types that `add_sensors` may add.
KINDS = (
    *FRAMES,
    *ACCELERATIONS,
    *ON_SITES,
    *ON_BODIES,
    *(f"{what}{limit}" for what in ("joint", "tendon") for limit in LIMITS),
    *"jointpos jointvel jointactuatorfrc ballquat ballangvel tendonpos tendonvel tendonactuatorfrc".split(),
    *"actuatorpos actuatorvel actuatorfrc clock e_potential e_kinetic".split(),
)

#: Types that it adds where geoms touch.
TOUCHES = ("touch", "contact")
_DATA = ("found", "force", "torque", "dist", "pos", "normal", "tangent")


def add_sensors(text: str, seed: int, count: int, kinds: tuple[str, ...] = (*KINDS, *TOUCHES)) -> str:
    """Return the XML of a model with sensors of every kind that fits it, ``count`` of each, and two cameras."""
    return _Sensors(text, seed).text(count, kinds)


def heap(seed: int, option: str, bodies: int = 4) -> str:
    """Return the XML of bodies with spheres and capsules that overlap each other and a plane."""
    rng = np.random.default_rng(seed)

    def numbers(count: int, low: float, high: float) -> str:
        return " ".join(map(repr, rng.uniform(low, high, count).tolist()))

    def geoms() -> str:
        own = ""
        for _ in range(2):
            kind, size = (("sphere", 1), ("capsule", 2))[rng.integers(2)]
            own += f'<geom type="{kind}" size="{numbers(size, 0.08, 0.2)}" pos="{numbers(3, -0.15, 0.15)}" '
            own += f'condim="{rng.choice([1, 3, 4, 6])}" friction="{numbers(3, 0.2, 1)}" margin="0.02"/>'
        return own

    text = ""
    for k in range(bodies):
        site = f'<site name="s{k}" pos="{numbers(3, -0.2, 0.2)}" quat="{numbers(4, -1, 1)}"/>'
        arm = f'<body name="arm{k}" pos="{numbers(3, -0.2, 0.2)}"><joint axis="{numbers(3, -1, 1)}"/>{geoms()}</body>'
        pos = f'pos="{numbers(3, -0.2, 0.2)}"'
        text += f'<body name="b{k}" {pos}><freejoint name="j{k}"/>{geoms()}{site}{arm}</body>'
    plane = '<geom type="plane" size="5 5 .1" pos="0 0 -.1"/>'
    return f"<mujoco><option {option}/><worldbody>{plane}{text}</worldbody></mujoco>"


class _Sensors:
    def __init__(self, text: str, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.root = ET.fromstring(text)
        self.added = 0
        world = self.root.find("worldbody")
        assert world is not None
        bodies = list(world.iter("body"))
        for k, body in enumerate(bodies[:2]):
            self.place(ET.SubElement(body, "camera", name=f"cam{k}"))
        if world.find("geom") is None:
            for k, body in enumerate(bodies):
                self.place(
                    ET.SubElement(body, "geom", name=f"look{k}", size=".05", contype="0", conaffinity="0", mass="0")
                )
        self.touches = any(geom.get("contype") != "0" for geom in world.iter("geom"))
        for k, geom in enumerate(world.iter("geom")):
            geom.set("name", geom.get("name", f"geom{k}"))
        self.place(ET.SubElement(world, "site", name="here"))
        for site in world.iter("site"):
            site.set("type", str(self.rng.choice(["sphere", "capsule", "ellipsoid", "cylinder", "box"])))
            site.set("size", " ".join(map(repr, self.rng.uniform(0.1, 0.5, 3).tolist())))
        option = self.root.find("option")
        assert option is not None
        option.set("magnetic", "0.1 -0.2 0.4")
        names = {kind: [x.attrib["name"] for x in world.iter(kind)] for kind in ("site", "geom", "camera", "body")}
        self.names = {**names, "xbody": names["body"]}
        joints = list(world.iter("joint"))
        self.scalars = [x.attrib["name"] for x in joints if x.get("type") in ("hinge", "slide")]
        limited = {x.attrib["name"] for x in self.root.iter() if x.get("range") and x.tag in ("joint", "fixed")}
        self.balls = [x.attrib["name"] for x in joints if x.get("type") == "ball"]
        tendon, actuator = self.root.find("tendon"), self.root.find("actuator")
        self.tendons = [x.attrib["name"] for x in tendon] if tendon is not None else []
        self.limited = {
            "joint": [name for name in (*self.scalars, *self.balls) if name in limited],
            "tendon": [name for name in self.tendons if name in limited],
        }
        self.actuators = []
        for k, element in enumerate(actuator if actuator is not None else []):
            element.set("name", f"a{k}")
            self.actuators.append(f"a{k}")

    def place(self, element: ET.Element) -> None:
        element.set("pos", " ".join(map(repr, self.rng.uniform(-0.3, 0.3, 3).tolist())))
        element.set("quat", " ".join(map(repr, self.rng.uniform(-1, 1, 4).tolist())))

    def text(self, count: int, kinds: tuple[str, ...]) -> str:
        section = ET.SubElement(self.root, "sensor")
        for kind in kinds if self.touches else (kind for kind in kinds if kind not in TOUCHES):
            for _ in range(count):
                attributes = self.attributes(kind)
                if attributes is not None:
                    self.added += 1
                    element = ET.SubElement(section, kind, name=f"x{self.added}", **attributes)
                    if kind != "contact" and not kind.endswith(("axis", "quat")) and self.rng.random() < 0.2:
                        element.set("cutoff", repr(self.rng.uniform(0.01, 1.0)))
        return ET.tostring(self.root, encoding="unicode")

    def object(self, prefix: str) -> dict[str, str]:
        kind = str(self.rng.choice([kind for kind, names in self.names.items() if names]))
        return {f"{prefix}type": kind, f"{prefix}name": str(self.rng.choice(self.names[kind]))}

    def attributes(self, kind: str) -> dict[str, str] | None:
        """Attributes of a sensor, or None where the model has nothing for it."""
        if kind in FRAMES or kind in ACCELERATIONS:
            seen = kind in FRAMES and self.rng.random() < 0.6
            return self.object("obj") | (self.object("ref") if seen else {})
        if kind == "contact":
            return self.contact()
        if kind in ON_SITES or kind == "touch":
            return {"site": str(self.rng.choice(self.names["site"]))}
        if kind in ON_BODIES:
            return {"body": str(self.rng.choice(self.names["body"]))}
        if kind in ("clock", "e_potential", "e_kinetic"):
            return {}
        for what, names in (
            *((f"{what}limit", names) for what, names in self.limited.items()),
            ("joint", self.scalars),
            ("ball", self.balls),
            ("tendon", self.tendons),
            ("actuator", self.actuators),
        ):
            if kind.startswith(what):
                own = "joint" if what == "ball" else what.removesuffix("limit")
                return {own: str(self.rng.choice(names))} if names else None
        raise AssertionError(kind)

    def contact(self) -> dict[str, str]:
        """Attributes of a sensor of contacts."""
        rng = self.rng
        attributes = {}
        for number, kinds in ((1, ("site", "body", "subtree", "geom", "")), (2, ("body", "subtree", "geom", "", ""))):
            kind = str(rng.choice(kinds))
            if kind:
                names = self.names["body" if kind == "subtree" else kind]
                attributes["site" if kind == "site" else f"{kind}{number}"] = str(rng.choice(names))
        reduction = str(rng.choice(["none", "mindist", "maxforce", "netforce"]))
        # tests of these need the count and the force
        always = {"none": ("found",), "maxforce": ("found", "force")}.get(reduction, ())
        chosen = [part for part in _DATA if rng.random() < 0.6 or part in always]
        number = {"none": 6, "maxforce": 1}.get(reduction, rng.integers(1, 5))
        return attributes | {"data": " ".join(chosen or ["found"]), "num": str(number), "reduce": reduction}
