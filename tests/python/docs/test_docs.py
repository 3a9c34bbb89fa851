"""The documents: every block of code on the site and in the README runs, and the generated pages are whole."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

import tightloop as tl
from code_blocks import blocks, reading
from conftest import REPOSITORY

sys.path.insert(0, str(REPOSITORY / "docs"))
import moving_picture

from generate import command_line, pages, performance, scene_file

PAGES = REPOSITORY / "docs/pages"
# a page with generated parts is run with them
WRITTEN = sorted(
    path
    for path in PAGES.rglob("*.md")
    if "```" in path.read_text() and str(path.relative_to(PAGES)) not in pages.PARTS
)


@pytest.mark.parametrize("path", WRITTEN, ids=lambda path: str(path.relative_to(PAGES)))
def test_every_block_of_a_page_runs(path, tmp_path):
    with reading(tmp_path, REPOSITORY) as reader:
        for block in blocks(path.name, path.read_text()):
            if not block.needs:
                reader.run(block)


@pytest.mark.parametrize("name", pages.PARTS)
def test_every_block_of_a_generated_page_runs(name, tmp_path):
    text = pages.page(name)
    assert text.startswith("# ") and "<!--" not in text
    with reading(tmp_path, REPOSITORY) as reader:
        for block in blocks(name, text):
            reader.run(block)


@pytest.mark.parametrize("name", pages.PARTS)
def test_the_generated_parts_of_a_page_are_those_of_the_code(name):
    text = (PAGES / name).read_text()
    assert pages.write(name, text) == text, "`make pages` writes them anew"
    assert len(text) > 1.5 * len(pages.handwritten(text))


def test_a_page_without_the_place_of_a_part_is_refused():
    with pytest.raises(LookupError, match=r"fields\.md has places for .*; give it those for .*parameters"):
        pages.write("reference/fields.md", "# Fields\n<!-- generated: fields -->\n<!-- end -->\n")


def test_blocks_that_do_not_run_say_why():
    texts = {path.name: path.read_text() for path in [*WRITTEN, REPOSITORY / "README.md"]}
    found = [block for name, text in texts.items() for block in blocks(name, text)]
    needs = Counter(block.needs for block in found if block.needs)
    for block in found:
        if block.needs:
            print(f"{block}: {block.needs}")
    # a new one is added here, too
    assert needs == {
        "needs a Ray cluster": 1,
        "needs a Ray cluster and stable-baselines3": 1,
        "needs a Vulkan driver": 1,
        "needs a browser": 1,
        "needs a checkout": 14,
        "needs a compiler": 3,
        "needs a network": 2,
        "needs a notebook": 1,
        "needs a scene file of yours": 2,
        "needs an NVIDIA GPU": 1,
        "needs docker": 1,
        "needs jax": 3,
        "needs lerobot": 1,
        "needs mjlab": 4,
        "needs mujoco": 1,
        "needs mujoco and onnxruntime": 1,
        "needs onnxruntime": 2,
        "needs ray[rllib]": 1,
        "needs rsl-rl-lib": 1,
        "needs skrl": 1,
        "needs stable-baselines3": 1,
        "needs torch, mujoco, and minutes": 1,
        "needs torch, and minutes": 3,
        "needs torchrl": 1,
        "needs torchrun": 1,
    }
    assert len(found) - needs.total() >= 40


def test_the_readme_runs(tmp_path):
    found = blocks("README.md", (REPOSITORY / "README.md").read_text())
    (lines,) = [block.text.splitlines() for block in found if block.language == "python"]
    assert len(lines) == 12  # as its heading says
    with reading(tmp_path, REPOSITORY) as reader:
        for block in found:
            if not block.needs:
                reader.run(block)
        assert reader.names["sim"].worlds == 4096


def test_the_first_picture_of_the_readme_moves():
    text = (REPOSITORY / "README.md").read_text()
    picture = re.search(r"!\[.+?\]\((.+?)\)", text)
    assert picture is not None and picture.start() < text.index("\n## ")
    path = REPOSITORY / picture[1]
    assert path.stat().st_size < 1e6
    with Image.open(path) as image:
        frames = [np.asarray(frame.convert("RGB"), int) for frame in ImageSequence.Iterator(image)]
    assert len(frames) > 30 and image.info["loop"] == 0
    # each differs from the one before; where the arms follow the grasp, nearly everywhere
    changes = [float(np.mean(np.abs(new - old) > 8)) for old, new in pairwise(frames)]
    assert min(changes) > 1e-4 and max(changes) > 0.3
    # and the script that draws it is there
    assert path == moving_picture.FILE


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
    for name in [*pages.PARTS, "reference/performance.md"]:
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
    text = pages.page("reference/command-line.md")
    named = command_line.commands()
    some = {"serve", "inspect", "bench", "record", "replay", "devices", "list", "top", "stop", "completions", "man"}
    assert some <= set(named)
    assert all(f"## tightloop {name}\n" in text for name in named)


def test_performance_page_and_readme_have_the_newest_results():
    cure = "run `cd docs && python -m generate.performance`"
    assert performance.PAGE.read_text() == performance.page(), cure
    assert performance.README.read_text() == performance.readme(), cure


def test_the_readme_claims_no_more_than_was_measured():
    def ratios(peer: str) -> list[float]:
        return [performance.ratio(line.file, line.ratio) for line in performance.SUMMARY if peer in line.peer]

    text = performance.README.read_text()
    said = re.search(r"makes (\d+) to (\d+) times the .* make (\d+) times", text, re.DOTALL)
    assert said is not None
    mujoco, envpool = ratios("rollout"), ratios("EnvPool")
    assert [int(number) for number in said.groups()] == [round(min(mujoco)), round(max(mujoco)), round(min(envpool))]


def test_the_readme_says_what_robots_on_the_ground_gain():
    rows = performance.read(performance.RESULTS / "amd-epyc-2-cores/mujoco_models.csv").rows
    # hands and arms stand on no ground
    ratios = [float(row["median_ratio"]) for row in rows if not re.search("hand|arm26", row["model"])]
    (rate,) = [
        float(row["tightloop_steps_per_s"])
        for row in rows
        if row["model"] == "MuJoCo-Warp G1, flat" and row["steps_per_call"] == "4"
    ]
    text = performance.README.read_text()
    said = re.search(r"on the ground gain less: (\d+) to (\d+) times", text)
    assert said is not None
    assert [int(number) for number in said.groups()] == [round(min(ratios)), round(max(ratios))]
    said = re.search(r"A G1 humanoid makes (\d+) thousand steps per second", text)
    assert said is not None and int(said[1]) == round(rate / 1000)


def test_the_performance_page_names_every_result_and_the_site_has_its_rows():
    short, full = performance.page(), performance.page(every=True)
    for path in performance.measured():
        link = f"({os.path.relpath(path, performance.PAGE.parent)})"
        assert link in short and link in full
    rows = sum(len(performance.read(path).rows) for path in performance.measured())
    assert full.count("\n| ") >= rows
    topics = {path.stem for path in performance.measured()}
    assert short.count("\n## ") == full.count("\n## ") == len(topics) + 1


def test_the_field_page_has_every_field_that_frames_name():
    stubs = (REPOSITORY / "py-client/python/tightloop/_core.pyi").read_text()
    frame = stubs.partition("class Frame:")[2].partition("\nclass ")[0]
    named = set(re.findall(r"^    (\w+): NDArray", frame, re.MULTILINE))
    text = pages.page("reference/fields.md")
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
