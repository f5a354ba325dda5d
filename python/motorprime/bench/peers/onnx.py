"""A tanh network as the bytes of an ONNX file: the few fields of the format that this takes, written out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..scene import Floats32

FLOAT = 1  # TensorProto.DataType


def network_bytes(weights: Sequence[Floats32], biases: Sequence[Floats32], count: int) -> bytes:
    """``y = gemm(tanh(... gemm(x)))`` for x (count, in) and weights (in, out)."""
    nodes, tensors, name = b"", b"", "x"
    for k, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        last = k == len(weights) - 1
        tensors += _field(5, _tensor(f"w{k}", weight)) + _field(5, _tensor(f"b{k}", bias))
        nodes += _field(1, _node("Gemm", [name, f"w{k}", f"b{k}"], "y" if last else f"g{k}"))
        if not last:
            nodes += _field(1, _node("Tanh", [f"g{k}"], f"h{k}"))
            name = f"h{k}"
    graph = nodes + _field(2, b"network") + tensors
    graph += _field(11, _value("x", (count, weights[0].shape[0])))
    graph += _field(12, _value("y", (count, weights[-1].shape[1])))
    return _number(1, 8) + _field(7, graph) + _field(8, _field(1, b"") + _number(2, 13))


def _node(kind: str, inputs: Sequence[str], output: str) -> bytes:
    named = b"".join(_field(1, name.encode()) for name in inputs) + _field(2, output.encode())
    return named + _field(3, output.encode()) + _field(4, kind.encode())


def _tensor(name: str, values: Floats32) -> bytes:
    sides = b"".join(_number(1, side) for side in values.shape)
    content = np.ascontiguousarray(values, dtype="<f4").tobytes()
    return sides + _number(2, FLOAT) + _field(8, name.encode()) + _field(9, content)


def _value(name: str, shape: Sequence[int]) -> bytes:
    sides = b"".join(_field(1, _number(1, side)) for side in shape)
    kind = _field(1, _number(1, FLOAT) + _field(2, sides))
    return _field(1, name.encode()) + _field(2, kind)


def _field(number: int, content: bytes) -> bytes:
    return _varint(number << 3 | 2) + _varint(len(content)) + content


def _number(number: int, value: int) -> bytes:
    return _varint(number << 3) + _varint(value)


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)
