"""Shows the metadata of a policy as ONNX, or writes that of a task into it.

    pip install onnx
    python examples/policy_file.py examples/trained/FrankaReach.onnx
    python examples/policy_file.py out/rsl_rl/FrankaReach-0/policy.onnx --task FrankaReach
    python examples/policy_file.py out/ppo/FrankaPickCubeDepth-0/policy.onnx --half

The metadata says what a program needs to run the policy elsewhere: names and order of the observation, the action and
the joints, scales, rates and gains. ``docs/pages/use/walking.md`` lists its entries.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from learning.program import needed

from tightloop.env import VectorEnv, policy_metadata
from tightloop.whole_files import whole_file

with needed("onnx"):
    import onnx
    from google.protobuf.message import DecodeError


if TYPE_CHECKING:
    from torch import nn

LARGE = 10_000  # numbers of a weight that `halve` stores in half precision
NORMALIZATION = "observation_normalization"  # how the graph takes observations, which no task says


def export(policy: nn.Module, inputs: int, path: Path, metadata: Mapping[str, str]) -> None:
    """Write a policy as ONNX: ``obs`` (worlds, inputs) in, ``action`` (worlds, actions) out.

    Args:
        policy: The policy, on the processor; it normalizes observations itself.
        inputs: Numbers of an observation.
        path: The file.
        metadata: Texts by name, as `policy_metadata` returns them.
    """
    import torch

    with whole_file(path) as part:
        torch.onnx.export(
            policy.eval(),
            (torch.zeros(2, inputs),),
            part,
            input_names=["obs"],
            output_names=["action"],
            dynamic_shapes=({0: torch.export.Dim("worlds")},),
            verbose=False,
            external_data=False,
        )
    attach(path, {**metadata, NORMALIZATION: "in the graph"})


def attach(path: Path, metadata: Mapping[str, str]) -> None:
    """Write metadata into an ONNX file, in place of what it has; only its normalization stays.

    Args:
        path: The file.
        metadata: Texts by name, as `policy_metadata` returns them.

    Raises:
        SystemExit: The policy takes or gives numbers of other sizes.
    """
    model = loaded(path)
    known = {entry.key: entry.value for entry in model.metadata_props if entry.key == NORMALIZATION}
    for name, tensor in (("observation_low", model.graph.input[0]), ("action_low", model.graph.output[0])):
        own, size = tensor.type.tensor_type.shape.dim[-1].dim_value, len(metadata[name].split(","))
        if own != size:
            raise SystemExit(f"{path}: {tensor.name} has {own} numbers, and the task has {size}: name its own task")
    onnx.helper.set_model_props(model, {**known, **metadata})
    with whole_file(path) as part:
        onnx.save(model, part)


def halve(path: Path) -> None:
    """Store the large weights of an ONNX file in half precision; it computes in single precision as before."""
    model = loaded(path)
    graph = model.graph
    for weight in [weight for weight in graph.initializer if weight.data_type == onnx.TensorProto.FLOAT]:
        values = onnx.numpy_helper.to_array(weight)
        if values.size < LARGE:
            continue
        name, half = weight.name, f"{weight.name}_half"
        weight.CopyFrom(onnx.numpy_helper.from_array(values.astype(np.float16), half))
        graph.node.insert(0, onnx.helper.make_node("Cast", [half], [name], to=onnx.TensorProto.FLOAT))
    with whole_file(path) as part:
        onnx.save(model, part)


def loaded(path: Path) -> onnx.ModelProto:
    """Return the model of a file.

    Raises:
        SystemExit: It is missing, or no ONNX file.
    """
    try:
        return onnx.load(path)
    except FileNotFoundError:
        raise SystemExit(f"there is no file {path}") from None
    except (OSError, DecodeError) as problem:
        raise SystemExit(f"{path} is no policy as ONNX: {problem}") from None


def read(path: Path) -> dict[str, str]:
    """Return the metadata of an ONNX file: texts by name."""
    return {entry.key: entry.value for entry in loaded(path).metadata_props}


def main() -> None:
    """Attach, and show."""
    parser = argparse.ArgumentParser(description="Show the metadata of a policy, or write that of a task into it.")
    parser.add_argument("policy", type=Path, help="ONNX file")
    parser.add_argument("--task", help="task of the policy, such as FrankaReach or FILE.py:CLASS")
    parser.add_argument("--half", action="store_true", help="store large weights in half precision")
    args = parser.parse_args()
    if args.half:
        halve(args.policy)
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
