"""The threshold: its definition, and its two methods as each other's oracle."""

import math
import os
import subprocess
import sys
import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import motorprime.errors
import reference
from motorprime.landscape import kernel_landscape, threshold

examples = settings(deadline=None, derandomize=True, max_examples=200)
sizes = st.tuples(st.integers(1, 30), st.integers(1, 30))
few_values = st.sampled_from([0.0, 0.0, 0.25, 0.5, 1.0, 2.0**127, 2.0**-149])
anything = st.floats(0, 2.0**127, width=32)


def landscapes(elements, dtype=np.float32):
    return sizes.flatmap(lambda shape: hnp.arrays(dtype, shape, elements=elements)).filter(np.any)


@examples
@given(landscapes(few_values) | landscapes(anything), st.floats(1e-6, 1))
def test_is_the_largest_value_that_leaves_enough_pixels(landscape, fraction):
    wanted = math.ceil(fraction * landscape.size - 1e-9)
    d = threshold(landscape, fraction=fraction)
    assert d == threshold(landscape, fraction=fraction, method="quicksort")
    assert d == reference.threshold(landscape, fraction=fraction)
    positive = landscape[landscape > 0]
    if len(positive) < wanted:
        assert d == positive.min()
    else:
        assert (landscape >= d).sum() >= wanted
        assert (landscape > d).sum() < wanted


@examples
@given(landscapes(few_values) | landscapes(anything), st.integers(1, 2000), st.integers(1, 9))
def test_a_count_is_of_full_image_pixels_and_a_stride_divides_it(landscape, count, stride):
    if not landscape[::stride, ::stride].any():
        with pytest.raises(motorprime.errors.ArgumentError, match=r"zero on every pixel|zero everywhere"):
            threshold(landscape, count=count, stride=stride)
        return
    d = threshold(landscape, count=count, stride=stride)
    assert d == threshold(landscape, count=count, stride=stride, method="quicksort")
    assert d == reference.threshold(landscape, count=count, stride=stride)


@examples
@given(landscapes(st.floats(0, 1e300), np.float64), st.integers(1, 900))
def test_float64_is_compared_in_float64(landscape, count):
    d = threshold(landscape, count=count)
    assert d == threshold(landscape, count=count, method="quicksort")
    assert d in landscape
    assert (landscape >= d).sum() >= min(count, (landscape > 0).sum())


@pytest.mark.parametrize("method", ["select", "quicksort"])
@pytest.mark.parametrize("fraction", [0.01, 0.3, 0.9, 1.0])
def test_both_methods_on_orders_that_are_hard_for_quicksort(method, fraction):
    rising = np.linspace(1, 2, 76_800, dtype=np.float32)
    trajectory = np.random.default_rng(0).uniform(0, 240, (50, 2))
    organ_pipe = np.concatenate([rising[::2], rising[::-2]])
    hard = [
        rising,
        rising[::-1],
        organ_pipe,
        np.ones_like(rising),
        np.repeat([1.0, 2.0], 38_400).astype(np.float32),
        median_of_three_killer(76_800),
        kernel_landscape(trajectory, (240, 320), width=40).ravel(),
    ]
    for pixels in hard:
        landscape = pixels.reshape(240, 320)
        d = threshold(landscape, fraction=fraction, method=method)
        assert d == reference.threshold(landscape, fraction=fraction)


def median_of_three_killer(size):
    """An order for which the median of three splits off two elements at a time (Musser, 1997)."""
    half = size // 2
    order = np.empty(size, dtype=np.float32)
    odd = np.arange(1, half + 1) % 2 == 1
    index = np.arange(1, half + 1)
    order[:half] = np.where(odd, index, half + index - 1)
    order[half:] = 2 * index
    return order + 1


def test_the_share_asked_for_is_the_share_kept():
    landscape = np.random.default_rng(0).permutation(76_800).reshape(240, 320).astype(np.float32) + 1
    for fraction in (0.1, 0.3, 0.5, 1.0):
        kept = (landscape >= threshold(landscape, fraction=fraction)).sum()
        assert kept == round(fraction * 76_800)


def test_rounding_does_not_ask_for_one_pixel_too_many():
    landscape = np.arange(1, 11, dtype=np.float32).reshape(2, 5)
    assert 0.3 * 10 <= 3 < 0.7 * 10 + 1e-9
    assert threshold(landscape, fraction=0.3) == 8
    assert threshold(landscape, fraction=0.7) == 4
    assert threshold(landscape, fraction=0.1 + 0.2) == 8
    assert threshold(landscape, fraction=1e-12) == 10


def test_ties_are_all_kept():
    landscape = np.array([[3, 2, 2], [2, 1, 0]], dtype=np.float32)
    assert threshold(landscape, count=2) == 2
    assert threshold(landscape, count=4) == 2
    assert threshold(landscape, count=5) == 1


def test_more_than_there_is_gives_the_smallest_positive_value():
    landscape = np.array([[0, 0, 0.5], [2, 0, 0]], dtype=np.float32)
    assert threshold(landscape, count=6) == 0.5
    assert threshold(landscape, count=10**18) == 0.5
    assert threshold(landscape, fraction=1.0) == 0.5


def test_stride_four_is_the_papers_subsample():
    landscape = kernel_landscape(np.random.default_rng(3).uniform(0, 240, (50, 2)), (240, 320), width=40)
    assert landscape[::4, ::4].size == 4800
    expected = reference.threshold(landscape[::4, ::4], fraction=0.3)
    assert threshold(landscape, fraction=0.3, stride=4) == expected
    assert threshold(landscape, count=23_040, stride=4) == expected


def test_a_stride_beyond_the_image_reads_the_first_pixel():
    landscape = np.array([[0.5, 2.0], [3.0, 4.0]], dtype=np.float32)
    assert threshold(landscape, fraction=1.0, stride=10**12) == 0.5


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({}, "fraction or count must be given"),
        ({"fraction": 0.5, "count": 3}, "fraction and count must not both be given"),
        ({"fraction": 0.0}, r"fraction must be in \(0, 1\], got 0.0"),
        ({"fraction": 1.0000001}, "fraction"),
        ({"fraction": -0.5}, "fraction"),
        ({"fraction": math.nan}, "fraction"),
        ({"count": 0}, "count must be a whole number of at least 1"),
        ({"count": -3}, "count.*-3"),
        ({"count": 10**30}, "count"),
        ({"count": 1, "stride": 0}, "stride"),
        ({"count": 1, "stride": -1}, "stride.*-1"),
        ({"count": 1, "method": "heapsort"}, "method must be one of 'select', 'quicksort', got 'heapsort'"),
    ],
)
def test_values_outside_their_domain_are_named(arguments, words):
    with pytest.raises(motorprime.errors.ArgumentError, match=words):
        threshold(np.ones((4, 5), dtype=np.float32), **arguments)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, -1.0, -1e-30])
def test_a_pixel_that_is_no_relevance_is_named(dtype, bad):
    landscape = np.ones((4, 5), dtype=dtype)
    landscape[2, 3] = bad
    with pytest.raises(motorprime.errors.ArgumentError, match=r"landscape must be finite.*landscape\[2, 3\]"):
        threshold(landscape, fraction=0.5)


def test_a_landscape_of_zeros_is_an_error():
    with pytest.raises(motorprime.errors.ArgumentError, match="landscape is zero everywhere"):
        threshold(np.zeros((4, 5), dtype=np.float32), fraction=0.5)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("method", ["select", "quicksort"])
@pytest.mark.parametrize("shape", [(12, 17), (240, 320)])
def test_with_a_stride_only_the_pixels_that_are_read_are_checked(shape, method, dtype):
    landscape = np.full(shape, math.nan, dtype=dtype)
    landscape[::4, ::4] = np.random.default_rng(5).uniform(size=shape)[::4, ::4]
    expected = reference.threshold(landscape[::4, ::4], fraction=0.3)
    assert threshold(landscape, fraction=0.3, stride=4, method=method) == expected
    landscape[8, 12] = math.nan
    with pytest.raises(
        motorprime.errors.ArgumentError, match=r"landscape must be finite.*landscape\[8, 12\]"
    ):
        threshold(landscape, fraction=0.3, stride=4, method=method)


@pytest.mark.parametrize("method", ["select", "quicksort"])
def test_minus_zero_is_a_zero(method):
    landscape = np.full((60, 70), -0.0, dtype=np.float32)
    with pytest.raises(motorprime.errors.ArgumentError, match="landscape is zero everywhere"):
        threshold(landscape, fraction=0.5, method=method)
    landscape[30, 40] = 0.25
    landscape[::2] += 0.0
    assert threshold(landscape, fraction=0.5, method=method) == 0.25


def adversaries():
    """Full-size landscapes whose content is hard on a selection by sampling."""
    rng = np.random.default_rng(7)
    noise = rng.random((240, 320), dtype=np.float32)
    plateau = noise.copy()
    plateau[:, ::2] = 0.65
    single = np.zeros_like(noise)
    single[100, 7] = 1
    return {
        "noise": noise,
        "plateau": plateau,
        "columns": np.tile(np.arange(320, dtype=np.float32), (240, 1)),
        "one pixel": single,
        "all but one": np.float32(1) - single,
        "denormals": (noise * 1e-42).astype(np.float32),
        "magnitudes": np.exp(170 * noise - 85).astype(np.float32),
        "minus zeros": np.where(noise < 0.7, np.float32(-0.0), noise),
        "largest": np.where(noise < 0.7, noise, np.finfo(np.float32).max),
    }


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("name", adversaries())
def test_hard_contents(name, dtype):
    landscape = adversaries()[name].astype(dtype)
    for fraction in (1e-9, 0.001, 0.3, 0.5, 0.7, 0.999, 1.0):
        for stride in (1, 2, 3, 4):
            if landscape[::stride, ::stride].any():
                d = threshold(landscape, fraction=fraction, stride=stride)
                assert d == reference.threshold(landscape[::stride, ::stride], fraction=fraction)


def test_a_thread_and_a_size_do_not_disturb_another():
    rng = np.random.default_rng(9)
    landscapes = [rng.random((h, w)) for h, w in [(5, 7), (240, 320), (64, 48)]]
    landscapes += [landscape.astype(np.float32) for landscape in landscapes]
    expected = [reference.threshold(landscape, fraction=0.3) for landscape in landscapes]
    wrong = []

    def run():
        for _ in range(30):
            found = [threshold(landscape, fraction=0.3) for landscape in landscapes]
            if found != expected:
                wrong.append(found)

    threads = [threading.Thread(target=run) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


ON_A_SET = """
import numpy as np
from motorprime.landscape import threshold
noise = np.random.default_rng(3).random((240, 320))
for dtype in (np.float32, np.float64):
    for stride in (1, 3, 4):
        print(threshold(noise.astype(dtype), fraction=0.3, stride=stride).hex())
"""


def test_every_instruction_set_gives_the_same_number():
    def on(simd):
        environment = {**os.environ, "MOTORPRIME_SIMD": simd}
        done = subprocess.run(
            [sys.executable, "-c", ON_A_SET], env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert on("baseline") == on("avx2") == on("avx512") != ""
