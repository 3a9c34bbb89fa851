"""Rollouts with a policy inside are what a loop of steps gives: observations, actions, faults and refusals."""

from __future__ import annotations

import signal
import subprocess
import sys
import textwrap
import time

import numpy as np
import onnx_files
import pytest

import tightloop as tl
from tightloop.planning import policy_rollouts
from tightloop.planning.policy_terms import Clock, Gravity, Input, LastAction, Values
from tightloop.tasks.kinematics import projected_gravity

FIELDS = ("joint_q", "joint_qd", "body_q")
WORLDS = 9


@pytest.fixture
def arm(pendulum, tmp_path):
    """Terms of every kind over the two joints of the pendulum, and a policy that drives both by torques."""
    observe = [
        Values("joint_q", of=["elbow", "shoulder"], minus=[0.1, 0.2], scale=[2.0, 0.5], low=-0.3, high=[0.2, 1.0]),
        Values("joint_q", of="arm/shoulder", function="cos"),
        Values("joint_qd", of="arm", history=3),
        Values("body_q", of="arm/lower", columns=[2, 0]),
        Values("joint_qd", columns=[-1], scale=0.1),
        Gravity("arm/upper"),
        Input("goal", 2, scale=0.5),
        LastAction(history=2),
        Clock(1.5, runs_with="goal"),
    ]
    path = onnx_files.write(tmp_path / "arm.onnx", onnx_files.perceptron([23, 40, 2], 5), 23)
    act = tl.Drive(command="joint_f", of=["arm/elbow", "arm/shoulder"], scale=[0.5, 2.0], offset=[0.1, 0.0], low=-0.4)
    return pendulum, tl.Policy(path, observe=observe, act=act, clip=0.6)


def seen_of_arm(frame, memory, goal, dt, kind):
    """What the policy of `arm` sees, in NumPy."""
    q, qd = frame.joint_q, frame.joint_qd
    # numbers of terms are float32, and so are bounds
    both = ((q[:, [1, 0]] - kind(np.array([0.1, 0.2], np.float32))) * kind([2.0, 0.5])).astype(np.float32)
    both = np.clip(both, np.float32(-0.3), np.array([0.2, 1.0], np.float32))
    past = memory.setdefault("qd", [qd, qd])
    phase = memory.get("phase", np.zeros(len(q), q.dtype)) * (goal != 0).any(axis=1)
    memory["phase"] = phase + kind(2 * np.pi * 1.5 * dt)
    last = memory.setdefault("last", [np.zeros((len(q), 2))] * 2)
    parts = [
        both,
        exact(np.cos, q[:, :1]),
        past[0],
        past[1],
        qd,
        frame.body_q[:, 2, [2, 0]],
        qd[:, 1:] * kind(np.float32(0.1)),
        projected_gravity(np, frame.body_q[:, 1, 3:]),
        goal * 0.5,
        *last,
        exact(np.sin, phase)[:, None],
        exact(np.cos, phase)[:, None],
    ]
    memory["qd"] = [past[1], qd.copy()]
    return np.concatenate([np.asarray(part, np.float32) for part in parts], axis=1)


def exact(function, values):
    """A sine or cosine of float32 with at most half a unit of error."""
    return function(values.astype(np.float64)).astype(values.dtype)


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_terms_of_every_kind_are_what_numpy_computes(arm, precision):
    scene, policy = arm
    rng = np.random.default_rng(2)
    goals = rng.normal(size=(12, WORLDS, 2)) * (rng.random((12, WORLDS, 1)) > 0.3)
    with tl.launch(scene, worlds=WORLDS, precision=precision, fields=FIELDS) as sim:
        kind = {"f32": np.float32, "f64": np.float64}[precision]
        assert sim.body_names[1:3] == ["arm/upper", "arm/lower"]
        frame = sim.write(joint_q=rng.normal(size=(WORLDS, 2)), joint_qd=rng.normal(size=(WORLDS, 2)))
        start, memory, expected = sim.snapshot(), {}, {name: [] for name in ("observation", "action", "joint_q")}
        for goal in goals:
            seen = seen_of_arm(frame, memory, goal.astype(kind), 1 / 120, kind)
            action = np.clip(policy(seen), np.float32(-0.6), np.float32(0.6))
            memory["last"] = [memory["last"][1], action]
            force = np.maximum(
                np.array([0.1, 0], np.float32) + np.array([0.5, 2.0], np.float32) * action, np.float32(-0.4)
            )
            frame = sim.step(joint_f=force[:, ::-1])
            for name, value in (("observation", seen), ("action", action), ("joint_q", frame.joint_q)):
                expected[name].append(np.array(value))
        rollout = sim.rollout(policy=policy, inputs={"goal": goals}, start=start, fields=tuple(expected), frames=12)
    for name, values in expected.items():
        # the histories of actions, sines of a phase: at most one unit in the last place of single precision
        assert np.abs(getattr(rollout, name) - values).max() < 2e-6, name
    assert np.array_equal(rollout.observation[0], expected["observation"][0])


def test_a_network_is_what_numpy_computes_in_double_precision(tmp_path):
    rng = np.random.default_rng(7)
    for activation, exact_function in (("Elu", None), ("Tanh", np.tanh), ("Relu", lambda x: np.maximum(x, 0.0))):
        layers = [("Sub", (rng.normal(size=11),), {}), ("Div", (rng.uniform(0.5, 2, 11),), {})]
        nodes = layers + onnx_files.perceptron([11, 70, 33, 3], 1, activation)
        policy = tl.Policy(onnx_files.write(tmp_path / "net.onnx", nodes, 11))
        seen = rng.normal(size=(50, 11)).astype(np.float32)
        x = (seen.astype(np.float64) - np.float32(layers[0][1][0])) / np.float32(layers[1][1][0])
        for operator, constants, _ in nodes[2:]:
            if operator == "Gemm":
                weights, biases = (np.asarray(constant, np.float32).astype(np.float64) for constant in constants)
                x = x @ weights.T + biases
            else:
                x = np.where(x > 0, x, np.expm1(np.minimum(x, 0))) if exact_function is None else exact_function(x)
        assert np.abs(policy(seen) - x).max() < 1e-5
        assert np.array_equal(policy(seen[3]), policy(seen)[3])


def test_results_depend_on_neither_worlds_nor_threads_nor_pieces(arm, monkeypatch):
    scene, policy = arm
    goals = np.random.default_rng(1).normal(size=(1, 37, 2))
    found = []
    for worlds, threads, first in ((37, 1, 16), (37, 2, 1), (5, 1, 3)):
        monkeypatch.setattr(policy_rollouts, "_FIRST", first)
        with tl.launch(scene, worlds=worlds, threads=threads, fields=FIELDS) as sim:
            rollout = sim.rollout(policy=policy, frames=20, inputs={"goal": goals[:, :worlds]})
            found.append(rollout.joint_q[:, :5])
            assert np.array_equal(sim.forward().joint_q, rollout.joint_q[-1])
    assert np.array_equal(found[0], found[1]) and np.array_equal(found[0], found[2])


def test_a_rollout_goes_on_with_the_memory_of_the_one_before(arm):
    scene, policy = arm
    goals = np.random.default_rng(4).normal(size=(20, WORLDS, 2))
    with tl.launch(scene, worlds=WORLDS, fields=FIELDS) as sim:
        start = sim.snapshot()
        whole = sim.rollout(policy=policy, inputs={"goal": goals}, frames=20)
        first = sim.rollout(policy=policy, inputs={"goal": goals[:8]}, frames=8, start=start)
        rest = sim.rollout(policy=policy, inputs={"goal": goals[8:]}, frames=12, memory=first.memory)
        assert np.array_equal(np.concatenate([first.joint_q, rest.joint_q]), whole.joint_q)
        assert rest.memory is not None and whole.memory is not None and len(whole.memory) == WORLDS
        assert np.array_equal(rest.memory, whole.memory)
        with pytest.raises(tl.CommandRefused, match=r"memory has 9 values.* give that of its own last rollout"):
            sim.rollout(policy=policy, inputs={"goal": goals[:8]}, frames=8, memory=np.zeros((WORLDS, 1)))


def test_commands_of_the_caller_are_added_to_those_of_the_policy(arm):
    scene, policy = arm
    rng = np.random.default_rng(6)
    noise = rng.normal(0, 0.2, (10, WORLDS, 2))
    goal = {"goal": (0.3, -0.2)}
    with tl.launch(scene, worlds=WORLDS, fields=FIELDS, params=("body_f",)) as sim:
        start = sim.snapshot()
        alone = sim.rollout(policy=policy, frames=10, inputs=goal)
        zero = sim.rollout({"joint_f": 0.0 * noise}, policy=policy, inputs=goal, start=start)
        assert np.array_equal(zero.joint_q, alone.joint_q)
        moved = sim.rollout(
            {"joint_f": noise, "body_f": np.zeros((10, 3, 6))},
            policy=policy,
            inputs=goal,
            start=start,
            fields=("action", "joint_q"),
        )
        sim.restore(start)
        scale, offset = np.array([0.5, 2.0], np.float32), np.array([0.1, 0.0], np.float32)
        for frame in range(10):
            force = (offset + scale * moved.action[frame])[:, ::-1].astype(np.float64) + noise[frame]
            stepped = sim.step(joint_f=np.maximum(force, np.float32(-0.4)))
            assert np.array_equal(stepped.joint_q, moved.joint_q[frame]), frame
        assert not np.array_equal(moved.joint_q, alone.joint_q)
        # a sequence of another joint is its own command
        by_name = sim.rollout({"joint_f": {"arm/elbow": np.zeros((10, 1))}}, policy=policy, inputs=goal, start=start)
        assert np.array_equal(by_name.joint_q, alone.joint_q)


def test_a_mimic_joint_follows_its_leader_with_what_the_caller_adds(tmp_path):
    text = '<robot name="m"><link name="base"/>'
    for name, mimic in (("lead", ""), ("follow", '<mimic joint="lead" multiplier="-1" offset="0.2"/>')):
        text += f"""<link name="{name}_link"><inertial><mass value="1"/>
            <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
            <joint name="{name}" type="revolute"><parent link="base"/><child link="{name}_link"/><axis xyz="0 0 1"/>
            <limit lower="-2" upper="2" effort="10" velocity="10"/>{mimic}</joint>"""
    (tmp_path / "m.urdf").write_text(text + "</robot>")
    scene = tl.Scene(gravity=(0, 0, 0))
    scene.add_urdf(tmp_path / "m.urdf")
    still = onnx_files.write(tmp_path / "still.onnx", [onnx_files.linear([[0.0]], [0.25])], 1)
    followers = [("m/follow", "m/lead", -1.0, 0.2)]
    act = tl.Drive(command="joint_target_q", of="m/lead", followers=followers)
    policy = tl.Policy(still, observe=[LastAction()], act=act)
    fields = ("joint_target_q",)
    with tl.launch(scene, worlds=2, precision="f64", fields=fields) as sim:
        for noise, lead in ((0.0, 0.25), (0.3, 0.55)):
            by_name = {"joint_target_q": {"m/lead": np.full((3, 2), noise)}}
            by_column = {"joint_target_q": np.full((3, 2, 2), noise)}
            for commands in (by_name, by_column):
                targets = sim.rollout(commands, policy=policy, fields=fields).joint_target_q
                np.testing.assert_allclose(targets, np.broadcast_to([lead, 0.2 - lead], (3, 2, 2)), atol=1e-6)


def test_costs_and_arrays_are_those_of_other_rollouts(arm):
    scene, policy = arm
    goal = {"goal": (0.3, -0.2)}
    with tl.launch(scene, worlds=WORLDS, fields=FIELDS) as sim:
        start = sim.snapshot()
        kept = sim.rollout(policy=policy, frames=40, inputs=goal, fields=("joint_q", "time"))
        costs = sim.rollout(
            policy=policy, frames=40, inputs=goal, start=start, cost=lambda frame: np.square(frame.joint_q).sum(axis=1)
        )
        assert costs.cost is not None
        assert np.allclose(costs.cost, np.square(kept.joint_q.astype(np.float64)).sum(axis=(0, 2)), rtol=1e-5)
        assert costs.fields == () and kept.fields == ("joint_q", "time")
        again = sim.rollout(policy=policy, frames=40, inputs=goal, start=start, fields=("joint_q", "time"), out=kept)
        assert again is kept
        with pytest.raises(tl.ArgumentError, match="cost returned"):
            sim.rollout(policy=policy, frames=4, inputs=goal, cost=lambda frame: frame.joint_q)
        sim.step()


@pytest.fixture
def breaking(pendulum, tmp_path):
    """A policy whose torque is NaN where the input is 1: ∞ · 0."""
    nodes = [("Mul", ([3e38],), {}), ("Mul", ([3e38],), {}), ("Mul", ([0.0],), {})]
    path = onnx_files.write(tmp_path / "nan.onnx", nodes, 1)
    act = tl.Drive(command="joint_f", of="arm/elbow")
    return pendulum, tl.Policy(path, observe=[Input("break", 1)], act=act)


def test_nan_of_a_policy_is_treated_as_that_of_a_client(breaking):
    scene, policy = breaking
    when = np.zeros((6, 3, 1))
    when[4, 1] = 1.0
    with tl.launch(scene, worlds=3, fields=("joint_q",)) as sim:
        with pytest.raises(tl.CommandRefused, match=r"rollout: frame 4: .*joint_f"):
            sim.rollout(policy=policy, frames=6, inputs={"break": when})
        # the worlds stay at the frame before
        assert sim.forward().step.tolist() == [4, 4, 4]
        sim.step()
    with tl.launch(scene, worlds=3, fields=("joint_q",), on_nan="freeze") as sim:
        rollout = sim.rollout(policy=policy, frames=6, inputs={"break": when})
        assert rollout.faulted.tolist() == [False, True, False]
        assert (rollout.status[:4] == 0).all()
        assert np.array_equal(rollout.joint_q[4:, 1], rollout.joint_q[[3, 3], 1])
        assert np.array_equal(rollout.joint_q[:, 0], rollout.joint_q[:, 2])


def test_a_world_that_is_reset_has_a_policy_that_begins_anew(pendulum, tmp_path):
    path = onnx_files.write(tmp_path / "push.onnx", [onnx_files.linear([[0.0, 0.0]], [1.0])], 2)
    act = tl.Drive(command="joint_f", of="arm/elbow", scale=40.0)
    policy = tl.Policy(path, observe=[LastAction(history=2)], act=act)
    with tl.launch(pendulum, worlds=2, fields=("joint_q",), bounds={"joint_qd": 20.0}, on_fault="reset") as sim:
        rollout = sim.rollout(policy=policy, frames=60, fields=("step", "observation"))
    bad = rollout.status != 0
    frames, worlds = np.nonzero(bad[:-2] & ~bad[1:-1])
    assert len(frames) > 3
    # the world was reset in the frame after its fault
    assert (rollout.step[frames + 1, worlds] == 1).all()
    assert (rollout.observation[frames + 2, worlds] == 0.0).all()
    assert (rollout.observation[frames + 1, worlds, 1] == 1.0).all()


def test_a_world_that_is_reset_between_two_rollouts_begins_anew_as_within_one(pendulum, tmp_path):
    path = onnx_files.write(tmp_path / "push.onnx", [onnx_files.linear([[0.0, 0.1]], [1.0])], 2)
    act = tl.Drive(command="joint_f", of="arm/elbow", scale=40.0)
    policy = tl.Policy(path, observe=[LastAction(history=2)], act=act)
    fields = ("observation", "joint_q", "step")
    with tl.launch(pendulum, worlds=2, fields=("joint_q",), bounds={"joint_qd": 20.0}, on_fault="reset") as sim:
        start, memory = sim.snapshot(), None
        whole = sim.rollout(policy=policy, frames=24, fields=fields)
        assert whole.faulted.all()
        sim.restore(start)
        for frame in range(24):
            one = sim.rollout(policy=policy, frames=1, fields=fields, memory=memory)
            memory = one.memory
            for name in fields:
                assert np.array_equal(getattr(one, name)[0], getattr(whole, name)[frame]), (name, frame)
        sim.restore(start)
        bad = sim.rollout(policy=policy, frames=1 + int(np.argmax(whole.status[:, 0] != 0)), fields=fields)
        assert (bad.status[-1] != 0).all()
        sim.forward()  # which resets them
        anew = sim.rollout(policy=policy, frames=1, fields=fields, memory=bad.memory)
        assert (anew.observation == 0.0).all() and (anew.step == 1).all()


def test_a_recording_of_it_replays_without_the_policy(arm, tmp_path):
    scene, policy = arm
    out = tmp_path / "policy.tlrec"
    with tl.launch(scene, worlds=3, fields=FIELDS) as sim:
        with sim.record(out) as recording:
            sim.rollout(policy=policy, frames=30, inputs={"goal": (0.1, 0.2)})
            sim.step()
        assert "no gaps" in recording.summary
    replayed = subprocess.run(
        [sys.executable, "-m", "tightloop", "replay", str(out)], capture_output=True, text=True, timeout=60, check=False
    )
    assert replayed.returncode == 0 and "bit for bit" in replayed.stdout, replayed.stdout + replayed.stderr


def test_a_client_that_dies_meanwhile_leaves_a_daemon_that_serves(arm, tmp_path, unique):
    scene, policy = arm
    name = unique()
    program = f"""
        import tightloop as tl
        from tightloop.planning import policy_rollouts
        from tightloop.planning.policy_terms import LastAction
        policy_rollouts._FIRST = 10**9
        sim = tl.attach({name!r})
        act = tl.Drive(command="joint_f", of="arm/elbow")
        policy = tl.Policy({str(tmp_path / "still.onnx")!r}, observe=[LastAction()], act=act)
        sim.step()
        print("begins", flush=True)
        sim.rollout(policy=policy, frames=10**9, fields=())
    """
    onnx_files.write(tmp_path / "still.onnx", [onnx_files.linear([[0.0]], [0.0])], 1)
    with tl.launch(scene, worlds=4, name=name, fields=FIELDS) as sim:
        sim.release()
        child = subprocess.Popen([sys.executable, "-c", textwrap.dedent(program)], stdout=subprocess.PIPE, text=True)
        try:
            assert child.stdout is not None and child.stdout.readline() == "begins\n"
            time.sleep(0.3)
            child.send_signal(signal.SIGKILL)
        finally:
            child.kill()
            child.wait()
        began = time.monotonic()
        rollout = sim.rollout(policy=policy, frames=5, inputs={"goal": (0.0, 0.0)})
        assert time.monotonic() - began < 10.0 and rollout.frames == 5


@pytest.mark.parametrize(
    ("arguments", "error", "match"),
    [
        ({"frames": 5}, tl.ArgumentError, r"sees the input 'goal'; give inputs=\{'goal'"),
        ({"inputs": {"goal": (1, 2)}}, tl.ArgumentError, "needs a number of frames; give frames=500"),
        ({"frames": 0, "inputs": {"goal": (1, 2)}}, tl.ArgumentError, "frames is 0; it must be at least 1"),
        ({"frames": 5, "inputs": {"goal": (1, 2, 3)}}, tl.ArgumentError, r"'goal' has shape \(3,\); give \(2,\)"),
        ({"frames": 5, "inputs": {"goal": np.zeros((9, 2))}}, tl.ArgumentError, r"\(5 or 1, 9, 2\)"),
        ({"frames": 5, "inputs": {"goal": (np.nan, 2)}}, tl.ArgumentError, "NaN or infinity"),
        ({"frames": 5, "inputs": {"gaol": (1, 2)}}, tl.ArgumentError, "did you mean `goal`"),
        ({"frames": 5, "inputs": (1, 2)}, tl.ArgumentError, "give a dict by name"),
        ({"frames": 5, "memory": [1.0]}, tl.ArgumentError, "memory has shape"),
        ({"frames": 5, "fields": ("joint_f",)}, tl.UnknownField, "joint_f"),
        (
            {"frames": 5, "commands": {"joint_f": np.zeros((4, 2))}},
            tl.ArgumentError,
            "frames is 5, and the commands have 4",
        ),
        ({"frames": 5, "policy": None, "commands": None}, tl.ArgumentError, "frames belongs to a policy"),
        ({"policy": None, "commands": "policy.onnx"}, tl.ArgumentError, "give it as policy="),
        (
            {"frames": 5, "memory": np.full((9, 2), np.nan)},
            tl.ArgumentError,
            "memory of world 0 has NaN .* set its row",
        ),
        ({"policy": 3, "frames": 5}, tl.ArgumentError, "path is 3"),
        ({"policy": "nowhere.onnx", "frames": 5}, tl.ArgumentError, r"nowhere\.onnx: cannot be read"),
    ],
)
def test_wrong_arguments_are_named_with_a_cure(arm, arguments, error, match):
    scene, policy = arm
    complete = {"policy": policy, "inputs": {"goal": (1.0, 2.0)}, **arguments}
    if arguments == {"frames": 5} or "policy" in arguments:
        complete.pop("inputs")
    with tl.launch(scene, worlds=WORLDS, fields=FIELDS) as sim:
        with pytest.raises(error, match=match):
            sim.rollout(**complete)
        assert sim.forward().step[0] == 0


def test_policies_that_cannot_run_are_refused_with_the_reason(arm, tmp_path):
    scene, _ = arm
    write = onnx_files.write
    with pytest.raises(tl.ArgumentError, match=r"operator LSTM of node `node0`.* multilayer perceptrons"):
        tl.Policy(write(tmp_path / "lstm.onnx", [("LSTM", (), {})], 2))
    (tmp_path / "text.onnx").write_text("no policy")
    with pytest.raises(tl.ArgumentError, match=r"text\.onnx: is no ONNX file"):
        tl.Policy(tmp_path / "text.onnx")
    bare = write(tmp_path / "bare.onnx", onnx_files.perceptron([2, 2], 0), 2)
    with pytest.raises(tl.ArgumentError, match=r"has no output `value`; give one of: action"):
        tl.Policy(bare, output="value")
    with pytest.raises(tl.ArgumentError, match=r"obs is float64 of shape \(3,\); give real numbers of shape"):
        tl.Policy(bare)(np.zeros(3))
    with pytest.raises(tl.ArgumentError, match="clip is 'wide'"):
        tl.Policy(bare, clip="wide")
    both, drive = Values("joint_q"), tl.Drive(command="joint_f", of="arm")
    cases = [
        (tl.Policy(bare), "does not say what the policy sees; give tl.Policy"),
        (tl.Policy(bare, observe=[both]), "does not say what the action drives"),
        (tl.Policy(bare, observe=[both, both], act=drive), "terms have 4 values .* takes 2"),
        (
            tl.Policy(bare, observe=[Values("joint_q", of=["arm/elbw", "arm/elbow"])], act=drive),
            "did you mean `arm/elbow`",
        ),
        (tl.Policy(bare, observe=[Values("joint_q", columns=[0, 2])], act=drive), "no column 2"),
        (tl.Policy(bare, observe=[Values("joint_q", axes_of="arm/upper")], act=drive), "give vectors of 3"),
        (tl.Policy(bare, observe=[Gravity("arm")], act=drive), "does not float; give one of its links"),
        (tl.Policy(bare, observe=[both], act=tl.Drive(command="joint_g")), "there is no command 'joint_g'"),
        (tl.Policy(bare, observe=[both], act=[drive, tl.Drive(command="joint_target_q")]), "drives value 3"),
        (tl.Policy(bare, observe=[both], act=tl.Drive(command="joint_f", of=[])), "has no columns; name joints"),
        (
            tl.Policy(
                bare,
                observe=[both],
                act=tl.Drive(command="joint_f", of="elbow", followers=[("elbow", "shoulder", 1.0, 0.0)]),
            ),
            "'shoulder' leads, and is not in `of`",
        ),
        (tl.Policy(bare, observe=[Values("joint_q", minus=[1, 2, 3])], act=drive), "minus has 3 numbers"),
    ]
    with tl.launch(scene, worlds=2, fields=FIELDS) as sim:
        for wrong, match in cases:
            with pytest.raises(tl.ArgumentError, match=match):
                sim.rollout(policy=wrong, frames=3)
        with pytest.raises(tl.UnknownField, match="add 'site_q' to `fields` at launch"):
            sim.rollout(policy=tl.Policy(bare, observe=[Values("site_q")], act=drive), frames=3)
        twice = tl.Policy(bare, observe=[both], act=[tl.Drive(command="joint_f", of=["elbow"])] * 2)
        with pytest.raises(tl.CommandRefused, match="driven twice"):
            sim.rollout(policy=twice, frames=3)
        sim.step()
