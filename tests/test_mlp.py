"""The small network against its twin, and its Jacobian against finite differences."""

import copy
import itertools
import math
import pickle
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import motorprime.errors
import reference
from motorprime._core import Mlp

examples = settings(deadline=None, derandomize=True, max_examples=60)
layouts = st.lists(st.integers(1, 9), min_size=2, max_size=5)
seeds = st.integers(0, 2**32 - 1)


def network(sizes, seed):
    """A network of these sizes with the arrays it was made from."""
    rng = np.random.default_rng(seed)
    weights = [rng.normal(0, 1 / math.sqrt(i), (o, i)) for i, o in itertools.pairwise(sizes)]
    biases = [rng.normal(0, 0.5, o) for o in sizes[1:]]
    inputs = rng.normal(0, 3, sizes[0]), rng.uniform(0.1, 4, sizes[0])
    outputs = rng.normal(0, 100, sizes[-1]), rng.uniform(1, 100, sizes[-1])
    return Mlp(weights, biases, *inputs, *outputs), (weights, biases, inputs, outputs)


def batch(arrays, rows, seed):
    """Inputs that the network's scale puts around the origin."""
    mean, std = arrays[2]
    return np.random.default_rng(seed + 1).normal(mean, 2 * std, (rows, len(mean)))


@examples
@given(layouts, seeds, st.integers(0, 40))
def test_agrees_with_the_twin(sizes, seed, rows):
    mlp, arrays = network(sizes, seed)
    x = batch(arrays, rows, seed)
    y = mlp(x)
    assert y.dtype == np.float32 and y.shape == (rows, sizes[-1])
    assert mlp.sizes == tuple(sizes)
    np.testing.assert_allclose((y - reference.mlp(x, *arrays)) / arrays[3][1], 0, atol=2e-5)


@examples
@given(layouts, seeds, st.integers(1, 20))
def test_the_jacobian_is_the_slope_of_raw_outputs_by_raw_inputs(sizes, seed, rows):
    mlp, arrays = network(sizes, seed)
    x = batch(arrays, rows, seed)
    jacobian = mlp.jacobian(x)
    assert jacobian.dtype == np.float32 and jacobian.shape == (rows, sizes[-1], sizes[0])
    for i in range(sizes[0]):
        step = np.zeros(sizes[0])
        step[i] = 1e-5 * arrays[2][1][i]
        rise = reference.mlp(x + step, *arrays) - reference.mlp(x - step, *arrays)
        unit = arrays[3][1] / arrays[2][1][i]
        np.testing.assert_allclose((jacobian[:, :, i] - rise / (2 * step[i])) / unit, 0, atol=2e-5)


def test_the_projection_of_the_paper():
    mlp, arrays = network((12, 25, 25, 2), 0)
    x = batch(arrays, 50, 0)
    np.testing.assert_allclose(mlp(x), reference.mlp(x, *arrays), atol=1e-3)
    np.testing.assert_allclose(mlp(x.astype(np.float32)), mlp(x), atol=1e-2)


def test_one_layer_is_linear_and_has_no_tanh():
    mlp = Mlp([[[2.0, 3.0]]], [[1.0]], [10.0, 20.0], [1.0, 2.0], [5.0], [10.0])
    np.testing.assert_allclose(mlp([[11.0, 24.0]]), [[(2 * 1 + 3 * 2 + 1) * 10 + 5]])
    np.testing.assert_allclose(mlp.jacobian([[11.0, 24.0]]), [[[20.0, 15.0]]])


def test_tanh_is_on_the_hidden_layer_only():
    mlp = Mlp([[[1.0]], [[3.0]]], [[0.0], [0.5]], [0.0], [1.0], [0.0], [1.0])
    np.testing.assert_allclose(
        mlp([[0.7], [-0.7]]).ravel(), [3 * math.tanh(0.7) + 0.5, -3 * math.tanh(0.7) + 0.5]
    )


def test_saturates_without_overflow():
    mlp, _ = network((3, 5, 2), 1)
    y = mlp([[1e30, -1e30, 1e30]])
    assert np.isfinite(y).all()
    assert not mlp.jacobian([[1e30, -1e30, 1e30]]).any()


def test_every_row_is_on_its_own():
    mlp, arrays = network((4, 7, 3), 2)
    x = batch(arrays, 37, 2)
    together = mlp(x)
    np.testing.assert_array_equal(together, np.concatenate([mlp(row[None]) for row in x]))
    np.testing.assert_array_equal(mlp(x[::-1]), together[::-1])
    np.testing.assert_array_equal(mlp(np.asfortranarray(x)), together)


def test_no_rows_give_no_rows():
    mlp, _ = network((4, 7, 3), 2)
    assert mlp(np.zeros((0, 4))).shape == (0, 3)
    assert mlp.jacobian(np.zeros((0, 4))).shape == (0, 3, 4)


def test_copies_and_pickles_are_equal_networks():
    mlp, arrays = network((4, 7, 3), 2)
    x = batch(arrays, 5, 2)
    for twin in (copy.copy(mlp), copy.deepcopy(mlp), pickle.loads(pickle.dumps(mlp))):
        np.testing.assert_array_equal(twin(x), mlp(x))
    assert repr(mlp) == "Mlp(4-7-3)"


def test_later_changes_of_the_arrays_do_not_reach_the_network():
    weights = np.ones((1, 1))
    mlp = Mlp([weights], [[0.0]], [0.0], [1.0], [0.0], [1.0])
    weights[:] = 7
    assert mlp([[1.0]]).item() == 1


def broken(**changes):
    good = {
        "weights": [np.ones((3, 2)), np.ones((1, 3))],
        "biases": [np.zeros(3), np.zeros(1)],
        "input_mean": np.zeros(2),
        "input_std": np.ones(2),
        "output_mean": np.zeros(1),
        "output_std": np.ones(1),
    }
    return Mlp(**(good | changes))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"weights": []}, "weights must be a list of at least one matrix"),
        ({"weights": [np.ones((3, 2)), np.ones((1, 4))]}, r"weights\[1\] must be \(out, 3\).*got \(1, 4\)"),
        ({"weights": [np.ones(3), np.ones((1, 3))]}, r"weights\[0\] must be \(out, in\), got \(3,\)"),
        ({"weights": [np.ones((0, 2)), np.ones((1, 0))]}, r"weights\[0\]"),
        ({"biases": [np.zeros(3)]}, "biases must be one vector per layer, 2, got 1"),
        ({"biases": [np.zeros(3), np.zeros(2)]}, r"biases\[1\] must be \(1,\).*got \(2,\)"),
        ({"biases": [np.array([0, np.nan, 0]), np.zeros(1)]}, r"biases\[0\] must be finite.*\[1\]"),
        ({"weights": [np.full((3, 2), 1e300), np.ones((1, 3))]}, r"weights\[0\] must be finite in float32"),
        ({"input_mean": np.zeros(3)}, r"input_mean must be \(2,\), got \(3,\)"),
        ({"input_std": np.array([1.0, 0.0])}, r"input_std must be positive.*input_std\[1\]"),
        ({"output_std": np.array([-1.0])}, "output_std must be positive"),
        ({"output_mean": np.array([np.inf])}, "output_mean must be finite"),
    ],
)
def test_parts_that_do_not_fit_are_named(changes, words):
    with pytest.raises(motorprime.errors.ArgumentError, match=words):
        broken(**changes)


@pytest.mark.parametrize("call", [Mlp.__call__, Mlp.jacobian])
@pytest.mark.parametrize(
    ("x", "error", "words"),
    [
        (np.zeros((3, 5)), motorprime.errors.ArgumentError, r"x must be \(N, 2\), got \(3, 5\)"),
        (np.zeros(2), motorprime.errors.ArgumentError, r"x must be \(N, 2\), got \(2,\)"),
        (np.zeros((1, 2, 1)), motorprime.errors.ArgumentError, r"x must be \(N, 2\)"),
        (np.array([[0, 0], [0, np.nan]]), motorprime.errors.ArgumentError, r"x must be finite.*x\[1, 1\]"),
        (
            np.zeros((3, 2), dtype=np.int64),
            motorprime.errors.ArgumentTypeError,
            "x must be .*got an array of int64",
        ),
        ("text", motorprime.errors.ArgumentTypeError, "x must be"),
        (None, motorprime.errors.ArgumentTypeError, "x must be"),
    ],
)
def test_inputs_that_do_not_fit_are_named(call, x, error, words):
    with pytest.raises(error, match=words):
        call(broken(), x)


def test_an_output_beyond_float32_is_an_error():
    mlp = Mlp([[[3e38]]], [[0.0]], [0.0], [1.0], [0.0], [1.0])
    with pytest.raises(motorprime.errors.ArgumentError, match=r"x has a row 1 .* overflows float32"):
        mlp([[0.0], [1e9]])


CALLS = [(Mlp.__call__, (5, 3)), (Mlp.jacobian, (5, 3, 4))]


@pytest.mark.parametrize(("call", "shape"), CALLS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_writes_to_the_array_it_is_given(call, shape, dtype):
    mlp, arrays = network((4, 7, 3), 2)
    x = batch(arrays, 5, 2).astype(dtype)
    given = x.copy()
    out = np.full(shape, np.nan, dtype=np.float32)
    assert call(mlp, x, out=out) is out
    np.testing.assert_array_equal(out, call(mlp, x))
    np.testing.assert_array_equal(x, given)
    assert call(mlp, x, out=None) is not out


@pytest.mark.parametrize(("call", "shape"), CALLS)
def test_an_output_that_does_not_fit_is_named(call, shape):
    mlp, arrays = network((4, 7, 3), 2)
    x = batch(arrays, 5, 2)
    good = np.empty(shape, dtype=np.float32)
    read_only = good.copy()
    read_only.flags.writeable = False
    doubled = np.empty((*shape[:-1], 2 * shape[-1]), dtype=np.float32)
    wrong_values = [
        (np.empty((6, *shape[1:]), dtype=np.float32), r"got \(6, "),
        (np.empty(shape[1:], dtype=np.float32), "got "),
        (good.ravel(), "got "),
        (np.asfortranarray(good), "contiguous in C order"),
        (doubled[..., ::2], "contiguous in C order"),
        (read_only, "read-only"),
    ]
    for out, words in wrong_values:
        expected = "out must be a writable C-contiguous float32 array of shape .*" + words
        with pytest.raises(motorprime.errors.ArgumentError, match=expected):
            call(mlp, x, out=out)
    for out in (np.empty(shape), np.empty(shape, dtype=">f4"), good.tolist(), "text"):
        with pytest.raises(motorprime.errors.ArgumentTypeError, match="out must be a writable"):
            call(mlp, x, out=out)


def test_an_output_over_the_input_is_an_error():
    memory = np.zeros(40, dtype=np.float32)
    mlp = broken()
    x = memory[:12].reshape(6, 2)
    with pytest.raises(motorprime.errors.ArgumentError, match="out overlaps an input"):
        mlp(x, out=memory[11:17].reshape(6, 1))
    with pytest.raises(motorprime.errors.ArgumentError, match="out overlaps an input"):
        mlp.jacobian(x[::-1], out=memory[:12].reshape(6, 1, 2))
    assert mlp(x, out=memory[12:18].reshape(6, 1)).shape == (6, 1)


def test_one_bad_number_far_into_the_points_is_named():
    x = np.zeros((100, 2), dtype=np.float32)
    x[77, 1] = np.inf
    out = np.full((100, 1), 7, dtype=np.float32)
    with pytest.raises(motorprime.errors.ArgumentError, match=r"x must be finite, got inf at x\[77, 1\]"):
        broken()(x, out=out)
    assert (out == 7).all()


def test_a_masked_array_is_an_error():
    x = np.ma.masked_array(np.zeros((3, 2)), mask=True)
    with pytest.raises(motorprime.errors.ArgumentTypeError, match="x must be an array without a mask"):
        broken()(x)


@pytest.mark.parametrize("rows", [3, 2000])
def test_threads_share_a_network(rows):
    mlp, arrays = network((12, 25, 25, 2), 0)
    other, _ = network((12, 40, 2), 1)
    batches = [batch(arrays, rows + k, k) for k in range(4)]
    expected = [(net(x), net.jacobian(x)) for x in batches for net in (mlp, other)]
    start = threading.Barrier(4)

    def work(_):
        start.wait()
        for _ in range(5):
            results = [(net(x), net.jacobian(x)) for x in batches for net in (mlp, other)]
            for (y, slope), (right, right_slope) in zip(results, expected, strict=True):
                np.testing.assert_array_equal(y, right)
                np.testing.assert_array_equal(slope, right_slope)

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(work, range(4)))
