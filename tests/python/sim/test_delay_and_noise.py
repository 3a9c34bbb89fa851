"""Commands that come late, and noise of commands and sensors: exactly when, and how much."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl
from conftest import PENDULUM

SUBSTEPS = 4
FRAMES = 12
PRECISIONS = pytest.mark.parametrize("precision", ["f64", "f32"])


def pendulum(path: Path, substeps: int, command_delay_max: int | None = None) -> tl.Scene:
    scene = tl.Scene(dt=1 / 400, substeps=substeps, command_delay_max=command_delay_max)
    scene.add_urdf(path, name="p")
    scene.robots["p"].joint_target_ke = [20.0, 10.0]
    scene.robots["p"].joint_target_kd = [1.0, 0.5]
    scene.robots["p"].joint_q = [0.3, -0.2]
    return scene


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    path = tmp_path / "pendulum.urdf"
    path.write_text(PENDULUM)
    return path


@PRECISIONS
def test_a_command_acts_after_its_delay_to_the_substep(urdf: Path, precision: str):
    # a run that sends each substep by hand what is due there has the same bits
    rng = np.random.default_rng(1)
    delays = np.array([0, 1, 2, 3, 4, 5, 7, 8, 9, 11, 12, 16, 0.5, 3.5])
    worlds = len(delays)
    sent = {name: rng.normal(size=(FRAMES, worlds, 2)) for name in ("joint_f", "joint_target_q", "joint_target_qd")}
    late = pendulum(urdf, SUBSTEPS)
    late.robots["p"].joint_target_mode = ["both", "both"]
    with tl.launch(late, worlds=worlds, precision=precision, params=("command_delay",)) as sim:
        sim.params.command_delay = delays
        assert sim.params.command_delay.shape == (worlds,)
        frames = [sim.step(**{name: values[n] for name, values in sent.items()}).copy() for n in range(FRAMES)]
    by_hand = pendulum(urdf, 1)
    by_hand.robots["p"].joint_target_mode = ["both", "both"]
    start = {"joint_f": [0.0, 0.0], "joint_target_q": [0.3, -0.2], "joint_target_qd": [0.0, 0.0]}
    with tl.launch(by_hand, worlds=worlds, precision=precision) as sim:
        for n in range(FRAMES):
            for substep in range(SUBSTEPS):
                due = np.floor((n * SUBSTEPS + substep - np.ceil(delays)) / SUBSTEPS).astype(int)
                now = {
                    name: np.array([values[due[w], w] if due[w] >= 0 else start[name] for w in range(worlds)])
                    for name, values in sent.items()
                }
                sim.step(**now)
            frame = sim.forward()
            assert np.array_equal(frame.joint_q, frames[n].joint_q), n
            assert np.array_equal(frame.joint_qd, frames[n].joint_qd), n


def test_a_delay_holds_over_resets_snapshots_and_frames_in_between(urdf: Path):
    scene = pendulum(urdf, SUBSTEPS)
    rng = np.random.default_rng(2)
    commands = rng.normal(size=(10, 3, 2))
    with tl.launch(scene, worlds=3, params=("command_delay",)) as sim:
        sim.params.command_delay = [6, 6, 16]
        first = [sim.step(joint_f=command).copy() for command in commands]
        # what is on its way is forgotten: the same run again, and in the world that is left alone another
        sim.reset(mask=[True, False, True])
        again = [sim.step(joint_f=command).copy() for command in commands]
        for one, other in zip(first, again, strict=True):
            assert np.array_equal(one.joint_q[[0, 2]], other.joint_q[[0, 2]])
            assert not np.array_equal(one.joint_q[1], other.joint_q[1])
        # what is on its way is part of a snapshot, and evaluating in between changes nothing
        sim.step(joint_f=commands[0])
        snapshot = sim.snapshot()
        on = [sim.step(joint_f=command).copy().joint_q for command in commands]
        sim.restore(snapshot)
        for command, expected in zip(commands, on, strict=True):
            sim.forward()
            assert np.array_equal(sim.step(joint_f=command).joint_q, expected)


def test_delays_beyond_the_scenes_room_are_refused_by_name(urdf: Path):
    with tl.launch(pendulum(urdf, SUBSTEPS), worlds=2, params=("command_delay",)) as sim:
        with pytest.raises(tl.CommandRefused, match=r"command_delay is 17 in world 1.*at most 16.*command_delay_max"):
            sim.params.command_delay = [3, 17]
        with pytest.raises(tl.CommandRefused, match=r"command_delay.*-1"):
            sim.params.command_delay = [3, -1]
        assert not sim.params.command_delay.any()
    with tl.launch(pendulum(urdf, SUBSTEPS, command_delay_max=40), worlds=2, params=("command_delay",)) as sim:
        sim.params.command_delay = 40
    with pytest.raises(tl.SceneError, match="command_delay_max"):
        pendulum(urdf, SUBSTEPS, command_delay_max=4001)
    with tl.launch(pendulum(urdf, SUBSTEPS), worlds=2) as sim, pytest.raises(tl.CommandRefused, match="command_delay"):
        sim.params.command_delay = 3


def assert_normal(samples: NDArray[np.float64], std: float) -> None:
    """Mean, standard deviation, skewness and kurtosis of so many normal numbers, within five standard errors."""
    x, n = samples.ravel() / std, samples.size
    assert abs(x.mean()) < 5 / n**0.5
    assert abs(x.std() - 1) < 5 / (2 * n) ** 0.5
    assert abs((x**3).mean()) < 5 * (15 / n) ** 0.5
    assert abs((x**4).mean() - 3) < 5 * (96 / n) ** 0.5


def assert_independent(samples: NDArray[np.float64]) -> None:
    """No correlation of one axis' neighbours, nor of columns."""
    x = samples / samples.std()
    for axis in range(x.ndim):
        one, other = np.delete(x, 0, axis), np.delete(x, -1, axis)
        assert abs((one * other).mean()) < 5 / one.size**0.5, axis


def slider(tmp_path: Path) -> tl.Scene:
    """Two sliders of 1 kg without gravity: what acts on them is their acceleration."""
    inertial = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    joints = [
        f'<link name="l{axis}">{inertial}</link><joint name="{axis}" type="prismatic"><parent link="base"/>'
        f'<child link="l{axis}"/><axis xyz="{vector}"/><limit lower="-1e6" upper="1e6"/></joint>'
        for axis, vector in (("x", "1 0 0"), ("y", "0 1 0"))
    ]
    path = tmp_path / "slider.urdf"
    path.write_text(f'<robot name="slider"><link name="base"/>{"".join(joints)}</robot>')
    scene = tl.Scene(dt=1e-3, substeps=SUBSTEPS, gravity=(0, 0, 0))
    scene.add_urdf(path, name="s")
    return scene


def forces_felt(sim: tl.Sim, frames: int, joint_f: list[float] | None = None) -> NDArray[np.float64]:
    """Mean force on each slider in each frame, ``(frames, worlds, dofs)``."""
    before, felt = sim.forward().joint_qd.astype(float), []
    for _ in range(frames):
        after = sim.step(joint_f=joint_f).joint_qd.astype(float)
        felt.append((after - before) / (sim.substeps * sim.dt))
        before = after
    return np.array(felt)


def test_noise_of_commands_is_normal_independent_and_drawn_for_each_frame(tmp_path: Path):
    scene = slider(tmp_path)
    scene.robots["s"].joint_target_ke, scene.robots["s"].joint_target_kd = [100.0, 100.0], [10.0, 10.0]
    scene.robots["s"].joint_target_mode = ["both", "both"]
    names = ("joint_f_noise", "joint_target_q_noise", "joint_target_qd_noise", "joint_target_ke", "joint_target_kd")
    with tl.launch(scene, worlds=400, precision="f64", params=names, fields=("joint_q", "joint_qd")) as sim:
        sim.params.write(joint_target_ke=0.0, joint_target_kd=0.0, joint_f_noise=[0.5, 2.0])
        felt = forces_felt(sim, 50, joint_f=[3.0, -1.0])
        for dof, (mean, std) in enumerate([(3.0, 0.5), (-1.0, 2.0)]):
            assert_normal(felt[..., dof] - mean, std)
        assert_independent((felt - [3.0, -1.0]) / [0.5, 2.0])
        # a drive turns the noise of its targets into force
        sim.params.write(joint_f_noise=0.0, joint_target_ke=100.0, joint_target_q_noise=0.01)
        sim.reset(seed=7)
        assert_normal(forces_felt(sim, 1, joint_f=[0.0, 0.0]), 1.0)
        sim.params.write(joint_target_ke=0.0, joint_target_kd=10.0, joint_target_q_noise=0.0, joint_target_qd_noise=0.2)
        sim.reset(seed=8)
        one = forces_felt(sim, 1)
        # the drive's damping acts within the frame
        assert_normal(one / (1 - 10.0 * sim.dt * (SUBSTEPS - 1) / 2), 2.0)


@PRECISIONS
def test_noise_is_a_function_of_seed_world_episode_and_step(tmp_path: Path, precision: str):
    def run(worlds: int, threads: int) -> NDArray[np.float64]:
        scene, params = slider(tmp_path), ("joint_f_noise", "joint_q_noise")
        fields = ("joint_qd", "joint_q", "joint_q_measured")
        with tl.launch(scene, worlds=worlds, threads=threads, precision=precision, params=params, fields=fields) as sim:
            sim.params.write(joint_f_noise=1.0, joint_q_noise=0.1)
            sim.reset(seed=11)
            frames = [sim.step().copy() for _ in range(3)]
            sim.reset()
            frames += [sim.step().copy() for _ in range(3)]
            # the same state shows the same noise
            assert np.array_equal(sim.forward().joint_q_measured, frames[-1].joint_q_measured)
            return np.array([np.hstack([frame.joint_qd, frame.joint_q_measured]) for frame in frames])

    one, many = run(1, 1), run(37, 2)
    assert np.array_equal(one, many[:, :1])
    assert len(np.unique(many)) == many.size
    if precision == "f32":
        assert many.dtype == np.float32


def test_noise_in_single_precision_is_that_of_double_rounded(tmp_path: Path):
    shown = []
    for precision in ("f64", "f32"):
        with tl.launch(
            slider(tmp_path), worlds=20, precision=precision, params=("joint_qd_noise",), fields=("joint_qd_measured",)
        ) as sim:
            sim.params.joint_qd_noise = 0.25
            shown.append(sim.step().joint_qd_measured.copy())
    assert np.array_equal(shown[0].astype(np.float32), shown[1])


def test_measured_fields_have_the_noise_that_was_asked_for_and_no_other(tmp_path: Path, urdf: Path):
    scene = slider(tmp_path)
    ball = scene.add_body(name="ball", mass=1.0, pos=(5, 0, 0))
    scene.add_sphere(radius=0.1, body=ball)
    scene.add_site(body="ball", pos=(0.1, 0, 0))
    scene.add_site(body="s/lx")
    scene.add_contact_sensor(of="ball")
    noise = {
        "joint_q_noise": 0.02,
        "joint_qd_noise": 0.3,
        "joint_torque_noise": 0.5,
        "gyro_noise": [0.1, 0.2],
        "accelerometer_noise": [0.3, 0.4],
        "site_q_noise": [[0.01, 0.05], [0.02, 0.06]],
        "site_qd_noise": [[0.1, 0.5], [0.2, 0.6]],
        "contact_sensor_noise": 0.7,
    }
    fields = (
        "joint_q",
        "joint_qd",
        "joint_q_measured",
        "joint_qd_measured",
        "joint_torque",
        "gyro",
        "accelerometer",
        "site_q",
        "site_qd",
        "contact_sensor",
    )
    worlds = 20000
    with tl.launch(scene, worlds=worlds, precision="f64", params=tuple(noise), fields=fields) as sim:
        exact = sim.step().copy()
        assert np.array_equal(exact.joint_q_measured, exact.joint_q)
        assert np.array_equal(exact.joint_qd_measured, exact.joint_qd)
        frame = sim.params.write(**noise)
        for name in ("joint_q", "joint_qd"):
            assert np.array_equal(getattr(frame, name), getattr(exact, name))
        off = {name: getattr(frame, name) - getattr(exact, name) for name in fields}
        turn = slice(sim.coords["s"].stop + 3, None)
        assert_normal(off["joint_q_measured"][:, : turn.start], 0.02)
        assert_normal(off["joint_qd_measured"], 0.3)
        assert_normal(off["joint_torque"], 0.5)
        assert_normal(off["contact_sensor"], 0.7)
        for site in range(2):
            assert_normal(off["gyro"][:, site], noise["gyro_noise"][site])
            assert_normal(off["accelerometer"][:, site], noise["accelerometer_noise"][site])
            assert_normal(off["site_q"][:, site, :3], noise["site_q_noise"][site][0])
            assert_normal(off["site_qd"][:, site, :3], noise["site_qd_noise"][site][0])
            assert_normal(off["site_qd"][:, site, 3:], noise["site_qd_noise"][site][1])
            vector = rotation_vector(exact.site_q[:, site, 3:], frame.site_q[:, site, 3:])
            assert_normal(vector, noise["site_q_noise"][site][1])
        assert_normal(rotation_vector(exact.joint_q[:, turn], frame.joint_q_measured[:, turn]), 0.02)
        columns = np.hstack([off[name].reshape(worlds, -1) for name in off if name not in ("joint_q", "joint_qd")])
        columns = np.delete(columns, np.flatnonzero(columns.std(axis=0) < 1e-9), axis=1)
        correlation = np.corrcoef(columns.T) - np.eye(columns.shape[1])
        # a turn moves the four numbers of a quaternion together; nothing else goes with anything
        assert (np.abs(correlation) > 6 / worlds**0.5).sum() <= 3 * 12


def rotation_vector(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
    """The turn from one orientation to another, in the axes of the first; small ones only."""
    x, y, z, w = np.moveaxis(before, -1, 0)
    conjugate = np.stack([-x, -y, -z, w], -1)
    vector = (
        conjugate[..., 3:] * after[..., :3]
        + after[..., 3:] * conjugate[..., :3]
        + np.cross(conjugate[..., :3], after[..., :3])
    )
    sine = np.linalg.norm(vector, axis=-1, keepdims=True)
    return vector * 2 * np.arcsin(sine) / sine


def test_a_reset_draws_delays_and_noises_from_their_ranges(urdf: Path):
    scene = pendulum(urdf, SUBSTEPS)
    scene.add_site(body="p/lower", name="tip")
    scene.randomize(
        params={
            "command_delay": tl.Uniform(2, 16),
            "joint_friction": {"p/elbow": tl.Uniform(0.1, 0.2)},
            "site_q_noise": {"tip": tl.Uniform(0.5, 0.6), "tip.angular": tl.Uniform(0.01, 0.02)},
        }
    )
    with tl.launch(scene, worlds=2000, params=("joint_q_noise",)) as sim:
        assert set(sim.params.names) == {"command_delay", "joint_friction", "site_q_noise", "joint_q_noise"}
        delay = sim.params.command_delay
        assert delay.min() >= 2 and delay.max() <= 16 and abs(delay.mean() - 9) < 0.5
        friction, noise = sim.params.joint_friction, sim.params.site_q_noise
        assert not friction[:, 0].any() and friction[:, 1].min() >= 0.1 and friction[:, 1].max() <= 0.2
        assert noise[:, 0, 0].min() >= 0.5 and noise[:, 0, 1].max() <= 0.02
        sim.reset(mask=np.arange(2000) < 1000)
        again = sim.params.command_delay
        assert (again[:1000] != delay[:1000]).all() and (again[1000:] == delay[1000:]).all()
    for ranges, message in [
        ({"command_delay": tl.Uniform(2, 17)}, r"randomize: command_delay: high is 17; give at most 16"),
        ({"command_delay": {"p": tl.Uniform(2, 3)}}, r"command_delay.*it is one number"),
        ({"joint_friction": {"p": tl.Uniform(-1, 3)}}, r"joint_friction of `p`: low is -1; give at least 0"),
        ({"gyro_noise": {"top": tl.Uniform(0, 1)}}, r"gyro_noise of `top`.*`tip`"),
    ]:
        wrong = pendulum(urdf, SUBSTEPS)
        wrong.add_site(body="p/lower", name="tip")
        wrong.randomize(params=ranges)
        with pytest.raises(tl.TightloopError, match=message):
            tl.launch(wrong, worlds=1).close()
