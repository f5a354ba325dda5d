"""What is learned of a cost model's errors: the usual ratio of batches and the late share of cycles."""

from __future__ import annotations

import numpy as np
import pytest

from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.pace import Pace


@pytest.mark.parametrize("ratio", [0.2, 0.9, 1.0, 3.0, 20.0])
def test_the_factor_comes_to_the_usual_ratio_whatever_the_outliers(ratio):
    generator, pace, seen = np.random.default_rng(0), Pace(), []
    for k in range(600):
        outlier = 100.0 if generator.random() < 0.2 else 1.0
        pace.ran(1e-3, 1e-3 * ratio * generator.uniform(0.97, 1.03) * outlier)
        if k > 200:
            seen.append(pace.factor)
    assert np.median(seen) == pytest.approx(ratio, rel=0.08)
    assert np.max(np.abs(np.log(np.array(seen) / ratio))) < 0.5


def test_the_factor_stays_within_reason():
    pace = Pace()
    for _ in range(500):
        pace.ran(1e-3, 0.0)
    assert pace.factor == pytest.approx(1 / 50)
    for _ in range(500):
        pace.ran(1e-3, 1e9)
    assert pace.factor == pytest.approx(50)


@pytest.mark.parametrize(("quantile", "scale"), [(0.99, 1e-3), (0.9, 1e-3), (0.95, 3e-3)])
def test_cycles_are_late_as_often_as_they_may_be(quantile, scale):
    """Something takes an exponential time at the end of each cycle of 100 ms."""
    generator, pace, late = np.random.default_rng(1), Pace(quantile=quantile, share=0.5), []
    for _ in range(40_000):
        seconds = pace.usable(0.1) + generator.exponential(scale)
        late.append(seconds > 0.1)
        pace.ended(0.1, seconds)
    assert np.mean(late[10_000:]) == pytest.approx(1 - quantile, rel=0.2)
    assert pace.reserve == pytest.approx(-scale * np.log(1 - quantile), rel=0.5)


def test_no_more_than_the_share_is_kept_free_and_none_of_it_piles_up():
    pace = Pace(share=0.1)
    for _ in range(1000):
        pace.ended(0.010, 1.0)
    assert pace.usable(0.010) == pytest.approx(0.009)
    assert pace.reserve < 0.1 * 0.010 + pace.step
    assert pace.usable(0.0) == 0.0
    for _ in range(1000):
        pace.ended(0.010, 0.001)
    assert pace.reserve == 0.0 and pace.usable(0.010) == 0.010


def test_a_late_cycle_with_a_small_budget_takes_nothing_from_the_reserve():
    pace = Pace(reserve=0.004)
    pace.ended(0.002, 0.003)
    assert pace.reserve == 0.004


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"quantile": 0.4}, ArgumentError),
        ({"quantile": 1.0}, ArgumentError),
        ({"quantile": np.nan}, ArgumentError),
        ({"step": 0.0}, ArgumentError),
        ({"factor": -1.0}, ArgumentError),
        ({"reserve": -1.0}, ArgumentError),
        ({"share": 1.0}, ArgumentError),
        ({"share": "0"}, ArgumentTypeError),
    ],
)
def test_a_number_outside_its_domain_is_named(change, error):
    with pytest.raises(error, match=next(iter(change))):
        Pace(**change)
