"""Shows the metadata of a policy as ONNX, or writes that of a task into it.

    pip install onnx
    python examples/policy_file.py examples/trained/FrankaReach.onnx
    python examples/policy_file.py out/rsl_rl/FrankaReach-0/policy.onnx --task FrankaReach

The metadata says what a program needs to run the policy elsewhere: names and order of the observation, the action and
the joints, scales, rates and gains. ``docs/pages/walking.md`` lists its entries.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from training import needed

from tightloop.env import VectorEnv, policy_metadata
from tightloop.whole_files import whole_file

with needed("onnx"):
    import onnx


def attach(path: Path, metadata: Mapping[str, str]) -> None:
    """Write metadata into an ONNX file; entries of other names stay.

    Args:
        path: The file.
        metadata: Texts by name, as `policy_metadata` returns them.
    """
    model = onnx.load(path)
    known = {entry.key: entry.value for entry in model.metadata_props}
    onnx.helper.set_model_props(model, {**known, **metadata})
    with whole_file(path) as part:
        onnx.save(model, part)


def read(path: Path) -> dict[str, str]:
    """Return the metadata of an ONNX file: texts by name."""
    return {entry.key: entry.value for entry in onnx.load(path).metadata_props}


def main() -> None:
    """Attach, and show."""
    parser = argparse.ArgumentParser(description="Show the metadata of a policy, or write that of a task into it.")
    parser.add_argument("policy", type=Path, help="ONNX file")
    parser.add_argument("--task", help="task of the policy, such as FrankaReach or FILE.py:CLASS")
    args = parser.parse_args()
    if args.task is not None:
        envs = VectorEnv(args.task, 1, threads=1)
        try:
            attach(args.policy, policy_metadata(envs))
        finally:
            envs.close()
    for name, value in read(args.policy).items():
        print(f"{name} = {value}")


if __name__ == "__main__":
    main()
