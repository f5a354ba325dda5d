"""The attention benchmark: recall curves of known maps, and what is counted."""

import numpy as np
import pytest

from motorprime import ArgumentError
from motorprime.attention import Look
from motorprime.evaluate import attention as benchmark
from motorprime.evaluate.attention import GRID, evaluate_attention, figures_of, found, recalls
from motorprime.evaluate.attention_moments import METHODS, Moment, maps_of
from pictures import shapes

pytestmark = pytest.mark.sim

SHAPE = (40, 50)


def relevant_square():
    relevant = np.zeros(SHAPE, np.bool_)
    relevant[10:20, 5:25] = True  # a tenth of the image
    return relevant


def test_a_map_of_the_relevant_pixels_finds_them_all_at_their_share(rng):
    relevant = relevant_square()
    counts = found(relevant.astype(np.float32), relevant, rng)
    assert counts[0] == 0
    assert counts[GRID // 20] == 100  # all of the first twentieth are relevant
    assert counts[GRID // 10] == counts[-1] == 200


def test_the_larger_comes_first(rng):
    relevant = relevant_square()
    counts = found(-relevant.astype(np.float32), relevant, rng)
    assert counts[GRID * 9 // 10] == 0
    assert counts[-1] == 200


def test_ties_are_broken_at_random_and_by_the_seed_alone():
    """Were they broken by place, the upper left would come first."""
    relevant = np.zeros(SHAPE, np.bool_)
    relevant[:4] = True  # the first tenth of all rows
    flat = np.zeros(SHAPE, np.float32)
    counts = found(flat, relevant, np.random.default_rng(3))
    np.testing.assert_allclose(counts / 200, np.linspace(0, 1, GRID + 1), atol=0.08)
    np.testing.assert_array_equal(counts, found(flat, relevant, np.random.default_rng(3)))
    assert (counts != found(flat, relevant, np.random.default_rng(4))).any()


def test_both_eyes_of_a_scene_count_by_their_relevant_pixels(rng):
    little = np.zeros(SHAPE, np.bool_)
    little[0, :50] = True
    maps = {name: np.zeros(SHAPE, np.float32) for name in METHODS}
    seen = [
        Moment(None, relevant_square(), maps | {"center": relevant_square().astype(np.float32)}),
        Moment(None, little, maps | {"center": -little.astype(np.float32)}),
    ]
    curve = recalls(seen, rng)["center"]
    assert curve[GRID // 10] == pytest.approx(200 / 250)
    assert curve[-1] == 1.0


def test_where_a_curve_reaches_95_percent_and_its_mean():
    parts = np.linspace(0.0, 1.0, GRID + 1)
    assert figures_of(parts) == pytest.approx({"pixels_for_95": 0.95, "auc": 0.5})
    assert figures_of(np.minimum(1.0, 4.0 * parts)) == pytest.approx({"pixels_for_95": 0.2375, "auc": 0.875})
    steep = figures_of(np.minimum(1.0, 4444.0 * parts))
    assert 0.0 < steep["pixels_for_95"] < 1.0 / GRID


def test_every_method_has_its_map():
    image = shapes(5, *SHAPE)
    plan = np.zeros(SHAPE, np.float32)
    plan[5, 7] = 2.0
    near, path = np.zeros(SHAPE, np.float32), np.zeros(SHAPE, np.float32)
    near[20, 20], path[30, 3] = 1.0, 1.0
    maps = maps_of(image, plan, Look(path), Look(near), np.array([[10.0, 4.0], [20.0, 8.0]]))
    assert tuple(maps) == METHODS
    assert all(found.shape == SHAPE and found.dtype == np.float32 for found in maps.values())
    first = {name: np.unravel_index(int(found.argmax()), SHAPE) for name, found in maps.items()}
    assert first["center"] in [(19, 24), (19, 25), (20, 24), (20, 25)]
    assert first["zoom_lens"] == (6, 15)
    assert first["peripersonal"] == (20, 20)
    assert first["palm_path"] == (30, 3)
    assert first["motorplan"] == first["motorplan_saliency"] == (5, 7)
    assert not maps["uniform"].any()


def test_what_an_eye_does_not_see_leaves_its_map_empty():
    maps = maps_of(shapes(5, *SHAPE), None, None, None, None)
    assert not maps["motorplan"].any()
    assert not maps["peripersonal"].any()
    np.testing.assert_array_equal(maps["zoom_lens"], maps["center"])


def test_scenes_in_which_nothing_moves_are_replaced_and_counted(monkeypatch):
    """With maps of the relevant pixels themselves, and one that says the contrary."""

    def fake(robot, seed, number):
        if number % 3 == 0:
            return None
        relevant = relevant_square()
        maps = {name: relevant.astype(np.float32) for name in METHODS}
        return [Moment(None, relevant, maps | {"fine_grained": -maps["uniform"]})]

    monkeypatch.setattr(benchmark, "moments", fake)
    result = evaluate_attention(None, scenes=7, seed=5)
    assert (result["scenes"], result["refused"], result["seed"]) == (7, 4, 5)
    assert result["relevant"] == pytest.approx(0.1)
    assert result["motorplan"]["pixels_for_95"] == pytest.approx(0.095)
    assert result["best_saliency"] == "spectral_residual"
    assert result["fine_grained"]["pixels_for_95"] == pytest.approx(0.995)
    assert result["ratio_to_saliency"] == pytest.approx(1.0)
    assert len(result["details"]["motorplan"]) == 101


def test_a_number_of_scenes_is_expected():
    with pytest.raises(ArgumentError, match="scenes"):
        evaluate_attention(None, scenes=0)
