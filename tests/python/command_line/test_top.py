"""``tightloop top``: what a daemon does now, as text, as JSON and for Prometheus."""

from __future__ import annotations

import contextlib
import json
import os
import re
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import tightloop as tl
from conftest import URDF
from processes import started

TOP = [sys.executable, "-m", "tightloop", "top"]
FRAMES = 10


@pytest.fixture
def sim() -> Iterator[tl.Sim]:
    """Eight boxes on the ground after 10 frames; the one of world 3 has no finite position."""
    scene = tl.Scene(dt=0.002, substeps=2)
    scene.add_ground()
    scene.add_body(name="box", pos=(0.0, 0.0, 0.099), mass=1.0)
    scene.add_box(body="box", half_extents=(0.1, 0.1, 0.1))
    fields = ("joint_q", "contact_count")
    with tl.launch(scene, worlds=8, device="cpu", threads=1, fields=fields, on_nan="freeze") as sim:
        force = np.zeros((8, 6))
        force[3] = np.nan
        sim.step(joint_f=force)
        for _ in range(FRAMES - 1):
            sim.step(joint_f=np.zeros(6))
        yield sim


def said(*arguments: str, code: int = 0) -> str:
    """What the command prints."""
    done = subprocess.run([*TOP, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    return done.stdout if code == 0 else done.stderr


def test_a_look_as_text(sim: tl.Sim) -> None:
    text = said(sim.name, "--count", "2", "--interval", "0.1")
    assert text.count(f"daemon    {sim.name}, pid {sim.pid}") == 2
    assert "faulted   1 of the 8 worlds" in text
    assert f"frames    {FRAMES}, 0 missed, 0 late, 0 skipped" in text
    assert re.search(r"contacts  [1-9]\.\d a world", text)


def test_a_look_as_json(sim: tl.Sim) -> None:
    look = json.loads(said(sim.name, "--count", "1", "--json"))
    assert (look["worlds"], look["seen_worlds"], look["faulted_worlds"]) == (8, 8, 1)
    assert look["controllers"] != []
    # resting boxes have four contacts, and one world has what it had at the start
    assert 3.0 < look["contacts_per_world"] <= 8.0
    assert look["memory_bytes"] > look["shared_bytes"] > 0
    [timing] = look["timing_us"]
    assert timing["frames"] == FRAMES
    assert timing["busy"]["worst"] >= timing["busy"]["p50"] > 0.0


def test_speed_is_that_of_the_interval(sim: tl.Sim) -> None:
    with subprocess.Popen(
        [*TOP, sim.name, "--count", "1", "--json", "--interval", "2"], stdout=subprocess.PIPE, text=True
    ) as top:
        frames = 0
        while top.poll() is None:
            sim.step()
            frames += 1
        assert top.stdout is not None
        look = json.loads(top.stdout.read())
    assert 0 < look["frames_per_s"] <= frames / 2.0
    assert look["steps_per_s"] == pytest.approx(look["frames_per_s"] * 8 * 2)


def test_prometheus_scrapes_loopback(sim: tl.Sim) -> None:
    command = [*TOP, sim.name, "--metrics", "127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as top:
        assert top.stdout is not None
        try:
            address = top.stdout.readline().strip()
            text = urllib.request.urlopen(address, timeout=20).read().decode()
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(address.replace("metrics", "secrets"), timeout=20)
        finally:
            top.kill()
    values = dict(line.rsplit(" ", 1) for line in text.splitlines() if not line.startswith("#"))
    assert values[f'tightloop_frames_total{{daemon="{sim.name}",group="0"}}'] == str(FRAMES)
    assert values[f'tightloop_faulted_worlds{{daemon="{sim.name}"}}'] == "1"
    known = {line.split()[2] for line in text.splitlines() if line.startswith("# TYPE")}
    assert {name.split("{")[0] for name in values} == known


@contextmanager
def scraped(name: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """A server of scrapes, and its port."""
    command = [*TOP, name, "--metrics", "127.0.0.1:0"]
    with started(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as top:
        assert top.stdout is not None
        yield top, int(top.stdout.readline().split(":")[2].split("/")[0])


def answer(port: int, request: bytes) -> bytes:
    """Return all that the server says to these bytes, until it closes."""
    with socket.create_connection(("127.0.0.1", port), timeout=20) as connection:
        connection.sendall(request)
        told = b""
        with contextlib.suppress(ConnectionResetError):
            while some := connection.recv(65536):
                told += some
    return told


def status(port: int, *lines: str) -> int:
    """Return the status of the answer to a request of these lines."""
    told = answer(port, "\r\n".join([*lines, "", ""]).encode())
    return int(told.split()[1])


def resident(pid: int) -> int:
    """Return the memory of a process [bytes]."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.parametrize("more", ["Content-Length: 100000000000000", "Content-Length: 5", "Transfer-Encoding: chunked"])
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_a_request_with_a_body_is_refused_and_the_next_one_served(sim: tl.Sim, method: str, more: str) -> None:
    with scraped(sim.name) as (_, port):
        refused = status(port, f"{method} /metrics HTTP/1.1", "Host: localhost", more)
        assert refused == (413 if method == "GET" else 405)
        assert status(port, "GET /metrics HTTP/1.1", "Host: localhost") == 200


def test_open_connections_that_say_nothing_keep_no_scrape_out(sim: tl.Sim) -> None:
    with scraped(sim.name) as (_, port), contextlib.ExitStack() as silent:
        for _ in range(200):
            connection = socket.create_connection(("127.0.0.1", port), timeout=20)
            silent.enter_context(connection).sendall(b"GET /metrics HTTP/1.1\r\nHost: local")
        began = time.monotonic()
        assert status(port, "GET /metrics HTTP/1.1", "Host: localhost") == 200
        assert time.monotonic() - began < 2.0


def test_a_head_without_end_takes_little_memory_and_little_time(sim: tl.Sim) -> None:
    with scraped(sim.name) as (top, port):
        before, began = resident(top.pid), time.monotonic()
        with (
            socket.create_connection(("127.0.0.1", port), timeout=20) as connection,
            pytest.raises(ConnectionError),
        ):
            while time.monotonic() - began < 20.0:
                connection.sendall(b"X-Header: " + b"a" * 65536 + b"\r\n")
        assert time.monotonic() - began < 10.0
        assert resident(top.pid) - before < 8e6
        assert status(port, "GET /metrics HTTP/1.1", "Host: localhost") == 200


def test_a_head_that_comes_byte_by_byte_is_not_waited_for(sim: tl.Sim) -> None:
    with scraped(sim.name) as (_, port):
        began = time.monotonic()
        with (
            socket.create_connection(("127.0.0.1", port), timeout=20) as connection,
            pytest.raises(ConnectionError),
        ):
            while time.monotonic() - began < 20.0:
                connection.sendall(b"G")
                time.sleep(0.1)
        assert time.monotonic() - began < 10.0


@pytest.mark.parametrize(
    "host",
    [
        "attacker.example",
        "attacker.example:9400",
        "localhost.attacker.example",
        "127.0.0.1@attacker.example",
        "a b",
        "",
    ],
)
def test_a_host_that_is_not_this_machine_gets_no_answer(sim: tl.Sim, host: str) -> None:
    with scraped(sim.name) as (_, port):
        assert status(port, "GET /metrics HTTP/1.1", f"Host: {host}") in (400, 421)
        assert status(port, "GET /metrics HTTP/1.1") in (400, 421)
        assert status(port, "GET /metrics HTTP/1.1", "Host: localhost", f"Host: {host}") in (400, 421)
        for ours in ("localhost", f"localhost:{port}", f"127.0.0.1:{port}", "LOCALHOST", "[::1]:1"):
            assert status(port, "GET /metrics HTTP/1.1", f"Host: {ours}") == 200


def test_a_scrape_while_a_daemon_steps_gets_an_error(unique: Callable[[], str]) -> None:
    name = unique()
    scene = tl.Scene(dt=1e-4, substeps=10_000)
    scene.add_urdf(URDF, name="arm")
    with tl.launch(scene, worlds=20_000, device="cpu", threads=1, name=name) as sim, scraped(name) as (top, port):
        sim.send()
        time.sleep(0.3)
        told = answer(port, b"GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert told.startswith(b"HTTP/1.1 503") and b"long work" in told
        assert top.poll() is None


@pytest.mark.parametrize(
    ("arguments", "cure"),
    [
        (("--interval", "0"), "0.1 to 3600"),
        (("--metrics", "0.0.0.0:0"), "127.0.0.1"),
        (("--metrics", "here"), "127.0.0.1:9400"),
    ],
)
def test_wrong_arguments_are_named(sim: tl.Sim, arguments: tuple[str, ...], cure: str) -> None:
    assert cure in said(sim.name, *arguments, code=2)


def test_a_daemon_that_is_not_there_is_named() -> None:
    assert "nobody-here" in said("nobody-here", code=1)
