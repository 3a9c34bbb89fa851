"""Looking at a simulation: in a browser, and as pictures. Its libraries come with ``pip install "tightloop[view]"``."""
