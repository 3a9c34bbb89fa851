"""What differs between systems is in one module. Its code for macOS and Windows works, as far as Linux can run it."""

from __future__ import annotations

import ast
import errno
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import tightloop as tl
from conftest import REPOSITORY
from processes import started
from tightloop import system
from tightloop.env import VectorEnv
from tightloop.whole_files import whole_file

PACKAGE = REPOSITORY / "py-client/python/tightloop"
DIFFERS = PACKAGE / "system.py"

#: What the package uses of modules whose contents differ between systems. All of it is on each of them.
EVERYWHERE = {
    "os": """O_CREAT O_EXCL O_RDONLY O_WRONLY PathLike W_OK _exit access close cpu_count environ fdopen fspath fstat
        getpid open scandir sep strerror utime""",
    "signal": "SIGINT SIG_DFL signal",
    "socket": "SOCK_STREAM getaddrinfo gethostname socket",
    "subprocess": "PIPE Popen TimeoutExpired",
}
#: Modules that some systems do not have, or that tell which one it is.
NOT_EVERYWHERE = set("ctypes fcntl grp msvcrt multiprocessing platform posix pty pwd resource termios winreg".split())
#: Arguments of processes that some systems refuse.
ARGUMENTS = {"creationflags", "pass_fds", "preexec_fn", "process_group", "start_new_session", "startupinfo"}
FOLDERS = re.compile(r"(^|\W)/(dev|proc|sys|tmp|var)\b")


def differences(source: str) -> list[str]:
    """Return what a source file uses that is not on each system, as ``line: what``."""
    found, tree = [], ast.parse(source)
    documented = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=names):
                used = [alias.name for alias in names if alias.name.partition(".")[0] in NOT_EVERYWHERE]
            case ast.ImportFrom(module=str(module)) if module in NOT_EVERYWHERE:
                used = [module]
            case ast.ImportFrom(module=str(module), names=names) if module in EVERYWHERE:
                used = [alias.name for alias in names if alias.name not in EVERYWHERE[module].split()]
            case ast.Attribute(value=ast.Name(id=module), attr=name) if module in EVERYWHERE:
                used = [] if name in EVERYWHERE[module].split() else [f"{module}.{name}"]
            case ast.Attribute(value=ast.Name(id="sys"), attr="platform"):
                used = ["sys.platform"]
            case ast.keyword(arg=str(name)) if name in ARGUMENTS:
                used = [name]
            case ast.Constant(value=str(text)) if id(node) not in documented and FOLDERS.search(text):
                used = [text]
            case _:
                continue
        found += [f"{node.lineno}: {each}" for each in used]
    return found


def test_only_one_module_uses_what_is_not_on_each_system() -> None:
    found = {
        str(file.relative_to(PACKAGE)): uses
        for file in PACKAGE.rglob("*.py")
        if file != DIFFERS and (uses := differences(file.read_text()))
    }
    assert not found, "put it into tightloop/system.py, or into EVERYWHERE if each system has it"
    assert differences(DIFFERS.read_text())


@pytest.mark.parametrize(
    "source",
    [
        "import fcntl",
        "def f():\n    import ctypes.util",
        "from os import memfd_create",
        "from fcntl import flock",
        "os.sched_getaffinity(0)",
        "process.send_signal(signal.SIGCONT)",
        "os.open(path, os.O_NONBLOCK)",
        "sys.platform == 'linux'",
        "Popen(command, start_new_session=True)",
        "Path('/dev/shm/file')",
        "Path(f'/proc/{pid}/fd')",
        "Path('/tmp')",
    ],
)
def test_what_is_not_on_each_system_is_found(source: str) -> None:
    assert len(differences(source)) == 1


def test_words_of_documentation_are_no_use() -> None:
    assert not differences('"""Files of /dev/shm/."""\nos.getpid()')


@pytest.mark.parametrize("platform", ["Linux", "Darwin", "Windows"])
def test_each_branch_uses_only_what_its_system_has(platform: str) -> None:
    pytest.importorskip("pyright", reason="it comes with requirements-dev.txt")
    command = [sys.executable, "-m", "pyright", "--project", REPOSITORY / "py-client", "--pythonplatform", platform]
    done = subprocess.run([*command, DIFFERS], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@contextmanager
def on(platform: str) -> Iterator[None]:
    """Let the module take this system for another one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(system, "sys", SimpleNamespace(platform=platform))
        yield


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The temporary folder, with nothing in it."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.mark.parametrize("platform", ["linux", "darwin", "win32"])
def test_what_passes_to_the_daemon_leaves_nothing(pendulum: tl.Scene, temporary: Path, platform: str) -> None:
    paths: list[str] = []

    class Client:
        """A client that notes the paths of files."""

        def __init__(self, client: Any) -> None:
            self._client = client

        def __getattr__(self, name: str) -> Any:
            def noted(path: str, *args: Any) -> Any:
                paths.append(path)
                return getattr(self._client, name)(path, *args)

            return noted if name in ("snapshot", "restore", "ik") else getattr(self._client, name)

    with tl.launch(pendulum, worlds=3) as sim, on(platform):
        sim._client = Client(sim._client)  # type: ignore[assignment]
        sim.step(joint_f=np.linspace(-1, 1, 6).reshape(3, 2))
        snapshot = sim.snapshot()
        there = sim.step().joint_q.copy()
        sim.restore(snapshot)
        assert np.array_equal(sim.step().joint_q, there)
        with pytest.raises(tl.SnapshotError, match="another model"):
            sim.restore(snapshot.with_model(1))
        goal = sim.forward_kinematics([0.1, 0.2])[-1]
        assert sim.ik(tl.Reach("arm/lower")).solve(goal[:3], goal[3:]).success.all()
    folder = f"/proc/{os.getpid()}/fd" if platform == "linux" else str(temporary)
    assert [str(Path(path).parent) for path in paths] == 4 * [folder]
    assert not list(temporary.iterdir())


@pytest.mark.parametrize("platform", ["darwin", "win32"])
def test_a_file_between_processes_is_closed_while_the_other_one_has_it(temporary: Path, platform: str) -> None:
    def open_files() -> set[str]:
        return {str(link.resolve()) for link in Path("/proc/self/fd").iterdir()}

    with on(platform), system.exchange_file(os.getpid(), b"question") as path:
        assert Path(path).read_bytes() == b"question" and Path(path).stat().st_mode & 0o777 == 0o600
        assert path not in open_files()
        other = temporary / "other"
        other.write_bytes(b"answer")
        other.replace(path)
        assert Path(path).read_bytes() == b"answer"
    with on(platform), pytest.raises(KeyError), system.exchange_file(os.getpid()):
        raise KeyError
    assert not list(temporary.iterdir())


@pytest.mark.parametrize("platform", ["darwin", "win32"])
def test_without_room_the_error_names_the_folder_of_the_system(
    pendulum: tl.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, platform: str
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
    with tl.launch(pendulum, worlds=1) as sim, on(platform):
        with pytest.raises(tl.SnapshotError, match=r"no room .*make room in the temporary folder") as problem:
            sim.snapshot()
        assert "/dev/shm" not in str(problem.value)


#: ``python -m tightloop.env serve`` on a system that a variable names.
SERVE = """
import sys, types
from tightloop import system
system.sys = types.SimpleNamespace(platform=sys.argv.pop(1))
from tightloop.env.__main__ import main
raise SystemExit(main())
"""


@pytest.mark.parametrize("platform", ["linux", "darwin"])
def test_a_task_is_served_from_a_file_on_each_system(platform: str, unique: Callable[[], str], tmp_path: Path) -> None:
    name = unique()
    command = [sys.executable, "-c", SERVE, platform, "serve", "CartPoleBalance", "--num-envs", "2", "--name", name]
    with started(command, stdout=subprocess.PIPE, text=True, env=os.environ | {"TMPDIR": str(tmp_path)}) as process:
        assert process.stdout is not None and "ready" in process.stdout.readline()
        scene = str(Path(f"/proc/{process.pid}/fd/0").readlink())
        assert scene.startswith("/memfd:scene" if platform == "linux" else str(tmp_path)), scene
        assert not list(tmp_path.iterdir()), "the scene has no name that could be left"
        env = VectorEnv("CartPoleBalance", daemon=name)
        assert env.reset(seed=0)[0].shape[0] == 2
        env.close()
        process.terminate()
        assert process.wait(20) == 0


def test_a_process_apart_is_a_session_or_a_group_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    with system.start_apart([sys.executable, "-c", "import os; print(os.getsid(0) == os.getpid())"]) as process:
        assert process.communicate()[0] == b"True\n"
    given: dict[str, Any] = {}
    monkeypatch.setattr(subprocess, "Popen", lambda command, **options: given.update(options))
    monkeypatch.setattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0x200, raising=False)
    with on("win32"):
        system.start_apart(["program"], stdin=subprocess.DEVNULL)
    assert given == {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": None, "creationflags": 0x200}


class Process:
    """A process that notes what it receives."""

    def __init__(self, problem: Exception | None = None) -> None:
        self.told: list[Any] = []
        self._problem = problem

    def send_signal(self, number: int) -> None:
        self.told.append(number)
        if self._problem is not None:
            raise self._problem

    def terminate(self) -> None:
        self.told.append("terminate")


@pytest.mark.parametrize(
    ("platform", "problem", "told"),
    [
        ("linux", None, ["terminate", signal.SIGCONT]),
        ("darwin", None, ["terminate", signal.SIGCONT]),
        ("win32", None, ["break"]),
        ("win32", OSError("no console"), ["break", "terminate"]),
        ("win32", SystemError("no console"), ["break", "terminate"]),
    ],
)
def test_a_process_is_asked_to_end_and_ended_where_nobody_can_ask(
    platform: str, problem: Exception | None, told: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(signal, "CTRL_BREAK_EVENT", "break", raising=False)
    process: Any = Process(problem)
    with on(platform):
        system.ask_to_end(process)
        system.resume(process)
    assert process.told == told


def test_what_asks_a_process_to_end_is_a_stop_signal_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(signal, "SIGBREAK", 21, raising=False)
    for platform in ("linux", "darwin"):
        with on(platform):
            assert system.stop_signals() == (signal.SIGINT, signal.SIGTERM)
    with on("win32"):
        assert system.stop_signals() == (signal.SIGINT, signal.SIGTERM, 21)


def test_an_orphan_on_windows_is_one_whose_parents_handle_reports_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """``python.exe`` of a virtual environment starts another process, so that the parent's id tells nothing."""
    ended = set[int]()
    kernel = SimpleNamespace(
        OpenProcess=lambda access, inherit, process: None if process in ended else -process,
        WaitForSingleObject=lambda handle, milliseconds: 0 if -handle in ended else 0x102,
    )
    monkeypatch.setattr(system, "_kernel", lambda: kernel)
    system._handle_of.cache_clear()
    with on("win32"):
        assert not system.is_orphan(1234567)
        ended.update((1234567, 7654321))
        assert system.is_orphan(1234567) and system.is_orphan(7654321)
    system._handle_of.cache_clear()
    assert not system.is_orphan(os.getppid()) and system.is_orphan(os.getpid())


def test_a_write_to_an_ended_process_is_known_on_windows_too() -> None:
    invalid = OSError(errno.EINVAL, "Invalid argument")
    assert system.is_broken_pipe(BrokenPipeError()) and not system.is_broken_pipe(invalid)
    with on("win32"):
        assert system.is_broken_pipe(BrokenPipeError()) and system.is_broken_pipe(invalid)
        assert not system.is_broken_pipe(OSError(errno.ENOSPC, "No space left"))


def test_a_file_is_flushed_by_what_each_system_flushes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fcntl = pytest.importorskip("fcntl")
    modes, full = [], []
    fsync = os.fsync

    def noted(descriptor: int) -> None:
        modes.append(fcntl.fcntl(descriptor, fcntl.F_GETFL) & os.O_ACCMODE)
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", noted)
    monkeypatch.setitem(
        sys.modules, "fcntl", SimpleNamespace(F_FULLFSYNC=51, fcntl=lambda descriptor, flag: full.append(flag))
    )
    for platform in ("linux", "darwin", "win32"):
        with on(platform), whole_file(tmp_path / platform) as part:
            part.write_text("kept")
        assert (tmp_path / platform).read_text() == "kept"
    assert modes == [os.O_RDONLY, os.O_RDONLY, os.O_RDWR] and full == [51]


@pytest.mark.parametrize("platform", ["linux", "darwin"])
def test_a_pipe_without_a_writer_is_refused_at_once(platform: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with on(platform), pytest.raises(tl.SnapshotError, match="it is not a file"):
        tl.Snapshot.load(tmp_path / "pipe")


def test_a_snapshot_is_read_on_windows(pendulum: tl.Scene, tmp_path: Path) -> None:
    with tl.launch(pendulum, worlds=2) as sim:
        sim.snapshot().save(tmp_path / "snapshot")
    with on("win32"):
        assert tl.Snapshot.load(tmp_path / "snapshot").worlds == 2


def test_all_cores_are_used_where_a_process_has_no_set_of_them() -> None:
    for platform in ("darwin", "win32"):
        with on(platform):
            assert system.usable_cores() == os.cpu_count()
    assert system.usable_cores() == len(os.sched_getaffinity(0))


@pytest.mark.parametrize("platform", ["darwin", "win32"])
def test_memory_of_a_gpu_is_refused_before_anything_is_asked_of_the_daemon(pendulum: tl.Scene, platform: str) -> None:
    with tl.launch(pendulum, worlds=1) as sim:
        frame = sim.step()
        with on(platform), pytest.raises(tl.GpuMemoryError, match=r"keep_on_gpu: .*on Linux only.*NumPy"):
            type(sim).keep_on_gpu(SimpleNamespace(info={}))  # type: ignore[arg-type]
        assert sim.step().step[0] == frame.step[0] + 1


@pytest.mark.parametrize(
    ("target", "sep", "expected"),
    [
        ("franka", "/", False),
        ("run.tlrec", "/", True),
        ("runs/run", "/", True),
        ("runs\\run", "/", False),
        ("runs\\run", "\\", True),
        ("runs/run", "\\", True),
    ],
)
def test_a_path_of_the_system_is_a_recording(
    target: str, sep: str, expected: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tightloop.view import source

    monkeypatch.setattr(source, "os", SimpleNamespace(sep=sep))
    assert source.is_recording(target) is expected
