"""What is valid in a task or in its actions and most likely a mistake, and tasks that are not what `Task` says."""

from __future__ import annotations

import subprocess
import sys
import warnings
from collections.abc import Sequence

import numpy as np
import pytest

import tightloop as tl
from conftest import REPOSITORY
from tightloop.env import Observed, VectorEnv
from tightloop.env.evaluation.bounds_watch import BoundsWatch
from tightloop.tasks.cartpole import CartPoleBalance


def told(task: type, steps: int, worlds: int = 4) -> list[str]:
    """Step an environment with random actions, and return what it warns of."""
    envs = VectorEnv(task, worlds)
    random = np.random.default_rng(0)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            envs.reset(seed=0)
            for _ in range(steps):
                envs.step(random.uniform(-1, 1, (worlds, 1)).astype(np.float32))
    finally:
        envs.close()
    assert all(warning.filename == __file__ for warning in caught), "not at the caller's line"
    return [str(warning.message) for warning in caught]


def test_an_action_that_is_nan_is_named_with_its_world_and_the_cure():
    envs = VectorEnv(CartPoleBalance, 3)
    try:
        envs.reset(seed=1)
        actions = np.zeros((3, 1))
        actions[1] = np.nan
        with pytest.warns(
            tl.TightloopWarning,
            match=r"1 world of 3 faulted: it is world 1, .* its action\[0\] \(JointTorque\) is nan\. Check the policy",
        ) as caught:
            envs.step(actions)
        assert len(caught) == 1 and caught[0].filename == __file__
    finally:
        envs.close()


def test_observations_beyond_their_bounds_are_reported_with_the_share_and_the_cure():
    class Narrow(CartPoleBalance):
        def observed(self) -> list[Observed]:
            *others, last = super().observed()
            return [*others, Observed(last.name, 0.25, 0.5, size=last.size)]

        def observe(self, xp, worlds) -> Sequence[np.ndarray]:
            *others, last = super().observe(xp, worlds)
            return [*others, last * 0.0 - 7.0]

    [warning] = told(Narrow, 200)
    name = CartPoleBalance().observed()[-1].name
    assert (
        f"Narrow.observe: `{name}` was beyond its bounds, 0.25 to 0.5, in 100% of the steps, by up to 7.25" in warning
    )
    assert f'Give Observed("{name}", …) wider bounds' in warning


def test_tasks_of_the_package_are_within_their_bounds():
    assert told(CartPoleBalance, 200) == []


@pytest.mark.parametrize(("share", "expected"), [(0.4, 0), (0.6, 1)])
def test_a_share_of_steps_and_one_value_of_many_are_enough(share, expected):
    watch = BoundsWatch("Walk", [Observed("up", -1, 1), Observed("speed", [-1, -2, -3], [1, 2, 3], size=3)])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for call in range(64):
            speed = np.zeros((5, 3), np.float32)
            speed[:, 1] = 9.0 if call < share * 64 else -2.0
            watch.look([np.ones(5), speed])
            watch.look([np.full(5, 1.0005), speed]) if call < 0 else None
    assert len(caught) == expected
    if expected:
        assert "Walk.observe: value 1 of `speed` was beyond its bounds, -2 to 2" in str(caught[0].message)


def test_values_at_their_bounds_rounding_and_open_bounds_are_no_mistake():
    parts = [Observed("grasped", 0, 1), Observed("quat", -1, 1, size=4), Observed("far", -np.inf, np.inf)]
    watch = BoundsWatch("Grasp", parts)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(200):
            watch.look([np.ones(3, bool), np.full((3, 4), 1.0000002), np.full(3, 1e30)])


@pytest.mark.parametrize(
    ("member", "value", "said"),
    [
        ("observed", lambda self: [("angle", -1, 1)], r"part 0 is \('angle', -1, 1\); .*Observed\('angle', -1, 1\)"),
        ("observed", lambda self: Observed("angle", -1, 1), r"observed: got Observed; return a list"),
        ("observed", lambda self: ["angle"], r"part 0 is 'angle'; give .*Observed\('angle', 'low', 'high'\)"),
        ("observed", lambda self: None, r"observed: got NoneType; return a list of Observed"),
        ("goal_draws", 3, r"goal_draws is 3, and there is no `goal`: define goal\(self, xp, worlds, draws\)"),
        ("goal_draws", 1.5, r"goal_draws is 1\.5; give a whole number"),
        ("goal_steps", 10, r"goal_steps is 10, and there is no `goal`"),
        ("goal_radius", "big", r"goal_radius is 'big'; give a number"),
        ("fields", "joint_q", r"fields is 'joint_q'; give a tuple of names"),
        ("fields", ("joint_q", "joint_pos"), r"'joint_pos', and there is no such field; did you mean `joint_q`"),
        ("launch_options", {"bound": {}}, r"launch_options has 'bound', .*did you mean `bounds`"),
        ("launch_options", ["bounds"], r"launch_options is \['bounds'\]; give a dict"),
        ("scene", lambda self: None, r"scene: got nothing; return a tightloop\.Scene"),
        ("scene", lambda self: "cart.xml", r"scene: got str; return a tightloop\.Scene"),
        (
            "reward",
            lambda self, worlds: 0,
            r"reward is reward\(self, worlds\); define it as reward\(self, xp, worlds\)",
        ),
        ("observe", lambda self, xp, worlds, more: 0, r"define it as observe\(self, xp, worlds\)"),
        ("reward", 1.0, r"reward is 1\.0; define a method reward\(self, xp, worlds\)"),
        ("goal", lambda self, worlds: 0, r"define it as goal\(self, xp, worlds, draws\)"),
    ],
)
def test_a_member_that_is_not_what_a_task_needs_is_named(member, value, said):
    task = type("Own", (CartPoleBalance,), {member: value})
    with pytest.raises(tl.TightloopError, match=rf"(?s){said}"):
        VectorEnv(task, 1)


def test_fields_that_worlds_do_not_have_suggest_those_that_they_have():
    class Guess(CartPoleBalance):
        def reward(self, xp, worlds):
            return worlds.joint_pos[:, 0]

    envs = VectorEnv(Guess, 1)
    try:
        envs.reset()
        with pytest.raises(tl.UnknownAttribute, match=r"worlds have no 'joint_pos'; did you mean `joint_q`\?"):
            envs.step(np.zeros((1, 1)))
    finally:
        envs.close()


def told_of(define) -> list[str]:
    """Define a task, make an environment of it, and return what is warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        VectorEnv(define(), 1).close()
    return [str(warning.message) for warning in caught]


@pytest.mark.parametrize(
    ("member", "value", "cure"),
    [
        ("terminate", lambda self, xp, worlds: worlds.joint_q[:, 0] > 1, "a Task has `terminated`"),
        ("truncate", lambda self, xp, worlds: worlds.joint_q[:, 0] > 1, "a Task has `truncated`"),
        ("metric", lambda self, xp, worlds: {}, "a Task has `metrics`"),
        ("sucess", lambda self, xp, worlds: None, "a Task has `success`"),
        ("rewards", lambda self, xp, worlds: 0, "a Task has `reward`"),
        ("reward_term", lambda self, xp, worlds: {}, "a Task has `reward_terms`"),
        ("observes", lambda self, xp, worlds: (), "a Task has `observe`"),
        ("inital_state", lambda self, xp, worlds, draws: {}, "a Task has `initial_state`"),
        ("disturbance", lambda self: (), "a Task has `disturbances`"),
        ("mirror", lambda self: None, "a Task has `mirrored`"),
        ("Terminated", lambda self, xp, worlds: None, "a Task has `terminated`"),
        ("max_steps", 50, "a Task has `max_episode_steps`"),
        ("max_epsiode_steps", 50, "a Task has `max_episode_steps`"),
        ("reward_weight", {"upright": 1.0}, "a Task has `reward_weights`"),
        ("goal_draw", 3, "a Task has `goal_draws`"),
        ("launch_option", {}, "a Task has `launch_options`"),
        ("step_dt", 0.02, "dt * substeps of its scene is the length of a control step"),
        ("decimation", 4, "give scene() a Scene(substeps=…)"),
        ("num_envs", 4, "give it to VectorEnv"),
    ],
)
def test_a_misspelt_member_is_reported_with_the_right_name(member, value, cure):
    [warning] = told_of(lambda: type("Own", (CartPoleBalance,), {member: value}))
    assert warning == f"task Own: nothing uses its `{member}`; {cure}"


def test_a_misspelt_attribute_of_a_task_itself_is_reported():
    class Own(CartPoleBalance):
        def __init__(self) -> None:
            super().__init__()
            self.max_steps = 40
            self.goals = [1, 2]  # no Task has a value of such a name

    [warning] = told_of(lambda: Own)
    assert warning == "task Own: nothing uses its `max_steps`; a Task has `max_episode_steps`"


def test_members_that_a_task_itself_uses_are_no_mistake():
    class Own(CartPoleBalance):
        step_dt = 0.02
        limits = (1.0, 2.0)

        def __init__(self) -> None:
            super().__init__()
            self.max_steps = 40

        def terminate(self, worlds):
            return worlds.joint_q[:, 0] > self.step_dt

        def terminated(self, xp, worlds):
            return self.terminate(worlds) & (worlds.elapsed < self.max_steps)

        @property
        def metric(self):
            return 1.0

        def metrics(self, xp, worlds):
            return {"own": worlds.joint_q[:, 0]}

    assert told_of(lambda: Own) == []


def test_tasks_of_the_package_and_of_the_examples_have_no_misspelt_members():
    program = """
import importlib, pkgutil, sys, warnings
warnings.simplefilter("error")
import tightloop.tasks
from tightloop.env import Task
from tightloop.env.registry import GYMNASIUM_TASKS, TASKS, make_task
from tightloop.env.task_members import tell_of_attributes
for module in pkgutil.walk_packages(tightloop.tasks.__path__, "tightloop.tasks."):
    importlib.import_module(module.name)
for name in (*TASKS, *GYMNASIUM_TASKS, *sys.argv[1:]):
    tell_of_attributes(make_task(name, {}), Task)
"""
    pytest.importorskip("mujoco")
    examples = REPOSITORY / "examples"
    own = [f"{examples}/own_task.py:Circle"]
    done = subprocess.run([sys.executable, "-c", program, *own], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
