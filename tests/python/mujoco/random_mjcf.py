"""Random MuJoCo models: trees of bodies with every kind of joint, springs, limits, actuators and geoms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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
    actuators: bool = False
    tendons: bool = False
    bounds: bool = False
    """Bounds of controls, actuator forces and sums of them on a joint."""
    geoms: bool = False
    option: str = ""
    """Attributes of ``<option>``."""
    flag: str = ""
    """Attributes of ``<option><flag/>``."""


def random_mjcf(seed: int, bodies: int, features: Features) -> str:
    """Return the XML of a random model."""
    return _Model(np.random.default_rng(seed), features).xml(bodies)


class _Model:
    def __init__(self, rng: np.random.Generator, features: Features) -> None:
        self.rng, self.features = rng, features
        self.scalars: list[str] = []
        self.joints = 0

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
        trees = ""
        while bodies > 0:
            size = int(self.rng.integers(1, bodies + 1))
            trees += self.body(size, root=True)
            bodies -= size
        return f"""<mujoco>
<compiler angle="radian" autolimits="true"/>
<option {f.option}><flag {f.flag}/></option>
<worldbody>{'<geom type="plane" size="5 5 .1" pos="0 0 -1"/>' if f.geoms else ""}{trees}</worldbody>
{self.tendons()}{self.equalities()}{self.actuators()}
</mujoco>"""

    def body(self, size: int, *, root: bool = False) -> str:
        joints = ""
        if root and self.has("free"):
            joints = f'<freejoint name="j{self._next()}"/>'
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
        return f"<body {pose}>{joints}{inertial}{self.geom()}{inside}</body>"

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

    def ball(self) -> str:
        return f'<joint name="j{self._next()}" type="ball" pos="{self.numbers(3, -0.2, 0.2)}"{self.passive()}/>'

    def scalar(self) -> str:
        name = f"j{self._next()}"
        self.scalars.append(name)
        kind = "hinge" if self.rng.random() < 0.6 else "slide"
        text = f'<joint name="{name}" type="{kind}" pos="{self.numbers(3, -0.2, 0.2)}" axis="{self.numbers(3)}"'
        text += self.passive()
        if self.has("reference"):
            text += f' ref="{self.rng.uniform(-1, 1):.17g}"'
        if self.has("springs"):
            rest = self.rng.uniform(-0.5, 0.5)
            text += f' stiffness="{self.rng.uniform(0.5, 20):.17g}" springref="{rest:.17g}"'
        if self.has("limits"):
            low, high = np.sort(self.rng.uniform(-0.6, 0.6, 2))
            margin = self.rng.choice([0.0, 0.05, 0.5])
            text += f' range="{low:.17g} {high:.17g}" margin="{margin}" {self.softness(("solreflimit", "solimplimit"))}'
        if self.has("friction"):
            text += f' frictionloss="{self.rng.uniform(0.05, 1):.17g}"'
            text += f" {self.softness(('solreffriction', 'solimpfriction'))}"
        if self.has("bounds", 0.3):
            text += ' actuatorfrcrange="-0.5 0.7"'
        return text + "/>"

    def geom(self) -> str:
        if not self.has("geoms", 0.8):
            return ""
        kind, size = [("sphere", 1), ("capsule", 2), ("box", 3)][self.rng.integers(3)]
        rng = self.rng
        text = f'<geom type="{kind}" size="{self.numbers(size, 0.05, 0.2)}" pos="{self.numbers(3, -0.1, 0.1)}" mass="0"'
        text += f' friction="{self.numbers(3, 0.1, 1.5)}" condim="{rng.choice([1, 3, 4, 6])}"'
        text += f' priority="{rng.choice([0, 0, 1])}" solmix="{rng.uniform(0, 2):.17g}"'
        text += f" {self.softness(('solref', 'solimp'))}"
        text += f' margin="{rng.choice([0, 0.01])}" gap="{rng.choice([0, 0.01])}"'
        text += f' contype="{rng.choice([1, 2, 3])}" conaffinity="{rng.choice([1, 2, 3])}"'
        return text + "/>"

    def tendons(self) -> str:
        if not self.features.tendons or len(self.scalars) < 2:
            return ""
        text = ""
        for k in range(2):
            own = self.rng.choice(self.scalars, min(len(self.scalars), 2 + k), replace=False)
            terms = "".join(f'<joint joint="{name}" coef="{self.rng.uniform(-1, 1):.17g}"/>' for name in own)
            text += f'<fixed name="t{k}">{terms}</fixed>'
        return f"<tendon>{text}</tendon>"

    def equalities(self) -> str:
        if not self.features.equalities or len(self.scalars) < 2:
            return ""
        first, second = self.rng.choice(self.scalars, 2, replace=False)
        line = f'polycoef="{self.rng.uniform(-0.2, 0.2):.17g} {self.rng.uniform(-1, 1):.17g} 0 0 0"'
        soft = self.softness(("solref", "solimp"))
        return f'<equality><joint joint1="{first}" joint2="{second}" {line} {soft}/></equality>'

    def actuators(self) -> str:
        if not self.features.actuators or not self.scalars:
            return ""
        rng, text = self.rng, ""
        targets = [f'joint="{name}"' for name in self.scalars]
        if self.features.tendons and len(self.scalars) >= 2:
            targets += ['tendon="t0"', 'tendon="t1"']
        for target in targets:
            gear = f'gear="{rng.uniform(-3, 3):.17g}"'
            bounds = ""
            if self.has("bounds"):
                bounds += ' ctrlrange="-0.5 0.8"'
            if self.has("bounds"):
                bounds += ' forcerange="-1 1.5"'
            kind = rng.integers(5)
            text += [
                f"<motor {target} {gear}{bounds}/>",
                f'<position {target} {gear} kp="{rng.uniform(1, 50):.17g}" kv="{rng.uniform(0.1, 5):.17g}"{bounds}/>',
                f'<velocity {target} {gear} kv="{rng.uniform(0.1, 5):.17g}"{bounds}/>',
                f'<damper {target} {gear} kv="{rng.uniform(0.1, 5):.17g}" ctrlrange="0 1"/>',
                f'<general {target} {gear} gaintype="affine" gainprm="{self.numbers(3)}" biastype="affine" '
                f'biasprm="{self.numbers(3, -1, 0)}"{bounds}/>',
            ][kind]
        return f"<actuator>{text}</actuator>"
