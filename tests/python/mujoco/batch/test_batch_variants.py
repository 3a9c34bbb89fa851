"""`tightloop.mujoco.Batch`: values that no parameter expresses, each against a MuJoCo model of its own."""

from __future__ import annotations

import warnings
from typing import Any

import mujoco
import numpy as np
import pytest
from batch_reference import FIELDS, XML, Lockstep, N, model_of, positions, separate

from tightloop.errors import TransportError
from tightloop.mujoco import Batch
from tightloop.mujoco.batch import engine
from tightloop.mujoco.batch.variants import MODELS_MAX

RK4, EULER = int(mujoco.mjtIntegrator.mjINT_RK4), int(mujoco.mjtIntegrator.mjINT_EULER)
IMPLICIT = int(mujoco.mjtIntegrator.mjINT_IMPLICIT)
#: Field, place in it, and its values in some of the simulations.
CASES: dict[str, tuple[str, Any, tuple[Any, ...]]] = {
    "timestep": ("timestep", (), (0.001, 0.002, 0.003)),
    "integrator": ("integrator", (), (RK4, EULER)),
    "implicit": ("integrator", (), (IMPLICIT,)),
    "flags": ("disableflags", (), (int(mujoco.mjtDisableBit.mjDSBL_GRAVITY),)),
    "cone": ("cone", (), (int(mujoco.mjtCone.mjCONE_ELLIPTIC),)),
    "geom_size": ("geom_size", (4, 0), (0.12, 0.08, 0.12)),
    "geom_pos": ("geom_pos", 4, ((0.0, 0.01, 0.02), (0.02, 0.0, -0.02))),
    "body_pos": ("body_pos", 2, ((0.0, 0.1, 0.2), (0.1, 0.0, 0.0))),
    "body_quat": ("body_quat", 3, ((0.8, 0.6, 0.0, 0.0),)),
    "jnt_axis": ("jnt_axis", 1, ((0.0, 0.6, 0.8), (0.6, 0.8, 0.0))),
    "jnt_stiffness": ("jnt_stiffness", (1,), (0.5, 2.0)),
    "qpos_spring": ("qpos_spring", (1,), (0.2,)),
    "geom_condim": ("geom_condim", (4,), (1, 4)),
    "geom_contype": ("geom_contype", (4,), (0,)),
    "power": ("geom_solimp", (4, 4), (1.0, 3.0)),
    "gear": ("actuator_gear", (0, 0), (2.0, 9.0)),
    "ctrlrange": ("actuator_ctrlrange", 0, ((-0.2, 0.1),)),
    "biastype": ("actuator_biastype", (1,), (int(mujoco.mjtBias.mjBIAS_NONE),)),
    "free": ("dof_damping", (-1,), (0.05,)),
}


def put(home: Any, field: str, place: Any, value: Any) -> None:
    """Set an element of a field of a model or of a simulation."""
    home = home if hasattr(home, field) else home.opt
    if place == ():
        setattr(home, field, value)
    else:
        getattr(home, field)[place] = value


@pytest.mark.parametrize("case", CASES)
def test_values_that_need_a_model_act_as_models_of_their_own(case: str) -> None:
    field, place, values = CASES[case]
    model, models = model_of(contacts=True), separate(model_of(contacts=True))
    with Batch(model, N, 1, precision="f64") as batch:
        expanded, armature = batch.expand(field), batch.expand("dof_armature")
        for sim, own in enumerate(models):
            if sim % 3:
                value = values[sim % len(values)]
                put(own, field, place, value)
                # MuJoCo's broad phase has its own sizes
                own.geom_rbound[4] = own.geom_size[4, 0]
                expanded[(sim, *place) if isinstance(place, tuple) else (sim, place)] = value
            armature[sim, 0] = own.dof_armature[0] = 0.1 * sim
        lockstep = Lockstep(batch, models)
        # after a Runge-Kutta step, MuJoCo's fields are of its last evaluation
        compared = ("qpos", "qvel", "time", *(FIELDS if field != "integrator" else ()))
        for name in compared:
            batch.bind(name)
        lockstep.write("qpos", positions(model, 8))
        lockstep.write("qvel", np.tile([0, 0, 0, 0, 0, 1.0, 0.3, -1.0, 0, 0, 0], (N, 1)))
        lockstep.write("ctrl", np.full((N, model.nu), 0.4))
        for nstep in (1, 3, 60):
            lockstep.step(nstep=nstep)
            lockstep.assert_equal(compared, 1e-5)
        lockstep.step([1, 2, 4], nstep=2)
        lockstep.assert_equal(compared, 1e-5)
        assert batch._variants.count == 1 + len({sim % len(values) for sim in range(N) if sim % 3})


@pytest.mark.parametrize("forward", [False, True])
def test_simulations_change_their_models_while_they_run(forward: bool) -> None:
    """Random timesteps and integrators, subsets, forces, resets and a field that is bound later."""
    model, models, rng = model_of(), separate(model_of()), np.random.default_rng(4)
    with Batch(model, N, 1, forward, precision="f64") as batch:
        timestep, integrator = batch.expand("timestep"), batch.expand("integrator")
        case = Lockstep(batch, models, forward=forward)
        case.write("qpos", positions(model, 1))
        # forces on a free joint turn once per step, not at each evaluation of Runge-Kutta
        turned = np.append(np.ones(model.nv - 6), np.zeros(6))
        for call in range(20):
            for sim in rng.choice(N, 2, replace=False):
                timestep[sim] = models[sim].opt.timestep = rng.choice([0.002, 0.004, 0.005])
                integrator[sim] = models[sim].opt.integrator = rng.choice([RK4, EULER, model.opt.integrator])
            case.write("ctrl", rng.uniform(-1.5, 1.5, (N, model.nu)))
            case.write("qfrc_applied", rng.normal(0, 0.3, (N, model.nv)) * turned * (call > 10))
            case.write("xfrc_applied", rng.normal(0, 0.3, (N, model.nbody, 6)) * (call > 13))
            ids = sorted(rng.choice(N, 4, replace=False).tolist()) if call % 4 == 3 else list(range(N))
            if call == 8:
                batch.bind("qacc")
            if call == 12:
                batch.reset(ids, keyframe=0)
                for sim in ids:
                    mujoco.mj_resetDataKeyframe(models[sim], case.data[sim], 0)
                    case.data[sim].qfrc_applied[:] = batch.bind("qfrc_applied")[sim]
                    case.data[sim].ctrl[:] = batch.bind("ctrl")[sim]
            case.step(ids, nstep=1 + call % 3)
            # without `forward`, MuJoCo's qacc is of the last evaluation of Runge-Kutta
            case.assert_equal(("qpos", "qvel", "time", *(("qacc",) if forward and call >= 8 else ())), 1e-8, ids)
        assert batch._variants.count <= 1 + N, "a model without simulations ends"


def test_history_holds_the_rows_of_every_model() -> None:
    model = model_of()
    with Batch(model, N, 1, precision="f64") as batch:
        batch.expand("timestep")[:] = 0.001 * (1 + np.arange(N))
        ids = np.array([0, 2, 3, 5])
        history = np.empty((4, 3, batch.nstate))
        batch.step(ids, nstep=3, history=history)
        np.testing.assert_allclose(history[:, :, 0], 0.001 * (1 + ids)[:, None] * np.arange(1, 4))
        np.testing.assert_array_equal(history[:, -1], batch.bind("state")[ids])


def test_another_model_beside_them_changes_no_bit_of_the_others() -> None:
    model = model_of(contacts=True)
    with Batch(model, N, 1) as batch, Batch(model, N, 1) as alone:
        timestep = batch.expand("timestep")
        for each in (batch, alone):
            each.bind("qpos")[:] = positions(model, 5)
            each.step(nstep=40)
        timestep[2] = 0.002
        timestep[4] = 0.002
        for call in range(4):
            if call == 2:
                timestep[4] = 0.001
            batch.step(nstep=5)
            alone.step(nstep=5)
        others = [0, 1, 3, 5]
        np.testing.assert_array_equal(batch.bind("qpos")[others], alone.bind("qpos")[others])
        assert not np.array_equal(batch.bind("qpos")[2], alone.bind("qpos")[2])


def test_fields_that_others_make_fixed_are_taken_over() -> None:
    """A medium drags boxes of the model's masses, and the limit of a ball is no parameter."""
    model, models = model_of(), separate(model_of())
    with Batch(model, N, 1, precision="f64") as batch:
        batch.expand("body_mass"), batch.expand("jnt_range")
        for sim, field, place, value in (
            (2, "viscosity", (), 0.1),
            (3, "jnt_limited", (2,), 1),
            (3, "jnt_range", (2,), (0, 0.3)),
        ):
            put(models[sim], field, place, value)
            batch.expand(field)[(sim, *place)] = value
        models[2].body_mass[1] = batch.expand("body_mass")[2, 1] = 2.0
        lockstep = Lockstep(batch, models)
        lockstep.write("qpos", positions(model, 8))
        lockstep.step(nstep=10)
        lockstep.assert_equal(("qpos", "qvel"), 1e-7)


def test_parameters_still_differ_within_a_model() -> None:
    model, models = model_of(), separate(model_of())
    with Batch(model, N, 1, precision="f64") as batch:
        damping, compared = batch.expand("dof_damping"), ("qpos", "qvel")
        lockstep = Lockstep(batch, models)
        for call in range(3):
            for sim, each in enumerate(models):
                each.dof_damping[-1], each.dof_damping[1] = 0.05, 0.1 * (sim + call)
                damping[sim] = each.dof_damping
            lockstep.step(nstep=5)
            lockstep.assert_equal(compared, 1e-8)
        assert batch._variants.count == 2
        bound = batch.expand("geom_rbound")
        bound[2] += 1.0
        lockstep.step()
        assert batch._variants.count == 2, "MuJoCo's broad phase has no influence"


def test_values_go_back_and_forth_also_to_zero() -> None:
    model = model_of()
    with Batch(model, N, 1, precision="f64") as batch:
        integrator, pids = batch.expand("integrator"), set()
        for value in (RK4, EULER, model.opt.integrator, EULER, RK4):
            integrator[5] = value
            batch.step(np.array([5]))
            pids.add(batch._variants._running[batch._variants._home[5]].engine.sim.pid)
        integrator[[0, 1]] = RK4
        batch.step()
        assert batch._variants.count == 3
        integrator[:] = model.opt.integrator
        batch.step()
        assert batch._variants.count == 1


def test_equal_rows_of_a_model_have_equal_futures_bit_for_bit() -> None:
    model = model_of(contacts=True)
    with Batch(model, N, 1) as batch:
        state = batch.bind("state")
        batch.expand("timestep")[2:4] = 0.002
        batch.bind("qpos")[:] = positions(model, 4)
        batch.step(nstep=60)
        state[3] = state[2]
        batch.step(nstep=5)
        np.testing.assert_array_equal(state[3], state[2])


def test_a_launch_that_fails_breaks_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    model = model_of()
    with Batch(model, N, 1, precision="f64") as batch:
        timestep, time = batch.expand("timestep"), batch.bind("time")
        batch.step()
        timestep[2] = 0.002
        with monkeypatch.context() as patch:
            patch.setattr(engine, "launch", lambda *_, **__: (_ for _ in ()).throw(TransportError("no memory")))
            with pytest.raises(TransportError):
                batch.step()
        np.testing.assert_array_equal(time, 0.004)
        batch.step()
        np.testing.assert_allclose(time, [0.006 if sim == 2 else 0.008 for sim in range(N)])


def test_messages_have_the_numbers_of_simulations() -> None:
    with Batch(model_of(), N, 1) as batch:
        timestep, mass, time = batch.expand("timestep"), batch.expand("body_mass"), batch.bind("time")
        timestep[3] = 0.002
        force = batch.bind("qfrc_applied")
        force[3, 0] = 1e39
        with pytest.raises(ValueError, match="sim 3: qfrc_applied"):
            batch.step()
        force[3, 0], mass[3, 1] = 0.0, -1.0
        with pytest.raises(ValueError, match="world 3"):
            batch.step()
        assert not time.any(), "no simulation was stepped"


def test_worlds_that_a_simulation_has_left_are_at_rest() -> None:
    model = model_of()
    with Batch(model, N, 1, precision="f64") as batch:
        force, timestep, warning = batch.bind("xfrc_applied"), batch.expand("timestep"), batch.bind("warning")
        force[2, 1] = 1e9
        batch.step()
        timestep[2], force[2] = 0.001, 0.0
        batch.reset(np.array([2]))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            batch.step(nstep=200)
        assert not warning.any()


def test_constants_are_those_of_each_model() -> None:
    model, models = model_of(contacts=True), separate(model_of(contacts=True))
    with Batch(model, N, 1, precision="f64") as batch:
        timestep, mass = batch.expand("timestep"), batch.expand("body_mass")
        for sim, each in enumerate(models):
            timestep[sim] = each.opt.timestep = 0.002 if sim % 2 else 0.004
            mass[sim, 4] = each.body_mass[4] = 0.5 + 0.2 * sim
            mujoco.mj_setConst(each, mujoco.MjData(each))
        with pytest.warns(UserWarning, match="softness"):
            batch.set_const()
        lockstep = Lockstep(batch, models)
        lockstep.step(nstep=80)
        lockstep.assert_equal(("qpos", "qvel"), 1e-6)


def test_masses_in_a_medium_differ() -> None:
    xml = XML.format(contacts=0).replace("<worldbody>", '<option density="100" viscosity=".1"/><worldbody>', 1)
    model = mujoco.MjModel.from_xml_string(xml)
    models = separate(model)
    with Batch(model, N, 1, precision="f64") as batch:
        inertia = batch.expand("body_inertia")
        for sim, own in enumerate(models):
            own.body_inertia[1:4] *= 1.0 + 0.3 * sim
            inertia[sim] = own.body_inertia
        lockstep = Lockstep(batch, models)
        lockstep.write("ctrl", np.full((N, model.nu), 0.4))
        lockstep.step(nstep=20)
        lockstep.assert_equal(("qpos", "qvel"), 1e-8)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("timestep", -1.0, "dt is -1"),
        ("timestep", np.nan, "timestep"),
        ("integrator", 99, "99"),
        ("integrator", int(mujoco.mjtIntegrator.mjINT_DISCRETE), "mjINT_DISCRETE"),
        ("geom_type", 99, "geom_type is 99"),
        ("geom_pos", np.nan, "geom_pos"),
    ],
)
def test_a_model_that_does_not_run_stops_no_other(field: str, value: float, message: str) -> None:
    model = model_of()
    with Batch(model, N, 1, precision="f64") as batch:
        values, time = batch.expand(field), batch.bind("time")
        own = values[2].copy()
        values[2] = value
        for call in (batch.forward, batch.reset, batch.step):
            with pytest.raises(RuntimeError, match=f"sim 2: .*{message}"):
                call()
        np.testing.assert_array_equal(time, [0.0 if sim == 2 else 0.004 for sim in range(N)])
        values[2] = own
        batch.step()
        np.testing.assert_allclose(time, [0.004 if sim == 2 else 0.008 for sim in range(N)])


def test_an_adhesion_with_velocity_stops_no_other() -> None:
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><geom type="plane" size="1 1 1"/>
      <body name="pad" pos="0 0 .1"><joint type="slide" axis="0 0 1"/><geom size=".1"/></body></worldbody>
      <actuator><general body="pad" biastype="affine" biasprm="1 0 0"/></actuator></mujoco>""")
    with Batch(model, N, 1, precision="f64") as batch:
        bias = batch.expand("actuator_biasprm")
        # a constant is a parameter, a factor of velocity is not supported
        bias[1, 0, 0] = 3.0
        batch.step()
        bias[2, 0, 2] = -0.5
        with pytest.raises(RuntimeError, match=r"sim 2: .*adhesion by a force that depends on velocity"):
            batch.step()


def test_more_models_than_there_may_be_are_refused_at_once() -> None:
    sims = MODELS_MAX + 4
    with Batch(model_of(), sims, 1, precision="f64") as batch:
        timestep, time = batch.expand("timestep"), batch.bind("time")
        timestep[:] = 0.001 + 1e-5 * np.arange(sims)
        message = f"timestep: {sims} different models in one Batch.*at most {MODELS_MAX}"
        for _ in range(2):
            with pytest.raises(ValueError, match=message):
                batch.step()
        assert not time.any()
        timestep[:] = 0.001
        # one by one to the same value: they share a model before there are too many
        for sim in range(sims):
            batch.step(np.array([sim]))
        assert batch._variants.count <= MODELS_MAX + 1
        batch.step()
        np.testing.assert_allclose(time, 0.002)
