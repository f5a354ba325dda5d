"""The Gibbs sampler: the same chain as its twin, and the distribution that it promises."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import motorprime.errors
import reference
from motorprime.landscape import gaussian_landscape, gibbs_sample

examples = settings(deadline=None, derandomize=True, max_examples=150)
sizes = st.tuples(st.integers(1, 20), st.integers(1, 20))
pixels = st.sampled_from([0.0, 0.0, 0.0, 0.5, 1.0]) | st.floats(0, 2.0**127, width=32)
landscapes = sizes.flatmap(lambda s: hnp.arrays(np.float32, s, elements=pixels)).filter(np.any)
seeds = st.integers(0, 2**64 - 1)


def chi_square(landscape, samples):
    """The statistic over positive pixels, and its degrees of freedom."""
    counts = np.zeros(landscape.shape)
    np.add.at(counts, (samples[:, 1], samples[:, 0]), 1)
    expected = landscape.astype(float) / landscape.sum(dtype=float) * len(samples)
    assert not counts[landscape == 0].any()
    used = landscape > 0
    return ((counts - expected)[used] ** 2 / expected[used]).sum(), used.sum() - 1


@examples
@given(landscapes, seeds, st.integers(0, 12), st.integers(0, 3), st.integers(1, 3))
def test_gives_the_chain_of_its_twin_on_positive_pixels_only(landscape, seed, n, burn_in, thin):
    samples = gibbs_sample(landscape, n, seed=seed, burn_in=burn_in, thin=thin)
    assert samples.dtype == np.int32 and samples.shape == (n, 2)
    twin = reference.gibbs_sample(landscape, n, seed, burn_in=burn_in, thin=thin)
    np.testing.assert_array_equal(samples, twin)
    assert (landscape[samples[:, 1], samples[:, 0]] > 0).all()


@examples
@given(landscapes, seeds, st.data())
def test_starts_where_it_is_told(landscape, seed, data):
    v = data.draw(st.sampled_from(np.flatnonzero(landscape.any(axis=1)).tolist()))
    u = data.draw(st.integers(0, landscape.shape[1] - 1))
    samples = gibbs_sample(landscape, 8, seed=seed, start=(u, v))
    np.testing.assert_array_equal(samples, reference.gibbs_sample(landscape, 8, seed, start=(u, v)))


def test_the_first_sample_of_many_seeds_follows_the_landscape():
    landscape = np.random.default_rng(0).random((6, 7), dtype=np.float32)
    landscape[landscape < 0.2] = 0
    samples = np.concatenate([gibbs_sample(landscape, 1, seed=seed) for seed in range(20_000)])
    statistic, degrees = chi_square(landscape, samples)
    assert statistic < reference.chi_square_bound(degrees)


def test_the_fifth_sample_of_many_seeds_still_follows_the_landscape():
    landscape = np.random.default_rng(1).random((5, 5), dtype=np.float32)
    samples = np.concatenate([gibbs_sample(landscape, 5, seed=seed)[-1:] for seed in range(20_000)])
    statistic, degrees = chi_square(landscape, samples)
    assert statistic < reference.chi_square_bound(degrees)


def test_a_long_chain_forgets_its_start():
    landscape = gaussian_landscape((8.3, 5.1), (3.0, 2.0, 2.0), (12, 16))
    samples = gibbs_sample(landscape, 40_000, seed=3, start=(15, 5), burn_in=50, thin=8)
    statistic, degrees = chi_square(landscape, samples)
    assert statistic < reference.chi_square_bound(degrees)


def test_marginals_and_correlation_of_a_gaussian():
    chol = (20.0, 9.0, 12.0)
    landscape = gaussian_landscape((100, 60), chol, (120, 200), cutoff=5.0)
    samples = gibbs_sample(landscape, 60_000, seed=11, thin=3).astype(float)
    factor = np.array([[chol[0], 0], [chol[1], chol[2]]])
    np.testing.assert_allclose(samples.mean(axis=0), [100, 60], atol=0.5)
    np.testing.assert_allclose(np.cov(samples.T), factor @ factor.T, rtol=0.05)


def test_u_is_the_column_and_v_the_row():
    landscape = np.zeros((4, 9), dtype=np.float32)
    landscape[2, 7] = 1
    np.testing.assert_array_equal(gibbs_sample(landscape, 3, seed=0), [[7, 2]] * 3)


def test_two_modes_apart_are_chosen_by_mass_and_never_left():
    """Modes that share neither rows nor columns: a chain keeps to the one where it began."""
    landscape = np.zeros((20, 30), dtype=np.float32)
    landscape[2:6, 3:8] = 3.0
    landscape[12:16, 20:25] = 1.0
    calls = [gibbs_sample(landscape, 200, seed=seed) for seed in range(2000)]
    first_mode = [(call[:, 0] < 15).all() for call in calls]
    second_mode = [(call[:, 0] > 15).all() for call in calls]
    assert np.logical_xor(first_mode, second_mode).all()
    assert np.mean(first_mode) == pytest.approx(0.75, abs=5 * math.sqrt(0.75 * 0.25 / 2000))


def test_two_modes_that_share_rows_are_both_visited():
    landscape = np.zeros((20, 30), dtype=np.float32)
    landscape[2:6, 3:8] = 3.0
    landscape[4:8, 20:25] = 1.0
    samples = gibbs_sample(landscape, 20_000, seed=0, thin=5)
    assert (samples[:, 0] < 15).mean() == pytest.approx(0.75, abs=0.05)


def test_the_scale_of_the_landscape_does_not_matter():
    landscape = np.random.default_rng(4).random((9, 11), dtype=np.float32)
    samples = gibbs_sample(landscape, 50, seed=9)
    np.testing.assert_array_equal(gibbs_sample(landscape * np.float32(2.0**100), 50, seed=9), samples)
    np.testing.assert_array_equal(gibbs_sample(landscape.astype(np.float64), 50, seed=9), samples)


def test_thinning_and_burn_in_pick_from_one_chain():
    landscape = np.random.default_rng(5).random((9, 11), dtype=np.float32)
    chain = gibbs_sample(landscape, 40, seed=2)
    picked = gibbs_sample(landscape, 5, seed=2, burn_in=7, thin=4)
    np.testing.assert_array_equal(picked, chain[10:27:4])


def test_more_sweeps_than_fit_between_two_looks_at_signals():
    landscape = np.random.default_rng(5).random((3, 3), dtype=np.float32)
    many = gibbs_sample(landscape, 40_000, seed=2)
    np.testing.assert_array_equal(many[9::10], gibbs_sample(landscape, 4_000, seed=2, thin=10))
    np.testing.assert_array_equal(many[30_000:], gibbs_sample(landscape, 10_000, seed=2, burn_in=30_000))


@examples
@given(landscapes, seeds, st.integers(0, 12), st.integers(0, 3), st.integers(1, 3))
def test_writes_the_same_samples_to_the_array_it_is_given(landscape, seed, n, burn_in, thin):
    out = np.full((n, 2), -7, dtype=np.int32)
    samples = gibbs_sample(landscape, n, seed=seed, burn_in=burn_in, thin=thin, out=out)
    assert samples is out
    np.testing.assert_array_equal(out, gibbs_sample(landscape, n, seed=seed, burn_in=burn_in, thin=thin))


def test_an_array_is_filled_over_several_looks_at_signals():
    landscape = np.random.default_rng(5).random((3, 3), dtype=np.float32)
    out = np.full((40_000, 2), -7, dtype=np.int32)
    assert gibbs_sample(landscape, 40_000, seed=2, start=(1, 1), out=out) is out
    np.testing.assert_array_equal(out, gibbs_sample(landscape, 40_000, seed=2, start=(1, 1)))


def test_an_array_is_left_alone_when_the_landscape_or_the_start_is_an_error():
    landscape = np.ones((4, 5), dtype=np.float32)
    landscape[3] = 0
    out = np.full((6, 2), -7, dtype=np.int32)
    with pytest.raises(motorprime.errors.ArgumentError, match="start must be on a row"):
        gibbs_sample(landscape, 6, start=(2, 3), out=out)
    with pytest.raises(motorprime.errors.ArgumentError, match="zero everywhere"):
        gibbs_sample(landscape * 0, 6, out=out)
    with pytest.raises(motorprime.errors.ArgumentError, match="n must be"):
        gibbs_sample(landscape, -6, out=out)
    assert (out == -7).all()


def test_several_modes_in_several_blocks_of_rows_start_by_their_mass():
    """The first row is drawn from the masses of blocks and then of rows; both must follow the landscape."""
    landscape = np.zeros((70, 3), dtype=np.float32)
    landscape[[0, 15, 16, 31, 47, 48, 69]] = np.arange(1, 22).reshape(7, 3)
    samples = np.concatenate([gibbs_sample(landscape, 1, seed=seed) for seed in range(20_000)])
    statistic, degrees = chi_square(landscape, samples)
    assert statistic < reference.chi_square_bound(degrees)


def test_seeds():
    landscape = np.ones((30, 30), dtype=np.float32)
    known = gibbs_sample(landscape, 4, seed=0)
    np.testing.assert_array_equal(known, reference.gibbs_sample(landscape, 4, 0))
    np.testing.assert_array_equal(gibbs_sample(landscape, 4, seed=np.uint64(0)), known)
    assert not np.array_equal(gibbs_sample(landscape, 4, seed=1), known)
    assert not np.array_equal(gibbs_sample(landscape, 20), gibbs_sample(landscape, 20))


def test_a_numpy_generator_gives_one_draw_and_advances():
    landscape = np.ones((30, 30), dtype=np.float32)
    generator = np.random.default_rng(7)
    first, second = gibbs_sample(landscape, 4, seed=generator), gibbs_sample(landscape, 4, seed=generator)
    assert not np.array_equal(first, second)
    drawn = int(np.random.default_rng(7).bit_generator.random_raw())
    np.testing.assert_array_equal(first, gibbs_sample(landscape, 4, seed=drawn))


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"n": -1}, motorprime.errors.ArgumentError, "n must be a whole number of at least 0.*-1"),
        ({"n": 2**31}, motorprime.errors.ArgumentError, "n must be at most 2147483647"),
        ({"n": 10**30}, motorprime.errors.ArgumentError, "n must be"),
        ({"n": 2.0}, motorprime.errors.ArgumentTypeError, "n must be a whole number"),
        ({"thin": 0}, motorprime.errors.ArgumentError, "thin"),
        ({"burn_in": -1}, motorprime.errors.ArgumentError, "burn_in"),
        ({"start": (5, 0)}, motorprime.errors.ArgumentError, "start must be .* inside the image, u < 5"),
        ({"start": (0, 4)}, motorprime.errors.ArgumentError, "start must be .* inside the image"),
        ({"start": (-1, 0)}, motorprime.errors.ArgumentError, "start"),
        ({"start": (10**25, 0)}, motorprime.errors.ArgumentError, "start"),
        ({"start": (2, 3)}, motorprime.errors.ArgumentError, "start must be on a row .* not zero"),
        ({"start": (1.0, 2.0)}, motorprime.errors.ArgumentTypeError, "start"),
        ({"start": 3}, motorprime.errors.ArgumentTypeError, "start"),
        ({"seed": -1}, motorprime.errors.ArgumentError, "seed"),
        ({"seed": 2**64}, motorprime.errors.ArgumentError, "seed"),
        ({"seed": 1.0}, motorprime.errors.ArgumentTypeError, "seed"),
        ({"seed": True}, motorprime.errors.ArgumentTypeError, "seed"),
    ],
)
def test_values_outside_their_domain_are_named(arguments, error, words):
    landscape = np.ones((4, 5), dtype=np.float32)
    landscape[3] = 0
    with pytest.raises(error, match=words):
        gibbs_sample(landscape, **({"n": 3} | arguments))


@pytest.mark.parametrize("n", [0, 3])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -1.0])
def test_a_pixel_that_is_no_relevance_is_named(n, dtype, bad):
    landscape = np.ones((4, 50), dtype=dtype)
    landscape[2, 33] = bad
    with pytest.raises(
        motorprime.errors.ArgumentError, match=r"landscape must be finite.*landscape\[2, 33\]"
    ):
        gibbs_sample(landscape, n, seed=0)


def test_a_landscape_of_zeros_is_an_error():
    with pytest.raises(motorprime.errors.ArgumentError, match="landscape is zero everywhere"):
        gibbs_sample(np.zeros((4, 5), dtype=np.float32), 3)
