"""Models that tightloop runs without what it does not support: what is left moves as in MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import tightloop as tl
from tightloop.errors import SceneError

ARM = """<mujoco><option {option}/><worldbody>
<geom name="floor" type="plane" size="1 1 1" pos="0 0 -2"/>
<body name="arm"><joint name="hinge" axis="0 1 0" damping=".1"/>
  <geom name="rod" type="capsule" size=".05" fromto="0 0 0 .5 0 0"/>
  <body name="hand" pos=".5 0 0"><joint name="ball" type="ball" damping=".05"/>
    <geom name="palm" size=".1" {geom}/></body></body>
</worldbody>{more}
<actuator><motor name="turn" joint="hinge" ctrlrange="-1 1"/>{actuators}</actuator>
</mujoco>"""
BALL_TENDON = '<tendon><fixed name="odd" stiffness="5"><joint joint="ball" coef="1"/></fixed></tendon>'

ODD_PAD = '<general name="pad" body="hand" biastype="affine" biasprm="0 0 -1"/>'


def arm(*, option: str = "", geom: str = "", more: str = "", actuators: str = "") -> str:
    return ARM.format(option=option, geom=geom, more=more, actuators=actuators)


@pytest.mark.parametrize(
    ("parts", "without", "note"),
    [
        ({"option": 'integrator="discrete"'}, "integrator", "mjINT_IMPLICITFAST takes the place"),
        ({"geom": 'adhesion="-1"'}, "palm", "geom `palm` touches nothing"),
        ({"more": BALL_TENDON}, "odd", "tendon `odd` has length 0"),
        ({"more": BALL_TENDON, "actuators": '<motor name="pull" tendon="odd"/>'}, "tendon:odd", "by its 1 actuators"),
        ({"actuators": ODD_PAD}, "pad", "exerts no force"),
    ],
)
def test_a_model_runs_without_what_is_refused(parts, without, note):
    model = mujoco.MjModel.from_xml_string(arm(**parts))
    with pytest.raises(SceneError, match="without"):
        tl.Scene.from_mujoco(model)
    scene = tl.Scene.from_mujoco(model, without=(without,))
    assert any(note in said for said in next(iter(scene.models.values())).notes)
    # MuJoCo's arm alone: nothing of the rest acts while it swings
    integrator = "implicitfast" if without == "integrator" else "Euler"
    plain = mujoco.MjModel.from_xml_string(arm(option=f'integrator="{integrator}"'))
    data = mujoco.MjData(plain)
    data.ctrl[0] = 0.7
    with tl.launch(scene, worlds=1, precision="f64", fields=("qpos",)) as sim:
        controls = np.full(model.nu, 0.7)
        for _ in range(200):
            frame = sim.step(ctrl=controls)
            mujoco.mj_step(plain, data)
        np.testing.assert_allclose(frame.qpos[0], data.qpos, rtol=1e-8, atol=1e-8)


def test_activations_behind_an_actuator_that_is_left_out_keep_their_places():
    odd = '<general name="odd" body="hand" dyntype="integrator" actlimited="true" actrange="0 1"/>'
    slow = '<general name="slow" joint="hinge" dyntype="filter" dynprm=".1"/>'
    model = mujoco.MjModel.from_xml_string(arm(actuators=odd + slow))
    plain = mujoco.MjModel.from_xml_string(arm(actuators=slow))
    data = mujoco.MjData(plain)
    data.ctrl[:] = (0.1, 0.6)
    with tl.launch(tl.Scene.from_mujoco(model, without=["odd"]), worlds=1, precision="f64", fields=("qpos",)) as sim:
        for _ in range(100):
            frame = sim.step(ctrl=[0.1, 0.3, 0.6])
            mujoco.mj_step(plain, data)
        np.testing.assert_allclose(frame.qpos[0], data.qpos, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize(
    ("without", "message"),
    [
        (("nobody",), "the model has no geom or joint or pair or equality or tendon or actuator or key `nobody`"),
        (("integrator",), "mjINT_EULER is supported"),
        (("tendon:rod",), "the model has no tendon `rod`"),
        ("rod", "give a tuple of names"),
        ((3,), "give names of elements"),
        (5, "give names of elements"),
        (("noslip_iterations",), "the model has no noslip_iterations"),
    ],
)
def test_a_wrong_name_is_refused(without, message):
    with pytest.raises(SceneError, match=message):
        tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(arm()), without=without)


def test_names_with_colons_and_iterators_are_taken():
    model = mujoco.MjModel.from_xml_string(arm(option='noslip_iterations="5"').replace('"rod"', '"robot0:k"'))
    scene = tl.Scene.from_mujoco(model, without=(name for name in ("geom:robot0:k", "noslip_iterations")))
    notes = next(iter(scene.models.values())).notes
    assert any("`robot0:k` touches nothing" in note for note in notes) and any("noslip" in note for note in notes)


def test_a_power_of_solimp_is_bounded():
    xml = arm().replace('name="hinge"', 'name="hinge" range="-1 1" solimplimit=".9 .95 .001 .5 40"')
    model = mujoco.MjModel.from_xml_string(xml)
    with pytest.raises(SceneError, match="power 40"):
        tl.Scene.from_mujoco(model)
    scene = tl.Scene.from_mujoco(model, without=["hinge"])
    assert any("the power of its solimp is 16" in note for note in next(iter(scene.models.values())).notes)


def test_a_saved_scene_keeps_what_was_left_out(tmp_path):
    model = mujoco.MjModel.from_xml_string(arm(option='noslip_iterations="5"'))
    scene = tl.Scene.from_mujoco(model, without=("noslip_iterations",))
    scene.save(tmp_path / "scene.toml")
    (own,) = tl.Scene.load(tmp_path / "scene.toml").models.values()
    assert any("noslip" in note for note in own.notes)
