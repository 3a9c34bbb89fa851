"""Numbers of a run of `ppo.py`, and those that suit tightloop's tasks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Config:
    """Numbers of a run; the command line changes any of them."""

    minutes: float = 3.0  # how long to train, evaluations and waiting included
    num_envs: int = 2048
    steps: int = 24  # of a rollout, in every world
    epochs: int = 5  # that a rollout is learned from
    minibatches: int = 4  # of an epoch
    hidden: int = 128  # units of each of two layers, in actor and critic
    gamma: float = 0.99  # what a reward is worth one step later
    lam: float = 0.95  # λ of the advantages
    clip: float = 0.2  # of the ratio of probabilities
    entropy: float = 0.0  # weight of the entropy in the loss
    calm: float = 0.0  # weight of the squares of all mean actions in the loss; it falls to 0 by the end of the run
    anneal: bool = False  # whether the weight of the entropy falls to 0 by the end of the run
    lr: float = 1e-3  # learning rate at the start
    kl: float = 0.01  # change of the policy that the learning rate aims at, a rollout; a tenth of it at the end
    std: float = 0.6  # standard deviation of actions at the start
    grad_max: float = 1.0  # norm of a gradient, at most
    reward_scale: float = 1.0  # of the rewards that are learned from, which should be some hundredths a step
    mirror: bool = False  # whether actor and critic are symmetric, if the task has a mirror image
    muon: bool = False  # whether hidden layers learn by Muon instead of Adam; needs torch 2.9
    evaluate: float = 15.0  # seconds between evaluations
    film_every: float = 0.0  # minutes between films of the policy; 0 for none
    total: int = 0  # env steps after which to stop, instead of minutes; the same run then has the same bits
    evaluate_steps: int = 1_000_000  # env steps between them, if the run ends by steps
    enough: float = 2.0  # success at which to stop before the time is over; above 1 it never does
    threads: int = 1  # of the simulation
    torch_threads: int = 1  # of the learner, and of the policy beside the simulation


PRESETS = {
    "CartPoleBalance": Config(minutes=0.5, num_envs=512, hidden=64, threads=1),
    "CartPoleSwingUp": Config(
        1.0, 256, 64, minibatches=8, hidden=64, gamma=0.98, kl=0.02, std=1.0, evaluate=10.0, threads=1
    ),
    "FrankaReach": Config(3.0, 512, 32, minibatches=16, gamma=0.9, kl=0.02, std=1.0),
    "FrankaPushCube": Config(
        15.0, 1024, 20, epochs=8, minibatches=32, gamma=0.9, lam=0.9, hidden=256, kl=0.02, evaluate=30.0
    ),
    "FrankaPickCube": Config(
        60.0, 1024, 20, epochs=8, minibatches=32, gamma=0.8, lam=0.9, hidden=256, kl=0.02, evaluate=60.0
    ),
    "FrankaPickCubeDepth": Config(
        10.0, 1024, 20, epochs=8, minibatches=32, gamma=0.8, lam=0.9, hidden=256, calm=0.02, kl=0.02, evaluate=60.0
    ),
    "QuadrupedVelocityFlat": Config(
        5.0, 512, 16, epochs=2, gamma=0.98, entropy=0.004, kl=0.03, std=0.7, mirror=True, evaluate=30.0
    ),
    "QuadrupedVelocityRough": Config(
        60.0,
        512,
        16,
        epochs=2,
        gamma=0.98,
        entropy=0.004,
        anneal=True,
        kl=0.03,
        std=0.7,
        mirror=True,
        muon=True,
        evaluate=120.0,
    ),
    "HumanoidVelocityFlat": Config(
        20.0, 512, 16, epochs=2, gamma=0.99, entropy=0.004, kl=0.04, std=0.6, mirror=True, evaluate=60.0
    ),
    "AntRun": Config(5.0, 1024, 16, epochs=4, kl=0.02, std=0.6, evaluate=60.0),
    "Ant-v5": Config(10.0, 1024, 16, epochs=4, kl=0.02, std=0.4, reward_scale=0.02, evaluate=60.0),
    "FrankaLift": Config(minutes=30.0, num_envs=2048, gamma=0.98, hidden=256, entropy=0.005, evaluate=60.0),
}
#: What differs from the task's numbers for robots that tightloop knows by name.
ROBOTS: dict[str, dict[str, Any]] = {
    "unitree_g1": {"minutes": 10.0},
    "unitree_go1": {"minutes": 3.0, "muon": True},
}
