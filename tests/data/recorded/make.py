"""Makes the recordings and snapshots of this folder, with an installed tightloop: ``python make.py``.

They stand for the files that users have from earlier releases, so they are made once and never again: later releases
must replay them bit for bit. `sim-daemon/src/recording/tests/earlier.rs` does that. New files get new names.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

import tightloop as tl

HERE = Path(__file__).resolve().parent
WORLDS = 2
# frames that are recorded, and the one before which the first snapshot is taken
FRAMES, TAKEN_AT = 24, 16
FR3 = HERE.parents[2] / "py-client/python/tightloop/assets/fr3/fr3_franka_hand.urdf"
GAINS = np.array([4500, 4500, 3500, 3500, 2000, 2000, 2000, 100, 100], np.float64)


def lesson() -> tl.Scene:
    """The arm of the lesson, above a cube on a table."""
    scene = tl.Scene(dt=1 / 480, substeps=8)
    arm = scene.add_urdf(FR3, name="arm", pos=(-0.5, -0.5, 0.1))
    arm.joint_q = [-0.0037, 0.0239, 0.0037, -2.3684, -0.0001, 2.3922, 0.7855, 0.05, 0.05]
    arm.joint_target_ke, arm.joint_target_kd = GAINS, GAINS / 10
    scene.add_box(half_extents=(0.4, 0.4, 0.05), name="table")
    scene.add_cube(pos=(0.1, 0.0, 0.0751), name="cube")
    scene.add_site(body="arm/fr3_hand_tcp", name="grip")
    return scene


def quadruped() -> tl.Scene:
    """A robot of the size of a Go1 that falls on its feet, with starts and friction that a reset draws."""
    scene = tl.Scene(dt=0.005, substeps=4)
    scene.solver(cone="pyramidal", impratio=1.0)
    scene.add_ground()
    dog = scene.add_urdf(HERE / "quadruped.urdf", name="dog", floating=True, pos=(0, 0, 0.32))
    dog.joint_q = dog.joint_target_q = [0.0, 0.8, -1.6] * 4
    dog.joint_target_ke, dog.joint_target_kd, dog.joint_armature = 40.0, 1.0, 0.01
    for leg in ("FL", "FR", "RL", "RR"):
        scene.add_contact_sensor(of=f"dog/{leg}_foot", name=leg)
    scene.randomize(joint_q={"dog": tl.Uniform(-0.1, 0.1)}, params={"shape_mu": {"ground": tl.Uniform(0.6, 1.2)}})
    scene.friction_combine = "min"
    return scene


def machine() -> tl.Scene:
    """A model from MuJoCo."""
    return tl.Scene.from_mujoco(HERE / "machine.xml")


def make(name: str, scene: tl.Scene, command: str, moved: slice, flags: list[str]) -> None:
    """Record frames of a scene whose command swings in the columns `moved`, and keep the worlds of two of them."""
    path = HERE / f"{name}.toml"
    scene.save(path)
    serve = [sys.executable, "-m", "tightloop", "serve", str(path), "--name", f"make-{name}", "--worlds", str(WORLDS)]
    daemon = subprocess.Popen([*serve, *flags], stdout=subprocess.DEVNULL)
    try:
        with tl.attach(f"make-{name}", timeout=30) as sim:
            sim.reset(seed=7)
            frame = sim.step()
            held = np.zeros((WORLDS, moved.stop)) if command == "ctrl" else np.array(frame.joint_target_q)
            with sim.record(HERE / f"{name}.tlrec"):
                for frame in range(FRAMES):
                    if frame == TAKEN_AT:
                        sim.snapshot().save(HERE / f"{name}_start.tlsnap")
                    # the frames between the two snapshots have no command
                    target = held.copy()
                    swings = np.arange(target[:, moved].size).reshape(WORLDS, -1)
                    target[:, moved] += 0.1 * np.sin(0.3 * frame + swings)
                    sim.step(**({command: target} if frame < TAKEN_AT else {}))
            sim.snapshot().save(HERE / f"{name}_end.tlsnap")
    finally:
        daemon.terminate()
        daemon.wait()


if __name__ == "__main__":
    fields = "joint_q,joint_qd,joint_target_q"
    make("lesson", lesson(), "joint_target_q", slice(0, 7), ["--fields", fields, "--params", "joint_target_ke,gravity"])
    make(
        "quadruped",
        quadruped(),
        "joint_target_q",
        slice(6, 18),
        ["--fields", f"{fields},contact_sensor", "--precision", "f64"],
    )
    make("machine", machine(), "ctrl", slice(0, 3), ["--fields", "joint_q,joint_qd,sensordata"])
