"""mjlab's scripts with tightloop's physics: ``python -m tightloop.mjlab train Mjlab-Velocity-Flat-Unitree-G1 …``.

The arguments behind the script's name are mjlab's own.
"""

from __future__ import annotations

import importlib
import os
import sys

from tightloop.errors import TightloopError

#: Scripts by the names that mjlab gives them on the command line.
SCRIPTS = {
    "train": "mjlab.scripts.train",
    "play": "mjlab.scripts.play",
    "list-envs": "mjlab.scripts.list_envs",
    "viz-nan": "mjlab.scripts.nan_viz",
}


def main() -> int:
    """Run a script of mjlab with tightloop's physics; return the exit code."""
    name, *rest = sys.argv[1:] or [""]
    if name not in SCRIPTS:
        print(f"usage: python -m tightloop.mjlab {{{','.join(SCRIPTS)}}} …", file=sys.stderr)
        if name in ("-h", "--help"):
            return 0
        if name:
            print(f"mjlab has no script `{name}`", file=sys.stderr)
        return 2
    # mjlab chooses a GPU for its tensors where torch sees one, and they belong beside the worlds
    os.environ["CUDA_VISIBLE_DEVICES"] = ""
    # threads of torch that wait by spinning would take the cores from the worlds
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    from tightloop.adapters import mjlab

    try:
        mjlab.install()
        if name in ("train", "play"):
            print("mjlab simulates with tightloop, on the CPU", file=sys.stderr)
        sys.argv = [f"python -m tightloop.mjlab {name}", *rest]
        importlib.import_module(SCRIPTS[name]).main()
    except TightloopError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
