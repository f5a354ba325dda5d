"""Read what is printed: a network that names each line of text that another one found."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from .._arrays import integer, rows
from ..errors import ArgumentError, StateError
from ..where import Where
from .base import Detections, Detector, check_image
from .onnx import check_input, listed, load_session, per_channel

HEIGHT = 48
"""Of the network's input [px]; lines are scaled to it."""


class TextReader:
    """A network that reads lines of text, trained with connectionist temporal classification.

    Its input is (1, 3, 48, W) float32 of ``(pixel - mean) * scale`` in BGR, its output (1, T, K) the
    likelihoods of K characters at T places: at first the blank, then the characters that the model's metadata
    list under ``character``, and the space. Of equal characters at neighbouring places one counts.

    Source: Graves et al., *Connectionist Temporal Classification*, 2006; best-path decoding.

    Args:
        model: the .onnx file.
        mean: subtracted from pixels (0 to 255).
        scale: what that is multiplied with.
        threads: of the runtime; 0 lets it choose.

    Raises:
        ArgumentError: the file is no ONNX model, has other inputs or outputs, or lists no characters.
        MissingExtraError: onnxruntime is not installed.
    """

    def __init__(
        self,
        model: Path | str,
        *,
        mean: npt.ArrayLike = 127.5,
        scale: npt.ArrayLike = 1.0 / 127.5,
        threads: int = 0,
    ) -> None:
        self.mean, self.scale = per_channel("mean", mean), per_channel("scale", scale)
        self._session: Any = load_session(Path(model), integer("threads", threads, at_least=0))
        self._input, _ = check_input(self._session.get_inputs())
        known = self._session.get_modelmeta().custom_metadata_map
        if "character" not in known:
            raise ArgumentError(f"model: metadata 'character' expected, found {', '.join(known) or 'none'}")
        self._characters = ["", *known["character"].splitlines(), " "]
        outputs = self._session.get_outputs()
        if len(outputs[0].shape) != 3 or outputs[0].shape[2] != len(self._characters):
            raise ArgumentError(
                f"model: an output (1, T, {len(self._characters)}) expected, found {listed(outputs)}"
            )

    def read(self, image: NDArray[np.uint8], boxes: npt.ArrayLike) -> list[tuple[str, float]]:
        """What stands in boxes (N, 4) of ``image`` (H, W, 3) uint8 RGB: text and mean likelihood of each.

        Raises:
            ArgumentError: a box is no box.
            StateError: the network fails.
        """
        check_image(image)
        return [self._line(image, box) for box in rows("boxes", boxes, 4).tolist()]

    def _line(self, image: NDArray[np.uint8], box: Iterable[float]) -> tuple[str, float]:
        height, width = image.shape[:2]
        u0, v0, u1, v1 = np.clip(np.rint(list(box)), 0, (width, height, width, height)).astype(int).tolist()
        if u1 <= u0 or v1 <= v0:
            return "", 0.0
        line = np.ascontiguousarray(image[v0:v1, u0:u1, ::-1])
        across = max(HEIGHT // 3, round(HEIGHT * (u1 - u0) / (v1 - v0)))
        scaled = cv2.resize(line, (across, HEIGHT), interpolation=cv2.INTER_CUBIC)
        pixels = ((scaled - self.mean) * self.scale).astype(np.float32).transpose(2, 0, 1)[None]
        try:
            (likely,) = self._session.run(None, {self._input: pixels})[0]
        except Exception as error:  # the runtime's errors have no base of their own
            raise StateError(f"model: it failed on an input {pixels.shape}: {error}") from error
        return self._decode(np.asarray(likely, dtype=np.float32))

    def _decode(self, likely: NDArray[np.float32]) -> tuple[str, float]:
        best = likely.argmax(axis=1)
        new = np.flatnonzero((best != 0) & (best != np.append(0, best[:-1])))
        text = "".join(self._characters[k] for k in best[new])
        return text, float(likely[new, best[new]].mean()) if len(new) else 0.0


@dataclass(frozen=True)
class ReadText:
    """A text detector whose labels are what it reads.

    Args:
        detector: finds lines of text.
        reader: reads each of them.
    """

    detector: Detector
    reader: TextReader

    def detect(self, image: NDArray[np.uint8], where: Where) -> Detections:
        """Lines of text at the pixels that ``where`` asks for, each labelled with what it says."""
        found = self.detector.detect(image, where)
        read = self.reader.read(image, found.boxes)
        return replace(found, labels=tuple(text for text, _ in read))
