"""Ellipsoids at every other shape: points, distances and normals against MuJoCo, and at rest."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from geom_pairs import at_rest, pair_model, random_poses
from live_model import live

import tightloop as tl
from tiers import nightly

STATES = [1_000, nightly(10_000)]
FIELDS = ("contact_count", "contact_pos", "contact_distance", "contact_normal")
EGG = ("ellipsoid", (0.05, 0.08, 0.11))
DISC = ("ellipsoid", (0.12, 0.1, 0.02))
PAIRS = {
    "sphere": (EGG, ("sphere", (0.06,))),
    "small sphere at a disc": (("sphere", (0.01,)), DISC),
    "capsule": (EGG, ("capsule", (0.05, 0.09))),
    "box": (EGG, ("box", (0.05, 0.08, 0.11))),
    "disc on a plate": (DISC, ("box", (0.3, 0.3, 0.05))),
    "cylinder": (EGG, ("cylinder", (0.08, 0.05))),
    "ellipsoid": (EGG, ("ellipsoid", (0.06, 0.06, 0.03))),
    "discs": (DISC, DISC),
}
#: MuJoCo's search ends at 1e-6 m or after 35 iterations, and normals are good to the root of that over a radius. With a
#: smaller `ccd_tolerance` it is no better. sim-core/engine/tests/collide/hulls.rs compares ours with exact oracles.
SAME, SAME_NORMAL, SAME_POINT = 1e-5, 0.1, 0.02
#: Depth up to which both find the same way out, relative to the smallest radius.
SHALLOW = 0.3


@pytest.mark.parametrize("states", STATES)
@pytest.mark.parametrize("name", PAIRS)
def test_contacts_are_mujocos(name, states):
    free, still = PAIRS[name]
    qpos = random_poses(np.random.default_rng(list(PAIRS).index(name)), free, still, states)
    least = min(min(size) for kind, size in (free, still) if kind == "ellipsoid")
    with live(pair_model(free, still, 0.005), worlds=states, fields=FIELDS) as pair:
        frame = pair.place(at_rest(pair.model, qpos))
        data, shallow, deeper = mujoco.MjData(pair.model), 0, []
        for world, pose in enumerate(frame.qpos.astype(float)):
            mujoco.mj_resetData(pair.model, data)
            data.qpos[:] = pose
            mujoco.mj_forward(pair.model, data)
            found = float(frame.contact_distance[world, 0]) if frame.contact_count[world] else 0.005
            expected = float(data.contact.dist[0]) if data.ncon else 0.005
            if expected < -SHALLOW * least:
                deeper.append(found / expected)
                continue
            assert abs(found - expected) < SAME, f"{pose.tolist()}: {found}, MuJoCo {expected}"
            if data.ncon and frame.contact_count[world]:
                shallow += 1
                way = -1.0 if data.contact.geom[0, 0] else 1.0
                off = np.abs(frame.contact_normal[world, 0] - way * data.contact.frame[0, :3]).max()
                apart = np.abs(frame.contact_pos[world, 0] - data.contact.pos[0]).max()
                assert off < SAME_NORMAL, f"{pose.tolist()}: {off}"
                assert apart < SAME_POINT, f"{pose.tolist()}: {apart}"
    assert shallow > states // 25
    # MuJoCo's depths of deep penetration are off by a few percent, and another way out may be about as short
    assert max(deeper) < 1.3 and np.mean(np.array(deeper) > 1.03) < 0.01, sorted(deeper)[-10:]


@pytest.mark.parametrize("ground", ['type="plane" size="0 0 1"', 'type="box" size="1 1 .1" pos="0 0 -.1"'])
@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_an_egg_comes_to_rest_on_its_side(ground, precision):
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><geom {ground} friction="1 .05 .01" condim="6"/>
        <body pos="0 0 .13" euler="20 10 0"><freejoint/><geom type="ellipsoid" size=".05 .08 .11" mass="1"/></body>
        </worldbody></mujoco>"""
    )
    with tl.launch(tl.Scene.from_mujoco(model), worlds=4, precision=precision, fields=("qpos", "qvel")) as sim:
        for _ in range(3000):
            frame = sim.step()
        assert np.abs(frame.qpos[:, 2] - 0.05).max() < 1e-3
        assert np.abs(frame.qvel).max() < 1e-2
