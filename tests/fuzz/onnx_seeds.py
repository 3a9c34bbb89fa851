"""ONNX files of small policies, as bytes."""

import struct


def varint(number: int) -> bytes:
    """A number of protocol buffers."""
    data = b""
    while number > 0x7F:
        data, number = data + bytes((number & 0x7F | 0x80,)), number >> 7
    return data + bytes((number,))


def field(number: int, value: bytes | str | int | float) -> bytes:
    """A field of protocol buffers."""
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    if isinstance(value, float):
        return varint(number << 3 | 5) + struct.pack("<f", value)
    data = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(data)) + data


def node(operator: str, inputs: list[str], output: str, **attributes: int | float) -> bytes:
    """An operator of a graph."""
    data = b"".join(field(1, name) for name in inputs) + field(2, output) + field(4, operator)
    for name, value in attributes.items():
        data += field(5, field(1, name) + field(2 if isinstance(value, float) else 3, value))
    return field(1, data)


def tensor(name: str, shape: list[int], raw: bool = False) -> bytes:
    """A constant, whose numbers are a quarter each."""
    count = 1
    data = field(2, 1) + field(8, name)
    for size in shape:
        data += field(1, size)
        count *= size
    return field(5, data + field(9 if raw else 4, struct.pack("<f", 0.25) * count))


def port(number: int, name: str, size: int) -> bytes:
    """An input or an output of a graph, of rows of that size."""
    shape = field(1, field(2, "batch")) + field(1, field(1, size))
    return field(number, field(1, name) + field(2, field(1, field(1, 1) + field(2, shape))))


def files() -> dict[str, bytes]:
    """Multilayer perceptrons, which differ in how exporters write them."""
    ends = port(11, "obs", 3) + port(12, "action", 2)
    texts = field(14, field(1, "task") + field(2, "CartPole"))
    weights = tensor("w", [2, 3]) + tensor("b", [2], raw=True)
    square = tensor("s", [2, 2]) + tensor("r", [1, 2])
    rows = "".join("gbmv")
    statistics = b"".join(tensor(name, [3]) for name in rows)
    external = field(13, field(1, "location") + field(2, "data"))
    beside = field(5, field(1, 2) + field(1, 3) + field(2, 1) + field(8, "w") + field(14, 1) + external)
    gemm = node("Gemm", ["obs", "w", "b"], "h", transB=1, alpha=1.0)
    graphs = {
        "gemm_elu": gemm + node("Elu", ["h"], "action", alpha=1.0) + weights,
        "silu": gemm + node("Sigmoid", ["h"], "g") + node("Mul", ["h", "g"], "action") + weights,
        "matmul": gemm + node("MatMul", ["h", "s"], "k") + node("Add", ["k", "r"], "action") + weights + square,
        "clip": gemm + node("Clip", ["h"], "k", min=-1.0, max=1.0) + node("Tanh", ["k"], "action") + weights,
        "normalized": node("BatchNormalization", ["obs", *rows], "n", epsilon=0.001)
        + node("Gemm", ["n", "w"], "action", transB=1)
        + statistics
        + tensor("w", [2, 3]),
        "folded": node("Sqrt", ["b"], "q")
        + node("Transpose", ["w"], "t")
        + node("MatMul", ["obs", "t"], "h")
        + node("Div", ["h", "q"], "action")
        + weights,
        "external": node("Gemm", ["obs", "w"], "action", transB=1) + beside,
    }
    return {name + ".onnx": field(7, graph + ends) + texts for name, graph in graphs.items()}
