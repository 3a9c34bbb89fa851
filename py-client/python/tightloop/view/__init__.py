"""Looking at worlds: in a browser, as pictures, as films; from a running daemon or from a recording.

Its libraries come with ``pip install "tightloop[view]"``.
"""

from __future__ import annotations
