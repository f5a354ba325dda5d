"""Calibration files, written by hand as programs write them, and broken ones."""

from __future__ import annotations

import contextlib
import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorprime.camera import Camera
from motorprime.errors import ArgumentError, StateError
from motorprime.small_yaml import parse

OPENCV = """%YAML:1.0
---
calibration_time: "Mon Nov 23 05:26:00 2026"
image_width: 640
image_height: 480
flags: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.3591573396163199e+02, 0., 3.4228315473308373e+02, 0.,
       5.3591573396163199e+02, 2.3557082909788173e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -2.6637260909660682e-01, -3.8588898922304653e-02,
       1.7831947042852964e-03, -2.8122100441115472e-04,
       2.3839153080878486e-01 ]
"""
OPENCV_CAMERA = Camera(
    640,
    480,
    535.91573396163199,
    535.91573396163199,
    342.28315473308373,
    235.57082909788173,
    (
        -0.26637260909660682,
        -0.038588898922304653,
        1.7831947042852964e-03,
        -2.8122100441115472e-04,
        0.23839153080878486,
    ),
)

ROS = """image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [438.78337, 0.     , 305.59334,
           0.     , 437.30288, 243.73835,
           0.     , 0.     , 1.     ]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.361976, 0.11051, 0.001014, 0.000505, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [393.65, 0., 322.8, 0., 0., 393.65, 241.09, 0., 0., 0., 1., 0.]
"""
ROS_CAMERA = Camera(
    640, 480, 438.78337, 437.30288, 305.59334, 243.73835, (-0.361976, 0.11051, 0.001014, 0.000505, 0.0)
)

MESSAGE = """header:
  stamp:
    sec: 12
    nanosec: 0
  frame_id: ''
height: 480
width: 640
distortion_model: plumb_bob
d:
- -0.361976
- 0.11051
- 0.001014
- 0.000505
- 0.0
k: [438.78337, 0.0, 305.59334, 0.0, 437.30288, 243.73835, 0.0, 0.0, 1.0]
binning_x: 0
roi: {x_offset: 0, y_offset: 0, do_rectify: false}
---
height: 1
"""


@pytest.fixture
def write(tmp_path):
    def write(text: str, name: str = "calibration.yaml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_opencv_yaml_is_read_to_the_last_bit(write):
    assert Camera.from_opencv_yaml(write(OPENCV)) == OPENCV_CAMERA
    assert Camera.from_opencv_yaml(str(write(OPENCV))) == OPENCV_CAMERA


@pytest.mark.parametrize(
    "changes",
    [
        {"camera_matrix": "Camera_Matrix", "image_width": "image_Width", "image_height": "image_Height"},
        {"camera_matrix": "cameraMatrix", "distortion_coefficients": "dist_coeffs"},
        {"camera_matrix": "K", "distortion_coefficients": "D"},
        {"image_width: 640\nimage_height: 480": "cameraResolution: [ 640, 480 ]"},
    ],
)
def test_common_variants_of_the_keys_are_read(write, changes):
    text = OPENCV
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    assert Camera.from_opencv_yaml(write(text)) == OPENCV_CAMERA


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
def test_what_opencv_writes_is_read(tmp_path, suffix):
    path = tmp_path / f"calibration.{suffix}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", OPENCV_CAMERA.matrix)
    storage.write("distortion_coefficients", np.array([OPENCV_CAMERA.distortion]))
    storage.release()
    assert Camera.from_opencv_yaml(path) == OPENCV_CAMERA


def test_a_file_without_a_size_takes_the_shape_given(write):
    path = write(OPENCV.replace("image_width: 640\nimage_height: 480\n", ""))
    assert Camera.from_opencv_yaml(path, shape=(480, 640)) == OPENCV_CAMERA
    with pytest.raises(ArgumentError, match=r"calibration.yaml: no key image_width \(or .*\); there are"):
        Camera.from_opencv_yaml(path)


finite = st.floats(allow_nan=False, allow_infinity=False, width=64)
focal = st.floats(min_value=1e-3, max_value=1e6)


@settings(deadline=None)
@given(
    size=st.tuples(st.integers(1, 10**5), st.integers(1, 10**5)),
    f=st.tuples(focal, focal),
    c=st.tuples(finite, finite),
    distortion=st.sampled_from([0, 4, 5, 8, 12, 14]).flatmap(lambda n: st.tuples(*[finite] * n)),
)
def test_written_cameras_are_read_back_to_the_last_bit(tmp_path_factory, size, f, c, distortion):
    path = tmp_path_factory.mktemp("camera") / "camera.yml"
    camera = Camera(*size, *f, *c, distortion)
    camera.to_opencv_yaml(path)
    assert Camera.from_opencv_yaml(path) == (camera if any(distortion) else Camera(*size, *f, *c))


def test_opencv_itself_reads_what_is_written(tmp_path):
    path = tmp_path / "camera.yml"
    OPENCV_CAMERA.to_opencv_yaml(path)
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(storage.getNode("camera_matrix").mat(), OPENCV_CAMERA.matrix)
    np.testing.assert_array_equal(
        storage.getNode("distortion_coefficients").mat(), [OPENCV_CAMERA.distortion]
    )
    storage.release()


def test_a_file_that_cannot_be_written_is_named(tmp_path):
    camera = Camera(320, 240, 250.0, 250.0, 160.0, 120.0)
    with pytest.raises(ArgumentError, match=r"path: cannot write .*camera\.yaml: No such file"):
        camera.to_opencv_yaml(tmp_path / "nowhere" / "camera.yaml")


def test_a_camera_of_unknown_size_is_not_written(tmp_path):
    with pytest.raises(StateError, match="size"):
        Camera(0, 0, 1.0, 1.0, 0.0, 0.0).to_opencv_yaml(tmp_path / "camera.yml")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("camera_matrix", "matrix", "no key camera_matrix"),
        ("distortion_coefficients", "lens", "no key distortion_coefficients"),
        ("image_height", "tallness", "no key image_height"),
        ("image_width: 640", "image_width: 640.5", "image_width: expected an integer"),
        ("image_width: 640", 'image_width: "640"', "image_width: expected an integer"),
        ("flags: 0", "fisheye_model: 1", "fisheye_model"),
        ("rows: 3", "rows: 2", "camera_matrix: rows, cols and data"),
        ("rows: 3\n   cols: 3", "rows: 1\n   cols: 9", "camera_matrix: expected 3 x 3 numbers, got 1 x 9"),
        ("0., 0., 1. ]", "0., 0., 2. ]", "camera_matrix: matrix: expected"),
        ("5.3591573396163199e+02, 0.,", "5.3591573396163199e+02, 7.,", "camera_matrix: .*skew"),
        ("5.3591573396163199e+02, 0.,", "-5.3591573396163199e+02, 0.,", "camera_matrix: fx"),
        ("5.3591573396163199e+02, 0.,", ".Nan, 0.,", "camera_matrix: .*nan"),
        ("rows: 5", "rows: 6", "distortion_coefficients: rows, cols and data"),
        (OPENCV, "hello", "OpenCV can read"),
        (OPENCV, "", "OpenCV can read"),
        (OPENCV, "%YAML:1.0\n---\ncamera_matrix: [1, 2", "OpenCV can read"),
    ],
)
def test_a_broken_opencv_file_is_named_with_its_key(write, old, new, message):
    assert old in OPENCV
    with pytest.raises(ArgumentError, match=rf"calibration\.yaml: .*{message}"):
        Camera.from_opencv_yaml(write(OPENCV.replace(old, new)))


@pytest.mark.parametrize("read", [Camera.from_opencv_yaml, Camera.from_camera_info])
def test_a_file_that_cannot_be_read_is_named(tmp_path, read):
    with pytest.raises(ArgumentError, match=r"absent\.yaml: No such file"):
        read(tmp_path / "absent.yaml")
    with pytest.raises(ArgumentError, match="cannot read"):
        read(tmp_path)
    binary = tmp_path / "image.yaml"
    binary.write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(ArgumentError, match=r"image\.yaml: expected text"):
        read(binary)


D = "rows: 1\n  cols: 5\n  data: [-0.361976, 0.11051, 0.001014, 0.000505, 0.0]"
BLOCK = "rows: 1\n  cols: 5\n  data:\n  - -0.361976\n  - 0.11051\n  - 0.001014\n  - 0.000505\n  - 0.0"
FLOW = " {rows: 1, cols: 5, data: [-0.361976, 0.11051, 0.001014, 0.000505, 0.0]}"


@pytest.mark.parametrize(
    "text",
    [
        ROS,
        MESSAGE,
        ROS.replace(D, BLOCK),
        ROS.replace("\n  " + D, FLOW),
        "# made by hand\n---\n" + ROS.replace("image_width: 640", "image_width: 640   # pixels"),
        ROS.replace("\n", "\r\n"),
    ],
    ids=["camera_calibration", "message", "block list", "flow mapping", "comments", "crlf"],
)
def test_camera_info_is_read(write, text):
    assert Camera.from_camera_info(write(text)) == ROS_CAMERA


def test_camera_info_with_a_rational_lens_and_without_any(write):
    eight = ROS.replace("plumb_bob", "rational_polynomial").replace("cols: 5", "cols: 8")
    eight = eight.replace("0.000505, 0.0]", "0.000505, 0.1, 0.2, 0.3, 0.4]")
    distortion = (-0.361976, 0.11051, 0.001014, 0.000505, 0.1, 0.2, 0.3, 0.4)
    assert Camera.from_camera_info(write(eight)).distortion == distortion
    none = ROS.replace("-0.361976, 0.11051, 0.001014, 0.000505, 0.0", "0, 0, 0, 0, 0")
    assert Camera.from_camera_info(write(none)).distortion == ()
    assert (
        Camera.from_camera_info(
            write(MESSAGE.split("d:\n-")[0] + "d: []\nk: [9, 0, 1, 0, 9, 1, 0, 0, 1]")
        ).distortion
        == ()
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("plumb_bob", "equidistant", "distortion_model: expected plumb_bob or .*got 'equidistant'"),
        ("distortion_model: plumb_bob\n", "", "no key distortion_model"),
        ("plumb_bob", "rational_polynomial", "distortion_model: rational_polynomial has .*got 5"),
        ("camera_matrix:", "matrix:", "no key camera_matrix"),
        ("distortion_coefficients:", "lens:", "no key distortion_coefficients"),
        ("image_width: 640", "image_width: wide", "image_width: expected an integer"),
        ("image_width: 640", "image_width: .nan", "image_width: expected an integer"),
        ("image_width: 640", "image_width: .inf", "image_width: expected an integer"),
        ("image_width: 640", "image_width: 0", "image_width: expected an integer >= 1"),
        ("rows: 3\n  cols: 3\n  data: [438", "cols: 3\n  data: [438", "camera_matrix: no key rows"),
        ("rows: 3\n  cols: 3\n", "rows: 4\n  cols: 3\n", "camera_matrix: 4 rows x 3 cols, but 9"),
        ("438.78337", "abc", "camera_matrix: expected a list of numbers"),
        ("438.78337", "true", "camera_matrix: expected a list of numbers"),
        ("438.78337", "-438.78337", "camera_matrix: fx"),
        ("0.001014", ".nan", r"distortion_coefficients: distortion.*nan at \[2\]"),
        ("  rows: 1", " rows: 1", "line 13: the indentation"),
        ("0.11051", "[0.11051", "is not closed"),
        (ROS, "", "expected a YAML mapping"),
        (ROS, "- 1\n- 2\n", "line 1: expected 'key: value'"),
    ],
)  # fmt: skip
def test_a_broken_camera_info_is_named_with_its_key(write, old, new, message):
    assert old in ROS
    with pytest.raises(ArgumentError, match=rf"calibration\.yaml: .*{message}"):
        Camera.from_camera_info(write(ROS.replace(old, new, 1)))


def test_the_yaml_reader_knows_scalars_and_nesting():
    text = "a: 1\nb: {c: [1.5, -2e3, .5], 'd e': \"f: g\"}\n"
    text += "h:\n  i:\n    - yes it is\n    - true\n  j:\nk: -.inf\n"
    assert parse(text) == {
        "a": 1,
        "b": {"c": [1.5, -2000.0, 0.5], "d e": "f: g"},
        "h": {"i": ["yes it is", True], "j": None},
        "k": -math.inf,
    }


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a: &anchor 1", 1),
        ("a: 1\nb: *anchor", 2),
        ("a: |\n  text", 1),
        ("a: !!binary x", 1),
        ("a: 1\na: 2", 2),
        ("a:\n\tb: 1", 2),
        ("a: 1\n  b: 2", 2),
        ("a:\n  - b: 1", 2),
        ("a:\n  - - 1", 2),
        ("a: [1 2]", 1),
        ("a: [1, 2]]", 1),
        ("a: [1, 2}", 1),
        ("a: {b 1}", 1),
        ("a: {b: 1, b: 2}", 1),
        ("a: b: c", 1),
        ("just text", 1),
    ],
)
def test_the_yaml_reader_names_the_line_of_what_it_does_not_know(text, line):
    with pytest.raises(ArgumentError, match=f"line {line}: "):
        parse(text)


@settings(deadline=None)
@given(st.text(alphabet="ab:-[]{},'\" \n\t#&1.e", max_size=40))
def test_the_yaml_reader_answers_any_text_with_a_mapping_or_an_argument_error(text):
    with contextlib.suppress(ArgumentError):
        assert isinstance(parse(text), dict)
