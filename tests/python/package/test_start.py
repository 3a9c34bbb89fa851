"""The import of tightloop is fast, because it loads only what is used; the bench `newcomer_start` has the rest."""

from __future__ import annotations

import json
import subprocess
import sys

IMPORT = """
import json, sys, time
begun = time.perf_counter()
import tightloop
seconds = time.perf_counter() - begun
print(json.dumps([seconds, sorted(sys.modules)]))
"""
LIMIT = 0.05  # [s]


def test_the_import_takes_less_than_50_ms_and_loads_no_library():
    samples = []
    for _ in range(5):
        done = subprocess.run([sys.executable, "-c", IMPORT], capture_output=True, text=True, check=True)
        seconds, modules = json.loads(done.stdout)
        samples.append(seconds)
        assert not {"numpy", "gymnasium", "tightloop.scene"} & {*modules}
    # the fastest one: others waited for the machine
    assert min(samples) < LIMIT, samples
