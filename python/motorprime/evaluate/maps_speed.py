"""How fast learned maps are, beside other ways to compute the same: part of ``evaluate maps``."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from .._arrays import Floats
from ..bench.peers import networks
from ..bench.scene import Network as Weights
from ..bench.timing import FULL, QUICK, Effort, interleave
from ..learning.levenberg_marquardt import Split
from ..learning.network import Network
from ..projection import NeuralProjection

POINTS = 50


def project_speed(projection: NeuralProjection, x: Floats, *, quick: bool = False) -> dict[str, Any]:
    """Microseconds to project 50 points to all cameras, in one process, in turn with its peers.

    The peers compute the pixels of the same networks in float32 and neither check their inputs nor tell what
    is out of view; ``kernels_us`` is our own kernels used in that way.

    Args:
        projection: not adapted.
        x: (50, 12) inputs with one posture.
        quick: a few repetitions only.
    """
    points, joints = np.ascontiguousarray(x[:, :3]), x[0, 3:].copy()
    single = np.ascontiguousarray(x, dtype=np.float32)
    parts = [part.place for part in projection.learned.values()]
    mlps = [part.mlp() for part in parts]
    outs = [np.empty((len(x), 2), np.float32) for _ in parts]
    raw = [_weights(part) for part in parts]
    layers = [networks.Layers(part, len(x)) for part in raw]
    dnns = [networks.opencv(part, len(x)) for part in raw]
    calls: dict[str, Callable[[], Any]] = {
        "project_us": lambda: projection.project(points, joints),
        "kernels_us": lambda: [mlp(single, out=out) for mlp, out in zip(mlps, outs, strict=True)],
        "numpy_us": lambda: [layer(single) for layer in layers],
        "opencv_dnn_us": lambda: [dnn(single) for dnn in dnns],
    }
    if networks.onnxruntime_installed():
        runtimes = [networks.onnxruntime(part, len(x)) for part in raw]
        calls["onnxruntime_us"] = lambda: [runtime(single) for runtime in runtimes]
    effort: Effort = QUICK if quick else FULL
    return {name: times.median for name, times in interleave(calls, effort).items()}


def peer_training(start: Network, x: Floats, y: Floats, parts: Split) -> dict[str, float]:
    """Seconds per iteration of scipy.optimize.least_squares(method="lm") on the training part.

    It gets the analytic Jacobian in double precision. MINPACK factors the whole Jacobian in each iteration,
    where we factor its normal equations.
    """
    from scipy.optimize import least_squares

    z = ((x - start.input_mean) / start.input_std)[parts.train]
    t = ((y - start.output_mean) / start.output_std)[parts.train]

    def residuals(vector: Floats) -> Floats:
        return (start.with_parameters(vector).activations(z)[-1] - t).ravel()

    def jacobian(vector: Floats) -> Floats:
        return parameter_jacobian(start.with_parameters(vector), z)

    began = time.perf_counter()
    result = least_squares(residuals, start.parameters, jac=jacobian, method="lm", max_nfev=2)
    seconds = time.perf_counter() - began
    return {"scipy_s_per_iteration": seconds / max(int(result.njev), 1)}


def parameter_jacobian(network: Network, z: Floats) -> Floats:
    """Derivatives (N out, P) of the normalised outputs, sample by sample, by the parameters."""
    layers = network.activations(z)
    outputs, count = layers[-1].shape[1], len(z)
    delta = np.broadcast_to(np.eye(outputs), (count, outputs, outputs))
    blocks = []
    for k in range(len(network.weights) - 1, -1, -1):
        blocks.append(delta)
        blocks.append((delta[..., None] * layers[k][:, None, None, :]).reshape(count, outputs, -1))
        if k:
            delta = (delta @ network.weights[k]) * (1.0 - layers[k] ** 2)[:, None, :]
    return np.concatenate(blocks[::-1], axis=2).reshape(count * outputs, -1)


def _weights(network: Network) -> Weights:
    return Weights(
        list(network.weights),
        list(network.biases),
        network.input_mean,
        network.input_std,
        network.output_mean,
        network.output_std,
    )
