"""Looking at worlds: in a browser, as pictures, as films; from a running daemon or from a recording."""

from __future__ import annotations
