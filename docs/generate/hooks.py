"""Hooks of mkdocs: they put the generated parts into the pages, and pictures of the repository beside them."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

sys.path.insert(0, str(Path(__file__).parents[1]))

from generate import pages, performance


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pictures that pages show from outside of docs/pages."""
    for picture in pages.pictures():
        files.append(File.generated(config, f"pictures/{picture.name}", content=picture.read_bytes()))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Fill the page, and keep its links inside of the site. That of performance gets all results."""
    name = page.file.src_uri
    is_performance = name == "reference/performance.md"
    markdown = performance.page(every=True) if is_performance else markdown
    text = pages.inside(name, pages.fill(name, markdown))
    if name == "api/rust.md":
        # rustdoc lies beside the site, where mkdocs sees no page
        link = r'| <a href="../rust/\1/index.html"><code>\1</code></a> |'
        text = re.sub(r"^\| `(sim_\w+)` \|", link, text, flags=re.MULTILINE)
    return text
