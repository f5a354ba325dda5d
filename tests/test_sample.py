"""The independent sampler: the pixels of its twin, the distribution and the distances that it promises."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import reference
from motorprime.errors import ArgumentError, ArgumentTypeError, Error
from motorprime.landscape import gaussian_landscape, gibbs_sample, sample

examples = settings(deadline=None, derandomize=True, max_examples=250)
sizes = st.tuples(st.integers(1, 40), st.integers(1, 40))
ties = st.sampled_from([0.0, 0.0, 0.0, 0.5, 1.0])
tiny = st.sampled_from([0.0, -0.0, 1e-45, 2.0**-149, 1e-38])
huge = st.floats(0, 2.0**127, width=32)
pixels = ties | tiny | huge
landscapes = sizes.flatmap(lambda s: hnp.arrays(np.float32, s, elements=pixels, fill=ties)).filter(np.any)
seeds = st.integers(0, 2**64 - 1)
distances = st.sampled_from([1e-200, 1e-9, 1.0, math.sqrt(2), 2.0, 5.0, 1e9, 1e200]) | st.floats(1e-3, 45)


def chi_square(counts, masses):
    """The statistic over what has mass, and its degrees of freedom."""
    expected = masses / masses.sum(dtype=float) * counts.sum()
    used = masses > 0
    assert not counts[~used].any()
    return ((counts - expected)[used] ** 2 / expected[used]).sum(), used.sum() - 1


def counted(shape, samples):
    counts = np.zeros(shape)
    np.add.at(counts, (samples[:, 1], samples[:, 0]), 1)
    return counts


def gaps(samples):
    """Distances between all pairs, infinite from a sample to itself."""
    offsets = samples[:, None].astype(float) - samples[None].astype(float)
    return np.hypot(offsets[..., 0], offsets[..., 1]) + np.where(np.eye(len(samples)), np.inf, 0.0)


def left_over(landscape, samples, distance):
    """The positive pixels that are far enough from all samples."""
    left = landscape > 0
    for u, v in samples.tolist():
        left &= ~reference.too_near(landscape.shape, (u, v), distance)
    return left


@examples
@given(landscapes, seeds, st.integers(0, 12))
def test_gives_the_pixels_of_its_twin_and_only_positive_ones(landscape, seed, n):
    samples = sample(landscape, n, seed=seed)
    assert samples.dtype == np.int32 and samples.shape == (n, 2)
    np.testing.assert_array_equal(samples, reference.sample(landscape, n, seed))
    assert (landscape[samples[:, 1], samples[:, 0]] > 0).all()
    np.testing.assert_array_equal(sample(landscape.astype(np.float64), n, seed=seed), samples)


@examples
@given(landscapes, seeds, st.integers(0, 12), distances)
def test_gives_the_pixels_of_its_twin_at_a_distance(landscape, seed, n, distance):
    samples = sample(landscape, n, seed=seed, min_distance=distance)
    np.testing.assert_array_equal(samples, reference.sample(landscape, n, seed, distance))
    assert (landscape[samples[:, 1], samples[:, 0]] > 0).all()
    assert not (gaps(samples) < distance).any()
    if len(samples) < n:
        assert not left_over(landscape, samples, distance).any()


@examples
@given(
    hnp.arrays(np.float64, st.tuples(st.integers(1, 20), st.integers(1, 20)), elements=st.floats(0, 1e38)),
    seeds,
    st.sampled_from([0.0, 1.5, 6.0]),
)
def test_a_landscape_of_float64_is_rounded_to_float32(landscape, seed, distance):
    landscape[0, 0] = 1.0
    samples = sample(landscape, 6, seed=seed, min_distance=distance)
    np.testing.assert_array_equal(samples, reference.sample(landscape, 6, seed, distance))
    rounded = landscape.astype(np.float32)
    np.testing.assert_array_equal(samples, sample(rounded, 6, seed=seed, min_distance=distance))


@pytest.mark.parametrize("shape", [(1, 1), (1, 37), (33, 1), (16, 16), (17, 31), (32, 48), (15, 65)])
def test_samples_follow_the_landscape(shape):
    landscape = np.random.default_rng(0).random(shape, dtype=np.float32)
    landscape[landscape < 0.2] = 0
    landscape[-1, -1] = 0.5
    samples = sample(landscape, 200_000, seed=5)
    statistic, degrees = chi_square(counted(shape, samples), landscape)
    assert degrees == 0 or statistic < reference.chi_square_bound(degrees)


def test_the_first_sample_of_many_seeds_follows_the_landscape():
    landscape = np.random.default_rng(0).random((6, 7), dtype=np.float32)
    samples = np.concatenate([sample(landscape, 1, seed=seed) for seed in range(20_000)])
    statistic, degrees = chi_square(counted(landscape.shape, samples), landscape)
    assert statistic < reference.chi_square_bound(degrees)


def test_successive_samples_do_not_depend_on_each_other():
    landscape = np.random.default_rng(3).random((4, 5), dtype=np.float32)
    samples = sample(landscape, 100_001, seed=8)
    places = samples[:, 1] * 5 + samples[:, 0]
    pairs = np.zeros((20, 20))
    np.add.at(pairs, (places[:-1], places[1:]), 1)
    statistic, degrees = chi_square(pairs, np.outer(landscape, landscape))
    assert statistic < reference.chi_square_bound(degrees)


def test_mean_and_covariance_of_a_gaussian():
    chol = (20.0, 9.0, 12.0)
    landscape = gaussian_landscape((100, 60), chol, (120, 200), cutoff=5.0)
    samples = sample(landscape, 60_000, seed=11).astype(float)
    factor = np.array([[chol[0], 0], [chol[1], chol[2]]])
    np.testing.assert_allclose(samples.mean(axis=0), [100, 60], atol=0.5)
    np.testing.assert_allclose(np.cov(samples.T), factor @ factor.T, rtol=0.05)


def test_modes_apart_all_get_their_share_in_one_call():
    """Modes that share neither rows nor columns, between which a Gibbs chain cannot cross."""
    landscape = np.zeros((60, 70), dtype=np.float32)
    masses = (3.0, 1.0, 4.0)
    for k, mass in enumerate(masses):
        landscape[4 + 20 * k : 10 + 20 * k, 50 - 20 * k : 56 - 20 * k] = mass
    samples = sample(landscape, 20_000, seed=0)
    shares = np.bincount(samples[:, 1] // 20) / len(samples)
    np.testing.assert_allclose(
        shares, np.divide(masses, sum(masses)), atol=5 * math.sqrt(0.25 / len(samples))
    )
    assert len(set(gibbs_sample(landscape, 2000, seed=0)[:, 1] // 20)) == 1


def test_u_is_the_column_and_v_the_row():
    landscape = np.zeros((4, 9), dtype=np.float32)
    landscape[2, 7] = 1
    np.testing.assert_array_equal(sample(landscape, 3, seed=0), [[7, 2]] * 3)
    np.testing.assert_array_equal(sample(landscape.T, 3, seed=0), [[2, 7]] * 3)


def test_the_scale_of_the_landscape_does_not_matter():
    landscape = np.random.default_rng(4).random((9, 11), dtype=np.float32)
    samples = sample(landscape, 50, seed=9, min_distance=1.5)
    scaled = landscape * np.float32(2.0**100)
    np.testing.assert_array_equal(sample(scaled, 50, seed=9, min_distance=1.5), samples)


def test_fewer_samples_are_the_beginning_of_more():
    landscape = np.random.default_rng(4).random((19, 21), dtype=np.float32)
    for distance in (0.0, 2.5):
        many = sample(landscape, 20, seed=9, min_distance=distance)
        np.testing.assert_array_equal(sample(landscape, 7, seed=9, min_distance=distance), many[:7])


def test_a_call_leaves_nothing_behind_for_the_next():
    rng = np.random.default_rng(6)
    cases = [rng.random((h, w), dtype=np.float32) for h, w in ((40, 33), (5, 60), (17, 17), (64, 3))]
    fresh = [reference.sample(case, 8, 3, 4.0) for case in cases]
    for _ in range(3):
        for case, right in zip(cases, fresh, strict=True):
            np.testing.assert_array_equal(sample(case, 8, seed=3, min_distance=4.0), right)
            sample(case, 3, seed=1)
            gibbs_sample(case, 3, seed=1)


def test_the_first_sample_is_the_same_at_every_distance():
    landscape = np.random.default_rng(4).random((19, 21), dtype=np.float32)
    for seed in range(200):
        first = sample(landscape, 1, seed=seed)
        for distance in (1e-9, 3.0, 1e6):
            np.testing.assert_array_equal(sample(landscape, 4, seed=seed, min_distance=distance)[:1], first)


@pytest.mark.parametrize(("peak", "calls"), [(1.0, 40_000), (2000.0, 20_000)], ids=["even", "peaked"])
def test_the_second_sample_follows_what_the_first_has_left(peak, calls):
    """With a peak most draws fall too near to it, and the masses that are left are summed anew."""
    landscape = np.random.default_rng(2).uniform(0.5, 1.5, (4, 4)).astype(np.float32)
    landscape[1, 2] *= peak
    landscape[3, 0] = 0
    distance = 2.0
    counts = np.zeros((16, 16))
    for seed in range(calls):
        (u, v), (u2, v2) = sample(landscape, 2, seed=seed, min_distance=distance).tolist()
        counts[v * 4 + u, v2 * 4 + u2] += 1
    conditional = np.zeros((16, 16))
    for first in range(16):
        near = reference.too_near((4, 4), (first % 4, first // 4), distance)
        conditional[first] = np.where(near, 0.0, landscape).ravel()
        conditional[first] /= conditional[first].sum()
    # Rows that hardly ever come first are left out: chi-square needs expectations of a few counts.
    rows = landscape.ravel() / landscape.sum() * calls > 500
    expected = conditional[rows] * counts[rows].sum(axis=1, keepdims=True)
    assert not counts[rows][expected == 0].any()
    used = expected > 0
    statistic = ((counts[rows] - expected)[used] ** 2 / expected[used]).sum()
    assert statistic < reference.chi_square_bound(used.sum() - rows.sum())


def test_no_distance_allows_repeats_and_a_tiny_one_forbids_only_them():
    landscape = np.ones((5, 6), dtype=np.float32)
    landscape[0, 0] = 0
    repeated = sample(landscape, 100, seed=0)
    assert len(repeated) == 100 and len(np.unique(repeated, axis=0)) < 30
    for distance in (1e-9, 1e-200, 5e-324, 1.0):
        once = sample(landscape, 100, seed=0, min_distance=distance)
        assert len(once) == len(np.unique(once, axis=0)) == 29


def test_the_distance_itself_is_far_enough():
    row = np.ones((1, 10), dtype=np.float32)
    for distance, most in ((3.0, {2, 3, 4}), (9.0, {1, 2}), (9.000001, {1})):
        found = {len(sample(row, 50, seed=seed, min_distance=distance)) for seed in range(200)}
        assert found == most
    corners = np.zeros((4, 5), dtype=np.float32)
    corners[0, 0] = corners[3, 4] = 1
    assert len(sample(corners, 9, seed=0, min_distance=5.0)) == 2
    assert len(sample(corners, 9, seed=0, min_distance=np.nextafter(5.0, 6.0))) == 1


@pytest.mark.parametrize("distance", [30.0, 1e10, 1e200, 1.7e308])
def test_a_distance_larger_than_the_image_gives_one_sample(distance):
    landscape = np.random.default_rng(4).random((12, 17), dtype=np.float32)
    for seed in range(20):
        assert sample(landscape, 50, seed=seed, min_distance=distance).shape == (1, 2)


def test_hardly_any_mass_beside_a_peak_is_found_nevertheless():
    landscape = np.full((8, 8), 1e-30, dtype=np.float32)
    landscape[4, 4] = 1e30
    samples = sample(landscape, 100, seed=0, min_distance=1.0)
    assert samples[0].tolist() == [4, 4]
    assert len(np.unique(samples, axis=0)) == 64


def test_writes_to_the_array_it_is_given():
    landscape = np.random.default_rng(5).random((19, 11), dtype=np.float32)
    out = np.full((30, 2), -7, dtype=np.int32)
    assert sample(landscape, 30, seed=2, out=out) is out
    np.testing.assert_array_equal(out, sample(landscape, 30, seed=2))
    before = landscape.copy()
    sample(landscape, 30, seed=3, min_distance=2.0, out=out)
    np.testing.assert_array_equal(landscape, before)
    empty = np.zeros((0, 2), dtype=np.int32)
    assert sample(landscape, 0, seed=2, out=empty) is empty


def test_fewer_samples_are_a_view_of_the_beginning_of_out():
    landscape = np.random.default_rng(5).random((19, 11), dtype=np.float32)
    out = np.full((30, 2), -7, dtype=np.int32)
    samples = sample(landscape, 30, seed=2, min_distance=9.0, out=out)
    assert 0 < len(samples) < 30
    assert samples.base is out and samples.ctypes.data == out.ctypes.data
    assert (out[len(samples) :] == -7).all()
    np.testing.assert_array_equal(samples, sample(landscape, 30, seed=2, min_distance=9.0))


@pytest.mark.parametrize("draw", [sample, gibbs_sample])
def test_an_out_that_cannot_be_written_is_refused_and_left_alone(draw):
    landscape = np.ones((4, 5), dtype=np.float32)
    good = np.zeros((6, 2), dtype=np.int32)
    read_only = good.copy()
    read_only.flags.writeable = False
    wrong_values = [
        (np.zeros((5, 2), dtype=np.int32), r"got \(5, 2\)"),
        (np.zeros((2, 6), dtype=np.int32), r"got \(2, 6\)"),
        (np.zeros(12, dtype=np.int32), r"got \(12,\)"),
        (np.zeros((6, 2, 1), dtype=np.int32), r"got \(6, 2, 1\)"),
        (np.asfortranarray(good), "contiguous in C order"),
        (np.zeros((12, 2), dtype=np.int32)[::2], "contiguous in C order"),
        (good[::-1], "contiguous in C order"),
        (read_only, "read-only"),
    ]
    for out, words in wrong_values:
        expected = r"out must be a writable C-contiguous int32 array of shape \(6, 2\).*" + words
        with pytest.raises(ArgumentError, match=expected):
            draw(landscape, 6, seed=0, out=out)
        assert not out.any()
    for dtype in (np.int64, np.uint32, np.float32, ">i4"):
        with pytest.raises(ArgumentTypeError, match="out must be a writable C-contiguous int32"):
            draw(landscape, 6, seed=0, out=np.zeros((6, 2), dtype=dtype))
    for other in (good.tolist(), "out", 3, True):
        with pytest.raises(ArgumentTypeError, match="out must be a writable C-contiguous int32"):
            draw(landscape, 6, seed=0, out=other)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("draw", [sample, gibbs_sample])
def test_an_out_over_the_landscape_is_an_error(draw, dtype):
    memory = np.zeros(400, dtype=np.uint8)
    landscape = memory[: 20 * np.dtype(dtype).itemsize].view(dtype).reshape(4, 5)
    landscape[:] = 1
    end = landscape.nbytes
    touching = memory[end - 8 : end + 40].view(np.int32).reshape(6, 2)
    with pytest.raises(ArgumentError, match="out overlaps an input"):
        draw(landscape, 6, seed=0, out=touching)
    with pytest.raises(ArgumentError, match="out overlaps an input"):
        draw(landscape[::-1], 6, seed=0, out=touching)
    assert (landscape == 1).all()
    beside = memory[end : end + 48].view(np.int32).reshape(6, 2)
    assert draw(landscape, 6, seed=0, out=beside) is beside


def test_seeds():
    landscape = np.ones((30, 30), dtype=np.float32)
    known = sample(landscape, 4, seed=0)
    np.testing.assert_array_equal(known, reference.sample(landscape, 4, 0))
    np.testing.assert_array_equal(sample(landscape, 4, seed=np.uint64(0)), known)
    assert not np.array_equal(sample(landscape, 4, seed=1), known)
    assert not np.array_equal(sample(landscape, 20), sample(landscape, 20))


def test_a_numpy_generator_gives_one_draw_and_advances():
    landscape = np.ones((30, 30), dtype=np.float32)
    generator = np.random.default_rng(7)
    first, second = (sample(landscape, 4, seed=generator, min_distance=d) for d in (0.0, 3.0))
    assert not np.array_equal(first, second)
    stream = np.random.default_rng(7).bit_generator
    np.testing.assert_array_equal(first, sample(landscape, 4, seed=int(stream.random_raw())))
    again = sample(landscape, 4, seed=int(stream.random_raw()), min_distance=3.0)
    np.testing.assert_array_equal(second, again)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"n": -1}, ArgumentError, "n must be a whole number of at least 0.*-1"),
        ({"n": 2**31}, ArgumentError, "n must be at most 2147483647"),
        ({"n": 10**30}, ArgumentError, "n must be"),
        ({"n": 2.0}, ArgumentTypeError, "n must be a whole number"),
        ({"n": True}, ArgumentTypeError, "n must be a whole number"),
        ({"n": "3"}, ArgumentTypeError, "n must be a whole number"),
        ({"n": None}, ArgumentTypeError, "n must be a whole number"),
        ({"min_distance": -1.0}, ArgumentError, r"min_distance must be finite and >= 0, got -1"),
        ({"min_distance": -1e-300}, ArgumentError, "min_distance must be finite and >= 0"),
        ({"min_distance": math.nan}, ArgumentError, "min_distance must be finite and >= 0, got NaN"),
        ({"min_distance": math.inf}, ArgumentError, "min_distance must be finite and >= 0, got inf"),
        ({"min_distance": 10**400}, ArgumentError, "min_distance"),
        ({"min_distance": "3"}, ArgumentTypeError, "min_distance must be a number"),
        ({"min_distance": True}, ArgumentTypeError, "min_distance must be a number"),
        ({"min_distance": None}, ArgumentTypeError, "min_distance must be a number"),
        ({"min_distance": [3.0]}, ArgumentTypeError, "min_distance must be a number"),
        ({"seed": -1}, ArgumentError, "seed"),
        ({"seed": 2**64}, ArgumentError, "seed"),
        ({"seed": 1.0}, ArgumentTypeError, "seed"),
        ({"seed": True}, ArgumentTypeError, "seed"),
        ({"seed": "1"}, ArgumentTypeError, "seed"),
    ],
)
@pytest.mark.parametrize("zeros", [False, True])
def test_values_outside_their_domain_are_named(arguments, error, words, zeros):
    landscape = np.full((4, 5), not zeros, dtype=np.float32)
    with pytest.raises(error, match=words):
        sample(landscape, **({"n": 3} | arguments))


@pytest.mark.parametrize("min_distance", [0.0, 3.0])
@pytest.mark.parametrize("n", [0, 3])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -1.0])
def test_a_pixel_that_is_no_relevance_is_named(min_distance, n, dtype, bad):
    landscape = np.ones((40, 50), dtype=dtype)
    landscape[22, 33] = bad
    out = np.full((n, 2), -7, dtype=np.int32)
    with pytest.raises(ArgumentError, match=r"landscape must be finite.*landscape\[22, 33\]"):
        sample(landscape, n, seed=0, min_distance=min_distance, out=out)
    assert (out == -7).all()


@pytest.mark.parametrize("n", [0, 3])
@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_a_landscape_of_zeros_is_an_error(n, zero):
    with pytest.raises(ArgumentError, match="landscape is zero everywhere"):
        sample(np.full((4, 5), zero, dtype=np.float32), n)
    with pytest.raises(ArgumentError, match="landscape is zero everywhere"):
        sample(np.full((4, 5), 1e-60), n)  # zero in float32, in which the samplers compute


@pytest.mark.parametrize("draw", [sample, gibbs_sample])
def test_a_pixel_beyond_float32_is_named_with_the_value_that_was_given(draw):
    landscape = np.ones((4, 5))
    landscape[2, 3] = 1e300
    with pytest.raises(ArgumentError, match=r"finite in float32, got 1e300 at landscape\[2, 3\]"):
        draw(landscape, 3, seed=0)


@pytest.mark.parametrize(
    ("landscape", "error", "words"),
    [
        (np.ones((4, 5), dtype=np.int64), ArgumentTypeError, "landscape must be an array of float32"),
        (np.ones((4, 5), dtype=np.uint8), ArgumentTypeError, "landscape must be an array of float32"),
        (np.ones((4, 5), dtype=bool), ArgumentTypeError, "landscape must be an array of float32"),
        ([[1.0, 2.0]], ArgumentTypeError, "landscape must be an array"),
        (None, ArgumentTypeError, "landscape must be an array"),
        (np.ones(5, dtype=np.float32), ArgumentError, r"landscape must be \(H, W\), got \(5,\)"),
        (np.ones((1, 4, 5), dtype=np.float32), ArgumentError, r"landscape must be \(H, W\), got \(1, 4, 5\)"),
        (np.ones((0, 5), dtype=np.float32), ArgumentError, "landscape must be"),
        (np.ma.masked_less(np.ones((4, 5)), 0), ArgumentTypeError, "without a mask"),
    ],
)
def test_what_is_no_landscape_is_named(landscape, error, words):
    with pytest.raises(error, match=words) as info:
        sample(landscape, 3, seed=0)
    assert isinstance(info.value, Error)
