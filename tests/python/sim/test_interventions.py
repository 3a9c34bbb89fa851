"""What is done to some worlds through a daemon, and no others notice: random programs against a twin, bit for bit.

``TIGHTLOOP_CASES=100 TIGHTLOOP_SEED=7`` tries that many programs from that seed on.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl

WORLDS = 19
FIELDS = ("joint_q", "joint_qd", "joint_qdd", "joint_f", "joint_target_q", "body_q", "body_qd", "mass_matrix")
CONTACTS = ("contact_count", "contact_pos", "contact_force", "contact_pair", "body_contact_force")
ALWAYS = ("time", "step", "status", "contacts_left_out")
PARAMS = ("gravity", "body_mass_scale", "joint_damping", "joint_target_ke", "joint_effort_limit", "shape_mu", "body_f")
FIRST = int(os.environ.get("TIGHTLOOP_SEED", "1"))
SEEDS = range(FIRST, FIRST + int(os.environ.get("TIGHTLOOP_CASES", "6")))
FROZEN = 1 | 8

Op = tuple[str, dict[str, Any]]
Mask = NDArray[np.bool_]


@pytest.fixture
def scene(pendulum) -> tl.Scene:
    """A driven pendulum that starts anywhere, over a box and a ball on the ground, with room for few contacts."""
    pendulum.contacts_max = 6
    pendulum.robots["arm"].joint_target_ke = [20.0, 5.0]
    pendulum.add_ground(z=-0.1)
    pendulum.add_box(half_extents=(0.1, 0.1, 0.1), body=pendulum.add_body(name="box", pos=(0.3, 0, 0.02)))
    pendulum.add_sphere(radius=0.1, body=pendulum.add_body(name="ball", pos=(0.35, 0.05, 0.25)))
    pendulum.randomize(joint_q={"arm": tl.Uniform(-1.0, 1.0)})
    return pendulum


def launch(scene: tl.Scene, precision: str = "f32", **options: Any) -> tl.Sim:
    return tl.launch(scene, worlds=WORLDS, precision=precision, params=PARAMS, fields=(*FIELDS, *CONTACTS), **options)


def random_op(rng: np.random.Generator, sim: tl.Sim, mask: Mask, huge: float | None) -> Op:
    """Something that touches the worlds of the mask alone; commands are of all worlds, and no such thing."""

    def numbers(shape: tuple[int, ...], size: float) -> NDArray[np.float64]:
        values = rng.uniform(-size, size, (WORLDS, *shape))
        if huge is not None:
            values[rng.random(values.shape) < 0.3] = rng.choice([huge, -huge, 1e6])
        values[~mask] = np.nan  # which nobody may look at
        return values

    kind = rng.integers(6)
    if kind == 0:
        return "write", {"joint_qd": numbers((len(sim.dof_names),), 2.0), "mask": mask}
    if kind == 1:
        start = np.tile([0.3, -0.2, 0.3, 0, 0.1, 0, 0, 0, 1, 0.35, 0.05, 0.25, 0, 0, 0, 1], (WORLDS, 1))
        return "write", {"joint_q": start + rng.uniform(-0.2, 0.2, start.shape), "mask": mask}
    if kind == 2:
        wrench = numbers((len(sim.body_names), 6), 3.0)
        scale = rng.uniform(0.3, 3.0, (WORLDS, len(sim.body_names)))
        return "params.write", {"body_f": wrench, "body_mass_scale": scale, "mask": mask}
    if kind == 3:
        gains = rng.uniform(0, 50, (WORLDS, len(sim.dof_names))) if huge is None else 1e30
        return "params.write", {"joint_target_ke": gains, "gravity": numbers((3,), 10.0), "mask": mask}
    if kind == 4:
        seeds = [None, 3, rng.integers(0, 2**32, WORLDS)][rng.integers(3)]
        return "reset", {"mask": mask, "seed": seeds}
    return "restore", {"worlds": mask, "from_world": [None, int(rng.integers(WORLDS))][rng.integers(2)]}


def programs(rng: np.random.Generator, sim: tl.Sim, sick: Mask, huge: float | None) -> tuple[list[Op], list[Op]]:
    """A program, and the same with something else done to the sick worlds."""
    plain: list[Op] = []
    changed: list[Op] = []
    others = np.flatnonzero(~sick)
    for _ in range(14):
        for _ in range(rng.integers(2)):
            op = random_op(rng, sim, rng.random(WORLDS) < 0.4, None)
            if op[1].get("from_world") is not None:
                op[1]["from_world"] = int(rng.choice(others))
            plain.append(op)
            changed.append(op)
        changed += [random_op(rng, sim, sick, huge) for _ in range(rng.integers(3))]
        if rng.random() < 0.3:
            changed.append(("forward", {}))
        torque = rng.uniform(-3, 3, (WORLDS, len(sim.dof_names)))
        plain.append(("step", {"joint_f": torque}))
        torque = torque.copy()
        torque[sick] = rng.uniform(-3, 3, torque[sick].shape) if huge is None else huge
        changed.append(("step", {"joint_f": torque}))
    return plain, changed


def play(sim: tl.Sim, ops: list[Op], kept: tl.Snapshot) -> list[tl.FrameCopy]:
    """The frame after each step; what is restored is the same in every run."""
    frames = []
    for name, arguments in ops:
        if name == "restore":
            sim.restore(kept, **arguments)
        elif name == "params.write":
            sim.params.write(**arguments)
        else:
            frame = getattr(sim, name)(**arguments)
            if name == "step":
                frames.append(frame.copy())
    return frames


def differing(one: list[tl.FrameCopy], two: list[tl.FrameCopy], worlds: Mask) -> list[str]:
    def bits(frame: tl.FrameCopy, name: str) -> bytes:
        return np.ascontiguousarray(getattr(frame, name)[worlds]).tobytes()

    return [
        f"{name} in frame {k}"
        for k, (a, b) in enumerate(zip(one, two, strict=True))
        for name in (*FIELDS, *CONTACTS, *ALWAYS)
        if bits(a, name) != bits(b, name)
    ]


@pytest.mark.parametrize("seed", SEEDS)
def test_other_worlds_keep_their_bits(scene, seed):
    rng = np.random.default_rng(seed)
    precision = ("f32", "f64")[seed % 2]
    huge = {"f32": 1e38, "f64": 1e307}[precision] if seed % 3 else None
    sick = rng.random(WORLDS) < 0.3
    sick[rng.integers(WORLDS)] = True
    sick[rng.integers(WORLDS)] = False
    faults = {"bounds": {"joint_qd": 200.0}, "on_fault": ("freeze", "reset")[seed // 2 % 2]} if seed % 4 else {}
    with launch(scene, precision, threads=1, **faults) as sim, launch(scene, precision, threads=2, **faults) as twin:
        for _ in range(5):
            sim.step()
        kept = sim.snapshot()
        sim.reset(seed=seed)
        twin.reset(seed=seed)
        plain, changed = programs(rng, sim, sick, huge)
        expected, found = play(sim, plain, kept), play(twin, changed, kept)
        assert not differing(expected, found, ~sick)
        assert differing(expected, found, sick), "something was done to them"
        if huge is not None:
            assert any((frame.status[sick] & FROZEN).any() for frame in found)
        for frame in found:
            assert np.isfinite(frame.joint_q).all() and np.isfinite(frame.joint_qd).all()
        # the sick are as good as new once parameters and state are
        for run in (sim, twin):
            for name in PARAMS:
                run.params.write(**{name: 1.0})
            run.reset(mask=sick, seed=9)
        assert not differing([sim.step().copy()], [twin.step().copy()], sick)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e39])
def test_numbers_that_are_not_finite_are_refused_by_name_and_change_nothing(scene, bad):
    world = 11
    with launch(scene) as sim:
        dofs, coords, links = len(sim.dof_names), len(sim.coord_names), len(sim.body_names)
        sim.step(joint_f=np.ones(dofs))
        before = sim.snapshot().to_bytes()
        inputs = {
            "joint_f": (sim.step, dofs, "joint_target_q"),
            "joint_target_q": (sim.step, dofs, "joint_f"),
            "joint_target_qd": (sim.step, dofs, "joint_f"),
            "joint_q": (sim.write, coords, "joint_qd"),
            "joint_qd": (sim.write, dofs, "joint_q"),
            "gravity": (sim.params.write, 3, "joint_damping"),
            "joint_damping": (sim.params.write, dofs, "gravity"),
            "shape_mu": (sim.params.write, 3, "gravity"),
        }
        for name, (call, columns, other) in inputs.items():
            values = np.zeros((WORLDS, columns))
            values[world, 1] = bad
            # nothing of another array is taken either
            for more in ({}, {other: np.full((WORLDS, inputs[other][1]), 0.5)}):
                if "joint_target_q" in more:
                    more["joint_target_q"][:, 2:] = 0.0  # nothing drives a free body
                with pytest.raises(tl.CommandRefused, match=rf"`{name}` is .* in world {world} for "):
                    call(**more, **{name: values})
        push = np.zeros((WORLDS, links, 6))
        push[world, 1, 2] = bad
        with pytest.raises(tl.CommandRefused, match=rf"`body_f` is .* in world {world} for "):
            sim.step(joint_f=np.full((WORLDS, dofs), 0.7), body_f=push)
        assert sim.snapshot().to_bytes() == before


@pytest.mark.parametrize("scale", [0.0, -1.0, 1e-9, np.nan, np.inf])
@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_an_impossible_mass_is_refused_by_name_and_changes_nothing(scene, scale, precision):
    with launch(scene, precision) as sim:
        sim.step()
        before = sim.snapshot().to_bytes()
        scales = np.ones((WORLDS, len(sim.body_names)))
        scales[4, 2] = scale
        with pytest.raises(tl.CommandRefused, match=r"body_mass_scale.*`arm/lower`"):
            sim.params.write(gravity=0.0, body_mass_scale=scales)
        assert sim.snapshot().to_bytes() == before
        # worlds outside the mask are not looked at
        sim.params.write(body_mass_scale=scales, mask=np.arange(WORLDS) != 4)
