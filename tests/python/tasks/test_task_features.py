"""What a task may name: memory, reward terms, starts, levels, pushes, history, privileged observations, symmetry."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import tightloop as tl
from tightloop.env import JointTorque, Mirror, Observed, Push, Task, VectorEnv
from tightloop.tasks.cartpole import URDF, CartPoleBalance

WORLDS = 8
STEPS = 40
MODES = ["NEXT_STEP", "SAME_STEP", "DISABLED"]


class Remembering(CartPoleBalance):
    """Counts its own steps, keeps the position before, and adds up the speed."""

    max_episode_steps = 7

    def remember(self, xp, worlds, memory):
        now = worlds.joint_q[:, 0]
        if memory is None:
            return {"steps": 0 * worlds.elapsed, "before": xp.stack([now, now], 1), "way": 0.0 * now}
        before = memory["before"]
        return {
            "steps": memory["steps"] + 1,
            "before": xp.stack([before[:, 1], now], 1),
            "way": memory["way"] + abs(now - before[:, 1]),
        }

    def observed(self):
        return [Observed("before", -3, 3, 2), Observed("way", 0, 9), Observed("steps", 0, 99), Observed("now", -3, 3)]

    def observe(self, xp, worlds):
        own = worlds.memory
        return own["before"], own["way"], own["steps"], worlds.joint_q[:, 0]

    def terminated(self, xp, worlds):
        # worlds end at different times
        return (worlds.joint_q[:, 1] > 0.0) & (worlds.elapsed >= 4)


def actions(rng: np.random.Generator, width: int = 1) -> np.ndarray[Any, Any]:
    return rng.uniform(-1, 1, (WORLDS, width)).astype(np.float32)


@pytest.mark.parametrize("mode", MODES)
def test_memory_is_of_the_episode_and_changes_once_per_step(mode: str) -> None:
    envs: Any = VectorEnv(Remembering, WORLDS, autoreset_mode=mode)
    rng = np.random.default_rng(0)
    obs, _ = envs.reset(seed=0)
    count, last, way, ends = np.zeros(WORLDS), obs[:, 4].copy(), np.zeros(WORLDS), 0
    done = np.zeros(WORLDS, bool)
    try:
        for _ in range(STEPS):
            if mode == "DISABLED" and done.any():
                obs, _ = envs.reset(options={"reset_mask": done})
                count[done], way[done], last[done] = 0, 0, obs[done, 4]
            obs, _, terminated, truncated, infos = envs.step(actions(rng))
            begun = done if mode == "NEXT_STEP" else np.zeros(WORLDS, bool)
            done = terminated | truncated
            ends += int(done.sum())
            seen = infos["final_obs"] if mode == "SAME_STEP" and done.any() else obs
            seen = np.where(done[:, None], seen, obs)
            count = np.where(begun, 0, count + 1)
            way = np.where(begun, 0, way + np.abs(seen[:, 4] - last))
            before = np.where(begun, seen[:, 4], last)
            np.testing.assert_array_equal(seen[:, 3], count)
            np.testing.assert_array_equal(seen[:, 0], before)
            np.testing.assert_array_equal(seen[:, 1], seen[:, 4])
            np.testing.assert_allclose(seen[:, 2], way, rtol=0, atol=STEPS * 2.0**-23)
            last = seen[:, 4].copy()
            if mode == "SAME_STEP":
                count[done], way[done], last[done] = 0, 0, obs[done, 4]
                np.testing.assert_array_equal(obs[done, 3], 0)
        assert ends > 2 * WORLDS, "episodes ended, and at different times"
    finally:
        envs.close()


class Forgetful(CartPoleBalance):
    def remember(self, xp, worlds, memory):
        first = {"a": worlds.joint_q[:, 0]}
        return first if memory is None else {"b": worlds.joint_q[:, 0]}


class Growing(CartPoleBalance):
    def remember(self, xp, worlds, memory):
        return {"a": worlds.joint_q[:, 0] if memory is None else worlds.joint_q}


class NoDict(CartPoleBalance):
    def remember(self, xp, worlds, memory):
        return worlds.joint_q


class OneNumber(CartPoleBalance):
    def remember(self, xp, worlds, memory):
        return {"a": 1.0}


@pytest.mark.parametrize(
    ("task", "named"),
    [
        (Forgetful, r"Forgetful\.remember: not every call returns a, b; return the same names"),
        (Growing, r"Growing\.remember: 'a' is float32 of shape \(8, 2\) now, and was float32 with \(\) per world"),
        (NoDict, r"NoDict\.remember: got ndarray; return a dict of arrays by name"),
        (OneNumber, r"OneNumber\.remember: 'a' is float64 of shape \(\); return numbers of 8 worlds"),
    ],
)
def test_wrong_memories_are_refused_by_name(task: type[Task], named: str) -> None:
    envs: Any = VectorEnv(task, WORLDS)
    try:
        with pytest.raises(tl.ArgumentError, match=named):
            envs.reset(seed=0)
            envs.step(np.zeros((WORLDS, 1)))
    finally:
        envs.close()


class InTerms(CartPoleBalance):
    max_episode_steps = 5
    reward_weights = {"upright": 2.0, "speed": -0.5}  # noqa: RUF012

    def reward_terms(self, xp, worlds):
        return {"upright": xp.cos(worlds.joint_q[:, 1]), "speed": abs(worlds.joint_qd[:, 0])}

    reward = Task.reward


@pytest.mark.parametrize("mode", MODES)
def test_a_reward_is_the_sum_of_its_terms_which_are_logged_per_episode(mode: str) -> None:
    envs: Any = VectorEnv(InTerms, WORLDS, autoreset_mode=mode)
    rng, total, ended = np.random.default_rng(1), np.zeros(WORLDS), 0
    envs.reset(seed=1)
    done = np.zeros(WORLDS, bool)
    try:
        for _ in range(STEPS):
            if mode == "DISABLED" and done.any():
                envs.reset(options={"reset_mask": done})
            _, reward, terminated, truncated, infos = envs.step(actions(rng))
            done = terminated | truncated
            total += reward
            if not done.any():
                assert not [name for name in infos if name.startswith("return/")]
                continue
            own = infos["final_info"] if mode == "SAME_STEP" else infos
            parts = own["return/upright"] + own["return/speed"]
            np.testing.assert_array_equal(own["_return/upright"], done)
            np.testing.assert_allclose(parts[done], total[done], rtol=0, atol=20 * 2.0**-22)
            assert (own["return/speed"][done] < 0).all() and (own["return/upright"][done] > 0).all()
            assert not parts[~done].any()
            ended += int(done.sum())
            total[done] = 0.0
        assert ended > 2 * WORLDS
    finally:
        envs.close()


class Unweighted(InTerms):
    reward_weights = {"upright": 2.0}  # noqa: RUF012


class Untold(InTerms):
    reward_weights = {"upright": 2.0, "speed": -0.5, "effort": 1.0}  # noqa: RUF012


@pytest.mark.parametrize(
    ("task", "named"),
    [
        (Unweighted, r"Unweighted\.reward_terms: 'speed' has no weight in reward_weights"),
        (Untold, r"Untold\.reward_terms: reward_weights has 'effort', which is not returned"),
    ],
)
def test_terms_and_weights_belong_together(task: type[Task], named: str) -> None:
    envs: Any = VectorEnv(task, WORLDS)
    try:
        envs.reset(seed=0)
        with pytest.raises(tl.ArgumentError, match=named):
            envs.step(np.zeros((WORLDS, 1)))
    finally:
        envs.close()


class Placed(CartPoleBalance):
    """Starts where level and draws say; a level more after each episode, up to 3."""

    max_episode_steps = 3
    initial_draws = 1
    levels = 4
    first_levels = 2

    def initial_state(self, xp, worlds, draws):
        cart = 0.5 * worlds.level + 0.1 * draws[:, 0]
        return {"joint_q": xp.stack([cart, 0.0 * cart], 1)}

    def next_level(self, xp, worlds):
        return xp.minimum(worlds.level + 1, 3)


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP"])
def test_a_task_chooses_where_episodes_start_by_level(mode: str) -> None:
    envs: Any = VectorEnv(Placed, WORLDS, autoreset_mode=mode)
    still = np.zeros((WORLDS, 1))
    try:
        obs, _ = envs.reset(seed=5)
        first = np.floor(obs[:, 0] / 0.5)
        assert set(first) == {0.0, 1.0}, "levels are drawn below first_levels"
        seen = [obs]
        for step in range(1, 13 if mode == "SAME_STEP" else 16):
            obs, _, terminated, truncated, _ = envs.step(still)
            begins = step % 3 == 0 if mode == "SAME_STEP" else step % 4 == 0
            if mode == "SAME_STEP":
                assert ((terminated | truncated) == begins).all()
            if begins:
                seen.append(obs)
        for episode, starts in enumerate(seen):
            np.testing.assert_array_equal(np.floor(starts[:, 0] / 0.5), np.minimum(first + episode, 3))
        assert len(np.unique(np.concatenate([starts[:, 0] for starts in seen]))) == len(seen) * WORLDS
        again, _ = envs.reset(seed=5)
        np.testing.assert_array_equal(again, seen[0], "a seed repeats its levels and draws")
        assert envs.level.tolist() == first.tolist()
        given = np.arange(WORLDS) % 3
        chosen, _ = envs.reset(seed=5, options={"level": given})
        np.testing.assert_array_equal(np.floor(chosen[:, 0] / 0.5), given)
        assert envs.level.tolist() == given.tolist()
        number = int(given[-1])
        for wrong in (given[1:], given - 1, given + 0.5, given + 2, given + 2**40, "hard", [[1], [2, 3]]):
            with pytest.raises(tl.errors.ArgumentError, match=r"options, level: .* give (whole numbers|0 to 3)"):
                envs.reset(seed=99, options={"level": wrong})
            np.testing.assert_array_equal(envs.level, given)
        kept, _ = envs.reset(options={"reset_mask": np.ones(WORLDS, bool), "level": given})
        assert not (kept == chosen).all() and envs.level[-1] == number, "a refused reset draws nothing"
        alone: Any = VectorEnv(Placed, 1)
        own, _ = alone.reset(seed=5 + 3)
        alone.close()
        np.testing.assert_array_equal(own[0], seen[0][3], "whatever the number of worlds")
    finally:
        envs.close()


class AtEdge(CartPoleBalance):
    """Ends its episode without a terminal state where the cart leaves the middle."""

    def truncated(self, xp, worlds):
        return abs(worlds.joint_q[:, 0]) > 0.05


def test_a_task_truncates_episodes() -> None:
    envs: Any = VectorEnv(AtEdge, WORLDS, autoreset_mode="SAME_STEP")
    try:
        envs.reset(seed=1)
        ended = np.zeros(WORLDS, bool)
        for _ in range(60):
            _, _, terminated, truncated, infos = envs.step(np.ones((WORLDS, 1)))
            cut = truncated & ~terminated
            if cut.any():
                assert (np.abs(infos["final_obs"][cut, 0]) > 0.05).all()
            ended |= cut
        assert ended.all()
    finally:
        envs.close()


class Pushed(Task):
    """A free box, pushed."""

    fields = ("joint_q", "joint_qd")
    max_episode_steps = 1000

    def scene(self):
        scene = tl.Scene(dt=1 / 200, substeps=4, gravity=(0, 0, 0))
        scene.add_body(name="box", mass=2.0, inertia=(0.01, 0.01, 0.01), pos=(0, 0, 1))
        scene.add_urdf(URDF, name="cart")
        return scene

    def controls(self):
        return [JointTorque(["cart/slide"], 1.0)]

    def bind(self, names):
        first = names.dofs["box"].start
        self._box = slice(first, first + 3)

    def disturbances(self):
        return [Push("box/body", 3.0, (0.1, 0.4))]

    def observed(self):
        return [Observed("velocity", -np.inf, np.inf, 3)]

    def observe(self, xp, worlds):
        return (worlds.joint_qd[:, self._box],)

    def reward(self, xp, worlds):
        return 0.0 * worlds.joint_q[:, 0]


def test_pushes_are_impulses_of_one_step_at_random_times_of_the_seed() -> None:
    envs: Any = VectorEnv(Pushed, WORLDS)
    still = np.zeros((WORLDS, 1))
    try:
        velocity = [envs.reset(seed=9)[0]]
        velocity += [envs.step(still)[0] for _ in range(200)]
        gained = np.diff(velocity, axis=0)  # (steps, worlds, 3)
        impulse = 2.0 * np.linalg.norm(gained, axis=2)
        hit = impulse > 1e-3
        assert (impulse < 3.0 + 1e-4).all() and impulse.max() > 2.5
        assert not gained[..., 2].any(), "horizontal"
        for world in range(WORLDS):
            between = np.diff(np.flatnonzero(hit[:, world]))
            # 0.1 to 0.4 s of 20 ms; a tiny push may not show
            assert between.min() >= 5 and np.median(between) <= 20
        assert len({tuple(np.flatnonzero(hit[:, world])) for world in range(WORLDS)}) == WORLDS
        again = [envs.reset(seed=9)[0]] + [envs.step(still)[0] for _ in range(50)]
        np.testing.assert_array_equal(again, velocity[:51])
    finally:
        envs.close()


class WithHistory(CartPoleBalance):
    max_episode_steps = 6

    def observed(self):
        return [Observed("cart", -3, 3, history=3), Observed("both", -9, 9, 2, history=2), Observed("steps", 0, 99)]

    def observe(self, xp, worlds):
        return worlds.joint_q[:, 0], worlds.joint_qd, worlds.elapsed

    def privileged_observed(self):
        return [Observed("all", -99, 99, 4), Observed("cart", -9, 9, history=2)]

    def privileged_observe(self, xp, worlds):
        return xp.concat([worlds.joint_q, worlds.joint_qd], axis=1), worlds.joint_q[:, 0]


@pytest.mark.parametrize("mode", MODES)
def test_history_begins_with_the_episode_and_holds_the_steps_before(mode: str) -> None:
    envs: Any = VectorEnv(WithHistory, WORLDS, autoreset_mode=mode)
    rng = np.random.default_rng(3)
    try:
        assert envs.single_observation_space.shape == (8,)
        obs, infos = envs.reset(seed=2)
        carts = [[value] * 3 for value in obs[:, 2]]
        np.testing.assert_array_equal(obs[:, :3], carts)
        np.testing.assert_array_equal(infos["privileged"][:, 0], obs[:, 2])
        for _ in range(STEPS):
            done = envs._done.copy() if mode == "NEXT_STEP" else np.zeros(WORLDS, bool)
            if mode == "DISABLED" and envs._done.any():
                mask = envs._done.copy()
                obs, _ = envs.reset(options={"reset_mask": mask})
                for world in np.flatnonzero(mask):
                    carts[world] = [obs[world, 2]] * 3
            obs, _, terminated, truncated, infos = envs.step(actions(rng))
            ended = terminated | truncated
            seen = np.where(ended[:, None], infos["final_obs"], obs) if "final_obs" in infos else obs
            for world in range(WORLDS):
                now = seen[world, 2]
                carts[world] = [now] * 3 if done[world] else [*carts[world][1:], now]
            np.testing.assert_array_equal(seen[:, :3], carts)
            np.testing.assert_array_equal(infos["privileged"][:, [0, 5]], obs[:, [2, 2]])
            np.testing.assert_array_equal(infos["privileged"][:, 4], obs[:, 1])
            np.testing.assert_array_equal(infos["privileged"][:, 2:4], obs[:, 5:7])
            if mode == "SAME_STEP" and ended.any():
                final = infos["final_info"]["privileged"]
                np.testing.assert_array_equal(final[ended, 0], infos["final_obs"][ended, 2])
                for world in np.flatnonzero(ended):
                    carts[world] = [obs[world, 2]] * 3
                    np.testing.assert_array_equal(obs[world, :3], carts[world])
    finally:
        envs.close()


class Symmetric(CartPoleBalance):
    """A cart and a pole seen in a mirror move the other way."""

    def mirrored(self):
        names = [part.name for part in self.observed()]
        signs = [-1, -1, 1, -1, -1]
        return Mirror({name: ([0], [sign]) for name, sign in zip(names, signs, strict=True)}, ([0], [-1]))


def test_a_symmetry_holds_for_the_physics() -> None:
    envs: Any = VectorEnv(Symmetric, WORLDS, autoreset_mode="DISABLED")
    rng = np.random.default_rng(4)
    try:
        observed, action_columns, privileged = envs.mirror
        assert privileged is None
        envs.reset(seed=0)
        start = rng.uniform(-0.05, 0.05, (WORLDS // 2, 2)).astype(np.float32)
        envs.sim.write(joint_q=np.concatenate([start, -start]), joint_qd=np.zeros((WORLDS, 2)))
        for _ in range(8):
            half = 0.5 * actions(rng)[: WORLDS // 2]
            obs, *_ = envs.step(np.concatenate([half, half[:, action_columns.order] * action_columns.signs]))
            one, other = obs[: WORLDS // 2], obs[WORLDS // 2 :]
            np.testing.assert_array_equal(other[:, observed.order] * observed.signs, one)
    finally:
        envs.close()


@pytest.mark.parametrize(
    ("flips", "named"),
    [
        (Mirror({}, ([0], [1])), r"observed: the part 'position of the cart' is missing"),
        (Mirror({"wheel": ([0], [1])}, ([0], [1])), r"observed: there is no part 'wheel'; there are: position"),
        (Mirror({}, ([1], [1])), r"action: order is \[.*1.*\]; give 1 indices"),
    ],
)
def test_a_symmetry_that_does_not_fit_is_refused_by_name(flips: Mirror, named: str) -> None:
    class Wrong(CartPoleBalance):
        def observed(self):
            return [Observed("position of the cart", -1, 1)] if flips.observed or flips.action[0] == [0] else []

        def mirrored(self):
            return flips

    class WrongAction(Symmetric):
        def mirrored(self):
            return Mirror(super().mirrored().observed, flips.action)

    with pytest.raises(tl.ArgumentError, match=named):
        VectorEnv(WrongAction if flips.action[0] == [1] else Wrong, 2)


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: Push("box", 0.0, (1.0, 2.0)), "Push: impulse"),
        (lambda: Push("box", 1.0, (2.0, 1.0)), "Push: interval is .*; give the shorter time first"),
        (
            lambda: Push("box", 1.0, 3.0),  # type: ignore[arg-type]
            "Push: interval is 3.0; give the shortest and the longest time",
        ),
        (lambda: Observed("a", 0, 1, history=0), "observation `a`: history"),
    ],
)
def test_wrong_parts_are_refused_by_name(make: Any, named: str) -> None:
    with pytest.raises(tl.TightloopError, match=named):
        make()
