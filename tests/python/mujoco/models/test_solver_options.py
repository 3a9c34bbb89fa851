"""Runs that the solver's options stop early end where MuJoCo's do, in double precision."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from live_model import Live, live, relative
from random_mjcf import CONSTRAINED, random_mjcf

# Two legs on a floor, a pile, a ball that flies, and dry friction that reverses: several islands, which change.
XML = """
<mujoco><option timestep="0.004" {option}><flag {flag}/></option>
<worldbody><geom type="plane" size="5 5 .1" friction="{friction}" condim="{condim}"/>
  <body pos="0 0 .4"><freejoint/><geom type="capsule" size=".06" fromto="-.2 0 0 .2 0 0"/>
    <body pos=".2 .05 0"><joint axis="0 1 0" damping=".2" frictionloss=".3" range="-.4 .4" limited="true"/>
      <geom type="capsule" size=".03" fromto="0 0 0 .05 0 -.3"/></body>
    <body pos="-.2 -.05 0"><joint axis="0 1 0" damping=".2" armature=".01"/>
      <geom type="capsule" size=".03" fromto="0 0 0 -.05 0 -.3"/></body></body>
  <body pos="1 0 .1"><freejoint/><geom type="sphere" size=".1"/></body>
  <body pos="1.02 .01 .29"><freejoint/><geom type="sphere" size=".1"/></body>
  <body pos="1.01 .05 .5"><freejoint/><geom type="capsule" size=".05 .1"/></body>
  <body pos="3 0 3"><freejoint/><geom type="sphere" size=".1"/></body>
  <body pos="-1 0 1"><joint axis="0 1 0" frictionloss="2"/><geom type="capsule" size=".04" fromto="0 0 0 .4 0 0"/>
    <body pos=".4 0 0"><joint type="ball"/><geom type="capsule" size=".04" fromto="0 0 0 .3 0 0"/></body></body>
</worldbody></mujoco>
"""
CASES = {
    "one iteration": 'iterations="1"',
    "three iterations": 'iterations="3"',
    "four evaluations of a line": 'iterations="5" ls_iterations="4"',
    "nine evaluations of a line": 'iterations="4" ls_iterations="9"',
    "mjx": 'iterations="1" ls_iterations="4"',
    "a loose tolerance": 'tolerance="1e-3"',
    "a loose line": 'tolerance="1e-2" ls_tolerance="0.5"',
    "Runge-Kutta": 'integrator="RK4" iterations="2"',
    "Runge-Kutta to a loose tolerance": 'integrator="RK4" tolerance="1e-4"',
    "implicitfast": 'integrator="implicitfast" iterations="2" ls_iterations="6"',
    "implicit": 'integrator="implicit" iterations="2" ls_iterations="6"',
    "defaults": "",
}
FLAGS = {"islands": "", "one island": 'island="disable"', "cold start": 'warmstart="disable"'}
STEPS = 200


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("flag", FLAGS)
@pytest.mark.parametrize("case", CASES)
def test_a_run_that_options_stop_early_is_mujocos(case: str, flag: str, cone: str) -> None:
    """Positions agree to 1e-9 until MuJoCo departs by a hundredth of that from a run that begins 1e-13 away."""
    condim = {"islands": 3, "one island": 4, "cold start": 6}[flag]
    option = f'cone="{cone}" {CASES[case]}'
    xml = XML.format(option=option, flag=FLAGS[flag], friction="0.7 0.01 0.002", condim=condim)
    with live(xml, worlds=2, solved=False) as run:
        assert steps_that_agree(run, seed=3, spread=0.03) > STEPS // 2


# Where a slope is 0 up to rounding on a whole segment, as with dry friction alone, rounding chooses α (1 of 100 models)
@pytest.mark.parametrize("seed", range(16))
def test_a_random_model_under_random_options_is_mujocos(seed: int) -> None:
    """Joints, ties, tendons, welds, limits and contacts agree as far as MuJoCo's run is not chaotic."""
    rng = np.random.default_rng(seed)
    option = " ".join(
        f'{name}="{rng.choice(values)}"'
        for name, values in {
            "iterations": ["1", "2", "3", "4", "10", "100"],
            "ls_iterations": ["2", "4", "6", "10", "50"],
            "tolerance": ["1e-4", "1e-6", "1e-8", "1e-10"],
            "ls_tolerance": ["0.01", "0.1", "0.5"],
            "cone": ["pyramidal", "elliptic"],
            "integrator": ["Euler", "implicitfast", "RK4"],
        }.items()
    )
    features = replace(CONSTRAINED, geoms=True, option=option, flag=rng.choice(list(FLAGS.values())))
    with live(random_mjcf(seed, int(rng.integers(2, 9)), features), worlds=2, solved=False) as run:
        assert steps_that_agree(run, seed, spread=0.1) > 0


def steps_that_agree(run: Live, seed: int, spread: float) -> int:
    """Compare runs until MuJoCo departs from its own neighbour, and return the steps compared."""
    states = run.states(seed, spread=spread, speed=0.5)
    own, other = list(run.data(states)), list(run.data(states))
    for data in other:
        data.qvel[:] *= 1 + 1e-13
    run.place(states)
    compared, agrees = 0, [True] * len(own)
    for _ in range(STEPS):
        frame = run.sim.step()
        for world, pair in enumerate(zip(own, other, strict=True)):
            for data in pair:
                mujoco.mj_step(run.model, data)
            first, second = pair
            agrees[world] &= relative(first.qpos, second.qpos) < 1e-11 and not first.warning.number.any()
            if agrees[world]:
                compared += 1
                assert relative(frame.qpos[world], first.qpos) < 1e-9
    return compared


def test_a_run_differs_where_an_option_does() -> None:
    """Each option has an effect on this model, so that ignoring one fails the test above."""
    ends = []
    for option in (*CASES.values(), 'iterations="1" ls_iterations="4" ls_tolerance="0.9"'):
        model = mujoco.MjModel.from_xml_string(XML.format(option=option, flag="", friction="0.7 0.01 0.002", condim=3))
        data = mujoco.MjData(model)
        data.qvel[:] = np.random.default_rng(0).normal(0, 0.5, model.nv)
        for _ in range(STEPS):
            mujoco.mj_step(model, data)
        ends.append(data.qpos.copy())
    for first in range(len(CASES)):
        for second in range(first):
            assert relative(ends[first], ends[second]) > 1e-9, (list(CASES)[first], list(CASES)[second])
