"""How the friction of two shapes combines: the rule of the scene, in every place that friction can come from."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import tightloop as tl

#: Friction of ground and cube, and what each rule makes of them; halves are exact in float32.
GROUND, CUBE = 0.25, 0.5
RULES = {"max": 0.5, "mean": 0.375, "min": 0.25, "product": 0.125}


def slide(rule: Any, ground: float, cube: float, *, varies: str = "", seconds: float = 0.5) -> np.ndarray:
    """Return where a cube is that slid on a ground, tilted by its gravity."""
    scene = tl.Scene(gravity=(6.0, 0.0, -8.0), friction_combine=rule)
    scene.add_ground(mu=1.0 if varies else ground)
    scene.add_cube(pos=(0, 0, 0.025), mu=1.0 if varies else cube)
    if varies == "drawn":
        drawn = {"ground": tl.Uniform(ground, ground), "cube": tl.Uniform(cube, cube)}
        scene.randomize(params={"shape_mu": drawn})
    with tl.launch(scene, worlds=2, params=("shape_mu",) if varies else ()) as sim:
        if varies == "written":
            sim.params.shape_mu = np.tile([ground, cube], (2, 1))
        frame = sim.forward()
        for _ in range(round(seconds * 60)):
            frame = sim.step()
        return frame.joint_q.copy()


@pytest.mark.parametrize("varies", ["", "drawn", "written"])
@pytest.mark.parametrize("rule", RULES)
def test_a_rule_is_as_if_both_had_its_result(rule, varies):
    both = RULES[rule]
    got = slide(rule, GROUND, CUBE, varies=varies)
    assert np.array_equal(got, slide("max", both, both, varies=varies))
    # 7.5 m/s² would be all of it; mu g cos resists
    assert got[0, 0] == pytest.approx((6.0 - both * 8.0) / 2 * 0.25, rel=0.05)


def test_a_rule_is_saved_with_the_scene(tmp_path):
    path = tmp_path / "scene.toml"
    tl.Scene(friction_combine="mean").save(path)
    assert 'friction_combine = "mean"' in path.read_text()
    assert tl.Scene.load(path).friction_combine == "mean"
    tl.Scene().save(path)
    assert "friction_combine" not in path.read_text(), "the default is as it was"


def test_an_unknown_rule_is_refused_with_those_that_there_are():
    with pytest.raises(tl.SceneError, match=r"friction_combine 'sum'.*'max', 'mean', 'min', 'product'"):
        tl.Scene(friction_combine="sum")  # type: ignore[arg-type]


@pytest.mark.parametrize("varies", [False, True])
def test_geoms_of_a_mujoco_model_keep_mujocos_rule(varies):
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string("""<mujoco><option gravity="6 0 -8"/><worldbody>
      <geom name="floor" type="plane" size="1 1 .1" friction=".25"/>
      <body pos="0 0 .025"><freejoint/><geom name="box" type="box" size=".025 .025 .025" friction=".5"/></body>
      </worldbody></mujoco>""")
    ends = []
    rules: tuple[Any, ...] = ("max", "min")
    for rule in rules:
        scene = tl.Scene.from_mujoco(model, name="m", substeps=8)
        scene.friction_combine = rule
        scene.add_cube(pos=(0.5, 0.5, 5), name="own")
        with tl.launch(scene, worlds=1, params=("shape_mu",) if varies else ()) as sim:
            frame = sim.forward()
            for _ in range(30):
                frame = sim.step()
            ends.append(frame.joint_q[0, :7].copy())
    assert np.array_equal(*ends)


@pytest.mark.parametrize("varies", [False, True])
def test_a_cube_on_a_geom_of_a_mujoco_model_follows_mujocos_rule(varies):
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string("""<mujoco><option gravity="6 0 -8"/><worldbody>
      <geom name="floor" type="plane" size="1 1 .1" friction=".25"/></worldbody></mujoco>""")
    ends = {}
    cases: tuple[tuple[Any, float], ...] = (("max", CUBE), ("min", CUBE), ("max", GROUND))
    for rule, mu in cases:
        scene = tl.Scene.from_mujoco(model, name="m", substeps=8)
        scene.friction_combine = rule
        scene.add_cube(pos=(0, 0, 0.025), mu=mu, name="own")
        with tl.launch(scene, worlds=1, params=("shape_mu",) if varies else ()) as sim:
            frame = sim.forward()
            for _ in range(30):
                frame = sim.step()
            ends[rule, mu] = frame.joint_q[0].copy()
    assert np.array_equal(ends["max", CUBE], ends["min", CUBE])
    assert ends["max", GROUND][0] > 1.5 * ends["max", CUBE][0], "the cube's own friction counts where it is larger"
