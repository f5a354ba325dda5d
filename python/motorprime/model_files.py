"""Model files: weights in safetensors, and in the header one JSON text that says what they are."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._arrays import Floats
from .errors import ArgumentError

_KEY = "motorprime"
FORMAT = 1


def write_model(path: str | Path, kind: str, arrays: Mapping[str, Floats], about: Mapping[str, Any]) -> None:
    """Write arrays and what they are.

    Args:
        path: the file; its folder must be there. It is replaced at once or not at all.
        kind: what the model is, e.g. 'neural projection'.
        arrays: {name: array}; kept with their dtype.
        about: anything that JSON can hold.

    Raises:
        ArgumentError: the file cannot be written.
    """
    from safetensors.numpy import save

    text = json.dumps({"format": FORMAT, "kind": kind, **about})
    data = save({name: np.asarray(array, order="C") for name, array in arrays.items()}, {_KEY: text})
    path = Path(path)
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}-", delete=False) as aside:
            try:
                aside.write(data)
                aside.close()
                Path(aside.name).chmod(0o644)
                Path(aside.name).replace(path)
            except BaseException:
                Path(aside.name).unlink(missing_ok=True)
                raise
    except OSError as error:
        raise ArgumentError(f"path: cannot write {path}: {error.strerror}") from None


def read_model(path: str | Path, kind: str) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Arrays and description of a model file.

    Raises:
        ArgumentError: there is no such file, it was cut off or is no model file, or holds another kind.
    """
    from safetensors import SafetensorError
    from safetensors.numpy import load

    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ArgumentError(f"path: cannot read {path}: {error.strerror}") from None
    try:
        size = int.from_bytes(data[:8], "little")
        header = json.loads(data[8 : 8 + size]) if len(data) >= 8 + size > 8 else {}
        about = json.loads(header.get("__metadata__", {}).get(_KEY, "{}"))
        arrays = load(data)
    except (SafetensorError, ValueError, AttributeError):
        raise ArgumentError(f"path: {path} is no model file, or was cut off") from None
    if not isinstance(about, dict) or about.get("kind") is None:
        raise ArgumentError(f"path: {path} is not a model of motorprime")
    if about.get("format") != FORMAT:
        raise ArgumentError(f"path: {path} has format {about.get('format')}; this version reads {FORMAT}")
    if about["kind"] != kind:
        raise ArgumentError(f"path: {path} is a {about['kind']}, a {kind} expected")
    return arrays, about
