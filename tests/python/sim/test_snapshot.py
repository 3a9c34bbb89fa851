"""Snapshots through the daemon: runs that are resumed with the same bits, and files that are refused."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

import tightloop as tl
from processes import alive

WORLDS = 21
FIELDS = ("joint_q", "joint_qd", "joint_qdd", "joint_f", "joint_target_q", "body_q")
ALWAYS = ("time", "step", "status", "contacts_left_out")
FROZEN = 1


def start(sim: tl.Sim) -> None:
    """Every world moves in its own way."""
    sim.write(joint_qd=np.linspace(-1, 1, 2 * sim.worlds).reshape(sim.worlds, 2))
    go(sim, 5)


def go(sim: tl.Sim, frames: int) -> list[bytes]:
    """Bits of all fields, a frame each; the first goes on under the commands that are held."""
    torque = np.linspace(0.2, 0.4, 2 * sim.worlds).reshape(sim.worlds, 2)
    seen = [bits(sim.step())]
    return seen + [bits(sim.step(joint_f=torque * frame)) for frame in range(1, frames)]


def bits(frame: tl.Frame, worlds: object = ...) -> bytes:
    return b"".join(np.ascontiguousarray(getattr(frame, name)[worlds]).tobytes() for name in FIELDS + ALWAYS)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture(params=["f32", "f64"])
def sim(request, pendulum):
    with tl.launch(pendulum, worlds=WORLDS, precision=request.param, fields=FIELDS) as sim:
        start(sim)
        yield sim


def test_a_run_is_resumed_with_the_same_bits(sim):
    snapshot = sim.snapshot()
    assert (snapshot.worlds, snapshot.precision) == (WORLDS, sim.precision)
    assert snapshot.model_hash == sim.info["model_hash"]
    here = bits(sim.forward())
    first = go(sim, 20)
    assert bits(sim.restore(snapshot)) == here
    assert go(sim, 20) == first
    sim.reset()
    sim.restore(snapshot)
    assert go(sim, 20) == first
    assert snapshot.to_bytes() != sim.snapshot().to_bytes()


def test_a_run_goes_on_in_another_daemon_from_a_file(sim, pendulum, tmp_path):
    sim.snapshot().save(tmp_path / "run.snapshot")
    first = go(sim, 20)
    snapshot = tl.Snapshot.load(str(tmp_path / "run.snapshot"))
    with tl.launch(pendulum, worlds=WORLDS, precision=sim.precision, threads=1, fields=FIELDS) as other:
        other.restore(snapshot)
        assert go(other, 20) == first


def test_only_the_worlds_of_the_mask_are_restored(sim):
    snapshot, before = sim.snapshot(), sim.forward().copy()
    go(sim, 4)
    after = sim.forward().copy()
    chosen = np.arange(WORLDS) % 3 == 0
    frame = sim.restore(snapshot, worlds=chosen)
    assert bits(frame, chosen) == bits(before, chosen)
    assert bits(frame, ~chosen) == bits(after, ~chosen)


def test_one_world_is_forked_into_all_and_into_other_numbers_of_worlds(sim, pendulum):
    snapshot, before = sim.snapshot(), sim.forward().copy()
    go(sim, 3)
    frame = sim.restore(snapshot, from_world=7)
    for name in FIELDS + ALWAYS:
        assert np.array_equal(getattr(frame, name), np.repeat(getattr(before, name)[7:8], WORLDS, axis=0)), name
    chosen = np.arange(WORLDS) < 2
    frame = sim.restore(snapshot, worlds=chosen, from_world=3)
    expected = before.joint_q[np.where(chosen, 3, 7)]
    assert np.array_equal(frame.joint_q, expected)
    with tl.launch(pendulum, worlds=50, precision=sim.precision, fields=FIELDS) as other:
        frame = other.restore(snapshot, from_world=20)
        assert np.array_equal(frame.joint_q, np.repeat(before.joint_q[20:], 50, axis=0))
        with pytest.raises(tl.SnapshotError, match=r"21 worlds.*50.*from_world"):
            other.restore(snapshot)


def test_a_frozen_world_stays_frozen_until_a_healthy_one_is_restored(sim):
    healthy = sim.snapshot()
    blow = np.zeros((WORLDS, 2))
    blow[4] = np.finfo(sim.forward().joint_q.dtype).max / 10
    assert sim.step(joint_f=blow).status[4] == FROZEN
    sick = sim.snapshot()
    assert not sim.restore(healthy).status.any()
    assert sim.step().step[4] == 6
    frame = sim.restore(sick)
    assert np.array_equal(frame.status, np.where(np.arange(WORLDS) == 4, FROZEN, 0))
    frame = sim.step(joint_f=np.zeros(2))
    assert frame.status[4] == FROZEN and frame.step[4] == 5 and frame.step[5] == 7
    frame = sim.restore(healthy, worlds=np.arange(WORLDS) == 4)
    assert not frame.status.any() and sim.step().step[4] == 6


def test_a_snapshot_is_the_same_after_bytes_and_files(sim, tmp_path):
    snapshot = sim.snapshot()
    for data in (snapshot.to_bytes(), bytearray(snapshot.to_bytes()), memoryview(snapshot.to_bytes())):
        assert tl.Snapshot.from_bytes(data).to_bytes() == snapshot.to_bytes()
    path = tmp_path / "snapshot"
    path.write_bytes(b"an older one")
    snapshot.save(path)
    assert tl.Snapshot.load(path).to_bytes() == snapshot.to_bytes()
    assert set(names(tmp_path)) <= {"pendulum.urdf", "snapshot"}
    assert repr(snapshot).startswith(f"Snapshot(worlds={WORLDS}, precision={sim.precision!r}, model_hash=0x")


def test_snapshots_leave_nothing_in_shared_memory(sim):
    def passing() -> set[str]:
        return {path.name for path in Path("/dev/shm").iterdir() if path.name.startswith(f"tightloop-{os.getpid()}-")}

    snapshot = sim.snapshot()
    sim.restore(snapshot)
    with pytest.raises(tl.SnapshotError):
        sim.restore(snapshot, from_world=WORLDS)
    assert not passing()


@pytest.fixture
def small(pendulum):
    with tl.launch(pendulum, worlds=2, fields=FIELDS) as sim:
        start(sim)
        yield sim


def test_every_changed_byte_and_every_shorter_snapshot_is_refused(small):
    data = small.snapshot().to_bytes()
    for at in range(len(data)):
        damaged = bytearray(data)
        damaged[at] ^= 1
        with pytest.raises(tl.SnapshotError):
            tl.Snapshot.from_bytes(damaged)
        with pytest.raises(tl.SnapshotError):
            tl.Snapshot.from_bytes(data[:at])
    with pytest.raises(tl.SnapshotError, match="damaged"):
        tl.Snapshot.from_bytes(data + b"\0")


@pytest.mark.parametrize(
    ("data", "named"),
    [
        (b"", "no snapshot"),
        (b"<robot/>" * 10, "no snapshot"),
        (b"tlsnap\r\n", "cut short: 8 bytes of 40"),
        (struct.pack("<8sIIQQII", b"tlsnap\r\n", 2, 0, 0, 0, 0, 4), "format 2.*format 1"),
    ],
)
def test_foreign_bytes_and_files_are_refused_by_name(tmp_path, data, named):
    with pytest.raises(tl.SnapshotError, match=named):
        tl.Snapshot.from_bytes(data)
    path = tmp_path / "foreign"
    path.write_bytes(data)
    with pytest.raises(tl.SnapshotError, match=f"foreign: .*{named}"):
        tl.Snapshot.load(path)


def test_places_that_cannot_be_read_or_written_are_named(small, tmp_path):
    snapshot = small.snapshot()
    with pytest.raises(tl.SnapshotError, match=r"nowhere/snapshot: cannot be written: No such file"):
        snapshot.save(tmp_path / "nowhere/snapshot")
    with pytest.raises(tl.SnapshotError, match="cannot be written: Is a directory"):
        snapshot.save(tmp_path)
    with pytest.raises(tl.SnapshotError, match="nowhere: cannot be read: No such file"):
        tl.Snapshot.load(tmp_path / "nowhere")
    with pytest.raises(tl.SnapshotError, match="path is 3"):
        tl.Snapshot.load(3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(tl.SnapshotError, match="data is str"):
        tl.Snapshot.from_bytes("snapshot")  # pyright: ignore[reportArgumentType]


def forged(snapshot: tl.Snapshot, at: int, number: bytes) -> tl.Snapshot:
    """With other bytes, and the checksum that belongs to them."""
    data = bytearray(snapshot.to_bytes())
    data[at : at + len(number)] = number
    data[12:16] = struct.pack("<I", zlib.crc32(data[16:]))
    return tl.Snapshot.from_bytes(data)


def test_what_does_not_fit_is_refused_and_the_daemon_goes_on(small, pendulum):
    snapshot = small.snapshot()
    go(small, 3)
    before = small.forward()
    with tl.launch(pendulum, worlds=2, precision="f64", fields=FIELDS) as other:
        double = other.snapshot()
    pendulum.robots["arm"].joint_armature = 0.5
    with tl.launch(pendulum, worlds=2, fields=FIELDS) as other:
        heavy = other.snapshot()
    refusals = [
        (double, {}, r"64 bits.*of 32.*precision f64"),
        (heavy, {}, "another model"),
        (snapshot, {"from_world": 2}, "from_world is 2; the snapshot has worlds 0 to 1"),
        (snapshot, {"from_world": 2**62}, "from_world is"),
        (forged(snapshot, 68, struct.pack("<f", np.nan)), {}, "world 0 .*not finite"),
    ]
    for wrong, arguments, named in refusals:
        with pytest.raises(tl.SnapshotError, match=named):
            small.restore(wrong, **arguments)
        assert bits(small.forward()) == bits(before), named
    refusals = [
        ({"worlds": [True]}, r"worlds: expected shape \(2,\)"),
        ({"worlds": [1, 0]}, "not bool"),
        ({"from_world": -1}, "from_world is -1"),
        ({"from_world": 0.5}, "from_world is 0.5"),
    ]
    for arguments, named in refusals:
        with pytest.raises(tl.CommandRefused, match=named):
            small.restore(snapshot, **arguments)
    with pytest.raises(tl.CommandRefused, match=r"snapshot is bytes; give a tightloop\.Snapshot"):
        small.restore(snapshot.to_bytes())  # pyright: ignore[reportArgumentType]
    assert bits(small.forward()) == bits(before)
    small.restore(snapshot)
    assert alive(small.pid)


def test_the_daemon_refuses_places_and_files_by_name_and_goes_on(small, tmp_path):
    """What a client in another language may send."""
    client, here = small._client, small.forward().copy()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "text").write_text("nothing")
    good = small.snapshot().to_bytes()
    (tmp_path / "cut").write_bytes(good[:-1])
    (tmp_path / "damaged").write_bytes(good[:-1] + bytes([good[-1] ^ 1]))
    with (tmp_path / "endless").open("wb") as file:
        file.truncate(1 << 43)
    there = names(tmp_path)
    writes = {
        str(tmp_path / "nowhere/file"): "no folder .*nowhere; make it first",
        str(tmp_path): "cannot be written",
        "/": "give the path of one",
        "/proc/file": "no folder|cannot be written",
        "relative": "relative.*absolute",
        "": "relative.*absolute",
        str(tmp_path / (300 * "a")): "cannot be written",
        str(tmp_path) + "/\0": "cannot be written",
    }
    for path, named in writes.items():
        with pytest.raises(tl.SnapshotError, match=named):
            client.snapshot(path)
    reads = {
        "nowhere": "nowhere: cannot be read: No such file",
        ".": "is no file",
        "pipe": "is no file",
        "text": "text: this is no snapshot",
        "cut": "cut: .*cut short",
        "damaged": "damaged: .*damaged",
        "endless": "endless: needs 8388608 MB of memory",
    }
    for name, named in reads.items():
        with pytest.raises(tl.SnapshotError, match=named):
            client.restore(str(tmp_path / name), None, None)
    with pytest.raises(tl.CommandRefused, match=r"path.*at most 4096 bytes"):
        client.restore("/" + 5000 * "a", None, None)
    assert names(tmp_path) == there
    assert bits(small.forward()) == bits(here)
    client.snapshot(str(tmp_path / "text"))
    assert bits(client.restore(str(tmp_path / "text"), None, None)) == bits(here)


def test_a_pipe_is_not_replaced_by_a_file(small, tmp_path: Path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(tl.SnapshotError, match="is there and no file"):
        small.snapshot().save(pipe)
    assert pipe.is_fifo()
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "file")
    small.snapshot().save(link)
    assert link.is_symlink() and tl.Snapshot.load(tmp_path / "file").worlds == small.worlds
