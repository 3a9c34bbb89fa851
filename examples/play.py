"""Runs a policy file in the loop, and draws what it did.

    pip install matplotlib onnxruntime tqdm
    python examples/play.py FrankaReach out/ppo/FrankaReach-0/policy.onnx
    python examples/play.py FrankaPickCube examples/trained/FrankaPickCube.onnx --num-envs 16 --film out/pick.mp4
    python examples/play.py FrankaPickCube examples/trained/FrankaPickCube.onnx --num-envs 16 --view
    python examples/play.py FrankaReach first.onnx second.onnx --num-envs 16 --view

The file is ONNX with the input ``obs`` (worlds, size) and the output ``action`` (worlds, actions), as
``examples/ppo.py`` leaves it. Every world plays one episode; the picture has the rewards, the
actions and the first observations of a few. It is ``out/play/TASK.png`` if ``--out`` names no other.

With ``--view``, worlds play until Ctrl-C. The page plots the reward, and its terms if the task has them. Of several
files, users choose there which policy acts.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path

import numpy as np
from learning.filming import Shooting, film_of
from learning.places import OUT
from learning.program import needed
from numpy.typing import NDArray

from evaluation import metrics
from tightloop.env import AutoresetMode, VectorEnv
from tightloop.view import Film
from tightloop.view.cameras import PRESETS

with needed("matplotlib", "onnxruntime", "tqdm"):
    import matplotlib
    import onnxruntime

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

RUNS = OUT / "play"
SHOWN = 8  # worlds in the picture


def play(
    envs: VectorEnv, policy: onnxruntime.InferenceSession, seed: int, film: Film | None
) -> dict[str, NDArray[np.float64]]:
    """One episode in every world: what was seen, done, and got, ``(steps, worlds, …)``; NaN after an episode's end."""
    obs, _ = envs.reset(seed=seed)
    shooting = None if film is None else Shooting(envs.max_episode_steps, "film")
    going, kept = np.ones(envs.num_envs, bool), {"obs": [], "action": [], "reward": []}
    while going.any():
        if film is not None and shooting is not None:
            film.add(envs.frame, goals=envs.marks)
            shooting.step()
        (action,) = policy.run(["action"], {"obs": obs})
        seen = obs
        obs, reward, terminated, truncated, infos = envs.step(action)
        step = {"obs": seen, "action": action, "reward": reward}
        # a task may define no success
        step |= {name: value for name, value in metrics(infos) if name == "success"}
        for name, array in step.items():
            kept.setdefault(name, []).append(np.where(going.reshape(-1, *[1] * (np.ndim(array) - 1)), array, np.nan))
        going &= ~(terminated | truncated)
    if shooting is not None:
        shooting.close()
    return {name: np.array(arrays) for name, arrays in kept.items()}


def show(envs: VectorEnv, policies: Mapping[str, onnxruntime.InferenceSession], seed: int) -> None:
    """Play with the policy that is chosen on the page, until Ctrl-C."""
    viewer, first = envs.viewer, next(iter(policies))
    assert viewer is not None
    if len(policies) > 1:
        viewer.offer([*policies])
    try:
        obs, _ = envs.reset(seed=seed)
        while viewer.open:
            (action,) = policies[viewer.choice or first].run(["action"], {"obs": obs})
            obs, *_ = envs.step(action)
    except KeyboardInterrupt:
        print()


def summary(task: str, kept: dict[str, NDArray[np.float64]]) -> str:
    """The return of the episodes, and how many end in success, if the task defines it."""
    returns, worlds = np.nansum(kept["reward"], axis=0), kept["reward"].shape[1]
    text = f"{task}: return {returns.mean():.3g} ± {returns.std():.2g}"
    if "success" not in kept:
        return text
    last = np.isfinite(kept["reward"]).sum(axis=0) - 1
    return f"{text}, success at the end {kept['success'][last, np.arange(worlds)].mean():.1%}"


def draw(path: Path, kept: dict[str, NDArray[np.float64]], envs: VectorEnv, title: str) -> None:
    """Rewards, actions and observations of the first worlds over time."""
    seconds = envs.control_dt * np.arange(len(kept["reward"]))
    parts, place = [], 0
    for part in envs.task.observed()[:4]:
        if part.shape is None:  # an image is no curve
            parts.append((f"{part.name} [{part.unit}]", kept["obs"][:, :SHOWN, place : place + part.width]))
        place += part.width
    panels = [("reward", kept["reward"][:, :SHOWN, None]), ("action", kept["action"][:, :SHOWN]), *parts]
    figure, axes = plt.subplots(2, 3, figsize=(12, 6), constrained_layout=True)
    for axis, (name, values) in zip(axes.flat, panels, strict=False):
        for world in range(values.shape[1]):
            axis.plot(seconds, values[:, world], color=f"C{world}", lw=0.8, alpha=0.7)
        axis.set(title=name, xlabel="time [s]")
        axis.grid(alpha=0.3)
    figure.suptitle(title)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=90)


def main() -> None:
    """Play, say how it went, and draw the picture."""
    parser = argparse.ArgumentParser(description="Run a policy file in the loop.")
    parser.add_argument("task", help="the task, such as FrankaReach")
    parser.add_argument("policy", type=Path, nargs="+", help="ONNX file; several with --view")
    parser.add_argument("--num-envs", type=int, default=256, help="worlds (default 256)")
    parser.add_argument("--seed", type=int, default=0, help="of the episodes (default 0)")
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument("--view", action="store_true", help="show it in the browser, at the pace of the world")
    shown.add_argument("--film", type=Path, help="film of the first worlds: .mp4, .gif, .html or a folder")
    parser.add_argument("--camera", choices=list(PRESETS), help="of the film (default: follow if the robot floats)")
    parser.add_argument("--out", type=Path, help="picture (default out/play/TASK.png)")
    args = parser.parse_args()
    out = args.out or RUNS / f"{args.task.rpartition(':')[2]}.png"

    if len(args.policy) > 1 and not args.view:
        parser.error("several policies are for --view; give one")
    if args.out is not None and args.view:
        parser.error("--view draws no picture; leave --out out")
    policies = {
        str(path): onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"]) for path in args.policy
    }
    policy = next(iter(policies.values()))
    options = {
        path: other.get_modelmeta().custom_metadata_map.get("task_options", "{}") for path, other in policies.items()
    }
    first = next(iter(options.values()))
    for path, text in options.items():
        if text != first:
            raise SystemExit(f"{path} is of a task made with {text}, and the first policy of one with {first}")
    made = json.loads(first)
    mode = "human" if args.view else "rgb_array" if args.film else None
    envs = VectorEnv(args.task, args.num_envs, autoreset_mode=AutoresetMode.SAME_STEP, render_mode=mode, **made)
    try:
        size = envs.single_observation_space.shape[0]
        for path, other in policies.items():
            expected = other.get_inputs()[0].shape[1]
            if expected != size:
                raise SystemExit(f"{path} takes {expected} numbers, and {args.task} has {size}")
        if args.view:
            return show(envs, policies, args.seed)
        with film_of(envs, args.film, args.camera) if args.film else nullcontext() as film:
            kept = play(envs, policy, args.seed, film)
        title = summary(args.task, kept)
        draw(out, kept, envs, title)
        print(f"{title}, {args.num_envs} worlds\npicture: {out}")
    finally:
        envs.close()


if __name__ == "__main__":
    main()
