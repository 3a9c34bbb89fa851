"""Random MuJoCo models: trees of bodies with every kind of joint, springs, limits, actuators and geoms."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import random_tendons


@dataclass(frozen=True)
class Features:
    """What a random model has besides bodies and joints; each with probability one half per element."""

    free: bool = False
    ball: bool = False
    several: bool = False
    """Bodies with up to three joints."""
    reference: bool = False
    springs: bool = False
    limits: bool = False
    friction: bool = False
    armature: bool = False
    damping: bool = False
    equalities: bool = False
    polynomials: bool = False
    """Equalities of one joint, and of higher than first degree."""
    connections: bool = False
    """Points of bodies that are connected, and bodies and sites that are welded."""
    mocap: bool = False
    """A body that is placed, with a body on it, a geom, and a weld to another one."""
    actuators: bool = False
    activations: bool = False
    """Actuators with a state."""
    transmissions: bool = False
    """Actuators on balls, free joints and sites."""
    tendons: bool = False
    spatial: bool = False
    """Tendons from site to site, around spheres and cylinders."""
    muscles: bool = False
    pulls: bool = False
    """Springs, dampers, limits, dry friction and equalities of tendons."""
    compensation: bool = False
    """Bodies that are held against gravity, passively or by the actuators of joints."""
    bounds: bool = False
    """Bounds of controls, actuator forces and sums of them on a joint or a tendon."""
    geoms: bool = False
    pairs: bool = False
    """Pairs of geoms that touch by rules of their own, and bodies that are excluded."""
    option: str = ""
    """Attributes of ``<option>``."""
    flag: str = ""
    """Attributes of ``<option><flag/>``."""


#: A medium that drags.
MEDIUM = 'density="900" viscosity="0.7" wind="0.3 -0.5 0.2"'
JOINTS = Features(free=True, ball=True, several=True, reference=True)
ACTUATED = replace(JOINTS, actuators=True, tendons=True)
CONSTRAINED = replace(
    ACTUATED,
    springs=True,
    limits=True,
    friction=True,
    armature=True,
    damping=True,
    equalities=True,
    connections=True,
    pulls=True,
    bounds=True,
)
EVERYTHING = replace(
    CONSTRAINED,
    polynomials=True,
    activations=True,
    transmissions=True,
    spatial=True,
    muscles=True,
    mocap=True,
    compensation=True,
    option=MEDIUM,
)


def random_mjcf(seed: int, bodies: int, features: Features) -> str:
    """Return the XML of a random model."""
    return _Model(np.random.default_rng(seed), features).xml(bodies)


class _Model:
    def __init__(self, rng: np.random.Generator, features: Features) -> None:
        self.rng, self.features = rng, features
        self.scalars: list[str] = []
        self.balls: list[str] = []
        self.frees: list[str] = []
        self.joints = self.bodies = 0
        self.geoms: list[tuple[str, int]] = []

    def has(self, feature: str, share: float = 0.5) -> bool:
        return getattr(self.features, feature) and self.rng.random() < share

    def numbers(self, count: int, low: float = -1.0, high: float = 1.0) -> str:
        return " ".join(f"{x:.17g}" for x in self.rng.uniform(low, high, count))

    def softness(self, names: tuple[str, str]) -> str:
        if self.rng.random() < 0.3:
            return ""
        rng = self.rng
        solref = (
            f"{rng.uniform(-2000, -200):.17g} {rng.uniform(-60, -5):.17g}"
            if rng.random() < 0.3
            else f"{rng.uniform(0.005, 0.05):.17g} {rng.uniform(0.3, 1.5):.17g}"
        )
        low, high = sorted(rng.uniform(0.3, 0.98, 2))
        width, middle, power = rng.uniform(0.001, 0.2), rng.uniform(0.1, 0.9), rng.integers(1, 5)
        return f'{names[0]}="{solref}" {names[1]}="{low:.17g} {high:.17g} {width:.17g} {middle:.17g} {power}"'

    def xml(self, bodies: int) -> str:
        f = self.features
        trees = self.mocap()
        while bodies > 0:
            size = int(self.rng.integers(1, bodies + 1))
            trees += self.body(size, root=True)
            bodies -= size
        return f"""<mujoco>
<compiler angle="radian" autolimits="true"/>
<option {f.option}><flag {f.flag}/></option>
<worldbody>{self.bend(0)}
{'<geom name="floor" type="plane" size="5 5 .1" pos="0 0 -1"/>' if f.geoms else ""}{trees}</worldbody>
{self.tendons()}{self.equalities()}{self.actuators()}{self.pairs()}
</mujoco>"""

    def mocap(self) -> str:
        if not self.features.mocap:
            return ""
        pose = f'pos="{self.numbers(3, -0.6, 0.6)}" quat="{self.numbers(4)}"'
        return f'<body name="placed" mocap="true" {pose}>{self.geom()}{self.body(1)}</body>'

    def body(self, size: int, *, root: bool = False) -> str:
        joints = ""
        if root and self.has("free"):
            self.frees.append(f"j{self._next()}")
            own = self.passive() + self.spring()
            joints = f'<joint type="free" name="{self.frees[-1]}"{own} {self.dry()}/>'
        elif self.has("ball", 0.3):
            joints = self.ball()
        elif self.rng.random() > 0.1:
            count = int(self.rng.integers(1, 4)) if self.features.several else 1
            joints = "".join(self.scalar() for _ in range(count))
        moments = np.sort(self.rng.uniform(0.02, 0.1, 3))
        moments[2] = min(moments[2], 0.9 * (moments[0] + moments[1]))
        inertial = (
            f'<inertial pos="{self.numbers(3, -0.2, 0.2)}" quat="{self.numbers(4)}" '
            f'mass="{self.rng.uniform(0.5, 3):.17g}" diaginertia="{" ".join(f"{x:.17g}" for x in moments)}"/>'
        )
        inside, size = "", size - 1
        while size > 0:
            own = int(self.rng.integers(1, size + 1))
            inside += self.body(own)
            size -= own
        pose = f'pos="{self.numbers(3, -0.6, 0.6)}" quat="{self.numbers(4)}"'
        self.bodies += 1
        name = f'name="b{self.bodies}"'
        site = f'<site name="s{self.bodies}" pos="{self.numbers(3, -0.2, 0.2)}" quat="{self.numbers(4)}"/>'
        name += self.compensation()
        bend = self.bend(self.bodies)
        return f"<body {name} {pose}>{joints}{inertial}{site}{bend}{self.geom()}{inside}</body>"

    def bend(self, body: int) -> str:
        """What tendons bend around on a body, and a site on the world, which has no other."""
        if not self.features.spatial:
            return ""
        site = "" if body else f'<site name="s0" pos="{self.numbers(3, -0.5, 0.5)}"/>'
        return site + random_tendons.shape(self.rng, self.numbers, str(body))

    def _next(self) -> int:
        self.joints += 1
        return self.joints

    def passive(self) -> str:
        text = ""
        if self.has("armature"):
            text += f' armature="{self.rng.uniform(0.01, 0.3):.17g}"'
        if self.has("damping"):
            text += f' damping="{self.rng.uniform(0.05, 2):.17g}"'
        return text

    def spring(self) -> str:
        """A spring of a ball or a free joint, which rests at the start."""
        return f' stiffness="{self.rng.uniform(0.5, 20):.17g}"' if self.has("springs") else ""

    def compensation(self) -> str:
        return f' gravcomp="{self.rng.uniform(-0.5, 1.5):.17g}"' if self.has("compensation") else ""

    def held(self) -> str:
        """Whether the actuators of a joint hold its bodies against gravity."""
        return ' actuatorgravcomp="true"' if self.has("compensation") else ""

    def ball(self) -> str:
        self.balls.append(f"j{self._next()}")
        text = f'<joint name="{self.balls[-1]}" type="ball" pos="{self.numbers(3, -0.2, 0.2)}"{self.passive()}'
        text += self.spring() + self.held()
        if self.has("limits"):
            text += f' range="0 {self.rng.uniform(0.2, 1.5):.17g}" margin="{self.rng.choice([0.0, 0.3])}"'
            text += f" {self.softness(('solreflimit', 'solimplimit'))}"
        return f"{text} {self.dry()}/>"

    def dry(self) -> str:
        """Dry friction of a joint."""
        if not self.has("friction"):
            return ""
        soft = self.softness(("solreffriction", "solimpfriction"))
        return f'frictionloss="{self.rng.uniform(0.05, 1):.17g}" {soft}'

    def scalar(self) -> str:
        name = f"j{self._next()}"
        self.scalars.append(name)
        kind = "hinge" if self.rng.random() < 0.6 else "slide"
        text = f'<joint name="{name}" type="{kind}" pos="{self.numbers(3, -0.2, 0.2)}" axis="{self.numbers(3)}"'
        text += self.passive() + self.held()
        if self.has("reference"):
            text += f' ref="{self.rng.uniform(-1, 1):.17g}"'
        if self.has("springs"):
            rest = self.rng.uniform(-0.5, 0.5)
            text += f' stiffness="{self.rng.uniform(0.5, 20):.17g}" springref="{rest:.17g}"'
        if self.has("limits"):
            low, high = np.sort(self.rng.uniform(-0.6, 0.6, 2))
            margin = self.rng.choice([0.0, 0.05, 0.5])
            text += f' range="{low:.17g} {high:.17g}" margin="{margin}" {self.softness(("solreflimit", "solimplimit"))}'
        text += f" {self.dry()}"
        if self.has("bounds", 0.3):
            text += ' actuatorfrcrange="-0.5 0.7"'
        return text + "/>"

    def geom(self) -> str:
        if not self.has("geoms", 0.8):
            return ""
        kind, size = [("sphere", 1), ("capsule", 2), ("box", 3)][self.rng.integers(3)]
        rng = self.rng
        self.geoms.append((f"g{len(self.geoms)}", self.bodies))
        name = self.geoms[-1][0]
        text = f'<geom name="{name}" type="{kind}" size="{self.numbers(size, 0.05, 0.2)}" mass="0"'
        text += f' pos="{self.numbers(3, -0.1, 0.1)}"'
        text += f' friction="{self.numbers(3, 0.1, 1.5)}" condim="{rng.choice([1, 3, 4, 6])}"'
        text += f' priority="{rng.choice([0, 0, 1])}" solmix="{rng.uniform(0, 2):.17g}"'
        text += f" {self.softness(('solref', 'solimp'))}"
        text += f' margin="{rng.choice([0, 0.01])}" gap="{rng.choice([0, 0.01])}"'
        bits = [0, 0, 1] if self.features.pairs else [1, 2, 3]
        text += f' contype="{rng.choice(bits)}" conaffinity="{rng.choice(bits)}"'
        return text + "/>"

    def pairs(self) -> str:
        if not self.features.pairs or len(self.geoms) < 1:
            return ""
        rng, text = self.rng, ""
        known = [("floor", 0), *self.geoms]
        for i, (first, body) in enumerate(known):
            for second, other in known[:i]:
                if rng.random() < 0.4:
                    text += self.pair(first, second)
                if min(body, other) and body != other and rng.random() < 0.3:
                    text += f'<exclude body1="b{body}" body2="b{other}"/>'
        return f"<contact>{text}</contact>"

    def pair(self, first: str, second: str) -> str:
        rng = self.rng
        slide, twist, roll = rng.uniform(0.1, 1.5, 3)
        text = f'<pair geom1="{first}" geom2="{second}" condim="{rng.choice([1, 3, 4, 6])}"'
        text += f' friction="{slide:.17g} {slide:.17g} {twist:.17g} {roll:.17g} {roll:.17g}"'
        text += f' margin="{rng.choice([0, 0.02])}" gap="{rng.choice([0, 0.01])}" {self.softness(("solref", "solimp"))}'
        if rng.random() < 0.5:
            text += f' solreffriction="{rng.uniform(0.005, 0.05):.17g} {rng.uniform(0.3, 1.5):.17g}"'
        return text + "/>"

    def tendons(self) -> str:
        text = ""
        for k in range(2 if self.features.tendons and len(self.scalars) >= 2 else 0):
            own = self.rng.choice(self.scalars, min(len(self.scalars), 2 + k), replace=False)
            terms = "".join(f'<joint joint="{name}" coef="{self.rng.uniform(-1, 1):.17g}"/>' for name in own)
            text += f'<fixed name="t{k}" {self.pulls()}>{terms}</fixed>'
        for k in range(2 if self.features.spatial else 0):
            path = random_tendons.path(self.rng, self.bodies + 1)
            text += f'<spatial name="p{k}" {self.pulls(1.0)}>{path}</spatial>'
        return f"<tendon>{text}</tendon>"

    def pulls(self, length: float = 0.0) -> str:
        """What acts along a tendon of about this length."""
        text, rng = "", self.rng
        if self.features.actuators and self.has("bounds"):
            text += 'actuatorfrcrange="-0.6 0.9" '
        if self.has("pulls"):
            text += f'stiffness="{rng.uniform(0.5, 20):.17g}" damping="{rng.uniform(0.05, 2):.17g}" '
        if self.has("pulls"):
            low, high = length + np.sort(rng.uniform(-0.5, 0.5, 2))
            text += f'springlength="{low:.17g} {high:.17g}" '
        if self.has("pulls"):
            low, high = length + np.sort(rng.uniform(-0.4, 0.4, 2))
            text += f'range="{low:.17g} {high:.17g}" margin="{rng.choice([0.0, 0.3])}" '
            text += self.softness(("solreflimit", "solimplimit"))
        if self.has("pulls"):
            text += f' frictionloss="{rng.uniform(0.05, 1):.17g}" {self.softness(("solreffriction", "solimpfriction"))}'
        return text

    def equalities(self) -> str:
        rng, text = self.rng, ""
        if self.features.equalities and len(self.scalars) >= 2:
            first, second = rng.choice(self.scalars, 2, replace=False)
            line = f'polycoef="{rng.uniform(-0.2, 0.2):.17g} {rng.uniform(-1, 1):.17g} 0 0 0"'
            text += f'<joint joint1="{first}" joint2="{second}" {line} {self.equality()}/>'
        if self.features.polynomials and len(self.scalars) >= 2:
            first, second = rng.choice(self.scalars, 2, replace=False)
            other = f'joint2="{second}"' if rng.random() < 0.7 else ""
            text += f'<joint joint1="{first}" {other} polycoef="{self.numbers(5, -0.5, 0.5)}" {self.equality()}/>'
        if self.features.pulls and self.features.tendons and len(self.scalars) >= 2:
            other = 'tendon2="t1"' if rng.random() < 0.7 else ""
            text += f'<tendon tendon1="t0" {other} polycoef="{self.numbers(5, -0.5, 0.5)}" {self.equality()}/>'
        if self.features.pulls and self.features.spatial:
            other = 'tendon2="p1"' if rng.random() < 0.7 else ""
            line = f'polycoef="{rng.uniform(-0.1, 0.1):.17g} {rng.uniform(-1, 1):.17g} 0 0 0"'
            text += f'<tendon tendon1="p0" {other} {line} {self.equality()}/>'
        if self.has("connections", 0.7):
            text += self.connection("connect") + self.connection("weld")
        if self.features.mocap:
            second = self.rng.integers(1, self.bodies + 1)
            text += f'<weld body1="placed" body2="b{second}" {self.equality()}/>'
        return f"<equality>{text}</equality>"

    def equality(self) -> str:
        return self.softness(("solref", "solimp"))

    def connection(self, kind: str) -> str:
        """Two bodies or sites that are held together, or a body and the world."""
        rng = self.rng
        first, second = rng.choice(self.bodies + 1, 2, replace=False)
        first, second = max(first, second), min(first, second)
        scale = f'torquescale="{rng.uniform(0.2, 2):.17g}"' if kind == "weld" else ""
        if second and rng.random() < 0.5:
            return f'<{kind} site1="s{first}" site2="s{second}" {scale} {self.equality()}/>'
        place = f'anchor="{self.numbers(3, -0.3, 0.3)}"'
        if kind == "weld" and rng.random() < 0.5:
            place += f' relpose="{self.numbers(7, -0.5, 0.5)}"'
        other = f'body2="b{second}"' if second else ""
        return f'<{kind} body1="b{first}" {other} {place} {scale} {self.equality()}/>'

    def actuators(self) -> str:
        if not self.features.actuators:
            return ""
        rng, text = self.rng, ""
        targets = [f'joint="{name}" gear="{self.numbers(1, -3, 3)}"' for name in self.scalars]
        if self.features.tendons and len(self.scalars) >= 2:
            tendons = [f"t{k}" for k in range(2)] * (2 if self.features.bounds else 1)
            targets += [f'tendon="{name}" gear="{self.numbers(1, -3, 3)}"' for name in tendons]
        if self.features.spatial:
            targets += [f'tendon="p{k}" gear="{self.numbers(1, -3, 3)}"' for k in range(2)]
        if self.features.transmissions:
            targets += self.transmissions()
        for target in targets:
            bounds = ""
            if self.has("bounds"):
                bounds += ' ctrlrange="-0.5 0.8"'
            if self.has("bounds"):
                bounds += ' forcerange="-1 1.5"'
            if target.startswith(("joint", "tendon")) and self.has("muscles"):
                text += random_tendons.muscle(rng, target, bounds)
                continue
            if self.has("activations", 0.7):
                text += self.with_activation(target, bounds)
                continue
            kind = rng.integers(5)
            text += [
                f"<motor {target}{bounds}/>",
                f'<position {target} kp="{rng.uniform(1, 50):.17g}" kv="{rng.uniform(0.1, 5):.17g}"{bounds}/>',
                f'<velocity {target} kv="{rng.uniform(0.1, 5):.17g}"{bounds}/>',
                f'<damper {target} kv="{rng.uniform(0.1, 5):.17g}" ctrlrange="0 1"/>',
                f"<general {target} {self.law()}{bounds}/>",
            ][kind]
        return f"<actuator>{text}</actuator>"

    def law(self) -> str:
        """An affine gain and bias. Gains that grow fast with the velocity would throw bodies off."""
        gain = f'gaintype="affine" gainprm="{self.numbers(2)} {self.numbers(1, -0.1, 0.1)}"'
        return f'{gain} biastype="affine" biasprm="{self.numbers(3, -1, 0)}"'

    def transmissions(self) -> list[str]:
        """One actuator on each ball and free joint, on some sites, and on sites relative to others."""
        kinds = self.rng.choice(["joint", "jointinparent"], len(self.balls) + len(self.frees))
        targets = [
            f'{kind}="{name}" gear="{self.numbers(6, -3, 3)}"'
            for kind, name in zip(kinds, self.balls + self.frees, strict=True)
        ]
        for _ in range(2):
            first, second = self.rng.integers(1, self.bodies + 1, 2)
            other = f'refsite="s{second}"' if self.rng.random() < 0.6 else ""
            targets.append(f'site="s{first}" {other} gear="{self.numbers(6, -1, 1)}"')
        if self.bodies > 1:
            first, second = self.rng.choice(self.bodies, 2, replace=False) + 1
            rod = f'cranklength="{self.rng.uniform(0.3, 2):.17g}"'
            targets.append(f'slidersite="s{first}" cranksite="s{second}" {rod} gear="{self.numbers(1, -1, 1)}"')
        return targets

    def with_activation(self, target: str, bounds: str) -> str:
        rng = self.rng
        kind = rng.choice(["integrator", "filter", "filterexact"])
        early = f'actearly="{rng.choice(["true", "false"])}"'
        limits = 'actrange="-0.4 0.3"' if rng.random() < 0.5 else ""
        time = f'dynprm="{rng.uniform(0.005, 0.5):.17g}"'
        return f'<general {target} dyntype="{kind}" {time} {early} {limits} {self.law()}{bounds}/>'
