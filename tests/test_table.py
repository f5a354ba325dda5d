"""Tables of joint states and pixels."""

import numpy as np
import pytest

from motorprime.errors import ArgumentError
from motorprime.recordings import read_table

GOOD = "shoulder,elbow,left_u,left_v,right_u,right_v\n0.3,-1.2,160.5,98.25,,\n0.4,-1.1,150,90,140,91\n"


def table(tmp_path, text, name="table.csv"):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_columns_are_joints_unless_they_are_a_camera_s_pixels(tmp_path):
    samples = read_table(table(tmp_path, GOOD))
    assert samples.names == ("shoulder", "elbow")
    assert samples.cameras == ("left", "right")
    np.testing.assert_array_equal(samples.joints, [[0.3, -1.2], [0.4, -1.1]])
    np.testing.assert_array_equal(samples.pixels["left"], [[160.5, 98.25], [150, 90]])
    np.testing.assert_array_equal(samples.pixels["right"], [[np.nan, np.nan], [140, 91]])
    assert samples.points is None


@pytest.mark.parametrize("comma", [";", "\t", ", "])
def test_other_commas_and_blank_lines_do_not_matter(tmp_path, comma):
    samples = read_table(table(tmp_path, "\ufeff" + GOOD.replace(",", comma).replace("\n", "\n\n")))
    assert len(samples) == 2
    assert samples.names == ("shoulder", "elbow")
    np.testing.assert_array_equal(samples.pixels["left"][0], [160.5, 98.25])


def test_the_order_of_the_columns_does_not_matter(tmp_path):
    samples = read_table(table(tmp_path, "cam_v,a,cam_u,b\n1,2,3,4\n"))
    assert samples.names == ("a", "b")
    np.testing.assert_array_equal(samples.pixels["cam"], [[3, 1]])


def test_a_numpy_table_is_the_same(tmp_path):
    rows = np.array(
        [(0.3, 160.5, 98.0), (0.4, np.nan, np.nan)],
        dtype=[("elbow", "f8"), ("left_u", "f4"), ("left_v", "f4")],
    )
    np.save(tmp_path / "table.npy", rows)
    samples = read_table(tmp_path / "table.npy")
    assert samples.names == ("elbow",)
    np.testing.assert_array_equal(samples.pixels["left"], [[160.5, 98.0], [np.nan, np.nan]])


BAD = {
    "a joint without value": ("a,c_u,c_v\n1,2,3\n,2,3\n", "row 3: joint 'a' has no value"),
    "half a pixel": ("a,c_u,c_v\n1,2,3\n1,,3\n", "row 3: 'c_u' and 'c_v' expected both or neither"),
    "no number": ("a,c_u,c_v\n1,2,x\n", "row 2, column 'c_v': a finite number expected, got 'x'"),
    "nan": ("a,c_u,c_v\nnan,2,3\n", "row 2, column 'a': a finite number expected, got 'nan'"),
    "infinity": ("a,c_u,c_v\n1,inf,3\n", "row 2, column 'c_u': a finite number"),
    "a value more": ("a,c_u,c_v\n1,2,3,4\n", "row 2: 3 values expected, got 4"),
    "a value less": ("a,c_u,c_v\n1,2\n", "row 2: 3 values expected, got 2"),
    "no camera": ("a,b\n1,2\n", "no camera: columns named <camera>_u and <camera>_v"),
    "no joint": ("c_u,c_v\n1,2\n", "no column of a joint"),
    "one of two": ("a,c_u\n1,2\n", "a column 'c_u' and no 'c_v'"),
    "twice": ("a,a,c_u,c_v\n1,1,2,3\n", "the column 'a' twice"),
    "no name": ("a,,c_u,c_v\n1,1,2,3\n", "a column without a name; it is number 2"),
    "empty": ("", "is empty"),
    "no rows": ("a,c_u,c_v\n", "no rows below its header"),
    "no header": ("1,2,3\n4,5,6\n", "no camera"),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD)
def test_what_is_wrong_with_a_table_is_said_with_its_row(tmp_path, text, message):
    with pytest.raises(ArgumentError, match=message):
        read_table(table(tmp_path, text))


def test_files_that_are_no_tables_say_so(tmp_path):
    with pytest.raises(ArgumentError, match=r"cannot read .*No such file"):
        read_table(tmp_path / "nowhere.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(ArgumentError, match="is no text"):
        read_table(tmp_path / "binary.csv")
    with pytest.raises(ArgumentError, match="is no NumPy file"):
        read_table(table(tmp_path, "1,2", "text.npy"))
    np.save(tmp_path / "plain.npy", np.ones((3, 4)))
    with pytest.raises(ArgumentError, match="a structured array"):
        read_table(tmp_path / "plain.npy")
    np.save(
        tmp_path / "words.npy", np.array([("x", 1.0, 2.0)], dtype=[("a", "U3"), ("c_u", "f8"), ("c_v", "f8")])
    )
    with pytest.raises(ArgumentError, match="numbers expected in 'a'"):
        read_table(tmp_path / "words.npy")
    np.save(
        tmp_path / "inf.npy",
        np.array([(np.inf, 1.0, 2.0)], dtype=[("a", "f8"), ("c_u", "f8"), ("c_v", "f8")]),
    )
    with pytest.raises(ArgumentError, match="row 1: infinity"):
        read_table(tmp_path / "inf.npy")
