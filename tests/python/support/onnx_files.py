"""ONNX files of small perceptrons, written by hand: the tests need no exporter."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: An operator, its constants, and its integer attributes.
Node = tuple[str, Sequence[ArrayLike], Mapping[str, int]]


def write(path: Path, nodes: Iterable[Node], inputs: int, metadata: Mapping[str, str] | None = None) -> Path:
    """Write a chain of operators from ``obs`` to ``action`` with opset 17; returns the path."""
    graph, tensors, value = b"", b"", "obs"
    for place, (operator, constants, attributes) in enumerate(nodes):
        names = [f"c{place}_{index}" for index in range(len(constants))]
        for name, constant in zip(names, constants, strict=True):
            tensors += field(5, _tensor(name, np.asarray(constant, np.float32)))
        result = f"v{place}"
        texts = [field(1, name.encode()) for name in (value, *names)]
        texts += [field(2, result.encode()), field(3, f"node{place}".encode()), field(4, operator.encode())]
        own = [field(5, field(1, name.encode()) + number(3, n) + number(20, 2)) for name, n in attributes.items()]
        graph += field(1, b"".join(texts + own))
        value = result
    last = field(1, value.encode()) + field(2, b"action") + field(4, b"Identity")
    axes = field(1, field(2, b"worlds")) + field(1, number(1, inputs))
    port = field(1, b"obs") + field(2, field(1, number(1, 1) + field(2, axes)))
    graph += field(1, last) + tensors + field(11, port) + field(12, field(1, b"action"))
    texts = (field(14, field(1, name.encode()) + field(2, text.encode())) for name, text in (metadata or {}).items())
    path.write_bytes(number(1, 8) + field(7, graph) + field(8, number(2, 17)) + b"".join(texts))
    return path


def linear(weights: ArrayLike, biases: ArrayLike) -> Node:
    """A linear layer with weights ``(outputs, inputs)``."""
    return "Gemm", (weights, biases), {"transB": 1}


def perceptron(sizes: Sequence[int], seed: int, activation: str = "Elu") -> list[Node]:
    """Linear layers of these sizes with random weights, and activations between them."""
    rng, nodes = np.random.default_rng(seed), []
    for inputs, outputs in itertools.pairwise(sizes):
        nodes += [linear(rng.normal(0, inputs**-0.5, (outputs, inputs)), rng.normal(0, 0.1, outputs))]
        nodes += [(activation, (), {})]
    return nodes[:-1]


def field(place: int, data: bytes) -> bytes:
    """A field of bytes."""
    return _varint(place << 3 | 2) + _varint(len(data)) + data


def number(place: int, value: int) -> bytes:
    """A field of a whole number."""
    return _varint(place << 3) + _varint(value)


def _tensor(name: str, values: NDArray[Any]) -> bytes:
    axes = b"".join(number(1, size) for size in values.shape)
    return axes + number(2, 1) + field(8, name.encode()) + field(9, values.astype("<f4").tobytes())


def _varint(value: int) -> bytes:
    data = b""
    while value >= 0x80:
        data, value = data + bytes([value & 0x7F | 0x80]), value >> 7
    return data + bytes([value])
