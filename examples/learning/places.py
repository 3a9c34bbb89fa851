"""Where the examples write what they leave."""

from __future__ import annotations

from pathlib import Path

_ABOVE = Path(__file__).resolve().parents[2]
#: ``out`` of the checkout; elsewhere, as in an installed wheel, ``out`` of the working directory.
OUT = (_ABOVE if (_ABOVE / "Makefile").is_file() else Path.cwd()) / "out"
#: How `play.py` is called from there.
PLAY = "python examples/play.py" if (_ABOVE / "Makefile").is_file() else "python -m tightloop.examples run play"
