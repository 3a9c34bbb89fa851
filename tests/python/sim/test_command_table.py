"""Every command of the table reaches the simulator as it was given, in each form that arguments may have."""

import inspect
import re

import numpy as np
import pytest

import tightloop as tl
from tightloop import _core
from tightloop.sim.command_rows import COMMANDS, CommandRow

WORLDS = 3
#: Those that are fields, too
FIELDS = [row for row in COMMANDS.values() if not row.is_param]
MODEL = """
<mujoco>
  <worldbody>
    <body name="hand" mocap="true" pos="0 0 1"/>
    <body name="other" mocap="true" pos="0 1 1"/>
    <body name="link">
      <joint name="hinge" axis="0 1 0"/>
      <geom size="0.1" contype="0" conaffinity="0"/>
      <body pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0"/>
        <geom size="0.1" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <equality>
    <joint name="tie" joint1="hinge" joint2="elbow"/>
  </equality>
  <actuator>
    <motor name="first" joint="hinge"/>
    <motor name="second" joint="elbow"/>
  </actuator>
</mujoco>
"""


@pytest.fixture(scope="module")
def sim(tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "model.xml"
    path.write_text(MODEL)
    scene = tl.Scene.from_mujoco(path)
    fields = [row.name for row in FIELDS]
    with tl.launch(scene, worlds=WORLDS, fields=fields, params=("body_f",), device="cpu", threads=1) as sim:
        yield sim


def values(sim, row: CommandRow, seed: int):
    """Values of a command, different in each world and column, shape ``(worlds, entries)`` or with its parts."""
    shape = np.shape(getattr(sim.forward(), row.name))
    drawn = np.random.default_rng(seed).uniform(0.1, 1.0, shape).astype(np.float32)
    return np.round(drawn) if row.is_switch else drawn


@pytest.mark.parametrize("call", [tl.Sim.step, tl.Sim.send])
def test_a_step_takes_the_commands_of_the_table_in_its_order(call):
    assert [*inspect.signature(call).parameters][1:] == [*COMMANDS]
    documented = re.findall(r"^ {4}(\w+): ", inspect.getdoc(call) or "", re.MULTILINE)
    assert [name for name in documented if name in COMMANDS] == [*COMMANDS]


def test_a_write_takes_every_command_that_the_state_keeps(sim):
    taken = [name for name in inspect.signature(tl.Sim.write).parameters if name in COMMANDS]
    assert taken == [row.name for row in FIELDS if row.is_written]
    for row in FIELDS:
        if row.is_written:
            given = values(sim, row, 1)
            assert np.array_equal(getattr(sim.write(**{row.name: given}), row.name), given)


@pytest.mark.parametrize("row", FIELDS, ids=lambda row: row.name)
def test_a_command_arrives_in_every_form_of_an_array(sim, row):
    whole = values(sim, row, 2)
    for form in (whole, whole.astype(np.float64), whole.tolist(), np.asfortranarray(whole), whole[::-1][::-1]):
        sim.reset()
        assert np.array_equal(getattr(sim.step(**{row.name: form}), row.name), whole)
    sim.reset()
    same = getattr(sim.step(**{row.name: whole[0]}), row.name)
    assert np.array_equal(same, np.broadcast_to(whole[0], whole.shape))


@pytest.mark.parametrize("row", COMMANDS.values(), ids=lambda row: row.name)
def test_arrays_that_fit_are_taken_without_a_conversion(sim, row):
    names, columns, parts, _ = sim._client.layout(row.name)
    assert columns == len(names) * parts > 0
    shape = (WORLDS, len(names), parts) if parts > 1 else (WORLDS, len(names))
    for dtype in (np.float32, np.float64):
        sim._client.step({row.name: np.zeros(shape, dtype)}, None)
    for other in (np.zeros(shape, np.int64), np.zeros(shape[1:]), np.zeros((*shape, 1)), np.zeros(shape).tolist()):
        with pytest.raises(_core.NotReady) as refused:
            sim._client.step({row.name: other}, None)
        assert refused.value.args == ([row.name],)


@pytest.mark.parametrize("row", COMMANDS.values(), ids=lambda row: row.name)
def test_a_rollout_takes_every_command(sim, row):
    names, _, parts, _ = sim._client.layout(row.name)
    shape = (2, WORLDS, len(names), parts) if parts > 1 else (2, WORLDS, len(names))
    assert sim.rollout({row.name: np.zeros(shape)}, fields=("time",)).frames == 2


@pytest.mark.parametrize("row", FIELDS, ids=lambda row: row.name)
def test_a_value_that_is_not_finite_is_refused_by_the_name_of_its_entry(sim, row):
    names, _, _, _ = sim._client.layout(row.name)
    spoiled = values(sim, row, 3)
    spoiled[1].flat[-1] = np.nan
    with pytest.raises(tl.CommandRefused, match=rf"`{row.name}` .*world 1.*`{re.escape(names[-1])}`"):
        sim.step(**{row.name: spoiled})


def test_a_command_that_no_model_has_is_refused():
    scene = tl.Scene(dt=1 / 500)
    scene.add_ground()
    with tl.launch(scene, worlds=1, device="cpu", threads=1) as sim:
        for row in COMMANDS.values():
            if sim._client.layout(row.name) is None and not row.is_param:
                with pytest.raises(tl.CommandRefused, match=f"{row.name}: no model of this scene has any"):
                    sim.step(**{row.name: [1.0]})
