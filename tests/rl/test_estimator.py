"""What ``examples/ppo.py`` makes of images: estimates of what only the critic is shown."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from torch import Tensor

from tightloop.env import Observed

sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))
from learning.agent import Agent
from learning.estimator import Estimator, EstimatorTrainer, Sight
from learning.optimizer import Optimizer
from policy_file import export, halve

EXAMPLES = Path(__file__).parents[2] / "examples"
SIZE = 32
PARTS = [
    Observed("speed", -1, 1, 2),
    Observed("depth", 0, 2, shape=(SIZE, SIZE)),
    Observed("angle", -1, 1),
]
CRITIC = [Observed("speed", -1, 1, 2), Observed("spot", -1, 1, 2), Observed("angle", -1, 1), Observed("size", 0, 9)]
INPUTS = 3 + SIZE * SIZE


def sight() -> Sight:
    found = Sight.of(PARTS, CRITIC)
    assert found is not None
    return found


def worlds(count: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Observations of a spot 4 pixels wide on a slope, and what the critic sees: where it is."""
    place = torch.rand(count, 2, generator=generator) * 1.6 - 0.8
    pixel = torch.linspace(-1, 1, SIZE)
    near = (pixel - place[:, :1]).abs() < 0.12, (pixel - place[:, 1:]).abs() < 0.12
    spot = near[1][:, :, None] & near[0][:, None, :]
    slope = 1.0 + 0.4 * pixel * (2.0 * torch.rand(count, 1, 1, generator=generator) - 1.0)
    image = slope.expand(count, SIZE, SIZE) - 0.05 * spot
    speed, angle = torch.randn(count, 2, generator=generator), torch.randn(count, 1, generator=generator)
    obs = torch.cat([speed, image.flatten(1), angle], 1)
    return obs, torch.cat([speed, place, angle, torch.zeros(count, 1)], 1)


def test_images_and_what_the_critic_alone_sees_are_found() -> None:
    found = sight()
    assert found.inputs == INPUTS and found.images == ((2, 1, SIZE, SIZE, 2.0),)
    assert found.targets == (2, 3, 5) and found.ranges == (2.0, 2.0, 9.0)
    assert Sight.of([PARTS[0], PARTS[2]], CRITIC) is None
    with pytest.raises(SystemExit, match="privileged_observed"):
        Sight.of(PARTS, [CRITIC[0]])
    with pytest.raises(SystemExit, match=r"'rgb' has shape \(64, 64, 3\); give \(height, width\)"):
        Sight.of([Observed("rgb", 0, 255, shape=(64, 64, 3))], CRITIC)
    with pytest.raises(SystemExit, match=r"'a' has shape \(20, 64\); .* both at least 28"):
        Sight.of([Observed("a", 0, 1, shape=(20, 64))], CRITIC)
    with pytest.raises(SystemExit, match="'a' has no bounds"):
        Sight.of([Observed("a", 0, np.inf, shape=(64, 64))], CRITIC)
    # a scan is no image, and what has no bounds has the scale of its values
    scanned = Sight.of([Observed("scan", 0, 9, shape=(30,)), *PARTS], [Observed("far", -np.inf, np.inf)])
    assert scanned is not None and scanned.images[0][0] == 32 and scanned.ranges == (0.0,)


def test_it_learns_where_a_spot_is() -> None:
    torch.manual_seed(0)
    generator = torch.Generator().manual_seed(1)
    estimator = Estimator(sight())
    trainer, errors = EstimatorTrainer(estimator), []
    for _ in range(20):
        obs, critic = worlds(4096, generator)
        errors.append(trainer.learn(obs, critic, torch.randperm(4096, generator=generator), 0.0))
    assert errors[0] > 0.5 and errors[-1] < 0.2, errors
    obs, critic = worlds(500, generator)
    with torch.no_grad():
        features = estimator.features(obs)
    assert features.shape == (500, estimator.outputs) and torch.equal(features[:, :3], obs[:, [0, 1, -1]])
    truth = estimator.wanted(critic)
    assert (features[:, 3:5] - truth[:, :2]).std() < 0.25
    # the truth replaces the estimates of some worlds alone
    shown, some = features.clone(), torch.arange(500) % 3 == 0
    estimator.reveal(shown, critic, some)
    assert torch.equal(shown[some, 3:], truth[some]) and torch.equal(shown[~some], features[~some])
    assert torch.equal(shown[:, :3], features[:, :3])


def test_a_policy_of_images_is_written_whole_and_leaves_the_estimator_alone(tmp_path: Path) -> None:
    torch.manual_seed(0)
    agent = Agent(INPUTS, 4, 6, 16, 0.5, sight=sight())
    assert agent.estimator is not None
    obs, critic = worlds(64, torch.Generator().manual_seed(2))
    agent.estimator.normalizer.see(obs[:, agent.estimator.rest])
    agent.see(agent.features(obs).detach(), critic)
    estimates = [weight.clone() for weight in agent.estimator.parameters()]
    optimizer = Optimizer(agent, 1e-2, muon=False)
    (agent(obs) ** 2).sum().backward()
    before = agent(obs).detach()
    optimizer.step()
    assert not torch.equal(before, agent(obs))
    for weight, then in zip(agent.estimator.parameters(), estimates, strict=True):
        assert torch.equal(weight, then)

    # by another agent of the same sizes, as films and checkpoints are made
    same = Agent(*agent.sizes, sight=sight())
    same.load_state_dict(agent.state_dict())
    export(same, INPUTS, tmp_path / "policy.onnx", facts())
    session = onnxruntime.InferenceSession(tmp_path / "policy.onnx", providers=["CPUExecutionProvider"])
    (action,) = session.run(["action"], {"obs": obs.numpy()})
    np.testing.assert_allclose(action, agent(obs).detach().numpy(), rtol=1e-4, atol=1e-5)

    size = (tmp_path / "policy.onnx").stat().st_size
    halve(tmp_path / "policy.onnx")
    # two bytes less for each of 33,000 numbers
    assert (tmp_path / "policy.onnx").stat().st_size < size - 60_000
    session = onnxruntime.InferenceSession(tmp_path / "policy.onnx", providers=["CPUExecutionProvider"])
    (halved,) = session.run(["action"], {"obs": obs.numpy()})
    np.testing.assert_allclose(halved, action, rtol=0, atol=2e-3 * np.abs(action).max())


def facts() -> dict[str, str]:
    """Metadata with the sizes that `export` checks."""
    return {"observation_low": ",".join(["0"] * INPUTS), "action_low": ",".join(["-1"] * 4)}


def run(*arguments: str) -> str:
    done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_run_on_images_goes_on_and_leaves_film_and_policy(tmp_path: Path) -> None:
    small = [
        "--num-envs",
        "32",
        "--steps",
        "5",
        "--minibatches",
        "2",
        "--evaluate-steps",
        "400",
        "--out",
        str(tmp_path),
    ]
    command = [f"{EXAMPLES}/ppo.py", "FrankaPickCubeDepth", *small]
    run(*command, "--total", "800", "--film-every", "0.01")
    folder = tmp_path / "FrankaPickCubeDepth-0"
    assert list((folder / "films").glob("*.mp4"))
    output = run(*command, "--total", "1600", "--resume")
    assert "goes on after" in output and "800 steps" in output, output
    log = EventAccumulator(str(folder / "log"))
    log.Reload()
    assert 0.0 < log.Scalars("learn/estimate_error")[-1].value < 3.0
    played = run(
        f"{EXAMPLES}/play.py", "FrankaPickCubeDepth", f"{folder}/policy.onnx", "--num-envs", "8", "--out",
        str(tmp_path / "play.png"),
    )  # fmt: skip
    assert "success at the end" in played
