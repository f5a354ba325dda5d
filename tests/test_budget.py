"""A detector within a budget of time, on a clock that is set by hand: no test waits."""

from __future__ import annotations

import numpy as np
import pytest

from motorprime import Detections, HistogramDetector, Mask, Tiles, Windows, kernel_landscape
from motorprime.attention import Look
from motorprime.budget import Budgeted
from motorprime.costs import CostModel
from motorprime.errors import ArgumentError, ArgumentTypeError, StateError
from motorprime.pace import Pace
from motorprime.portions import most_relevant_first, paint
from timed_detector import SetClock, TimedDetector

SHAPE = (120, 160)
IMAGE = np.zeros((*SHAPE, 3), np.uint8)
LOOK = Look(kernel_landscape(np.array([[60.0, 50.0], [90.0, 70.0]]), SHAPE, width=30.0))
COSTS = CostModel(call=1e-4, window=1e-5, tile=5e-5, pixel=1e-8)


OURS = ("by", "size", "strategy", "overlap", "pace", "costs")


def budgeted(seed=0, **options):
    clock = SetClock()
    ours = {"costs": COSTS} | {name: options.pop(name) for name in OURS if name in options}
    detector = TimedDetector(clock, **options)
    return Budgeted(detector, clock=clock, seed=seed, **ours), detector


def run(timely, budgets):
    seconds = np.array([timely.detect(IMAGE, LOOK, 1000.0 * b).seconds for b in budgets])
    return (seconds - budgets) / np.maximum(budgets, 0.010), seconds / budgets


BUDGETS = np.random.default_rng(5).uniform(0.002, 0.050, 400)


def test_a_cycle_ends_in_time_and_uses_it():
    overshoots, used = run(budgeted()[0], BUDGETS)
    assert overshoots.max() < 0.002 and used.min() > 0.9 and np.median(used) > 0.98


@pytest.mark.parametrize("slow", [0.3, 3.0, 10.0])
def test_a_model_that_is_wrong_is_put_right_from_cycle_to_cycle(slow):
    timely, detector = budgeted()
    detector.slow = slow
    overshoots, used = run(timely, BUDGETS)
    assert np.quantile(overshoots[50:], 0.99) < 0.10 and np.median(used[50:]) > 0.9


def test_stalls_are_learned_to_be_reckoned_with():
    """One batch in fifty is stopped for up to 3 ms: most cycles still end in time."""
    generator = np.random.default_rng(3)
    noise = lambda t: t + (generator.uniform(0.0, 0.003) if generator.random() < 0.02 else 0.0)  # noqa: E731
    budgets = np.tile(BUDGETS, 5)
    overshoots, used = run(budgeted(noise=noise)[0], budgets)
    assert np.quantile(overshoots[500:], 0.99) < 0.10 and np.median(used[500:]) > 0.85
    unlearned = run(budgeted(noise=noise, pace=Pace(share=0.0))[0], budgets)[0]
    assert np.mean(overshoots[500:] > 0) < 0.5 * np.mean(unlearned[500:] > 0)


def test_without_any_time_the_most_relevant_window_is_looked_at_and_the_rest_named():
    timely, detector = budgeted()
    glance = timely.detect(IMAGE, LOOK, 0)
    (windows,) = detector.looks
    v, u = np.unravel_index(LOOK.landscape.argmax(), SHAPE)
    assert windows.centres.tolist() == [[u, v]] and windows.size == 20
    assert glance.missed and glance.seconds > glance.budget == 0.0
    assert glance.looked == pytest.approx(400 / 19200)
    seen = LOOK.landscape[glance.pixels].sum() / LOOK.landscape.sum()
    assert glance.skipped == pytest.approx(1 - seen, rel=1e-4) and glance.skipped > 0.8
    assert isinstance(glance.rest, Mask)
    np.testing.assert_array_equal(glance.rest.mask, (LOOK.landscape > 0) & ~glance.pixels)


def test_without_any_time_the_best_pixel_or_the_first_tile_is_looked_at():
    glance = budgeted(by="mask")[0].detect(IMAGE, LOOK, 0)
    (mask,) = glance.looks
    assert LOOK.landscape[mask.mask].min() == LOOK.landscape.max()
    tiles = Tiles(np.array([[0, 0, 40, 30], [40, 0, 80, 30]]))
    glance = budgeted()[0].detect(IMAGE, tiles, 0)
    assert [t.boxes.tolist() for t in glance.looks] == [[[0, 0, 40, 30]]]
    assert glance.skipped == 0.5 and glance.rest.boxes.tolist() == [[40, 0, 80, 30]]


def test_the_first_window_is_the_peak_s_with_more_time_too():
    glance = budgeted()[0].detect(IMAGE, LOOK, 5)
    v, u = np.unravel_index(LOOK.landscape.argmax(), SHAPE)
    assert glance.looks[0].centres[0].tolist() == [u, v] and len(glance.looks) > 2
    assert not glance.missed and 0.0 < glance.skipped < 0.5
    for windows in glance.looks:
        assert (LOOK.landscape[windows.centres[:, 1], windows.centres[:, 0]] > 0).all()


def test_windows_are_drawn_as_the_strategy_says():
    """Stratified ones are spread evenly over two modes of the same mass, in every portion."""
    modes = Look(kernel_landscape(np.array([[40.0, 50.0], [120.0, 50.0]]), SHAPE, width=30.0))
    glance = budgeted(strategy="stratified")[0].detect(IMAGE, modes, 20)
    for windows in glance.looks:
        count = len(windows.centres)
        assert abs((windows.centres[:, 0] < 80).sum() - count / 2) <= 2
    chains = [w.centres for w in budgeted(strategy="gibbs")[0].detect(IMAGE, modes, 20).looks]
    assert any(abs((c[1:, 0] < 80).sum() - len(c) / 2) > 2 for c in chains)


def test_listed_windows_are_looked_at_in_their_order_until_time_or_the_list_ends():
    centres = np.random.default_rng(0).integers((0, 0), (160, 120), (600, 2))
    timely, detector = budgeted()
    glance = timely.detect(IMAGE, Windows(centres, 16), 4)
    looked = np.concatenate([windows.centres for windows in glance.looks])
    np.testing.assert_array_equal(looked, centres[: len(looked)])
    assert 250 < len(looked) < 400 and not glance.missed
    np.testing.assert_array_equal(glance.rest.centres, centres[len(looked) :])
    assert glance.rest.size == 16 and glance.skipped == pytest.approx(1 - len(looked) / 600)
    detector.looks.clear()
    glance = timely.detect(IMAGE, Windows(centres[:50], 16), 40)
    assert sum(len(windows.centres) for windows in detector.looks) == 50
    assert glance.skipped == 0.0 and glance.seconds < 0.002 and len(glance.rest.centres) == 0


def test_as_many_tiles_are_looked_at_as_fit_by_their_number_and_pixels():
    boxes = np.array([[0, 0, 100, 100]] * 3 + [[0, 0, 10, 10]] * 40)
    costs = CostModel(call=1e-4, tile=5e-5, pixel=1e-7)
    timely, detector = budgeted(costs=costs, pixel=1e-7)
    glance = timely.detect(IMAGE, Tiles(boxes), 3.8)  # 0.1 + 3 * 1.05 ms, and some small ones
    count = sum(len(tiles.boxes) for tiles in detector.looks)
    assert 3 <= count < 14 and not glance.missed and glance.seconds > 0.85 * glance.budget
    np.testing.assert_array_equal(glance.pixels, paint((Tiles(boxes[:count]),), SHAPE))


def test_the_most_relevant_pixels_are_as_many_as_there_is_time_for():
    timely, detector = budgeted(by="mask", pixel=1e-6, costs=CostModel(call=1e-4, pixel=1e-6))
    glance = timely.detect(IMAGE, LOOK, 2.1)
    (mask,) = detector.looks
    assert mask.mask.sum() == pytest.approx(2000, abs=3) and not glance.missed
    assert LOOK.landscape[mask.mask].min() >= LOOK.landscape[~mask.mask].max()
    assert glance.looked == pytest.approx(2000 / 19200, rel=0.01) and len(glance.looks) == 1
    everything = timely.detect(IMAGE, LOOK, 1000)
    assert everything.skipped == pytest.approx(0.0, abs=1e-6)


def test_looked_counts_every_pixel_once():
    generator = np.random.default_rng(2)
    mask = generator.random(SHAPE) < 0.01
    looks = (
        Windows(generator.integers((-5, -5), (170, 130), (40, 2)), 11),
        Tiles(np.array([[3, 4, 60, 20], [100, 100, 160, 120]])),
        Mask(mask),
    )
    expected = mask.copy()
    for u, v in looks[0].corners(SHAPE):
        expected[v : v + 11, u : u + 11] = True
    expected[4:20, 3:60] = expected[100:, 100:] = True
    np.testing.assert_array_equal(paint(looks, SHAPE), expected)
    assert not paint((), SHAPE).any()


def test_what_several_portions_found_is_one_thing_and_what_has_another_label_is_not():
    here, beside, there = (10, 10, 30, 30), (12, 10, 32, 30), (60, 60, 80, 80)
    found = [("glass", here), ("box", here), ("glass", beside), ("glass", there)]
    glance = budgeted(found=found)[0].detect(IMAGE, LOOK, 5)
    assert len(glance.looks) > 1
    assert glance.detections.labels == ("glass", "box", "glass")
    assert glance.detections.boxes.tolist() == [list(here), list(here), list(there)]
    assert glance.detections.scores.dtype == glance.detections.boxes.dtype == np.float32
    strict = budgeted(found=found, overlap=0.9)[0].detect(IMAGE, LOOK, 5)
    assert len(strict.detections) == 4
    nothing = budgeted()[0].detect(IMAGE, LOOK, 5).detections
    assert len(nothing) == 0 and nothing.boxes.shape == (0, 4)


class Raising(TimedDetector):
    """Raises in every third call."""

    error: BaseException = RuntimeError("lens cap")

    def detect(self, image, where):
        found = super().detect(image, where)
        if len(self.looks) % 3 == 0:
            raise self.error
        return found


def test_a_detector_that_raises_in_the_middle_ends_its_frame_and_not_the_loop():
    clock = SetClock()
    timely = Budgeted(Raising(clock, found=[("glass", (10, 10, 30, 30))]), COSTS, clock=clock, seed=0)
    glance = timely.detect(IMAGE, LOOK, 3)
    assert str(glance.failure) == "lens cap" and len(glance.looks) == 3
    assert glance.detections.labels == ("glass",) and not glance.missed and glance.skipped > 0.0
    assert timely.pace.reserve == 0.0
    again = timely.detect(IMAGE, LOOK, 0.2)
    assert again.failure is None and len(again.looks) == 1


def test_ctrl_c_is_no_failure_of_a_frame():
    clock = SetClock()
    detector = Raising(clock)
    detector.error = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        Budgeted(detector, COSTS, clock=clock, seed=0).detect(IMAGE, LOOK, 20)


def test_a_real_detector_finds_in_the_time_there_is_what_it_finds_without_haste():
    image = np.full((*SHAPE, 3), 128, np.uint8)
    image[40:60, 50:75] = (220, 30, 40)
    real = HistogramDetector(np.array([(220, 30, 40)] * 100, np.uint8))

    class Clocked(TimedDetector):
        def detect(self, image, where):
            super().detect(image, where)
            return real.detect(image, where)

    clock = SetClock()
    glance = Budgeted(Clocked(clock), COSTS, clock=clock, seed=0).detect(image, LOOK, 3)
    assert glance.detections.boxes.tolist() == [[50, 40, 75, 60]] and not glance.missed


def test_the_same_seed_looks_at_the_same_windows_and_arguments_are_not_changed():
    image, landscape = IMAGE.copy(), LOOK.landscape.copy()
    one, other = (budgeted(seed=4)[0].detect(IMAGE, LOOK, 5).looks for _ in range(2))
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a.centres, b.centres)
    np.testing.assert_array_equal(image, IMAGE)
    np.testing.assert_array_equal(landscape, LOOK.landscape)


def test_tiles_are_ordered_by_how_relevant_their_pixels_are():
    boxes = np.array([[0, 100, 20, 120], [50, 40, 70, 60], [80, 60, 120, 100], [0, 0, 160, 120]])
    ordered = most_relevant_first(Tiles(boxes), LOOK)
    assert ordered.boxes.tolist() == boxes[[1, 2, 3, 0]].tolist()
    with pytest.raises(ArgumentError, match=r"boxes\[1\]: pixels .* of an image of 160 x 120 expected"):
        most_relevant_first(Tiles(np.array([[0, 0, 5, 5], [0, 0, 161, 5]])), LOOK)


# What is refused.


@pytest.mark.parametrize(
    ("milliseconds", "error"),
    [
        (-1, ArgumentError),
        (-1e-9, ArgumentError),
        (np.nan, ArgumentError),
        (np.inf, ArgumentError),
        ("10", ArgumentTypeError),
        (None, ArgumentTypeError),
        ([1.0], ArgumentError),
    ],
)
def test_a_budget_that_is_none_is_named_and_nothing_is_looked_at(milliseconds, error):
    timely, detector = budgeted()
    with pytest.raises(error, match="milliseconds"):
        timely.detect(IMAGE, LOOK, milliseconds)
    assert not detector.looks


@pytest.mark.parametrize(
    ("image", "look", "message", "error"),
    [
        (IMAGE.astype(np.uint16), LOOK, "image: a uint8 array", ArgumentTypeError),
        (np.zeros((*SHAPE, 4), np.uint8), LOOK, "image: shape", ArgumentError),
        (
            IMAGE[:100],
            LOOK,
            r"look: a landscape of shape \(100, 160\) expected, got \(120, 160\)",
            ArgumentError,
        ),
        (IMAGE, Look(np.zeros(SHAPE, np.float32)), "look: the landscape is zero everywhere", ArgumentError),
        (
            IMAGE[:15],
            Look(LOOK.landscape[40:55].copy()),
            "image: 160 x 15 is smaller than a window",
            ArgumentError,
        ),
        (IMAGE[:15], Windows(np.zeros((1, 2), int)), "size: a window of 20 px does not fit", ArgumentError),
        (IMAGE, Tiles(np.array([[0, 0, 5, 5], [0, 0, 5, 121]])), r"boxes\[1\]: pixels", ArgumentError),
        (IMAGE, Tiles(np.array([[5, 5, 5, 9]])), r"boxes\[0\]: pixels", ArgumentError),
        (IMAGE, LOOK.landscape, "look: a Look, Windows or Tiles expected, got ndarray", ArgumentTypeError),
        (IMAGE, Mask(np.ones(SHAPE, bool)), "look: .* got Mask", ArgumentTypeError),
    ],
)
def test_what_cannot_be_looked_at_is_named(image, look, message, error):
    with pytest.raises(error, match=message):
        budgeted()[0].detect(image, look, 5)


def test_a_price_that_was_not_measured_is_asked_for():
    for costs, options, look, message in (
        (CostModel(call=1.0, pixel=1.0), {}, LOOK, r"each window expected.*kinds=\['windows'\]"),
        (CostModel(call=1.0, window=1.0), {"by": "mask"}, LOOK, r"each pixel expected.*kinds=\['mask'\]"),
        (CostModel(call=1.0, window=1.0), {}, Tiles(np.array([[0, 0, 5, 5]])), "each tile or pixel expected"),
    ):
        with pytest.raises(ArgumentError, match=message):
            budgeted(costs=costs, **options)[0].detect(IMAGE, look, 5)


def test_a_clock_that_goes_back_or_says_nothing_is_named():
    class Back(TimedDetector):
        def detect(self, image, where):
            self.clock.now -= 1.0
            return Detections()

    clock = SetClock()
    with pytest.raises(StateError, match="clock: it went back from"):
        Budgeted(Back(clock), COSTS, clock=clock).detect(IMAGE, LOOK, 5)
    with pytest.raises(StateError, match="clock: finite seconds expected, it said nan"):
        Budgeted(TimedDetector(clock), COSTS, clock=lambda: float("nan")).detect(IMAGE, LOOK, 5)


def test_a_detector_that_returns_something_else_is_named():
    class Wrong(TimedDetector):
        def detect(self, image, where):
            return [1, 2, 3]

    clock = SetClock()
    with pytest.raises(ArgumentTypeError, match="detector: detect should return Detections, got list"):
        Budgeted(Wrong(clock), COSTS, clock=clock).detect(IMAGE, LOOK, 5)


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"detector": None}, ArgumentTypeError),
        ({"costs": {"call": 1.0}}, ArgumentTypeError),
        ({"clock": 3.0}, ArgumentTypeError),
        ({"by": "tile"}, ArgumentError),
        ({"strategy": "best"}, ArgumentError),
        ({"size": 0}, ArgumentError),
        ({"size": 2.5}, ArgumentTypeError),
        ({"overlap": 0.0}, ArgumentError),
        ({"overlap": np.nan}, ArgumentError),
        ({"seed": -1}, ArgumentError),
    ],
)
def test_arguments_that_make_no_sense_are_named(change, error):
    clock = SetClock()
    given = {"detector": TimedDetector(clock), "costs": COSTS, "clock": clock} | change
    with pytest.raises(error, match=next(iter(change))):
        Budgeted(given.pop("detector"), given.pop("costs"), **given)
