"""A GPU that is not there, or cannot do what is asked: a message with the cure, exit codes as of other errors.

One that is lost in the midst of a run is lost in `sim-daemon/src/serve/server/tests.rs`: no driver loses one when asked
to.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tightloop as tl

URDF = Path(__file__).parents[3] / "examples/assets/fr3/fr3_franka_hand.urdf"
# What the loader of Vulkan calls it now, and did before
NO_DRIVER = {"VK_DRIVER_FILES": "/nonexistent", "VK_ICD_FILENAMES": "/nonexistent"}


@pytest.fixture
def no_driver(monkeypatch):
    for name, value in NO_DRIVER.items():
        monkeypatch.setenv(name, value)


@pytest.fixture
def serve(pendulum, tmp_path, unique):
    """Runs `tightloop serve` on a GPU until it fails."""

    def run(*arguments, scene=pendulum):
        file = tmp_path / "scene.toml"
        scene.save(file)
        command = [sys.executable, "-m", "tightloop", "serve", str(file), "--device=gpu", f"--name={unique()}"]
        return subprocess.run([*command, *arguments], capture_output=True, text=True, timeout=120, check=False)

    return run


@pytest.fixture
def grasp():
    """An arm at a cube on a table, whose programs take a driver seconds."""
    scene = tl.Scene(dt=1 / 480, substeps=8)
    scene.add_urdf(URDF, name="arm").joint_q = [0.0, 0.0, 0.0, -2.4, 0.0, 2.4, 0.8, 0.04, 0.04]
    scene.add_table(mu=0.8)
    scene.add_cube()
    return scene


@pytest.fixture
def cold(monkeypatch, tmp_path):
    """Nothing is kept of earlier runs, by us or by the driver."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def last_line(done):
    return done.stderr.strip().splitlines()[-1]


def test_the_validation_layer_watches_daemons_and_its_words_are_heard(pendulum, layer):
    with tl.launch(pendulum, worlds=1, device="gpu") as sim:
        assert "khronos_validation" in Path(f"/proc/{sim.pid}/maps").read_text()
    assert layer.words() == ""
    # a structure that says to be another one
    code = (
        "import ctypes\n"
        "vulkan = ctypes.CDLL('libvulkan.so.1')\n"
        "vulkan.vkCreateInstance((ctypes.c_uint32 * 16)(999), None, ctypes.byref(ctypes.c_void_p()))\n"
    )
    subprocess.run([sys.executable, "-c", code], timeout=60, check=True)
    assert "VUID-VkInstanceCreateInfo-sType-sType" in layer.words()


def test_a_gpu_runs_what_the_others_ask_in_vain(pendulum):
    with tl.launch(pendulum, worlds=2, device="gpu") as sim:
        assert sim.device.startswith("gpu (")
        assert sim.step().step.tolist() == [1, 1]


@pytest.mark.parametrize("adapter", ["nonsense", "99"])
def test_an_unknown_adapter_is_named_with_those_there_are(serve, adapter):
    done = serve(f"--adapter={adapter}")
    assert done.returncode == 2
    assert '"kind":"ArgumentError"' in done.stdout
    assert adapter in last_line(done)
    assert "there are: 0 `" in last_line(done)


def test_double_precision_on_a_gpu_is_refused_with_both_cures(pendulum, serve):
    with pytest.raises(tl.ArgumentError, match=r"single precision.*f32.*cpu"):
        tl.launch(pendulum, worlds=1, device="gpu", precision="f64")
    done = serve("--precision=f64")
    assert done.returncode == 2
    assert "single precision" in last_line(done)


@pytest.mark.usefixtures("no_driver")
def test_without_a_driver_the_message_says_what_to_install(pendulum, serve):
    with pytest.raises(tl.LaunchError, match=r"no adapter.*mesa-vulkan-drivers"):
        tl.launch(pendulum, worlds=1, device="gpu")
    done = serve()
    assert done.returncode == 1
    assert '"kind":"LaunchError"' in done.stdout
    assert "install a Vulkan driver" in last_line(done)


@pytest.mark.usefixtures("no_driver")
def test_without_a_driver_devices_reports_it_and_succeeds():
    command = [sys.executable, "-m", "tightloop", "devices"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout.count("\n")) == (0, 1)
    assert "no GPU" in done.stdout


@pytest.mark.usefixtures("no_driver")
def test_auto_is_the_processor_where_there_is_no_gpu_and_the_log_says_why(pendulum, tmp_path):
    log = tmp_path / "news.log"
    with tl.launch(pendulum, worlds=1024, device="auto", log=log) as sim:
        assert sim.device.startswith("cpu")
        sim.step()
    assert "device auto is the processor: no GPU was found" in log.read_text()


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        ({"worlds": 127}, "fewer than 128 worlds"),
        ({"worlds": 1024, "precision": "f64"}, "a GPU computes in single precision"),
    ],
    ids=["few worlds", "double precision"],
)
def test_auto_says_what_keeps_it_from_a_gpu(pendulum, tmp_path, arguments, why):
    log = tmp_path / "news.log"
    with tl.launch(pendulum, device="auto", log=log, **arguments) as sim:
        assert sim.device.startswith("cpu")
    assert f"device auto is the processor: {why}" in log.read_text()


def test_more_worlds_than_a_gpu_holds_are_refused_before_memory_is_taken(pendulum):
    with pytest.raises(tl.ResourceError, match="fewer worlds"):
        tl.launch(pendulum, worlds=20_000_000, device="gpu", fields=())


def test_a_daemon_goes_on_after_another_failed_on_the_gpu(pendulum, serve):
    with tl.launch(pendulum, worlds=1, device="gpu") as sim:
        assert serve("--adapter=nonsense").returncode == 2
        sim.step()


# The last two find the driver at work when the process ends, on one program or many
@pytest.mark.parametrize("limit", ["0.000001", "0.05", "0.2"])
@pytest.mark.usefixtures("cold")
def test_a_driver_that_takes_too_long_is_given_up_with_the_cures(grasp, serve, monkeypatch, limit):
    monkeypatch.setenv("TIGHTLOOP_COMPILE_LIMIT", limit)
    done = serve(scene=grasp)
    assert done.returncode == 1
    assert '"kind":"LaunchError"' in done.stdout
    assert "did not compile within" in last_line(done)
    assert "device = cpu" in last_line(done) and "TIGHTLOOP_COMPILE_LIMIT" in last_line(done)
    monkeypatch.setenv("TIGHTLOOP_COMPILE_LIMIT", "1e-6")
    with pytest.raises(tl.LaunchError, match="did not compile within"):
        tl.launch(grasp, worlds=1, device="gpu")


@pytest.mark.parametrize("limit", ["soon", "-1", "nan", ""])
def test_a_limit_that_is_no_time_is_refused(serve, monkeypatch, limit):
    monkeypatch.setenv("TIGHTLOOP_COMPILE_LIMIT", limit)
    done = serve()
    assert done.returncode == 2
    assert "give seconds" in last_line(done)


@pytest.mark.usefixtures("cold")
def test_auto_measures_once_and_falls_back_to_the_processor_where_the_gpu_does_not_start(
    pendulum, monkeypatch, tmp_path
):
    # the one GPU that every test has is software, which takes no part else
    monkeypatch.setenv("TIGHTLOOP_AUTO_SOFTWARE", "1")
    log = tmp_path / "news.log"

    def auto_note(sim):
        (note,) = (note for note in sim.info["notes"] if note.startswith("device auto is "))
        assert note in log.read_text()
        return note

    with tl.launch(pendulum, worlds=1024, device="auto", log=log) as sim:
        note = auto_note(sim)
        assert re.search(r": \d+\.\d{3} M steps/s beside \d+\.\d{3} M on .*, measured in \d+\.\d s$", note), note
        assert "a software driver" in note
        assert sim.device.startswith("gpu (" if note.startswith("device auto is the GPU `") else "cpu (")
    # from now on the GPU is the faster one
    (rates,) = (tmp_path / "cache/tightloop").glob("auto-*")
    key = rates.read_text().splitlines()[0]
    rates.write_text(f"{key}\n3100000 900000\n")
    with tl.launch(pendulum, worlds=1024, device="auto", log=log) as sim:
        assert sim.device.startswith("gpu (")
        note = auto_note(sim)
        assert note.startswith("device auto is the GPU `")
        assert note.endswith(": 3.100 M steps/s beside 0.900 M on the processor, measured by an earlier launch")
        with monkeypatch.context() as impatient:
            impatient.setenv("TIGHTLOOP_COMPILE_LIMIT", "1e-6")
            with tl.launch(pendulum, worlds=1024, device="auto", log=log) as other:
                assert other.device.startswith("cpu")
                note = auto_note(other)
                assert note.startswith("device auto is the processor: `") and "did not compile within" in note
                frame = other.step()
        # a daemon whose driver was in time goes on beside it
        np.testing.assert_allclose(sim.step().joint_q, frame.joint_q, atol=1e-6)
