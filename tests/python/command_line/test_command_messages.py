"""Wrong command lines: each is refused with exit code 1 or 2, and a message that names the culprit and the cure."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

JOINT = """<robot name="one"><link name="a"/><link name="b"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>"""

# arguments, exit code, what the message says
CASES = [
    ("serve nowhere.toml", 1, r"nowhere\.toml: cannot be read: .*; give the path of a file that you may read"),
    ("serve folder", 1, "folder: cannot be read: it is not a file; give the path"),
    ("serve empty.toml", 1, r"empty\.toml: .*; give a scene file.*Scene\.save"),
    ("serve hello.txt", 1, r"hello\.txt: .*; give a scene file"),
    ("serve empty.urdf", 1, r"empty\.urdf:1:1: broken XML: the file is empty; a URDF file holds one <robot>"),
    ("serve empty.xml", 1, r"empty\.xml: .*; give a scene file"),
    ("serve joint.urdf --worlds abc", 2, "'abc' for '--worlds <WORLDS>': give a whole number"),
    ("serve joint.urdf --worldz 3", 2, "'--worldz'.*'--worlds'"),
    ("serve joint.urdf --worlds 0", 2, 'worlds "0": ask for 1 to'),
    ("serve joint.urdf --groups 3 --worlds 4", 2, 'groups "3": 4 worlds .*; ask for a number that divides it'),
    ("serve joint.urdf --log folder", 1, 'log file "folder": .*; name a file in a folder that you may write to'),
    ("serve joint.urdf --log no/where.log", 1, r'log file "no/where\.log": .*; name a file'),
    ("serve joint.urdf --device tpu", 2, 'device "tpu": unknown; use auto, cpu or gpu'),
    ("bench folder", 1, "folder: cannot be read: it is not a file; give the path"),
    ("bench joint.urdf --threads 0", 2, 'threads "0": ask for 1'),
    ("inspect folder", 1, "folder: cannot be read: it is not a file; give the path"),
    ("inspect hello.txt", 1, r"hello\.txt:1:1: broken XML"),
    ("inspect macro.urdf", 1, "<xacro:include>.*run `xacro` on the file"),
    (
        "inspect joint.urdf --png no/where.png",
        1,
        r"no/where\.png: .*; say with --png FILE where",
    ),
    ("inspect joint.urdf --joint-q abc --png a.png", 2, "'abc' for '--joint-q <Q>': give a number"),
    ("inspect joint.urdf --hulls", 2, "--png <FILE>"),
    ("record nobody a.tlrec", 1, 'no daemon named "nobody" .*`tightloop serve SCENE --name nobody` starts one'),
    ("replay nowhere.tlrec", 2, r"nowhere\.tlrec: cannot be read: .*; give"),
    ("replay hello.txt", 2, "is no recording; give a file"),
    ("demo nowhere.urdf", 1, r"nowhere\.urdf: cannot be read: .*; give the path of a file that you may read"),
    ("demo empty.urdf", 1, r"empty\.urdf:1:1: broken XML: the file is empty"),
    ("demo --worlds many", 2, "--worlds: 'many' is not at least 1; give a whole number"),
    ("demo --seconds soon", 2, "--seconds: 'soon' is not above 0; give a number"),
    ("demo --out hello.txt", 1, r"--out hello\.txt is a file; give a folder"),
    ("view joint.urdf", 1, r"joint\.urdf is a file and no recording.*tightloop demo joint\.urdf --view"),
    ("view nobody --port abc", 2, "--port: 'abc' is no port; give 1 to 65535"),
    ("view nobody --worlds many", 2, "--worlds: 'many' worlds cannot be shown; give 1 to 1024"),
    ("film joint.urdf a.gif", 1, r"joint\.urdf is a file and no recording.*tightloop serve joint\.urdf"),
    ("film nowhere.tlrec a.gif", 1, r"nowhere\.tlrec: cannot be read: .*; give"),
    ("film nobody a.gif --size abc", 2, "--size: 'abc' is no size; give it as 640x480"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("commands")
    (made / "folder").mkdir()
    for name in ("empty.toml", "empty.urdf", "empty.xml"):
        (made / name).write_text("")
    (made / "hello.txt").write_text("hello")
    (made / "joint.urdf").write_text(JOINT)
    (made / "macro.urdf").write_text('<robot name="m"><link name="a"/><xacro:include filename="b"/></robot>')
    return made


@pytest.mark.parametrize(("line", "code", "said"), CASES, ids=[line for line, _, _ in CASES])
def test_a_wrong_command_line_names_culprit_and_cure(line: str, code: int, said: str, folder: Path) -> None:
    before = sorted(folder.iterdir())
    command = [sys.executable, "-m", "tightloop", *line.split()]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == code, done.stderr
    assert re.search(said, done.stderr, re.DOTALL), done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(folder.iterdir()) == before
