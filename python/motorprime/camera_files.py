"""Calibration files: OpenCV's and ROS CameraInfo. Used through the methods of :class:`Camera`."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TypeAlias

import cv2
import numpy as np

from ._arrays import Floats
from .camera import Camera
from .errors import ArgumentError, Error
from .small_yaml import Value, parse

# What OpenCV's samples, its calibration tool, ROS and common programs around them write.
_MATRIX = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "CameraMatrix", "K", "k")
_DISTORTION = (
    "distortion_coefficients",
    "Distortion_Coefficients",
    "dist_coeffs",
    "distCoeffs",
    "dist_coeff",
    "distortion",
    "D",
    "d",
)
_WIDTH = ("image_width", "image_Width", "imageWidth", "width")
_HEIGHT = ("image_height", "image_Height", "imageHeight", "height")
_SIZE = ("cameraResolution", "image_size", "imageSize")

_Path: TypeAlias = str | PathLike[str]

_ROS_COUNTS = {"plumb_bob": (0, 4, 5), "rational_polynomial": (0, 8, 12, 14)}


def read_opencv(path: _Path, shape: tuple[int, int] | None) -> Camera:
    """Read a cv2.FileStorage; see :meth:`Camera.from_opencv_yaml`."""
    entries = _storage(path)
    if entries.get("fisheye_model", 0.0) != 0.0:
        raise ArgumentError(f"{path}: fisheye_model: fisheye lenses are not supported")
    if shape is None:
        key = next((key for key in _SIZE if key in entries), None)
        if key is not None:
            width, height = (_size(path, key, value) for value in _numbers(path, key, entries[key], (2,)))
        else:
            width, height = (_size(path, *_find(path, entries, keys)) for keys in (_WIDTH, _HEIGHT))
        shape = height, width
    return _camera(path, entries, shape)


def read_camera_info(path: _Path) -> Camera:
    """Read a ROS CameraInfo YAML; see :meth:`Camera.from_camera_info`."""
    try:
        entries = parse(_text(path))
    except ArgumentError as error:
        raise ArgumentError(f"{path}: {error}") from None
    _, model = _find(path, entries, ("distortion_model",))
    if model not in _ROS_COUNTS:
        raise ArgumentError(
            f"{path}: distortion_model: expected {' or '.join(_ROS_COUNTS)}, got {model!r}, "
            "which this pinhole camera cannot represent"
        )
    width, height = (_size(path, *_find(path, entries, keys)) for keys in (_WIDTH, _HEIGHT))
    camera = _camera(path, entries, (height, width))
    if len(camera.distortion) not in _ROS_COUNTS[model]:
        counts = ", ".join(str(count) for count in _ROS_COUNTS[model])
        raise ArgumentError(
            f"{path}: distortion_model: {model} has {counts} coefficients, got {len(camera.distortion)}"
        )
    return camera


def write_opencv(camera: Camera, path: _Path) -> None:
    """Write OpenCV YAML; see :meth:`Camera.to_opencv_yaml`."""
    height, width = camera.shape
    # Programs that read this expect coefficients, so that none become five zeros.
    distortion = camera.distortion or (0.0,) * 5
    lines = ["%YAML:1.0", "---", f"image_width: {width}", f"image_height: {height}"]
    for key, array in (("camera_matrix", camera.matrix), ("distortion_coefficients", np.array([distortion]))):
        data = ", ".join(repr(value) for value in array.reshape(-1).tolist())
        lines += [f"{key}: !!opencv-matrix", f"   rows: {array.shape[0]}", f"   cols: {array.shape[1]}"]
        lines += ["   dt: d", f"   data: [ {data} ]"]
    try:
        Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise ArgumentError(f"path: cannot write {path}: {error.strerror}") from error


def _text(path: _Path) -> str:
    """Return the file's text."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise ArgumentError(f"path: cannot read {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ArgumentError(f"{path}: expected text in UTF-8: {error.reason}") from None


def _storage(path: _Path) -> dict[str, Value]:
    """Read the entries of a cv2.FileStorage that are numbers, texts, lists of numbers or matrices."""
    unreadable = f"{path}: not a YAML, XML or JSON file that OpenCV can read"
    text = _text(path)
    # OpenCV reports a file that it cannot parse in either of two ways.
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    except (cv2.error, SystemError):
        raise ArgumentError(unreadable) from None
    if not storage.isOpened():
        raise ArgumentError(unreadable)
    entries: dict[str, Value] = {}
    for key in storage.root().keys():  # noqa: SIM118 - not a mapping
        node = storage.getNode(key)
        if node.isInt() or node.isReal():
            entries[key] = node.real()
        elif node.isString():
            entries[key] = node.string()
        elif node.isSeq():
            items = [node.at(i) for i in range(node.size())]
            if all(item.isInt() or item.isReal() for item in items):
                entries[key] = [item.real() for item in items]
        elif node.isMap():
            try:
                matrix = node.mat()
            except cv2.error:
                raise ArgumentError(f"{path}: {key}: rows, cols and data do not agree") from None
            if matrix is not None:
                rows, cols = matrix.shape[:2]
                data: list[Value] = np.asarray(matrix, np.float64).reshape(-1).tolist()
                entries[key] = {"rows": rows, "cols": cols, "data": data}
    storage.release()
    return entries


def _camera(path: _Path, entries: Mapping[str, Value], shape: tuple[int, int]) -> Camera:
    key, value = _find(path, entries, _MATRIX)
    matrix = _numbers(path, key, value, (3, 3))
    distortion_key, value = _find(path, entries, _DISTORTION)
    distortion = tuple(_numbers(path, distortion_key, value, None).tolist())
    if not any(distortion) and len(distortion) <= 14:
        distortion = ()
    try:
        Camera.from_matrix(matrix, shape)
    except Error as error:
        raise ArgumentError(f"{path}: {key}: {error}") from None
    try:
        return Camera.from_matrix(matrix, shape, distortion)
    except Error as error:
        raise ArgumentError(f"{path}: {distortion_key}: {error}") from None


def _find(path: _Path, entries: Mapping[str, Value], keys: tuple[str, ...]) -> tuple[str, Value]:
    for key in keys:
        if key in entries:
            return key, entries[key]
    others = f" (or {', '.join(keys[1:])})" if len(keys) > 1 else ""
    raise ArgumentError(f"{path}: no key {keys[0]}{others}; there are {', '.join(entries) or 'none'}")


def _numbers(path: _Path, key: str, value: Value, shape: tuple[int, ...] | None) -> Floats:
    """Read a list of numbers, or a mapping of rows, cols and data; ``shape`` None takes any row or column."""
    size: tuple[int, ...] | None = None
    if isinstance(value, Mapping):
        missing = [part for part in ("rows", "cols", "data") if part not in value]
        if missing:
            raise ArgumentError(f"{path}: {key}: no key {missing[0]}")
        size = _size(path, f"{key}: rows", value["rows"], 0), _size(path, f"{key}: cols", value["cols"], 0)
        value = value["data"]
    if not isinstance(value, list) or not all(_is_number(item) for item in value):
        raise ArgumentError(f"{path}: {key}: expected a list of numbers, got {value!r}")
    array = np.array(value, np.float64)
    if size is not None and size[0] * size[1] != array.size:
        raise ArgumentError(f"{path}: {key}: {size[0]} rows x {size[1]} cols, but {array.size} numbers")
    if shape is None:
        if size is not None and min(size) > 1:
            raise ArgumentError(f"{path}: {key}: expected one row or column, got {size[0]} x {size[1]}")
        return array
    if (size is not None and size != shape) or array.size != np.prod(shape):
        got = f"{array.size} numbers" if size is None else f"{size[0]} x {size[1]}"
        raise ArgumentError(f"{path}: {key}: expected {' x '.join(str(n) for n in shape)} numbers, got {got}")
    return array.reshape(shape)


def _size(path: _Path, key: str, value: object, at_least: int = 1) -> int:
    if not isinstance(value, (int, float)) or isinstance(value, bool) or value % 1 != 0 or value < at_least:
        raise ArgumentError(f"{path}: {key}: expected an integer >= {at_least}, got {value!r}")
    return round(value)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
