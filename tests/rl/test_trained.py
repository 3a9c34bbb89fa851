"""The policies in ``examples/trained`` do what they were trained for."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

import tightloop as tl
from tightloop import assets
from tightloop.env import VectorEnv, policy_metadata
from tightloop.tasks.quadruped import QuadrupedVelocityFlat

EXAMPLES = Path(__file__).parents[2] / "examples"
sys.path.insert(0, str(EXAMPLES))

from sim2sim import COMMANDS, Facts, InMujoco, InTightloop  # noqa: E402

from evaluation import evaluate  # noqa: E402  (examples are no package)

# Marks: error [m or m/s] at most, success or return at least
MARKS = {
    "CartPoleSwingUp": ("success", 0.95),
    "FrankaReach": ("error", 0.02),
    "FrankaPushCube": ("success", 0.9),
    "FrankaPickCube": ("success", 0.8),
    "FrankaPickCubeDepth": ("success", 0.8),
    "QuadrupedVelocityFlat": ("velocity_error", 0.15),
    "QuadrupedVelocityRough": ("farthest", 4.5),
    "HumanoidVelocityFlat": ("velocity_error", 0.15),
    "AntRun": ("speed", 4.0),
    "Ant-v5": ("return", 3000.0),
}


@pytest.mark.parametrize("task", MARKS)
def test_a_trained_policy_meets_its_mark(task: str) -> None:
    policy = onnxruntime.InferenceSession(EXAMPLES / "trained" / f"{task}.onnx", providers=["CPUExecutionProvider"])
    found = evaluate(task, lambda obs: policy.run(["action"], {"obs": obs.astype(np.float32)})[0], threads=1)
    name, mark = MARKS[task]
    assert found[name] <= mark if name.endswith("error") else found[name] >= mark, found
    assert task != "QuadrupedVelocityFlat" or found["fell"] < 0.01, found


def test_a_quadruped_walks_in_mujoco_as_well() -> None:
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / "sim2sim.py"), str(EXAMPLES / "trained/QuadrupedVelocityFlat.onnx")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    apart = [float(number) for number in re.findall(r"joints are (\S+) rad apart", done.stdout)]
    seen = [float(number) for number in re.findall(r"observations (\S+)$", done.stdout, re.M)]
    errors = np.array(
        [[float(n) for n in row.split(" m/s")[:2]] for row in re.findall(r"([\d.]+ m/s +[\d.]+ m/s)", done.stdout)]
    )
    # a second of contacts in float64 doubles a rounding some twenty times
    assert len(apart) == 5 and max(apart) < 2.0**-30
    # fifty additions to a phase of 2π·2.5 in float32, and velocities of some ten rad/s
    assert len(seen) == 5 and max(seen) < 64 * 16.0 * 2.0**-24
    assert errors.shape == (6, 2) and errors.max() < 0.15 and np.abs(errors[:, 0] - errors[:, 1]).max() < 0.01


ARM = """
  <joint name="arm_1" type="revolute"><parent link="trunk"/><child link="upper"/><origin xyz="0.1 0 0.1"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="10" velocity="10"/></joint>
  <link name="upper"><inertial><mass value="0.3"/>
    <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial></link>
  <joint name="arm_2" type="continuous"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.1"/>
    <axis xyz="0 1 0"/></joint>
  <link name="lower"><inertial><origin xyz="0 0 0.05"/><mass value="0.2"/>
    <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial></link>
</robot>"""


@pytest.mark.parametrize("kind", ["urdf", "xml"])
def test_mujoco_shows_the_joints_of_the_action_alone(kind: str, tmp_path: Path) -> None:
    file = tmp_path / "dog.urdf"
    file.write_text(assets.QUADRUPED.read_text().replace("</robot>", ARM))
    if kind == "xml":
        robot = tl.Scene()
        robot.add_ground()
        robot.add_urdf(file, name="dog", floating=True)
        file = tmp_path / "dog.xml"
        file.write_text(robot.to_mujoco())
    envs = VectorEnv("QuadrupedVelocityFlat", 1, model=file)
    facts, task = Facts(tmp_path / "policy.onnx", policy_metadata(envs)), QuadrupedVelocityFlat(model=file)
    envs.close()
    assert len(facts.names("joint_names")) == 14
    with tl.launch(task.scene(), worlds=1, precision="f64", fields=task.fields) as sim:
        start = np.array(sim.reset().joint_q[0], np.float64) if kind == "urdf" else task.robot.start_q
        players = InTightloop(facts, task, sim), InMujoco(facts, task.robot, task.scene())
        for player in players:
            player.begin(start, COMMANDS[0])
            for _ in range(5):
                player.step(np.full((1, 12), 0.2, np.float32))
    ours, theirs = (player.obs for player in players)
    assert ours.shape == theirs.shape == (1, 50)
    np.testing.assert_allclose(ours, theirs, atol=1e-4)


@pytest.mark.parametrize(
    ("file", "said"),
    [
        ("no.onnx", "there is no policy .*no.onnx; name an ONNX file"),
        ("broken.onnx", "broken.onnx is no ONNX file that onnxruntime can read; export it again"),
        ("Ant-v5.onnx", "Ant-v5.onnx is a policy of tightloop/Ant-v5 .*only policies of velocity tasks run here"),
    ],
)
def test_sim2sim_names_a_file_that_it_cannot_play(file: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "broken.onnx").write_bytes(b"no ONNX")
    policy = EXAMPLES / "trained" / file if file.startswith("Ant") else tmp_path / file
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / "sim2sim.py"), str(policy)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1 and re.search(said, done.stderr) and "Traceback" not in done.stderr, done.stderr


@pytest.mark.parametrize("task", assets.POLICIES)
def test_a_policy_of_the_wheel_is_the_trained_one(task: str) -> None:
    policy = onnxruntime.InferenceSession(EXAMPLES / f"trained/{task}.onnx", providers=["CPUExecutionProvider"])
    obs = np.random.default_rng(0).normal(size=(50, policy.get_inputs()[0].shape[1])).astype(np.float32)
    (action,) = policy.run(["action"], {"obs": obs})
    # some hundred roundings of float32 in each of three layers
    np.testing.assert_allclose(assets.policy(task)(obs), action, rtol=1e-4, atol=1e-4)
