<<<<<<< HEAD
"""Looking at worlds: in a browser, as pictures, as films; from a running daemon or from a recording."""
=======
"""Looking at worlds: in a browser, as pictures, as films; from a running daemon or from a recording.

Its libraries come with ``pip install "tightloop[view]"``.
"""
>>>>>>> 0ce5b6ed9ac835296348359f53d235c0b8cb0d61

from __future__ import annotations
