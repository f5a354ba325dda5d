"""The paper's experiments: what counts as found, what is shown to the robot, and how both sides look."""

import json

import cv2
import numpy as np
import pytest

from motorprime import Memory, Windows, shipped
from motorprime.detectors import Mask
from motorprime.errors import ArgumentError
from motorprime.evaluate.paper import PAPER, beside, elsewhere, evaluate_paper, hit
from motorprime.evaluate.paper_moments import CARD, DETECTORS, Sight, paper_moments, printed
from motorprime.evaluate.paper_picture import draw_paper
from motorprime.evaluate.paper_sides import Gaze, Keypoints
from motorprime.step import Attended
from motorprime.tasks.timing import Stages

pytestmark = pytest.mark.sim

SIGHT = Sight({}, {"left": (10, 20, 30, 40)})


def test_a_detection_is_right_when_its_centre_is_a_pixel_of_the_target_s_box():
    corners = np.array([[10.0, 20.0], [29.0, 39.0]])
    assert hit(SIGHT, {"left": corners}) == {"left"} and beside(SIGHT, {"left": corners}) == 0
    off = np.array([[9.4, 30.0], [29.6, 30.0], [20.0, 19.4], [20.0, 39.6]])
    assert hit(SIGHT, {"left": off}) == set() and beside(SIGHT, {"left": off}) == 4
    # An eye that does not see the target finds nothing right.
    assert hit(SIGHT, {"right": corners}) == set() and beside(SIGHT, {"right": corners}) == 2
    assert beside(SIGHT, {"left": np.zeros((0, 2))}) == 0


def test_masks_move_on_to_what_was_not_looked_at_in_pieces():
    landscape = np.tile(np.linspace(0.1, 1.0, 400, dtype=np.float32), (240, 1))
    first = Attended(landscape, mask=landscape > landscape[0, 279])
    memories: dict[str, Memory] = {}
    looked = [elsewhere({"left": first}, memories)["left"].mask for _ in range(3)]
    np.testing.assert_array_equal(looked[0], first.mask)
    shares = [float((mask & ~looked[0]).mean()) for mask in looked]
    assert shares[0] == 0.0 and shares[1] > 0.1 and all(mask.mean() <= 0.31 for mask in looked)
    # The next is a piece with the image's proportions beside what was seen, and takes some of its border
    # along: what lies across it was seen in part only.
    v, u = np.nonzero(looked[1])
    assert looked[1][v.min() : v.max() + 1, u.min() : u.max() + 1].all()
    assert (np.ptp(u) + 1, np.ptp(v) + 1) == (219, 131) and 300 <= u.max() < 400
    windows = {"left": Attended(landscape, centres=np.zeros((3, 2), np.int32))}
    assert elsewhere(windows, memories) is windows


def test_a_memory_of_a_mask_keeps_off_its_border_but_not_off_the_image_s():
    memory, mask = Memory((60, 80)), np.zeros((60, 80), bool)
    mask[:30, :40] = True
    memory.note(Mask(mask), margin=5)
    np.testing.assert_array_equal(np.argwhere(memory.seen == 1.0).max(axis=0), (24, 34))
    assert memory.seen[0, 0] == 1.0 and memory.seen.sum() == 25 * 35
    memory.note(Windows(np.array([[70, 50]]), 4))
    assert memory.seen[0, 0] == pytest.approx(0.8) and memory.seen[50, 70] == 1.0
    with pytest.raises(ArgumentError, match="mask: shape"):
        memory.note(Mask(mask.T))
    with pytest.raises(ArgumentError, match="margin"):
        memory.note(Mask(mask), margin=-1)


@pytest.fixture(scope="module")
def moment(icub):
    (found,) = paper_moments(icub, "peripersonal", 0, 1, obstacle=True)
    return found


def test_a_scene_shows_the_glass_and_in_its_place_the_card(moment):
    assert set(moment.plain) == set(moment.cluttered) == set(DETECTORS)
    card_boxes = moment.plain["surf"].boxes
    for camera, image in moment.plain["surf"].images.items():
        assert image.shape == (240, 320, 3)
        glass, card = (moment.plain[name].boxes[camera] for name in DETECTORS)
        middles = [(np.array(box[:2]) + box[2:]) / 2 for box in (glass, card)]
        assert np.abs(middles[0] - middles[1]).max() < 40
        u0, v0, u1, v1 = card
        there = image[v0:v1, u0:u1].astype(float)
        assert there.std() > 35 and np.abs(there[..., 0] - there[..., 2]).mean() < 20  # black and white
        # Things alike change the picture, and not where the target is.
        assert moment.cluttered["histogram"].boxes[camera] == glass
    assert any(
        (moment.plain[name].images[camera] != moment.cluttered[name].images[camera]).any()
        for name in DETECTORS
        for camera in ("left", "right")
    )
    # The room has other print than the card's, which does not cover it.
    assert any(
        (moment.bare.images[camera] != moment.plain["surf"].images[camera]).any() for camera in card_boxes
    )
    assert moment.bare.boxes == card_boxes
    rng = np.random.default_rng(0)
    noisy, image = moment.plain["surf"].noisy(rng)["left"], moment.plain["surf"].images["left"]
    assert 1.0 < (noisy.astype(float) - image)[(image > 20) & (image < 235)].std() < 3.0


def test_the_card_is_found_where_it_stands_and_only_where_is_looked(moment, icub):
    side, sight = Keypoints(), moment.plain["surf"]
    images = sight.noisy(np.random.default_rng(0))
    stages = Stages()
    assert hit(sight, side.everywhere(images, stages)) and list(stages.seconds) == ["SURF"]
    landscape, there, away = np.ones((240, 320), np.float32), {}, {}
    for camera, (u0, v0, u1, v1) in sight.boxes.items():
        mask = np.zeros((240, 320), bool)
        mask[v0:v1, u0:u1] = True
        there[camera], away[camera] = (Attended(landscape, mask=m) for m in (mask, ~mask))
    assert hit(sight, side.attended(images, there, stages))
    assert not hit(sight, side.attended(images, away, stages))
    gaze = Gaze(shipped.neural_projection(icub), shipped.peripersonal_model(icub))
    kept: dict[str, Attended] = {}
    where = gaze.where(moment, stages, masks=True, seed=0, kept=kept)
    assert (
        where and all(0.25 < look.mask.mean() < 0.31 for look in where.values()) and set(kept) == set(where)
    )


def test_the_picture_of_the_card_has_the_card_s_proportions():
    height, width = printed().shape[:2]
    assert width / height == pytest.approx(CARD[0] / CARD[1])


def test_a_series_has_a_row_for_each_of_the_paper_s(icub, monkeypatch, tmp_path):
    """Only the scenes of the search: a reach takes much longer."""
    from motorprime.evaluate import paper

    real = paper.paper_moments
    monkeypatch.setattr(
        paper,
        "paper_moments",
        lambda robot, kind, *given, **named: real(robot, "peripersonal", *given, **named),
    )
    ticks = iter(range(10**6))
    result = evaluate_paper(icub, measurements=1, clock=lambda: float(next(ticks)))
    assert json.loads(json.dumps(result))["refused"] == 0
    for row, speedup in PAPER.items():
        figures = result[row]
        assert figures["paper_speedup"] == speedup and figures["measurements"] == 2
        assert figures["speedup"] == pytest.approx(figures["full_ms"] / figures["attended_ms"])
        assert ("speedup_in_bare_room" in figures) == row.startswith("surf")
        assert 0.0 <= figures["found"] <= 1.0 and figures["obstacle"]["measurements"] == 1
    assert result["histogram_motorplan"]["found"] == 1.0
    assert set(result["back_projection"]) == {"peripersonal", "motorplan"}
    draw_paper(result, tmp_path / "paper.png")
    drawn = cv2.imread(str(tmp_path / "paper.png"))
    assert drawn is not None and 0.05 < (drawn < 200).any(axis=2).mean() < 0.6


def test_bad_numbers_are_named(icub):
    with pytest.raises(ArgumentError, match="measurements"):
        evaluate_paper(icub, measurements=0)
