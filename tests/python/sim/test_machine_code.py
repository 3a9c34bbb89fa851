"""Models as machine code of their own: the same bits where the system forbids it, and `Sim.device` says which ran."""

from __future__ import annotations

import json
import platform
import subprocess
import sys

import pytest

# A filter of system calls: no memory becomes executable by mprotect, as with SELinux's execmem denied.
FORBID = """
import ctypes, struct
statements = [
    (0x20, 0, 0, 0),  # the number of the call
    (0x15, 0, 3, 10),  # mprotect, or let it pass
    (0x20, 0, 0, 32),  # its third argument
    (0x45, 0, 1, 4),  # PROT_EXEC, or let it pass
    (0x06, 0, 0, 0x00050000 | 13),  # EACCES
    (0x06, 0, 0, 0x7FFF0000),
]
code = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *statement) for statement in statements))
program = ctypes.create_string_buffer(struct.pack("HxxxxxxP", len(statements), ctypes.addressof(code)))
libc = ctypes.CDLL(None, use_errno=True)
PR_SET_NO_NEW_PRIVS, PR_SET_SECCOMP, FILTER = 38, 22, 2
assert libc.prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0
assert libc.prctl(PR_SET_SECCOMP, FILTER, program, 0, 0) == 0, ctypes.get_errno()
"""
RUN = """
import hashlib, json
import numpy as np
import tightloop as tl

scene = tl.Scene()
scene.add_urdf(tl.assets.FR3, name="arm")
with tl.launch(scene, worlds=20, device="cpu", threads=1) as sim:
    torques = np.linspace(-20, 20, 20 * 9, dtype=np.float32).reshape(20, 9)
    for _ in range(30):
        frame = sim.step(joint_f=torques)
    bits = hashlib.sha256(np.ascontiguousarray(frame.joint_q).tobytes()).hexdigest()
    print(json.dumps([sim.device, bits]))
"""


def run(*parts: str) -> tuple[str, str]:
    """The device and the bits of a run in a process of its own."""
    done = subprocess.run([sys.executable, "-c", "".join(parts)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    device, bits = json.loads(done.stdout)
    return device, bits


@pytest.mark.skipif(
    platform.machine() != "x86_64" or sys.platform != "linux", reason="filters calls of Linux on x86-64"
)
def test_where_memory_may_not_become_executable_the_stages_run_and_the_device_has_the_reason() -> None:
    device, bits = run(RUN)
    assert ", machine code" in device
    denied, same = run(FORBID, RUN)
    assert "stages only: the system gives no memory that may be executed" in denied
    assert "Permission denied" in denied
    assert same == bits
