"""What holds for the landscapes together: batches, threads, processes and determinism."""

import hashlib
import multiprocessing
import threading

import numpy as np
import pytest

import motorprime.errors
from motorprime.landscape import (
    gaussian_landscape,
    gaussian_landscapes,
    gibbs_sample,
    kernel_landscape,
    kernel_landscapes,
    threshold,
)

SHAPE = (60, 80)
RNG = np.random.default_rng(0)
STEREO = [RNG.uniform(-20, 90, (50, 2)), RNG.uniform(-20, 90, (33, 2))]


def test_a_batch_of_trajectories_is_bit_for_bit_the_single_calls():
    weights = [None, RNG.uniform(0, 1, 33)]
    width = [(20.0, 12.0), RNG.uniform(5, 30, 33)]
    for kernel in ("triangular", "gaussian"):
        batch = kernel_landscapes(STEREO, SHAPE, width=width, kernel=kernel, weights=weights)
        for got, points, h, w in zip(batch, STEREO, width, weights, strict=True):
            single = kernel_landscape(points, SHAPE, width=h, kernel=kernel, weights=w)
            np.testing.assert_array_equal(got, single)


def test_a_number_or_a_pair_is_the_width_of_the_whole_batch():
    for width in (15.0, (15.0, 20.0)):
        batch = kernel_landscapes(STEREO, SHAPE, width=width)
        for got, points in zip(batch, STEREO, strict=True):
            np.testing.assert_array_equal(got, kernel_landscape(points, SHAPE, width=width))


def test_a_batch_of_gaussians_is_bit_for_bit_the_single_calls():
    means = RNG.uniform(0, 60, (9, 2))
    chols = RNG.uniform(3, 20, (9, 3))
    batch = gaussian_landscapes(means, chols, SHAPE, cutoff=2.5, mixing=0.6)
    for got, mean, chol in zip(batch, means, chols, strict=True):
        np.testing.assert_array_equal(got, gaussian_landscape(mean, chol, SHAPE, cutoff=2.5, mixing=0.6))


def test_a_batch_writes_to_the_arrays_it_is_given():
    pair = np.full((2, *SHAPE), np.nan, dtype=np.float32)
    got = kernel_landscapes(STEREO, SHAPE, width=9.0, out=[pair[0], pair[1]])
    np.testing.assert_array_equal(pair, kernel_landscapes(STEREO, SHAPE, width=9.0))
    assert all(np.shares_memory(a, b) for a, b in zip(got, pair, strict=True))


def test_an_empty_batch_is_an_empty_list():
    assert kernel_landscapes([], SHAPE, width=9.0) == []
    assert gaussian_landscapes(np.zeros((0, 2)), np.zeros((0, 3)), SHAPE) == []


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: kernel_landscapes([STEREO[0], np.zeros((3, 3))], SHAPE, width=9.0),
            r"points\[1\] must be \(N, 2\)",
        ),
        (
            lambda: kernel_landscapes([STEREO[0], np.full((3, 2), np.nan)], SHAPE, width=9.0),
            r"points\[1\] must be",
        ),
        (lambda: kernel_landscapes(STEREO, SHAPE, width=[9.0, -1.0]), r"width\[1\] must be positive"),
        (lambda: kernel_landscapes(STEREO, SHAPE, width=[9.0]), "width must be a list of 2"),
        (lambda: kernel_landscapes(STEREO, SHAPE, width=-1.0), "width must be positive"),
        (lambda: kernel_landscapes(STEREO, SHAPE, width=9.0, weights=[None]), "weights must be a list of 2"),
        (lambda: kernel_landscapes(STEREO, SHAPE, width=9.0, out=[]), "out must be a list of 2"),
        (
            lambda: gaussian_landscapes([[1, 1], [2, 2]], [[1, 0, 1]], SHAPE),
            "chols must be one per row of means",
        ),
        (lambda: gaussian_landscapes([[1, 1], [2, 2]], [[1, 0, 1], [1, 0, 0]], SHAPE), r"chols\[1\]\[2\]"),
        (lambda: gaussian_landscapes([[1, 1]], [[1, 0, 1]], SHAPE, cutoff=0), "cutoff must be positive"),
    ],
)
def test_errors_name_the_item_of_the_batch(call, words):
    with pytest.raises(motorprime.errors.ArgumentError, match=words):
        call()


def test_a_batch_is_no_single_array():
    with pytest.raises(motorprime.errors.ArgumentTypeError, match="points must be a list"):
        kernel_landscapes(STEREO[0], SHAPE, width=9.0)


def fingerprint():
    """One number that changes with any bit of any kernel's result."""
    points = np.random.default_rng(1).uniform(0, 80, (100, 2))
    triangles = kernel_landscape(points, SHAPE, width=(17.0, 11.0))
    gaussians = kernel_landscape(points, SHAPE, width=7.0, kernel="gaussian")
    ellipse = gaussian_landscape((33.3, 22.2), (20.0, -7.0, 9.0), SHAPE, mixing=0.7)
    samples = gibbs_sample(triangles, 50, seed=5)
    parts = [triangles, gaussians, ellipse, samples, np.array(threshold(ellipse, fraction=0.2))]
    return hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest()


def test_threads_do_not_disturb_each_other():
    expected = fingerprint()
    found = []
    threads = [threading.Thread(target=lambda: found.append(fingerprint())) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [expected] * 8


def test_a_landscape_can_be_read_by_many_threads_at_once():
    landscape = kernel_landscape(STEREO[0], SHAPE, width=20.0)
    expected = gibbs_sample(landscape, 5000, seed=1)
    found = []
    threads = [
        threading.Thread(target=lambda: found.append(gibbs_sample(landscape, 5000, seed=1))) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4 and all(np.array_equal(samples, expected) for samples in found)


def _batch_in_child(queue):
    queue.put([landscape.sum() for landscape in kernel_landscapes(STEREO, SHAPE, width=9.0)])


@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no fork on this system")
def test_batches_work_in_a_forked_child_too():
    """The parent's worker threads do not exist in the child; it must not wait for them."""
    expected = [landscape.sum() for landscape in kernel_landscapes(STEREO, SHAPE, width=9.0)]
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_batch_in_child, args=(queue,))
    child.start()
    assert queue.get(timeout=60) == expected
    child.join()
