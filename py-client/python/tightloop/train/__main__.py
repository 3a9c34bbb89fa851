"""The command line of the trainer, that of ``examples/ppo.py``."""

from __future__ import annotations

import sys

from tightloop import examples


def main() -> None:
    """Train, evaluate, and leave the curve and the policy."""
    examples.run("ppo", sys.argv[1:])


if __name__ == "__main__":
    main()
