"""Hostile arguments at the border: the right answer or a `motorprime.Error`, never a panic or a crash.

A panic of the kernels would arrive as `PanicException`, which is no `Exception` and so fails these tests.
"""

import math

import numpy as np
import pytest

import motorprime.errors
from motorprime._core import Mlp
from motorprime.landscape import (
    gaussian_landscape,
    gaussian_landscapes,
    gibbs_sample,
    kernel_landscape,
    kernel_landscapes,
    sample,
    threshold,
)
from motorprime.step import attention_step

Error = motorprime.errors.Error
SHAPE = (12, 17)
POINTS = np.random.default_rng(0).uniform(0, 12, (30, 2))
PIXELS = kernel_landscape(POINTS, SHAPE, width=6.0)
MLP = Mlp([np.ones((3, 2))], [np.zeros(3)], [0.0, 0.0], [1.0, 1.0], [0.0] * 3, [1.0] * 3)
EYE = Mlp([np.full((2, 5), 0.1)], [np.zeros(2)], [0.0] * 5, [1.0] * 5, [8.0, 6.0], [1.0] * 2)
MATRIX = np.array([[9.0, 0.0, 8.0, 0.0], [0.0, 9.0, 6.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
PATH = np.random.default_rng(3).uniform([-0.4, -0.4, 0.6], [0.4, 0.4, 1.4], (30, 3))


def step(source, *arguments, **options):
    """The one camera's landscape of a fused step."""
    given = {"windows": 3, "seed": 1} | options
    if "pixels" in options:
        return attention_step(None, {"left": SHAPE}, **given)["left"].landscape
    return attention_step({"left": source}, {"left": SHAPE}, *arguments, **given)["left"].landscape


READERS = {
    "threshold": lambda x: threshold(x, fraction=0.3),
    "quicksort": lambda x: threshold(x, fraction=0.3, method="quicksort"),
    "stride": lambda x: threshold(x, fraction=0.3, stride=3),
    "gibbs": lambda x: gibbs_sample(x, 20, seed=1),
    "sample": lambda x: sample(x, 20, seed=1),
    "sample apart": lambda x: sample(x, 20, seed=1, min_distance=3.0),
}
TAKERS = {
    "points": lambda x: kernel_landscape(x, SHAPE, width=6.0),
    "width": lambda x: kernel_landscape(POINTS, SHAPE, width=x),
    "weights": lambda x: kernel_landscape(POINTS, SHAPE, width=6.0, weights=x),
    "batch points": lambda x: kernel_landscapes([POINTS, x], SHAPE, width=6.0),
    "batch width": lambda x: kernel_landscapes([POINTS, POINTS], SHAPE, width=[6.0, x]),
    "batch weights": lambda x: kernel_landscapes([POINTS, POINTS], SHAPE, width=6.0, weights=[None, x]),
    "mean": lambda x: gaussian_landscape(x, (3.0, 1.0, 2.0), SHAPE),
    "chol": lambda x: gaussian_landscape((5.0, 5.0), x, SHAPE),
    "means": lambda x: gaussian_landscapes(x, [(3.0, 1.0, 2.0)] * 2, SHAPE),
    "chols": lambda x: gaussian_landscapes([(5.0, 5.0)] * 2, x, SHAPE),
    "mlp": MLP,
    "jacobian": MLP.jacobian,
    "step path": lambda x: step(MATRIX, x),
    "step joints": lambda x: step(EYE, PATH, x),
    "step matrix": lambda x: step(x, PATH),
    "step pixels": lambda x: step(None, pixels={"left": x}),
}
GOOD = {
    "points": POINTS,
    "width": np.random.default_rng(1).uniform(3, 6, (30, 2)),
    "weights": np.random.default_rng(2).uniform(0, 1, 30),
    "batch points": POINTS,
    "batch width": np.random.default_rng(1).uniform(3, 6, (30, 2)),
    "batch weights": np.random.default_rng(2).uniform(0, 1, 30),
    "mean": np.array([5.0, 6.0]),
    "chol": np.array([3.0, 1.0, 2.0]),
    "means": np.array([[5.0, 6.0], [7.0, 2.0]]),
    "chols": np.array([[3.0, 1.0, 2.0], [2.0, -1.0, 4.0]]),
    "mlp": POINTS,
    "jacobian": POINTS,
    "step path": PATH,
    "step joints": np.array([0.4, -0.7]),
    "step matrix": MATRIX,
    "step pixels": POINTS,
}


def unaligned(array):
    """The same numbers at an address that is no multiple of their size."""
    raw = np.zeros(array.nbytes + 1, dtype=np.uint8)
    view = raw[1:].view(array.dtype).reshape(array.shape)
    view[...] = array
    assert not view.flags.aligned
    return view


def strided(array):
    """The same numbers as every second element along every axis."""
    big = np.zeros([2 * n for n in array.shape], dtype=array.dtype)
    view = big[(slice(None, None, 2),) * array.ndim]
    view[...] = array
    return view


def read_only(array):
    copy = array.copy()
    copy.flags.writeable = False
    return copy


LAYOUTS = {
    "fortran": np.asfortranarray,
    "transposed twice": lambda a: np.ascontiguousarray(a.T).T,
    "strided": strided,
    "reversed": lambda a: np.ascontiguousarray(a[(slice(None, None, -1),) * a.ndim])[
        (slice(None, None, -1),) * a.ndim
    ],
    "unaligned": unaligned,
    "read-only": read_only,
    "big-endian": lambda a: a.astype(a.dtype.newbyteorder(">")),
    "unaligned big-endian": lambda a: unaligned(a.astype(a.dtype.newbyteorder(">"))),
    "subclass": lambda a: a.view(type("Sub", (np.ndarray,), {})),
    "memory from bytes": lambda a: np.frombuffer(a.tobytes(), dtype=a.dtype).reshape(a.shape),
}
BAD_TYPES = {
    "None": None,
    "text": "0.5",
    "list of text": ["1", "2", "3"],
    "bytes": b"abc",
    "dict": {},
    "set": {1.0, 2.0},
    "class": np.ndarray,
    "object": object(),
    "complex list": [1j, 2j],
    "bool list": [True, False],
    "ragged": [[1.0, 2.0], [3.0]],
    "generator": (x for x in (1.0, 2.0)),
}
BAD_DTYPES = ["int8", "int32", "int64", "uint8", "uint64", "bool", "complex64", "complex128", "float16"]
BAD_DTYPES += ["longdouble", "U3", "S3", "O", "M8[s]", "m8[s]"]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_a_landscape_is_read_right_in_any_layout(read, layout, dtype):
    pixels = PIXELS.astype(dtype)
    before = layout(pixels)
    np.testing.assert_array_equal(read(before), read(pixels))
    np.testing.assert_array_equal(before, pixels)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
@pytest.mark.parametrize("name", TAKERS)
def test_small_arrays_are_read_right_in_any_layout(name, layout, dtype):
    numbers = GOOD[name].astype(dtype)
    before = layout(numbers)
    np.testing.assert_array_equal(TAKERS[name](before), TAKERS[name](numbers))
    np.testing.assert_array_equal(before, numbers)


def test_a_transposed_landscape_is_not_read_as_its_transpose():
    for draw in (gibbs_sample, sample):
        samples = draw(PIXELS.T, 200, seed=0)
        assert samples[:, 0].max() < SHAPE[0] and samples[:, 1].max() < SHAPE[1]
        assert (PIXELS[samples[:, 0], samples[:, 1]] > 0).all()


@pytest.mark.parametrize("name", [name for name in TAKERS if not name.endswith(("width", "matrix"))])
def test_lists_of_numbers_are_as_good_as_arrays(name):
    np.testing.assert_array_equal(TAKERS[name](GOOD[name].tolist()), TAKERS[name](GOOD[name]))
    rounded = np.ceil(GOOD[name])
    whole = [[int(x) for x in row] for row in rounded] if rounded.ndim == 2 else [int(x) for x in rounded]
    np.testing.assert_array_equal(TAKERS[name](whole), TAKERS[name](rounded))


@pytest.mark.parametrize("bad", BAD_TYPES.values(), ids=BAD_TYPES)
@pytest.mark.parametrize("take", [*READERS.values(), *TAKERS.values()], ids=[*READERS, *TAKERS])
def test_wrong_types_are_refused(take, bad):
    if bad is None and take in (TAKERS["weights"], TAKERS["batch weights"]):
        take(None)  # None stands for equal weights.
        return
    with pytest.raises(Error):
        take(bad)


@pytest.mark.parametrize("dtype", BAD_DTYPES)
@pytest.mark.parametrize("take", READERS.values(), ids=READERS)
def test_landscapes_of_other_dtypes_are_refused_by_name(take, dtype):
    with pytest.raises(
        motorprime.errors.ArgumentTypeError, match=r"landscape must be an array of float32"
    ) as info:
        take(np.ones(SHAPE).astype(dtype))
    assert "got an array of" in str(info.value)


@pytest.mark.parametrize("dtype", BAD_DTYPES)
@pytest.mark.parametrize("name", TAKERS)
def test_small_arrays_of_other_dtypes_are_refused_by_name(name, dtype):
    with pytest.raises(motorprime.errors.ArgumentTypeError, match="must be an array of float32 or float64"):
        TAKERS[name](np.ones_like(GOOD[name]).astype(dtype))


@pytest.mark.parametrize("shape", [(), (1,), (0,), (0, 5), (5, 0), (2, 3, 4), (1,) * 6, (1,) * 20])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("take", READERS.values(), ids=READERS)
def test_landscapes_of_other_shapes_are_refused(take, shape, dtype):
    with pytest.raises(motorprime.errors.ArgumentError, match="landscape must be"):
        take(np.ones(shape, dtype=dtype))


@pytest.mark.parametrize(
    "shape", [(), (1,), (0,), (0, 2), (5, 0), (2, 3, 4), (1,) * 6, (7, 5), (31, 2), (31,)]
)
@pytest.mark.parametrize("name", TAKERS)
def test_small_arrays_of_other_shapes_are_refused_or_fit(name, shape):
    array = np.ones(shape)
    if shape == () and "width" in name:
        np.testing.assert_array_equal(TAKERS[name](array), TAKERS[name](1.0))
        return
    if (shape in [(0, 2), (31, 2)] and name in ("mlp", "jacobian")) or (
        shape == (31, 2) and name.endswith(("points", "pixels"))
    ):
        TAKERS[name](array)
        return
    if shape == (0, 2) and name == "step pixels":
        with pytest.raises(motorprime.errors.NotInViewError):
            TAKERS[name](array)
        return
    with pytest.raises(motorprime.errors.ArgumentError):
        TAKERS[name](array)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("name", TAKERS)
def test_what_is_not_finite_is_named_with_its_index(name, dtype, bad):
    array = GOOD[name].astype(dtype)
    array.flat[-1] = bad
    if math.isnan(bad) and name == "step pixels":
        TAKERS[name](array)  # NaN marks a point that has no pixel.
        return
    with pytest.raises(motorprime.errors.ArgumentError, match=r"(finite|between).*got -?(NaN|inf).*\["):
        TAKERS[name](array)


def test_a_masked_array_is_refused():
    masked = np.ma.masked_less(PIXELS, 1e-3)
    for read in READERS.values():
        with pytest.raises(motorprime.errors.ArgumentTypeError, match="without a mask"):
            read(masked)


SCALARS = {
    "cutoff": lambda x: gaussian_landscape((5, 5), (2, 0, 2), SHAPE, cutoff=x),
    "mixing": lambda x: gaussian_landscape((5, 5), (2, 0, 2), SHAPE, mixing=x),
    "fraction": lambda x: threshold(PIXELS, fraction=x),
    "width": lambda x: kernel_landscape(POINTS, SHAPE, width=x),
    "min_distance": lambda x: sample(PIXELS, 9, seed=1, min_distance=x),
    "step width": lambda x: step(MATRIX, PATH, width=x),
    "step fraction": lambda x: step(MATRIX, PATH, windows=None, fraction=x),
    "step cutoff": lambda x: step(MATRIX, PATH, cutoff=x),
    "step mixing": lambda x: step(MATRIX, PATH, mixing=x),
}
INTEGERS = {
    "count": lambda x: threshold(PIXELS, count=x),
    "stride": lambda x: threshold(PIXELS, count=1, stride=x),
    "n": lambda x: gibbs_sample(PIXELS, x),
    "burn_in": lambda x: gibbs_sample(PIXELS, 1, burn_in=x),
    "thin": lambda x: gibbs_sample(PIXELS, 1, thin=x),
    "sample n": lambda x: sample(PIXELS, x),
    "shape": lambda x: gaussian_landscape((5, 5), (2, 0, 2), (x, 5)),
}


@pytest.mark.parametrize("good", [1, np.int32(1), np.float32(1), np.float64(1), 1.0])
@pytest.mark.parametrize("name", SCALARS)
def test_numpy_and_python_numbers_are_numbers(name, good):
    np.testing.assert_array_equal(SCALARS[name](good), SCALARS[name](1.0))


@pytest.mark.parametrize("bad", ["1", True, np.True_, 1j, np.complex64(1), object(), {}, b"1"], ids=repr)
@pytest.mark.parametrize("name", SCALARS)
def test_other_objects_are_no_numbers(name, bad):
    with pytest.raises(motorprime.errors.ArgumentTypeError, match=f"{name.split()[-1]} must be a number"):
        SCALARS[name](bad)


@pytest.mark.parametrize("bad", [10**400, -(10**400)])
@pytest.mark.parametrize("name", SCALARS)
def test_a_number_beyond_float64_is_an_error(name, bad):
    with pytest.raises(motorprime.errors.ArgumentError, match=name.split()[-1]):
        SCALARS[name](bad)


@pytest.mark.parametrize("good", [1, np.int8(1), np.uint64(1)])
@pytest.mark.parametrize("name", INTEGERS)
def test_numpy_and_python_integers_are_whole_numbers(name, good):
    INTEGERS[name](good)


@pytest.mark.parametrize("bad", ["1", True, 1.0, np.float64(1), None, object(), [1]], ids=repr)
@pytest.mark.parametrize("name", INTEGERS)
def test_other_objects_are_no_whole_numbers(name, bad):
    with pytest.raises(
        Error, match=f"{name.split()[-1]} (must be a whole number|.*must be given)|fraction or count"
    ):
        INTEGERS[name](bad)


@pytest.mark.parametrize("bad", [-1, -(10**30), 10**30])
@pytest.mark.parametrize("name", INTEGERS)
def test_negative_and_huge_whole_numbers_are_refused(name, bad):
    with pytest.raises(motorprime.errors.ArgumentError, match=name.split()[-1]):
        INTEGERS[name](bad)


@pytest.mark.parametrize(
    "bad", [5, "ab", None, (5,), (5, 6, 7), (5.0, 6.0), [], np.array([5, 6]), (True, 5)], ids=repr
)
def test_other_objects_are_no_shapes(bad):
    with pytest.raises(Error, match="shape must be"):
        kernel_landscape(POINTS, bad, width=3.0)


@pytest.mark.parametrize(
    "bad", [1, None, b"triangular", "Triangular", "", "tri\0angular", "\ud800"], ids=repr
)
def test_other_objects_are_no_names(bad):
    with pytest.raises(Error, match="kernel must be"):
        kernel_landscape(POINTS, SHAPE, width=3.0, kernel=bad)
    with pytest.raises(Error, match="method must be"):
        threshold(PIXELS, count=1, method=bad)


WRITERS = {
    "gaussian": lambda out: gaussian_landscape((5.0, 5.0), (2.0, 0.0, 2.0), SHAPE, out=out),
    "kernel": lambda out: kernel_landscape(POINTS, SHAPE, width=3.0, out=out),
    "gaussians": lambda out: gaussian_landscapes([(5.0, 5.0)], [(2.0, 0.0, 2.0)], SHAPE, out=[out])[0],
    "kernels": lambda out: kernel_landscapes([POINTS], SHAPE, width=3.0, out=[out])[0],
}


@pytest.mark.parametrize("name", WRITERS)
def test_out_is_written_whole_and_returned(name):
    out = np.full(SHAPE, np.nan, dtype=np.float32)
    assert WRITERS[name](out) is out
    np.testing.assert_array_equal(out, WRITERS[name.removesuffix("s")](None))


@pytest.mark.parametrize(
    "bad",
    [
        np.zeros(SHAPE),
        np.zeros(SHAPE, dtype=np.int32),
        np.zeros(SHAPE, dtype=">f4"),
        np.zeros(SHAPE[::-1], dtype=np.float32),
        np.zeros(SHAPE[::-1], dtype=np.float32).T,
        np.zeros((12, 34), dtype=np.float32)[:, ::2],
        np.zeros(SHAPE, dtype=np.float32)[::-1],
        np.zeros((1, *SHAPE), dtype=np.float32),
        np.zeros((), dtype=np.float32),
        unaligned(np.zeros(SHAPE, dtype=np.float32)),
        read_only(np.zeros(SHAPE, dtype=np.float32)),
        np.broadcast_to(np.float32(0), SHAPE),
        [[0.0] * 17] * 12,
        "out",
    ],
    ids=[
        "float64",
        "int32",
        "big-endian",
        "transposed shape",
        "transposed",
        "strided",
        "reversed",
        "3-d",
        "0-d",
        "unaligned",
        "read-only",
        "broadcast",
        "list",
        "text",
    ],
)
@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)
def test_an_out_that_cannot_be_written_is_refused_and_left_alone(write, bad):
    with pytest.raises(
        Error, match=r"out(\[0\])? must be a writable C-contiguous float32 array of shape \(12, 17\)"
    ):
        write(bad)
    assert not isinstance(bad, np.ndarray) or not bad.any()


def test_an_out_that_overlaps_an_input_is_refused():
    memory = np.zeros(SHAPE[0] * SHAPE[1] * 2)
    memory[:60] = POINTS.ravel()
    points = memory[:60].reshape(30, 2)
    out = memory.view(np.float32)[: SHAPE[0] * SHAPE[1]].reshape(SHAPE)
    with pytest.raises(motorprime.errors.ArgumentError, match="out overlaps an input"):
        kernel_landscape(points, SHAPE, width=3.0, out=out)
    with pytest.raises(motorprime.errors.ArgumentError, match=r"out\[1\] overlaps an input"):
        kernel_landscapes([points] * 2, SHAPE, width=3.0, out=[np.zeros(SHAPE, dtype=np.float32), out])
    with pytest.raises(motorprime.errors.ArgumentError, match="out overlaps an input"):
        gaussian_landscape(points[0], (1.0, 0.0, 1.0), SHAPE, out=out)
    np.testing.assert_array_equal(points, POINTS)


@pytest.mark.parametrize("dtype", ["<f8", ">f8", "<f4"])
@pytest.mark.parametrize("step", [1, -1, 3])
def test_an_out_between_the_points_of_a_strided_input_overlaps_it(dtype, step):
    memory = np.zeros(5000, dtype=np.uint8)
    points = memory[:4800].view(dtype)[: 60 * abs(step)][::step].reshape(30, 2)
    nbytes = 4 * SHAPE[0] * SHAPE[1]
    last = (59 * abs(step) + 1) * np.dtype(dtype).itemsize
    clear, touching = (memory[i : i + nbytes].view(np.float32).reshape(SHAPE) for i in (last, last - 4))
    assert kernel_landscape(points, SHAPE, width=3.0, out=clear) is clear
    with pytest.raises(motorprime.errors.ArgumentError, match="out overlaps an input"):
        kernel_landscape(points, SHAPE, width=3.0, out=touching)


def test_one_out_cannot_be_two_landscapes():
    out = np.zeros(SHAPE, dtype=np.float32)
    with pytest.raises(Error, match=r"out\[1\]"):
        kernel_landscapes([POINTS] * 2, SHAPE, width=3.0, out=[out, out])
    kernel_landscape(POINTS, SHAPE, width=3.0, out=out)


def test_an_image_too_large_for_memory_is_an_error_of_python():
    with pytest.raises((MemoryError, Error)):
        kernel_landscape(POINTS, (2**31 - 1, 2**20), width=3.0)


def test_errors_are_also_what_python_users_expect():
    with pytest.raises(ValueError, match="width"):
        kernel_landscape(POINTS, SHAPE, width=-1)
    with pytest.raises(TypeError, match="landscape"):
        threshold([[1.0]], fraction=0.5)
