"""Parameters drawn at resets, through the daemon and scene files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import tightloop as tl


@pytest.fixture
def drawn(pendulum) -> tl.Scene:
    """The pendulum over the ground with a cube, some parameters drawn."""
    pendulum.add_ground()
    pendulum.add_cube(pos=(1, 2, 3))
    pendulum.randomize(
        params={
            "shape_mu": {"cube": tl.Uniform(0.1, 1.0)},
            "gravity": {"z": tl.Normal(-9.81, 0.1)},
            "body_mass_scale": {"arm": tl.Uniform(0.9, 1.1), "arm/lower": tl.Uniform(2.0, 3.0)},
        }
    )
    return pendulum


def numbers(sim: tl.Sim) -> dict[str, np.ndarray]:
    return {name: getattr(sim.params, name).astype(float) for name in sim.params.names}


def test_worlds_get_numbers_of_their_own_at_launch_and_reset(drawn):
    worlds = 4096
    with tl.launch(drawn, worlds=worlds, precision="f64", params=("joint_damping",)) as sim:
        assert sim.params.names == ("gravity", "body_mass_scale", "joint_damping", "shape_mu")
        first = numbers(sim)
        cube = sim.shape_names.index("cube/box")
        upper, lower = (sim.body_names.index(f"arm/{link}") for link in ("upper", "lower"))
        mu, gravity = first["shape_mu"], first["gravity"]
        # a mean is known to 4.5 standard errors but in one of 100 000 samples
        error = 4.5 / np.sqrt(worlds)
        assert mu[:, cube].min() >= 0.1 and mu[:, cube].max() <= 1.0 and np.ptp(mu[:, cube]) > 0.89
        assert abs(mu[:, cube].mean() - 0.55) < error * 0.9 / np.sqrt(12)
        assert abs(gravity[:, 2].mean() + 9.81) < error * 0.1 and abs(gravity[:, 2].std() - 0.1) < error * 0.1
        assert not gravity[:, :2].any() and (mu[:, :cube] == mu[0, 0]).all()
        scale = first["body_mass_scale"]
        assert np.ptp(scale[:, upper]) <= 0.2 and scale[:, lower].min() >= 2
        # what has no range keeps what is written, what has one is drawn anew
        mask = np.arange(worlds) % 3 == 0
        sim.params.write(joint_damping=0.5, shape_mu=0.25)
        sim.step()
        assert (numbers(sim)["shape_mu"] == 0.25).all()
        sim.reset(mask=mask)
        second = numbers(sim)
        assert (second["joint_damping"] == 0.5).all()
        np.testing.assert_array_equal(second["shape_mu"][:, cube] != 0.25, mask)
        np.testing.assert_array_equal((second["gravity"] != gravity).any(axis=1), mask)
        sim.reset(seed=0)
        again = numbers(sim)
        np.testing.assert_array_equal(again["gravity"], gravity)
        np.testing.assert_array_equal(again["shape_mu"][:, cube], mu[:, cube])


def test_precision_threads_and_worlds_do_not_matter(drawn):
    with tl.launch(drawn, worlds=300, precision="f64", threads=1) as sim:
        many = numbers(sim)
    with tl.launch(drawn, worlds=17, precision="f32") as sim:
        for name, few in numbers(sim).items():
            np.testing.assert_array_equal(few, many[name][:17].astype(np.float32))


def test_a_scene_file_holds_ranges(drawn, tmp_path: Path):
    file = tmp_path / "scene.toml"
    drawn.save(file)
    assert "[randomize.params.shape_mu.cube]\nuniform = [0.1, 1.0]\n" in file.read_text()
    again = tl.Scene.load(file)
    assert again.to_toml() == drawn.to_toml()
    with tl.launch(drawn, worlds=3) as one, tl.launch(again, worlds=3) as other:
        for name, values in numbers(one).items():
            np.testing.assert_array_equal(values, numbers(other)[name])


def test_a_snapshot_carries_what_was_drawn(drawn):
    with tl.launch(drawn, worlds=5) as sim:
        sim.reset()
        kept, snapshot = numbers(sim), sim.snapshot()
        sim.reset()
        third = numbers(sim)
        sim.restore(snapshot)
        for name, values in kept.items():
            np.testing.assert_array_equal(numbers(sim)[name], values)
        # the episode was restored too
        sim.reset()
        for name, values in third.items():
            np.testing.assert_array_equal(numbers(sim)[name], values)


@pytest.mark.parametrize(
    ("params", "named"),
    [
        ({"mass": {"arm": tl.Uniform(0, 1)}}, "'mass', and there is no such parameter; did you mean `body_mass`"),
        (
            {"shape_mu": {"box": tl.Uniform(0, 1)}},
            "shape_mu of `box`: nothing that it varies has this name; there are: ",
        ),
        ({"shape_mu": {"cube": tl.Uniform(-1, 1)}}, "shape_mu of `cube`: low is -1; give at least 0"),
        ({"body_mass_scale": {"arm": tl.Uniform(0, 1)}}, "body_mass_scale of `arm`: low is 0; give at least 0.001"),
        ({"joint_damping": {"arm": tl.Normal(-1, 1)}}, "joint_damping of `arm`: mean is -1; give at least 0"),
        ({"joint_damping": {"arm/": tl.Uniform(0, 1)}}, "joint_damping of `arm/`: nothing"),
        ({"body_f": {"arm": tl.Uniform(0, 1)}}, "body_f of `arm`: it is a load, which a reset clears"),
        ({"gravity": tl.Uniform(0, 1)}, "randomize: gravity: give distributions by name; there are: `x`, `y`, `z`"),
        ({"joint_target_kd": {"cube": tl.Uniform(0, 1)}}, "joint_target_kd of `cube`: nothing"),
    ],
    ids=str,
)
def test_wrong_ranges_are_refused(drawn, params, named):
    with pytest.raises(tl.SceneError, match=re.escape(named)):
        drawn.randomize(params=params)
        tl.launch(drawn, worlds=1)


def test_a_gain_of_a_drive_that_follows_velocities_is_refused(pendulum):
    pendulum.robots["arm"].joint_target_mode = ["position", "velocity"]
    pendulum.randomize(params={"joint_target_ke": {"arm": tl.Uniform(1, 2)}})
    with pytest.raises(tl.SceneError, match="the drive of `arm/elbow` follows velocity targets only"):
        tl.launch(pendulum, worlds=1)
    pendulum.randomize(params={"joint_target_ke": {"arm/elbow": tl.Uniform(0, 0)}})
    with tl.launch(pendulum, worlds=4) as sim:
        gains = sim.params.joint_target_ke
        assert (gains[:, 0] >= 1).all() and not gains[:, 1].any()
