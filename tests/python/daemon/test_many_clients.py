"""Clients that only attach take places: one too many learns who holds them, and the dead give them back."""

from __future__ import annotations

import subprocess
import sys

import pytest

import tightloop as tl
from processes import started
from tightloop.errors import TightloopError

CLIENTS_MAX = 64
ATTACH = """
import sys, tightloop as tl
held = [tl.attach(sys.argv[1]) for _ in range(int(sys.argv[2]))]
print("held", flush=True)
sys.stdin.read()
"""


def test_a_client_too_many_learns_who_holds_the_places(pendulum):
    with tl.launch(pendulum, worlds=1, device="cpu") as sim:
        # the launching client has one
        command = [sys.executable, "-c", ATTACH, sim.name, str(CLIENTS_MAX - 1)]
        with started(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
            assert holder.stdout is not None
            assert holder.stdout.readline() == "held\n"
            with pytest.raises(
                TightloopError, match=rf"64 clients, .*\(process {holder.pid} has 63, process \d+ has 1\)"
            ):
                tl.attach(sim.name)
            holder.kill()
            holder.wait()
            # at once: the daemon cleans up meanwhile
            tl.attach(sim.name).close()
