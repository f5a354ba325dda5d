"""Networks in ONNX files as detectors, run on the tiles that are attended.

A fully convolutional network costs what its pixels cost, so a tile is cheaper than the image by nearly its
share of the pixels. It is looked at as it is, never scaled: scaling small tiles up would eat the saving.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from .._arrays import Floats, finite, integer, numbers
from ..errors import ArgumentError, ArgumentTypeError, MissingExtraError, StateError
from ..tiling import looked_at, reading, tiles
from ..where import Tiles, Where
from .base import Detections, check_image
from .merging import check_overlap, collect
from .onnx_layouts import ColumnBoxes, Layout, RowBoxes, TextMap

__all__ = ["ColumnBoxes", "Layout", "OnnxDetector", "RowBoxes", "TextMap"]


class OnnxDetector:
    """A network that finds objects or text.

    Its input is one image (N, 3, H, W) float32 of ``(pixel - mean) * scale``. Where the model fixes H and W,
    tiles have that size; else they have what the attended pixels need, in multiples of ``align``. What ends
    at the image's border is padded with zeros.

    The border of a tile looks different to a network from the inside of an image, and a halo of some ten
    pixels does not hold all that it sees: what is found on tiles is nearly what is found in the whole image,
    not the same. ``motorprime evaluate regions`` measures how nearly.

    Args:
        model: the .onnx file.
        layout: how its output is read: RowBoxes, ColumnBoxes or TextMap.
        mean: subtracted from pixels (0 to 255): one number, or one for each channel of the input.
        scale: what that is multiplied with: one number, or one for each channel of the input.
        channels: order of the input's colours, "rgb" or "bgr".
        halo: pixels read around what is attended.
        align: tiles begin and end at multiples of this, a multiple of the network's stride.
        overlap: boxes of two tiles that overlap so, intersection over union, are one object.
        batch: most tiles of one shape in one run, where the model takes several.
        threads: of the runtime; 0 lets it choose.

    Raises:
        ArgumentError: the file is no ONNX model, or has other inputs or outputs, which the message lists; or
            a number outside its domain.
        MissingExtraError: onnxruntime is not installed.
    """

    def __init__(
        self,
        model: Path | str,
        layout: Layout,
        *,
        mean: npt.ArrayLike = 0.0,
        scale: npt.ArrayLike = 1.0 / 255.0,
        channels: Literal["rgb", "bgr"] = "rgb",
        halo: int = 32,
        align: int = 32,
        overlap: float = 0.5,
        batch: int = 8,
        threads: int = 0,
    ) -> None:
        if channels not in ("rgb", "bgr"):
            raise ArgumentError(f"channels: 'rgb' or 'bgr' expected, got {channels!r}")
        self.layout, self.channels, self.overlap = layout, channels, check_overlap(overlap)
        self.mean, self.scale = per_channel("mean", mean), per_channel("scale", scale)
        self.halo, self.align = integer("halo", halo, at_least=0), integer("align", align, at_least=1)
        self.batch = integer("batch", batch, at_least=1)
        self._session = load_session(Path(model), integer("threads", threads, at_least=0))
        self._input, fixed = check_input(self._session.get_inputs())
        self._output = _choose_output(self._session.get_outputs(), layout)
        if isinstance(fixed[0], int):
            self.batch = min(self.batch, fixed[0])
        self._fixed_batch = fixed[0] if isinstance(fixed[0], int) else None
        self._size = (fixed[2], fixed[3]) if all(isinstance(side, int) for side in fixed[2:]) else None
        if self._size is not None and min(self._core()) < self.align:
            raise ArgumentError(
                f"halo: less than half of the model's input {self._size}, with room for a multiple of "
                f"align = {self.align}, expected, got {halo}"
            )

    def detect(self, image: NDArray[np.uint8], where: Where) -> Detections:
        """Detect in ``image`` (H, W, 3) uint8 RGB; findings in its pixels, whose centres ``where`` asks for.

        Raises:
            ArgumentError: ``where`` does not fit the image.
            ArgumentTypeError: the image or ``where`` has the wrong type.
            StateError: the network fails, or gives an output that cannot be read.
        """
        check_image(image)
        shape = image.shape[:2]
        places = self._tiles(where, shape)
        crops = [image[v0:v1, u0:u1] for u0, v0, u1, v1 in places.boxes.tolist()]
        found = [Detections()] * len(crops)
        for group in self._batches([self._padded(crop.shape[:2]) for crop in crops]):
            outputs = self._run([crops[k] for k in group])
            for k, output in zip(group, outputs, strict=True):
                found[k] = _cut(
                    self.layout.read(output, self._padded(crops[k].shape[:2])), crops[k].shape[:2]
                )
        return collect(found, places, where, shape, overlap=self.overlap)

    def _tiles(self, where: Where, shape: tuple[int, int]) -> Tiles:
        if self._size is None:
            return reading(where, shape, halo=self.halo, align=self.align)
        mask = looked_at(where, shape)
        mask = np.ones(shape, dtype=np.bool_) if mask is None else mask
        return tiles(mask, self._core(), halo=self.halo, align=self.align)

    def _core(self) -> tuple[int, int]:
        """Size of a tile's core when the model fixes its input."""
        assert self._size is not None
        halo = -(-self.halo // self.align) * self.align
        return self._size[0] - 2 * halo, self._size[1] - 2 * halo

    def _padded(self, size: tuple[int, ...]) -> tuple[int, int]:
        if self._size is not None:
            return self._size
        height, width = (-(-side // self.align) * self.align for side in size)
        return height, width

    def _batches(self, sizes: Sequence[tuple[int, int]]) -> Iterator[list[int]]:
        """Indices of tiles that run together: of one shape, and not too many."""
        for size in dict.fromkeys(sizes):
            same = [k for k, other in enumerate(sizes) if other == size]
            yield from (same[start : start + self.batch] for start in range(0, len(same), self.batch))

    def _run(self, crops: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        height, width = self._padded(crops[0].shape[:2])
        images = np.zeros((self._fixed_batch or len(crops), 3, height, width), dtype=np.float32)
        order = slice(None) if self.channels == "rgb" else slice(None, None, -1)
        for k, crop in enumerate(crops):
            pixels = np.multiply(crop[:, :, order], self.scale, dtype=np.float32)
            pixels -= (self.mean * self.scale).astype(np.float32)
            images[k, :, : crop.shape[0], : crop.shape[1]] = pixels.transpose(2, 0, 1)
        try:
            (output,) = self._session.run([self._output], {self._input: images})
        except Exception as error:  # the runtime's errors have no base of their own
            raise StateError(f"model: it failed on an input {images.shape}: {error}") from error
        if not self.layout.fits(output.shape) or len(output) < len(crops):
            raise StateError(f"model: an output {self.layout.says} expected, it gave {output.shape}")
        if not np.isfinite(output).all():
            raise StateError(f"model: finite numbers expected, it gave NaN or infinity for {images.shape}")
        return np.asarray(output[: len(crops)], dtype=np.float32)


def _cut(found: Detections, size: tuple[int, ...]) -> Detections:
    """Without what was found in the padding, and what reaches into it cut off."""
    height, width = size
    boxes = np.minimum(found.boxes, np.array([width, height, width, height], dtype=np.float32))
    kept = np.flatnonzero((boxes[:, 2:] > boxes[:, :2]).all(axis=1))
    return Detections(boxes[kept], found.scores[kept], tuple(found.labels[k] for k in kept))


def load_session(path: Path, threads: int) -> Any:
    """The runtime's session of a model.

    Raises:
        ArgumentError: the file is no ONNX model.
        MissingExtraError: onnxruntime is not installed.
    """
    try:
        import onnxruntime
    except ImportError:
        raise MissingExtraError("motorprime.detectors.onnx", "onnx") from None
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ArgumentError(f"model: cannot read {path}: {error.strerror}") from None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 4  # what goes wrong is raised, not printed
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # the runtime's errors have no base of their own
        raise ArgumentError(
            f"model: an ONNX model expected, {path} of {len(content)} bytes is none that runs: {error}"
        ) from None


def per_channel(name: str, value: npt.ArrayLike) -> Floats:
    """One number, or one for each channel, as (3,)."""
    array = finite(name, numbers(name, value))
    if array.shape not in ((), (3,)):
        raise ArgumentError(f"{name}: one number or 3 expected, got shape {array.shape}")
    return np.broadcast_to(array, (3,))


def check_input(inputs: Sequence[Any]) -> tuple[str, list[Any]]:
    """Name and shape of the one input (N, 3, H, W)."""
    images = [one for one in inputs if one.type == "tensor(float)" and len(one.shape) == 4]
    if (
        len(inputs) != 1
        or not images
        or not (images[0].shape[1] == 3 or not isinstance(images[0].shape[1], int))
    ):
        raise ArgumentError(f"model: one input (N, 3, H, W) of floats expected, found {listed(inputs)}")
    return images[0].name, list(images[0].shape)


def _choose_output(outputs: Sequence[Any], layout: Layout) -> str:
    """Name of the first output that the layout can read."""
    if not hasattr(layout, "fits"):
        raise ArgumentTypeError(
            f"layout: RowBoxes, ColumnBoxes or TextMap expected, got {type(layout).__name__}"
        )
    for one in outputs:
        if one.type == "tensor(float)" and layout.fits(one.shape):
            return str(one.name)
    raise ArgumentError(f"model: an output {layout.says} of floats expected, found {listed(outputs)}")


def listed(arguments: Sequence[Any]) -> str:
    """Inputs or outputs of a model, in words."""
    return ", ".join(f"'{one.name}' {tuple(one.shape)} {one.type}" for one in arguments) or "none"
