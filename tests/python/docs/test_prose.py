"""The words of the documents: links lead somewhere, sentences are short, no document installs another project."""

from __future__ import annotations

import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from conftest import REPOSITORY

sys.path.insert(0, str(REPOSITORY / "docs"))
from prose_of_code import files, written
from sentence_length import LONG, markdown_files, sentences, summary

PAGES = [REPOSITORY / "README.md", REPOSITORY / "docs/pages"]
DOCUMENTS = sorted({*markdown_files([REPOSITORY / "docs/pages"]), *REPOSITORY.glob("*.md")})
MEAN, LONGEST = 16, 30  # words; docs/sentence_length.py lists the sentences
# What shells and people would install: the project of somebody else under our import's name.
FOREIGN = re.compile(r"pip3? install (?:-\S+ )*[\"'`]?tightloop(?![\w-])")

# Words that only this project's authors understand, and the field's words for them.
DIALECT = {
    r"\b(?:physics|kernel|solver|step)(?:'s)? text\b"
    r"|\btexts? of (?:the )?(?:physics|kernels?|steps?|stages?)\b": "kernel source",
    r"\bmachines? that (?:runs?|writes?) (?:the|it)\b": "backend",
    r"\btold\b|\bsays? so\b|\bsaid so\b": "reported, logged",
    r"\b(?:turns?|rounds?) of (?:the )?(?:solver|newton)\b"
    r"|\b(?:solver|newton)(?:'s)? (?:turns?|rounds?)\b": "iteration",
    r"\bwhat is shown of\b|\bexports? of fields\b": "outputs",
    r"\b(?:is|are) no software\b(?! driver)": "a hardware GPU",
    r"\b(?:one|two|three|four|six|eight|values?|numbers?|rows?|bytes?|bits?|scalars?|entry|entries|lines?|words|columns"
    r"|seeds?|threads?|kernels?|digests?|evaluations?)(?: number| value)? an? (?:world|coordinate|dof|joint|body"
    r"|contact|frame|lane|line|row|column|commit|field|robot|iteration|step|substep|command|pair|hull|model|sensor|link|second"
    r"|shape|slot|element|side)\b(?! may)": "per",
    r"\bworlds? (?:are |that are )?alike\b|\bworlds (?:have|of|with) [a-z]+ of their own\b": "identical, independent",
    r"\blook(?:s|ed|ing)? on\b|\bonlookers?\b": "observe, observer",
    r"\btroubles?\b|\btroubled\b": "fault",
    r"\bseats?\b": "lane",
    r"\bthe wire\b": "protocol",
    r"\bbones?\b": "skeleton",
    r"\bwhoever\b|\bnext to nothing\b": "a process that, a user who; little",
}

FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"(`+)(?!`).+?\1")
LINK = re.compile(r"\]\(([^)\s]+)\)|^\[[^\]]+\]: (\S+)|<a href=\"([^\"]+)\"", re.MULTILINE)
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)


def links(text: str) -> list[str]:
    """Targets of the links of a Markdown text that stay in the repository."""
    text = CODE.sub("", FENCE.sub("", text))
    found = ["".join(groups) for groups in LINK.findall(text)]
    return [target for target in found if not re.match(r"[a-z]+:", target)]


@cache
def anchors(file: Path) -> set[str]:
    """Anchors of a file's headings, as forges and the site make them."""
    heads = HEADING.findall(FENCE.sub("", file.read_text()))
    return {re.sub(r"[^\w\- ]", "", head.lower()).strip().replace(" ", "-") for head in heads}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(REPOSITORY)))
def test_links_lead_to_files_of_the_repository(document):
    text = document.read_text()
    for target in links(text):
        path, _, anchor = target.partition("#")
        file = (document.parent / path).resolve() if path else document
        assert file.is_relative_to(REPOSITORY) and file.exists(), f"{document.name}: {target} leads nowhere"
        if anchor and file.suffix == ".md":
            assert anchor in anchors(file), f"{document.name}: {target}: there is no such heading"


def test_a_link_that_leads_nowhere_is_found():
    text = "[a](no-such.md) `[b](code.md)` [c](https://example.org)\n\n```text\n[d](fenced.md)\n```\n\n[e]: ref.md\n"
    assert links(text) == ["no-such.md", "ref.md"]
    assert "what-make-does" in anchors(REPOSITORY / "docs/pages/start/install.md")


def test_files_that_documents_link_to_are_committed():
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    done = subprocess.run(listed, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip("not a checkout")
    known = {REPOSITORY / name for name in done.stdout.splitlines()}
    known |= {folder for file in known for folder in file.parents}
    for document in DOCUMENTS:
        for target in links(document.read_text()):
            if path := target.partition("#")[0]:
                assert (document.parent / path).resolve() in known, f"{document.name}: git ignores {target}"


def test_sentences_of_the_documents_are_short():
    found = [(file, sentence) for file in markdown_files(PAGES) for sentence in sentences(file.read_text())]
    over = [f"{file.name}:{one.line}: {one.words} words: {one.text}" for file, one in found if one.words > LONGEST]
    assert not over, "\n".join(over)
    assert len(found) > 400 and summary([sentence for _, sentence in found]).mean <= MEAN


def test_sentences_are_counted_as_a_reader_counts_them():
    text = """# A heading is no sentence.

One two three. Four `five six(7, 8.9)` at 1.5 m, e.g. ten!
It wraps
over lines: [a link](https://example.org/a.b).

- An item
- Another item. With two sentences.

| a table | is left out. |
|---|---|

```python
code()  # This too. And this.
```
<!-- A comment. As well. -->
::: tightloop.Scene
    options:
      show_source: false
"""
    found = [(sentence.line, sentence.words) for sentence in sentences(text)]
    assert found == [(3, 3), (3, 7), (3, 6), (7, 2), (8, 2), (8, 3)]
    made = summary(sentences(" ".join(["Word."] * 19 + ["Long" + " word" * (LONG + 1) + "."])))
    assert (made.count, made.percentile_95, made.longest) == (20, 1, LONG + 2)


def test_no_document_installs_the_project_of_another_name():
    trees = ["docs", "examples", "py-client", "sim-core", "sim-daemon", "tests", "benches"]
    suffixes = {".md", ".py", ".pyi", ".rs", ".txt", ".toml", ".yml"}
    files = [file for tree in trees for file in (REPOSITORY / tree).rglob("*") if file.suffix in suffixes]
    files += [*REPOSITORY.glob("*.md"), REPOSITORY / "Makefile"]
    assert len(files) > 300
    told = [str(file) for file in files if file != Path(__file__) and FOREIGN.search(file.read_text(errors="replace"))]
    assert not told
    assert FOREIGN.search('pip install "tightloop[view]"') and FOREIGN.search("pip install -U tightloop\n")
    assert not FOREIGN.search("pip install dist/tightloop_sim-*.whl") and not FOREIGN.search(
        "pip install tightloop-sim"
    )


def dialect(sentence: str) -> str | None:
    """Return the words for what a sentence says in dialect; none where it says nothing so."""
    found = (words for pattern, words in DIALECT.items() if re.search(pattern, sentence, re.IGNORECASE))
    return next(found, None)


def test_comments_names_of_tests_and_messages_use_the_words_of_the_field():
    read = [file for file in files(REPOSITORY) if file.name not in ("prose_of_code.py", "test_prose.py")]
    wrong = [
        f"{file.relative_to(REPOSITORY)}:{line}: write `{words}`: {sentence.strip()[:100]}"
        for file in read
        for line, sentence in written(file, file.read_text(errors="replace"))
        if (words := dialect(sentence))
    ]
    assert len(read) > 1000
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    ("name", "text", "lines"),
    [
        ("a.rs", '/// Nobody is told.\nlet told = "told";\n', [1]),
        ("a.rs", 'let x = 1; // a row a world\nfail!("the user is \\\n told of it here");\n', [1, 2]),
        ("a.rs", "#[test]\nfn a_lost_device_says_so() {\n    let seat = '\"'; // `seat`\n}\n", [1]),
        ("a.rs", 'r#"<skin a="whoever sits on it">"#; "whoever"', [1]),
        (
            "a.py",
            '"""Whoever\n\nreads it on the wire.\n"""\nseat = 1  # a seat\n\ndef test_it_is_told(): ...\n',
            [1, 3, 5, 7],
        ),
        ("a.py", 'raise ValueError(f"{x} is told what to do")\ntold["told"]\n', [1]),
        ("a.toml", 'seat = "the seat"  # the seat\n', [1]),
        ("a.md", "The wire.\n\n```sh\nthe wire\n```\n\n`the wire`, and the wire\n", [1, 7]),
    ],
)
def test_dialect_is_found_where_readers_meet_it(name, text, lines):
    found = {line for line, sentence in written(Path(name), text) if dialect(sentence)}
    assert sorted(found) == lines


def test_the_readme_is_short():
    assert 80 <= len((REPOSITORY / "README.md").read_text().splitlines()) <= 120
