"""Networks of a few nodes as the bytes of ONNX files: bright cells are objects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motorprime.bench.peers.onnx import _field, _number

FLOAT, INT64 = 1, 7
CELL = 8


def map_network(channels: int = 3, outputs: int = 1) -> bytes:
    """(N, 3, H, W) -> the mean of the channels (N, 1, H, W)."""
    nodes = _node("ReduceMean", ["image"], "likely", axes=[1], keepdims=1)
    shape = ("n", 1, "h", "w")
    more = _field(12, _value("again", shape)) * (outputs - 1)
    return _model(
        nodes + (_node("Identity", ["likely"], "again") if outputs > 1 else b""),
        b"",
        _value("image", ("n", channels, "h", "w")),
        _field(12, _value("likely", shape)) + more,
    )


def box_network(layout: str, size: int, *, batch: int | str = "n") -> bytes:
    """(N, 3, size, size) -> a box for each cell of 8 x 8, scored by its mean: (N, 5, K) or (N, K, 6)."""
    count = size // CELL
    v, u = np.mgrid[:count, :count].reshape(2, 1, -1) * CELL + CELL / 2.0
    grid = np.concatenate([u, v, np.full_like(u, CELL), np.full_like(u, CELL)])[None].reshape(1, 4, -1)
    tensors = _field(5, _tensor("grid", grid.astype(np.float32)))
    tensors += _field(5, _tensor("flat", np.array([0, 1, -1], np.int64)))
    tensors += _field(5, _tensor("zero", np.zeros(1, np.float32)))
    tensors += _field(5, _tensor("one", np.ones(1, np.float32)))
    nodes = _node("AveragePool", ["image"], "cells", kernel_shape=[CELL, CELL], strides=[CELL, CELL])
    nodes += _node("ReduceMean", ["cells"], "mean", axes=[1], keepdims=1)
    nodes += _node("Reshape", ["mean", "flat"], "score")
    nodes += _node("Mul", ["score", "zero"], "nothing")
    nodes += _node("Add", ["grid", "nothing"], "places")  # one grid for each image
    if layout == "columns":
        nodes += _node("Concat", ["places", "score"], "boxes", axis=1)
        shape: tuple[int | str, ...] = (batch, 5, count * count)
    else:
        nodes += _node("Add", ["nothing", "one"], "sure")
        nodes += _node("Concat", ["places", "score", "sure"], "columns", axis=1)
        nodes += _node("Transpose", ["columns"], "boxes", perm=[0, 2, 1])
        shape = (batch, count * count, 6)
    image = _value("image", (batch, 3, size, size))
    return _model(nodes, tensors, image, _field(12, _value("boxes", shape)))


def _model(nodes: bytes, tensors: bytes, image: bytes, outputs: bytes) -> bytes:
    graph = nodes + _field(2, b"tiny") + tensors + _field(11, image) + outputs
    return _number(1, 8) + _field(7, graph) + _field(8, _field(1, b"") + _number(2, 13))


def _node(kind: str, inputs: Sequence[str], output: str, **attributes: int | list[int]) -> bytes:
    node = b"".join(_field(1, name.encode()) for name in inputs) + _field(2, output.encode())
    node += _field(3, output.encode()) + _field(4, kind.encode())
    for name, value in attributes.items():
        if isinstance(value, list):
            held = b"".join(_number(8, one) for one in value) + _number(20, 7)
        else:
            held = _number(3, value) + _number(20, 2)
        node += _field(5, _field(1, name.encode()) + held)
    return _field(1, node)


def _tensor(name: str, values: np.ndarray) -> bytes:
    sides = b"".join(_number(1, side) for side in values.shape)
    kind = INT64 if values.dtype == np.int64 else FLOAT
    return sides + _number(2, kind) + _field(8, name.encode()) + _field(9, values.tobytes())


def _value(name: str, shape: Sequence[int | str]) -> bytes:
    sides = b"".join(
        _field(1, _number(1, side) if isinstance(side, int) else _field(2, side.encode())) for side in shape
    )
    return _field(1, name.encode()) + _field(2, _field(1, _number(1, FLOAT) + _field(2, sides)))


def reader_network(characters: str | None = "A", classes: int = 3) -> bytes:
    """(N, 3, 48, W) -> the mean of each column's channels (N, W, 3): blue is blank, green A, red a space."""
    nodes = _node("ReduceMean", ["image"], "columns", axes=[2], keepdims=0)
    nodes += _node("Transpose", ["columns"], "likely", perm=[0, 2, 1])
    image = _value("image", ("n", 3, 48, "w"))
    model = _model(nodes, b"", image, _field(12, _value("likely", ("n", "w", classes))))
    if characters is not None:
        model += _field(14, _field(1, b"character") + _field(2, characters.encode()))
    return model
