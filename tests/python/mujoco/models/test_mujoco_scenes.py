"""Scenes with MuJoCo models: reading, saving, names, commands, and what is refused."""

from __future__ import annotations

import os
import subprocess
import sys

import mujoco
import numpy as np
import pytest

import tightloop as tl
from tightloop import optional_imports
from tightloop.mujoco import export

CART = """<mujoco model="cart"><option timestep="0.005" iterations="30"/><worldbody>
<geom type="plane" size="5 5 .1" pos="0 0 -2"/>
<body name="cart"><joint name="slider" type="slide" axis="1 0 0"/><geom name="box" type="box" size=".1 .1 .1"/>
<body><joint name="hinge" axis="0 1 0"/><geom type="capsule" size=".02" fromto="0 0 0 0 0 .6"/></body></body>
<body name="ball" pos="0 0 1"><freejoint/><geom size=".1"/></body>
</worldbody>
<actuator><motor name="push" joint="slider" gear="10" ctrlrange="-1 1"/><motor joint="hinge"/></actuator></mujoco>"""


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def model():
    return mujoco.MjModel.from_xml_string(CART)


def test_options_and_names_are_the_models(model):
    scene = tl.Scene.from_mujoco(model)
    assert (scene.dt, scene.substeps) == (0.005, 1)
    assert repr(scene.models["cart"]) == "MujocoModel('cart', dofs=8, actuators=2)"
    with tl.launch(scene, worlds=2) as sim:
        assert sim.actuator_names == ["cart/push", "cart/actuator1"]
        assert sim.body_names == ["cart/world", "cart/cart", "cart/body2", "cart/ball"]
        assert sim.shape_names == ["cart/world/geom0", "cart/cart/box", "cart/body2/geom2", "cart/ball/geom3"]
        assert sim.dof_names[:2] == ["cart/slider", "cart/hinge"]


def test_paths_and_specs_are_read_too(model, tmp_path):
    path = tmp_path / "cart.xml"
    path.write_text(CART)
    files = {
        tl.Scene.from_mujoco(source).models["cart"].file
        for source in (model, path, str(path), mujoco.MjSpec.from_string(CART))
    }
    assert len(files) == 1, "the same model is one file in the cache"


def test_fields_have_mujocos_order(model):
    fields = ("qpos", "qvel", "qacc", "actuator_force", "joint_q")
    with tl.launch(tl.Scene.from_mujoco(model), worlds=3, precision="f64", fields=fields) as sim:
        frame = sim.step(ctrl=[2.0, 0.5])
        np.testing.assert_array_equal(frame.actuator_force, [[1.0, 0.5]] * 3)  # the first is clamped to its range
        data = mujoco.MjData(model)
        data.ctrl[:] = [2.0, 0.5]
        mujoco.mj_step(model, data)
        np.testing.assert_allclose(frame.qpos[0], data.qpos, atol=1e-12)
        np.testing.assert_allclose(frame.qvel[0], data.qvel, atol=1e-12)
        np.testing.assert_array_equal(frame.joint_q[0, 5:], np.roll(frame.qpos[0, 5:], -1))


def test_a_saved_scene_needs_no_mujoco(model, tmp_path, monkeypatch):
    scene = tl.Scene.from_mujoco(model)
    (tmp_path / "kept").mkdir()
    scene.save(tmp_path / "kept" / "scene.toml")
    text = (tmp_path / "kept" / "scene.toml").read_text()
    assert 'model = "scene_models/cart.safetensors"' in text
    scene.models["cart"].file.unlink()
    monkeypatch.setattr(optional_imports, "import_module", _missing)
    loaded = tl.Scene.load(tmp_path / "kept" / "scene.toml")
    with tl.launch(loaded, worlds=1) as sim:
        assert sim.step(ctrl=[1, 0]).joint_q[0, 0] > 0
    with pytest.raises(tl.MissingLibrary, match="mujoco"):
        tl.Scene.from_mujoco(tmp_path / "cart.xml")


def _missing(_: str) -> None:
    raise ModuleNotFoundError(name="mujoco")


def test_what_is_left_out_is_noted():
    xml = CART.replace('iterations="30"', 'solver="PGS"')
    notes = tl.Scene.from_mujoco(mujoco.MjSpec.from_string(xml)).models["cart"].notes
    assert notes == [
        "Newton's method takes the place of mjSOL_PGS",
    ]


def test_a_model_is_served_from_the_command_line(tmp_path):
    path = tmp_path / "cart.xml"
    path.write_text(CART)
    name = f"cart-{os.getpid()}"
    command = [sys.executable, "-m", "tightloop", "serve", str(path), "--worlds=3", f"--name={name}"]
    daemon = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert daemon.stdout is not None and daemon.stdout.readline()
        with tl.attach(name) as sim:
            assert sim.actuator_names == ["cart/push", "cart/actuator1"]
            assert sim.step(ctrl=[1, 0]).joint_q.shape == (3, 9)
    finally:
        daemon.terminate()
        daemon.wait(10)
    path.write_text("<mujoco><worldbody><nonsense/></worldbody></mujoco>")
    failed = subprocess.run(command, capture_output=True, text=True, check=False)
    assert failed.returncode == 1 and "MuJoCo cannot compile it" in failed.stderr


def test_a_model_is_measured_from_the_command_line(tmp_path):
    path = tmp_path / "cart.xml"
    path.write_text(CART)
    command = [sys.executable, "-m", "tightloop", "bench", str(path), "--worlds=3", "--settle=0", "--seconds=0.01"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "3 worlds" in done.stdout, done.stderr


def test_models_stand_beside_robots_and_bodies(model):
    scene = tl.Scene.from_mujoco(model)
    scene.add_body(name="cube", pos=(0, 0, 1.19))
    scene.add_box(half_extents=(0.1, 0.1, 0.1), body="cube")
    other = scene.add_mujoco(model, name="other", pos=(3, 0, 0), quat=(0, 0, 1, 0))
    assert other.name == "other"
    with tl.launch(scene, worlds=2, fields=("body_q", "contact_count")) as sim:
        frame = sim.step(ctrl={"other": [1, 0]})
        places = dict(zip(sim.body_names, frame.body_q[0], strict=True))
        # turned by half a turn about z, the cart goes the other way
        assert places["other/cart"][0] < 3 and places["cart/cart"][0] == 0
        np.testing.assert_allclose(places["other/ball"][:3], [3, 0, 1], atol=1e-3)
        assert frame.contact_count[0] > 0, "the cube of the scene rests on the model's ball"


def test_contradicting_options_are_named(model):
    with pytest.raises(tl.SceneError, match=r"add_mujoco: dt of model `cart` is 0\.005, the scene has 0\.01"):
        tl.Scene(dt=0.01, substeps=1).add_mujoco(model)
    with pytest.raises(tl.SceneError, match="solver iterations of model `cart` is 30"):
        scene = tl.Scene(dt=0.005, substeps=1)
        scene.solver(cone="pyramidal", impratio=1, iterations=20, ls_iterations=50)
        scene.add_mujoco(model)


def test_commands_are_checked(model):
    with tl.launch(tl.Scene.from_mujoco(model), worlds=2) as sim:
        with pytest.raises(tl.CommandRefused, match=r"ctrl.*\(2, 2\)"):
            sim.step(ctrl=[1.0])
        with pytest.raises(tl.CommandRefused, match=r"ctrl.*cart/actuator1"):
            sim.step(ctrl=[0.0, np.nan])
        with pytest.raises(tl.CommandRefused, match="no robot `arm`"):
            sim.step(ctrl={"arm": [0.0, 0.0]})
        snapshot = sim.snapshot()
        after = sim.step(ctrl=[1.0, 0.2]).joint_q.copy()
        sim.restore(snapshot)
        np.testing.assert_array_equal(sim.step(ctrl=[1.0, 0.2]).joint_q, after)
        sim.reset()
        np.testing.assert_array_equal(sim.step().joint_q[:, 0], 0), "a reset clears the controls"


@pytest.mark.parametrize(
    ("elements", "reasons"),
    [
        (
            '<worldbody><body><joint type="ball" name="b"/><geom size=".1"/></body></worldbody>'
            '<tendon><fixed name="t" stiffness="1"><joint joint="b" coef="1"/></fixed></tendon>',
            ["tendon `t`: no support for joints that are not of one dof"],
        ),
        (
            '<worldbody><body name="b"><joint name="j" range="-9 9"/>'
            '<geom name="g" size=".1" adhesion="-1"/></body></worldbody>'
            '<actuator><general name="m" body="b" biastype="affine" biasprm="0 0 -1"/></actuator>',
            ["geom `g`: no support for a negative adhesion", "actuator `m`: no support for adhesion by a force"],
        ),
        (
            '<worldbody><geom name="f" type="plane" size="1 1 1"/>'
            '<body><freejoint/><geom name="g" size=".1"/></body></worldbody>'
            '<contact><pair name="p" geom1="f" geom2="g" solimp=".9 .95 .001 .5 40"/></contact>',
            ["pair `p`: no support for a solimp with the power 40"],
        ),
        (
            '<option integrator="discrete"/><worldbody><body><joint/><geom size=".1"/></body></worldbody>',
            ["option `integrator`: no support for mjINT_DISCRETE, use Euler, implicit"],
        ),
    ],
)
def test_what_is_not_supported_is_refused_by_name(elements, reasons):
    spec = mujoco.MjSpec.from_string(f"<mujoco>{elements}</mujoco>")
    with pytest.raises(tl.SceneError) as error:
        tl.Scene.from_mujoco(spec)
    for reason in reasons:
        assert reason in str(error.value)


def test_wrong_arguments_say_what_to_give(tmp_path):
    with pytest.raises(tl.SceneError, match="model is int; give a path to XML"):
        tl.Scene.from_mujoco(3)
    with pytest.raises(tl.SceneError, match="there is no such file"):
        tl.Scene.from_mujoco(tmp_path / "missing.xml")
    (tmp_path / "broken.xml").write_text("<mujoco><worldbody><nonsense/></worldbody></mujoco>")
    with pytest.raises(tl.SceneError, match=r"broken.xml: MuJoCo cannot compile it"):
        tl.Scene.from_mujoco(tmp_path / "broken.xml")


def test_damaged_files_are_refused(model, tmp_path):
    path = tmp_path / "cart.safetensors"
    export.export(model, path)
    whole, rng = path.read_bytes(), np.random.default_rng(0)
    text = f'dt = 0.01\nsubsteps = 1\n[[mujoco]]\nname = "m"\nmodel = "{path}"\n'
    (tmp_path / "scene.toml").write_text(text)
    for _ in range(300):
        damaged = bytearray(whole[: rng.integers(len(whole))] if rng.random() < 0.3 else whole)
        for place in rng.integers(0, max(len(damaged), 1), 4):
            if damaged:
                damaged[place] = rng.integers(256)
        path.write_bytes(bytes(damaged))
        try:
            tl.Dynamics(tl.Scene.load(tmp_path / "scene.toml"))
        except tl.SceneError:
            continue
