"""The documents: every block of code on the site and in the README runs, and the generated pages are whole."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tightloop as tl
from conftest import REPOSITORY
from fences import blocks, reading, wait_for

sys.path.insert(0, str(REPOSITORY / "docs"))
from generate import command_line, fields, performance, protocol, scene_file, tasks

PAGES = REPOSITORY / "docs/pages"
GENERATED = {
    "command-line.md": command_line,
    "fields.md": fields,
    "performance.md": performance,
    "protocol.md": protocol,
    "scene-file.md": scene_file,
    "tasks.md": tasks,
}
WRITTEN = sorted(path for path in PAGES.rglob("*.md") if "```" in path.read_text())


@pytest.mark.parametrize("path", WRITTEN, ids=lambda path: str(path.relative_to(PAGES)))
def test_every_block_of_a_page_runs(path, tmp_path):
    with reading(tmp_path, REPOSITORY) as reader:
        for block in blocks(path.name, path.read_text()):
            if not block.needs:
                reader.run(block)


@pytest.mark.parametrize("name", GENERATED)
def test_every_block_of_a_generated_page_runs(name, tmp_path):
    text = GENERATED[name].page()
    assert text.startswith("# ")
    with reading(tmp_path, REPOSITORY) as reader:
        for block in blocks(name, text):
            reader.run(block)


def test_blocks_that_do_not_run_say_why():
    texts = {path.name: path.read_text() for path in [*WRITTEN, REPOSITORY / "README.md"]}
    found = [block for name, text in texts.items() for block in blocks(name, text)]
    needs = Counter(block.needs for block in found if block.needs)
    for block in found:
        if block.needs:
            print(f"{block}: {block.needs}")
    # whoever adds one says so here, too
    assert needs == {
        "needs a Vulkan driver": 1,
        "needs a browser": 1,
        "needs a checkout": 7,
        "needs a compiler": 2,
        "needs a network": 2,
        "needs docker": 1,
        "needs onnxruntime": 1,
        "needs stable-baselines3": 2,
    }
    assert len(found) - needs.total() >= 40


def test_the_readme_runs(tmp_path, unique):
    page, name = REPOSITORY / "README.md", unique()
    text = page.read_text()
    # what the reader has at hand: arrays, and two daemons to attach to
    given: dict[str, Any] = {name: np.zeros((4096, 9)) for name in ("q", "tau")} | {
        name: np.zeros(9) for name in ("qd", "qdd", "goal")
    }
    scene = tl.Scene()
    scene.add_urdf(REPOSITORY / "examples/assets/fr3/fr3_franka_hand.urdf")
    circle = [sys.executable, "-m", "tightloop.env", "serve", f"{REPOSITORY}/examples/own_task.py:Circle"]
    server = subprocess.Popen([*circle, "--num-envs=8", "--name=circle"], stdout=subprocess.DEVNULL)
    try:
        wait_for("circle", dict(os.environ))
        with tl.launch(scene, worlds=1, name=name), reading(tmp_path, REPOSITORY, **given) as reader:
            found = blocks("README.md", text.replace('attach("NAME")', f'attach("{name}")'))
            assert [block.language for block in found].count("python") >= 3
            first = next(block for block in found if block.language == "python")
            assert len(first.text.splitlines()) <= 26  # the API in twenty lines, with its blank ones
            for block in found:
                if not block.needs:
                    reader.run(block)
            assert reader.names["kept"].joint_q.shape == (4096, 9)
            for envs in ("envs", "first", "second"):
                reader.names[envs].close()
    finally:
        server.terminate()
        server.wait(10)


def test_the_site_builds_without_a_warning(tmp_path):
    pytest.importorskip("mkdocs", reason="the site's tools are not installed: make docs")
    command = [
        sys.executable,
        "-m",
        "mkdocs",
        "build",
        "--strict",
        "--quiet",
        "-f",
        "docs/mkdocs.yml",
        "-d",
        str(tmp_path),
    ]
    quiet = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=REPOSITORY, env=quiet, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for name in GENERATED:
        assert (tmp_path / name.replace(".md", ".html")).stat().st_size > 10_000
    text = (tmp_path / "api/simulation.html").read_text()
    assert "Advance every world by one control frame" in text and "contact_normal" in text


def known_keys(scene: str, tmp_path: Path, word: str = "field") -> set[str]:
    """What the parser would have taken instead of what it refuses."""
    file = tmp_path / "scene.toml"
    file.write_text(scene)
    with pytest.raises(tl.SceneError, match=f"unknown {word} `zzz`") as refused:
        tl.Scene.load(file)
    _, _, said = str(refused.value).partition(f"unknown {word} `zzz`")
    return set(re.findall(r"`(\w+)`", said))


@pytest.mark.parametrize("table", scene_file.TABLES, ids=lambda table: table.heading)
def test_the_reference_has_the_keys_that_the_parser_knows(table, tmp_path):
    own = table.least + "zzz = 1\n" if table.path else "zzz = 1\n"
    text = scene_file.HEAD + own
    assert {key.name for key in scene_file.keys(table)} == known_keys(text, tmp_path)


def test_the_reference_has_the_tables_that_the_parser_knows():
    top = scene_file.keys(scene_file.TABLES[0])
    tables = {key.name for key in top if key.type.endswith(("Table", "Table>"))}
    assert tables == {path for table in scene_file.TABLES for path in table.path}


@pytest.mark.parametrize(
    ("word", "text"),
    [
        ("cone", '[solver]\ncone = "zzz"\n'),
        ("joint_target_mode", '[[robot]]\nurdf = "a"\njoint_target_mode = "zzz"\n'),
        ("type", '[[shape]]\ntype = "zzz"\n'),
        ("distributions", "[randomize.joint_q]\na = { zzz = [0, 1] }\n"),
    ],
)
def test_the_reference_has_the_words_that_the_parser_knows(word, text, tmp_path):
    source, enum = next((source, enum) for source, enum, _, key in scene_file.WORDS if key == word)
    named = {item.name for item in scene_file.words(source, enum)}
    assert named == known_keys(scene_file.HEAD + text, tmp_path, "variant")


def test_the_command_line_page_has_every_command():
    text = command_line.page()
    named = command_line.commands()
    assert {"serve", "inspect", "record", "replay", "devices", "list", "stop", "completions", "man"} <= set(named)
    assert all(f"## tightloop {name}\n" in text for name in named)


def test_the_performance_page_has_every_result():
    text = performance.page()
    for path in (REPOSITORY / "benches/results").glob("*/*.csv"):
        assert f": {path.name}\n" in text
        rows = [line for line in path.read_text().splitlines() if not line.startswith("#")]
        assert text.count("\n| ") >= len(rows)


def test_the_field_page_has_every_field_that_frames_name():
    stubs = (REPOSITORY / "py-client/python/tightloop/_core.pyi").read_text()
    frame = stubs.partition("class Frame:")[2].partition("\nclass ")[0]
    named = set(re.findall(r"^    (\w+): NDArray", frame, re.MULTILINE))
    text = fields.page()
    # what only observers get, and no launch asks for
    named.remove("state")
    assert "`state`" in text
    assert len(named) > 30 and all(f"| `{name}`" in text for name in named)


def test_the_api_pages_have_every_public_name():
    shown = re.findall(
        r"^::: tightloop\.(\w+)$", "".join(p.read_text() for p in (PAGES / "api").glob("*.md")), re.MULTILINE
    )
    exceptions = {
        name for name in tl.__all__ if isinstance(value := getattr(tl, name), type) and issubclass(value, Exception)
    }
    assert set(tl.__all__) - exceptions - {"__version__"} <= set(shown)
    assert "errors" in shown  # all of them
