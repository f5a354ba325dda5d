"""Where to look next: windows spread, kept apart, kept off what was seen, and sent elsewhere."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from motorprime import Camera, PosedCamera, Windows, kernel_landscape
from motorprime.attention import Look
from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.looking import Memory, _line, _stratified, choose_piece, choose_windows
from motorprime.portions import paint
from motorprime.rotations import rotation_matrices
from reference import chi_square_bound

SHAPE = (120, 160)
LOOK = Look(kernel_landscape(np.array([[50.0, 40.0], [110.0, 80.0]]), SHAPE, width=30.0))
STRATEGIES = ("gibbs", "independent", "apart", "stratified")


def covered(windows):
    """Share of the landscape's mass in the windows."""
    return LOOK.landscape[paint((windows,), SHAPE)].sum() / LOOK.landscape.sum()


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_windows_are_centred_on_the_landscape_and_come_again_with_the_seed(strategy):
    windows = choose_windows(LOOK, 30, size=16, strategy=strategy, seed=3)
    assert windows.size == 16 and windows.centres.dtype == np.int32
    assert (LOOK.landscape[windows.centres[:, 1], windows.centres[:, 0]] > 0).all()
    again = choose_windows(LOOK, 30, size=16, strategy=strategy, seed=3)
    np.testing.assert_array_equal(windows.centres, again.centres)
    assert len(choose_windows(LOOK, 0, strategy=strategy, seed=3).centres) == 0


@pytest.mark.parametrize("count", [1, 7, 50])
def test_stratified_windows_follow_the_landscape(count):
    """Each pixel is drawn in proportion to its value, over all the windows of a call."""
    field = np.random.default_rng(0).random((6, 7)).astype(np.float32)
    field[2:4, 3:] = 0.0
    counts, draws = np.zeros(field.shape), 4000 // count
    generator = np.random.default_rng(1)
    for _ in range(draws):
        u, v = choose_windows(Look(field), count, seed=generator).centres.T
        np.add.at(counts, (v, u), 1)
    expected = field / field.sum() * draws * count
    assert (counts[field == 0] == 0).all()
    degrees = np.count_nonzero(field) - 1
    positive = field > 0
    square = ((counts - expected)[positive] ** 2 / expected[positive]).sum()
    assert square < chi_square_bound(degrees)


def test_the_line_goes_through_blocks_within_blocks():
    order = np.empty(16, int)
    order[_line(4, 4)] = np.arange(16)
    assert order.reshape(4, 4).tolist() == [[0, 1, 4, 5], [2, 3, 6, 7], [8, 9, 12, 13], [10, 11, 14, 15]]
    assert sorted(_line(5, 3).tolist()) == list(range(15))


@pytest.mark.parametrize("number", [0.0, 1.0 - 2**-53])
def test_no_number_of_the_generator_draws_a_pixel_of_no_mass(number):
    field = np.zeros((4, 6), np.float32)
    field[1, 2], field[2, 3] = 0.3, 0.1
    draw = SimpleNamespace(random=lambda count: np.full(count, number))
    for count in (1, 2, 4):
        for u, v in _stratified(field, count, draw):
            assert field[v, u] > 0


def test_stratified_windows_cover_more_than_those_apart_and_these_more_than_independent_ones():
    means = {
        strategy: np.mean([covered(choose_windows(LOOK, 20, strategy=strategy, seed=s)) for s in range(60)])
        for strategy in STRATEGIES
    }
    assert means["stratified"] > means["independent"] + 0.03
    assert means["apart"] > means["independent"] + 0.03
    assert means["independent"] > means["gibbs"] - 0.02


def test_each_part_of_a_landscape_gets_its_share_of_stratified_windows_every_time():
    """Two modes of the same mass: the chain stays in one of them, this draws half from each."""
    for seed in range(20):
        centres = choose_windows(LOOK, 20, seed=seed).centres
        left = (centres[:, 0] < 80).sum()
        assert 9 <= left <= 11


def test_windows_apart_keep_half_a_window_and_are_fewer_where_no_more_fit():
    centres = choose_windows(LOOK, 40, strategy="apart", seed=1).centres
    distances = np.linalg.norm(centres[:, None] - centres[None], axis=2)[np.triu_indices(len(centres), 1)]
    assert distances.min() >= 10.0
    spot = np.zeros(SHAPE, np.float32)
    spot[50:54, 60:64] = 1.0
    assert len(choose_windows(Look(spot), 40, strategy="apart", seed=1).centres) == 1


def test_a_share_of_the_windows_explores_where_the_landscape_is_zero():
    share, generator = [], np.random.default_rng(2)
    where = np.zeros(SHAPE)
    for _ in range(400):
        centres = choose_windows(LOOK, 30, explore=0.05, seed=generator).centres
        outside = LOOK.landscape[centres[:, 1], centres[:, 0]] == 0
        assert len(centres) == 30 and outside.sum() in (1, 2)
        share.append(outside.mean())
        np.add.at(where, (centres[outside, 1], centres[outside, 0]), 1)
    assert np.mean(share) == pytest.approx(0.05, abs=0.004)
    zero = LOOK.landscape == 0
    for half in (np.s_[:, :80], np.s_[:, 80:], np.s_[:60], np.s_[60:]):  # all of what is outside alike
        assert where[half].sum() / where.sum() == pytest.approx(zero[half].sum() / zero.sum(), abs=0.08)


def test_nothing_is_explored_where_the_landscape_is_positive_everywhere():
    flat = Look(np.ones(SHAPE, np.float32))
    assert len(choose_windows(flat, 30, explore=0.5, seed=0).centres) == 30
    only = choose_windows(LOOK, 30, explore=1.0, seed=0).centres
    assert (LOOK.landscape[only[:, 1], only[:, 0]] == 0).all()


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_with_a_memory_ten_cycles_see_more_than_without(strategy):
    def ten(memory):
        options = {"strategy": strategy, "memory": memory, "explore": 0.2, "seed": np.random.default_rng(5)}
        looked = []
        for _ in range(10):
            looked.append(choose_windows(LOOK, 5, size=12, **options))
            if memory is not None:
                memory.note(looked[-1])
        return np.count_nonzero(paint(tuple(looked), SHAPE))

    assert ten(Memory(SHAPE, keep=0.95)) > 1.1 * ten(None)


def test_a_memory_holds_off_what_was_seen_and_fades():
    memory = Memory(SHAPE, keep=0.5)
    memory.note(Windows(np.array([[50, 40]]), 20))
    assert memory.seen.sum() == 400 and memory.seen[30:50, 40:60].all()
    weighed = memory.weigh(LOOK.landscape)
    np.testing.assert_array_equal(weighed == 0, (LOOK.landscape == 0) | (memory.seen == 1))
    centres = choose_windows(LOOK, 200, memory=memory, seed=0).centres
    assert (memory.seen[centres[:, 1], centres[:, 0]] == 0).all()
    memory.note(Windows(np.array([[55, 40]]), 20))
    assert memory.seen[40, 42] == 0.5 and memory.seen[40, 50] == 1.0 and memory.seen[40, 62] == 1.0
    memory.forget()
    assert not memory.seen.any()


def test_when_all_was_seen_one_looks_again():
    memory = Memory(SHAPE)
    memory.seen[:] = 1.0
    np.testing.assert_array_equal(memory.weigh(LOOK.landscape), LOOK.landscape)
    assert len(choose_windows(LOOK, 9, memory=memory, explore=0.3, seed=0).centres) == 9


def test_a_memory_moves_with_a_camera_that_turns():
    """What was seen stays with the directions in space, whatever the points that told of the turn."""
    camera = Camera(160, 120, 130.0, 130.0, 80.0, 60.0)
    before = PosedCamera(camera, np.eye(4))
    pose = np.eye(4)
    pose[:3, :3] = rotation_matrices(np.array([0.06, -0.12, 0.05]))
    after = PosedCamera(camera, pose)
    points = np.random.default_rng(0).uniform((-0.3, -0.2, 0.5), (0.3, 0.2, 1.5), (60, 3))
    memory = Memory(SHAPE)
    memory.note(Windows(np.array([[70, 50]]), 20))
    pairs = before.project(points), after.project(points)
    pairs[0][3] = np.nan
    memory.move(*pairs)
    expected = after.project(before.rays(np.array([[69.5, 49.5]]))[1])[0]
    assert np.linalg.norm(expected - (69.5, 49.5)) > 10
    v, u = np.mgrid[:120, :160]
    mass = memory.seen.sum()
    found = (memory.seen * u).sum() / mass, (memory.seen * v).sum() / mass
    np.testing.assert_allclose(found, expected, atol=0.5)
    assert mass == pytest.approx(400, rel=0.1) and memory.seen.max() <= 1.0


@pytest.mark.parametrize("count", [0, 3])
def test_a_memory_that_cannot_follow_forgets(count):
    memory = Memory(SHAPE)
    memory.note(Windows(np.array([[70, 50]]), 20))
    memory.move(np.arange(2.0 * count).reshape(-1, 2), np.arange(2.0 * count).reshape(-1, 2))
    assert not memory.seen.any()


@pytest.mark.parametrize(
    ("change", "message", "error"),
    [
        ({"look": LOOK.landscape}, "look: expected a Look", ArgumentTypeError),
        ({"look": Look(np.zeros(SHAPE, np.float32))}, "look: the landscape is zero", ArgumentError),
        ({"count": -1}, "count", ArgumentError),
        ({"count": 2.5}, "count", ArgumentTypeError),
        ({"size": 0}, "size", ArgumentError),
        ({"strategy": "best"}, "strategy: one of gibbs, independent, apart, stratified", ArgumentError),
        ({"explore": -0.1}, "explore", ArgumentError),
        ({"explore": 1.1}, "explore", ArgumentError),
        ({"explore": np.nan}, "explore", ArgumentError),
        ({"memory": Memory((5, 5))}, r"landscape: the memory's shape \(5, 5\) expected", ArgumentError),
        ({"seed": -1}, "seed", ArgumentError),
    ],
)
def test_what_makes_no_sense_is_named(change, message, error):
    given = {"look": LOOK, "count": 5} | change
    with pytest.raises(error, match=message):
        choose_windows(given.pop("look"), given.pop("count"), **given)


def test_a_memory_of_nothing_is_refused():
    for keep in (-0.1, 1.0, np.nan):
        with pytest.raises(ArgumentError, match="keep"):
            Memory(SHAPE, keep=keep)
    with pytest.raises(ArgumentError, match="shape"):
        Memory((0, 5))
    with pytest.raises(ArgumentError, match="after: as many points as before, 5"):
        Memory(SHAPE).move(np.zeros((5, 2)), np.zeros((4, 2)))
    with pytest.raises(ArgumentError, match="before"):
        Memory(SHAPE).move(np.full((5, 2), np.inf), np.zeros((5, 2)))
    with pytest.raises(ArgumentError, match="window of 20 px does not fit"):
        Memory((10, 10)).note(Windows(np.array([[5, 5]])))


def test_a_piece_is_the_rectangle_with_most_of_the_landscape():
    rng = np.random.default_rng(0)
    for fraction in (0.04, 0.3, 1.0):
        landscape = rng.random((30, 40), dtype=np.float32) ** 8
        mask = choose_piece(Look(landscape), fraction).mask
        height, width = round(30 * fraction**0.5), round(40 * fraction**0.5)
        sums = np.lib.stride_tricks.sliding_window_view(landscape, (height, width)).sum(axis=(2, 3))
        v, u = np.unravel_index(sums.argmax(), sums.shape)
        assert mask.sum() == height * width and mask[v : v + height, u : u + width].all()


def test_ten_pieces_show_a_thing_as_a_whole_wherever_it_is():
    rows, columns = np.mgrid[:120, :160]
    landscape = np.exp(-((rows - 60.0) ** 2 + (columns - 80.0) ** 2) / 2e3).astype(np.float32)
    memory, whole = Memory((120, 160), keep=0.98), np.zeros((120, 160), bool)
    for _ in range(10):
        piece = choose_piece(Look(landscape), 0.3, margin=16, memory=memory)
        memory.note(piece, margin=16)
        # Where the middle of a thing of 32 px may be for all of it that is in the image to be in the piece.
        v, u = np.nonzero(piece.mask)
        low = [x.min() + 16 if x.min() > 0 else 0 for x in (v, u)]
        high = [
            x.max() - 16 if x.max() + 1 < side else side for x, side in zip((v, u), (120, 160), strict=True)
        ]
        whole[low[0] : high[0], low[1] : high[1]] = True
    assert whole.mean() > 0.9


@pytest.mark.parametrize("fraction", [0.0, -0.1, 1.1, np.nan])
def test_a_piece_is_a_share_of_the_image(fraction):
    with pytest.raises(ArgumentError, match="fraction"):
        choose_piece(Look(np.ones((4, 4), np.float32)), fraction)


def test_a_piece_of_nothing_is_an_error():
    with pytest.raises(ArgumentError, match="zero everywhere"):
        choose_piece(Look(np.zeros((4, 4), np.float32)), 0.5)
    with pytest.raises(ArgumentError, match="margin: less than half of 10 px"):
        choose_piece(Look(np.ones((20, 40), np.float32)), 0.25, margin=5)
    choose_piece(Look(np.ones((20, 40), np.float32)), 0.25, margin=4)
    choose_piece(Look(np.ones((20, 40), np.float32)), 1.0, margin=400)
    with pytest.raises(ArgumentError, match="memory"):
        choose_piece(Look(np.ones((4, 4), np.float32)), 0.5, memory=Memory((4, 5)))
