"""Small tanh networks in NumPy, OpenCV and ONNX Runtime, with the scaling folded into the outer layers."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec

import cv2
import numpy as np

from ..scene import Floats32, Network
from .onnx import network_bytes

ONE = 20.0  # tanh(20) is 1 in float32


def folded(network: Network) -> tuple[list[Floats32], list[Floats32]]:
    """Weights (in, out) and biases of the same network without scaling, contiguous float32."""
    weights = [weight.copy() for weight in network.weights]
    biases = [bias.copy() for bias in network.biases]
    biases[0] = biases[0] - weights[0] @ (network.input_mean / network.input_std)
    weights[0] = weights[0] / network.input_std
    weights[-1] = weights[-1] * network.output_std[:, None]
    biases[-1] = biases[-1] * network.output_std + network.output_mean
    return (
        [np.ascontiguousarray(weight.T, dtype=np.float32) for weight in weights],
        [bias.astype(np.float32) for bias in biases],
    )


class Layers:
    """One product, one sum and one tanh per layer, all in place."""

    def __init__(self, network: Network, count: int) -> None:
        self.layers = list(zip(*folded(network), strict=True))
        self.outs = [np.empty((count, len(bias)), np.float32) for _, bias in self.layers]

    def __call__(self, x: Floats32) -> Floats32:
        """(N, out); valid until the next call."""
        last = len(self.layers) - 1
        for k, ((weight, bias), out) in enumerate(zip(self.layers, self.outs, strict=True)):
            np.dot(x, weight, out)
            np.add(out, bias, out)
            x = out if k == last else np.tanh(out, out)
        return x


class Augmented:
    """Biases as one more row of the weights, which leaves one product and one tanh per layer.

    The inputs get a column of ones; a hidden unit with the bias 20 keeps it through tanh.
    """

    def __init__(self, network: Network, count: int) -> None:
        weights, biases = folded(network)
        last = len(weights) - 1
        self.weights = []
        for k, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
            wide = np.zeros((weight.shape[0] + 1, weight.shape[1] + (k < last)), np.float32)
            wide[:-1, : len(bias)], wide[-1, : len(bias)] = weight, bias
            if k < last:
                wide[-1, -1] = ONE
            self.weights.append(wide)
        self.inputs = np.ones((count, weights[0].shape[0] + 1), np.float32)
        self.outs = [np.empty((count, weight.shape[1]), np.float32) for weight in self.weights]

    def __call__(self, x: Floats32) -> Floats32:
        """(N, out); valid until the next call."""
        self.inputs[:, :-1] = x
        return self.filled()

    def filled(self) -> Floats32:
        """The same for inputs that were written into ``inputs[:, :-1]``."""
        x = self.inputs
        for weight, out in zip(self.weights[:-1], self.outs[:-1], strict=True):
            x = np.tanh(np.dot(x, weight, out), out)
        return np.dot(x, self.weights[-1], self.outs[-1])


def opencv(network: Network, count: int) -> Callable[[Floats32], Floats32]:
    """``cv2.dnn`` on the network as ONNX."""
    net = cv2.dnn.readNetFromONNX(np.frombuffer(network_bytes(*folded(network), count), np.uint8))

    def run(x: Floats32) -> Floats32:
        net.setInput(x)
        return np.asarray(net.forward(), dtype=np.float32)

    return run


def onnxruntime_installed() -> bool:
    """Whether ONNX Runtime can be measured."""
    return find_spec("onnxruntime") is not None


def onnxruntime(network: Network, count: int) -> Callable[[Floats32], Floats32]:
    """ONNX Runtime on one thread."""
    runtime = import_module("onnxruntime")
    options = runtime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    content = network_bytes(*folded(network), count)
    session = runtime.InferenceSession(content, options, providers=["CPUExecutionProvider"])

    def run(x: Floats32) -> Floats32:
        return np.asarray(session.run(["y"], {"x": x})[0], dtype=np.float32)

    return run
