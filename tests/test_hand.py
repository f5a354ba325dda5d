"""The hand's synergy: one opening, all motors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from motorprime import ICUB, ArgumentError
from motorprime.control.hand import Hand
from motorprime.errors import ArgumentTypeError

TWO = Hand(
    motors=("thumb", "finger"),
    shapes={"open": (0.1, 0.0), "grasp": (0.5, 1.0), "fist": (0.9, 1.2), "flat": (-0.3, 0.2)},
    path=((1.0, "open"), (0.0, "grasp"), (-0.5, "fist")),
    slim="flat",
)


@pytest.mark.parametrize(("opening", "shape"), TWO.path)
def test_the_path_runs_through_its_shapes(opening, shape):
    assert TWO.targets(opening) == pytest.approx(TWO.shape(shape))


def test_between_shapes_the_targets_are_linear_in_the_opening():
    assert TWO.targets(0.25) == pytest.approx({"thumb": 0.4, "finger": 0.75})
    assert TWO.targets(-0.1) == pytest.approx({"thumb": 0.58, "finger": 1.04})


def test_an_opening_beyond_the_ends_is_the_end():
    assert TWO.targets(1.3) == pytest.approx(TWO.shape("open"))
    assert TWO.targets(-2.0) == pytest.approx(TWO.shape("fist"))
    assert (TWO.widest, TWO.tightest) == (1.0, -0.5)


def test_a_slim_hand_leaves_the_opening_for_the_slim_shape_by_shares():
    assert TWO.targets(0.3, slim=1.0) == pytest.approx(TWO.shape("flat"))
    assert TWO.targets(1.0, slim=0.25) == pytest.approx({"thumb": 0.0, "finger": 0.05})


@pytest.mark.parametrize("opening", [np.nan, np.inf, [0.1, 0.2], None])
def test_an_opening_that_is_no_number_is_named(opening):
    with pytest.raises((ArgumentError, ArgumentTypeError), match="opening"):
        TWO.targets(opening)


@pytest.mark.parametrize("slim", [-0.1, 1.1, np.nan])
def test_a_slimness_beyond_0_to_1_is_named(slim):
    with pytest.raises(ArgumentError, match="slim"):
        TWO.targets(0.5, slim=slim)


def test_an_unknown_shape_is_named_with_those_there_are():
    with pytest.raises(ArgumentError, match=r"'claw'.*'fist', 'flat', 'grasp', 'open'"):
        TWO.shape("claw")


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"shapes": {**TWO.shapes, "open": (0.1,)}}, r"shapes\['open'\]: expected shape \(2,\)"),
        ({"shapes": {**TWO.shapes, "open": (0.1, np.nan)}}, r"shapes\['open'\]: expected finite"),
        ({"path": ((1.0, "open"), (0.0, "claw"))}, "no shape 'claw'"),
        ({"slim": "thin"}, "no shape 'thin'"),
        ({"path": ((0.0, "grasp"), (1.0, "open"))}, "descending"),
        ({"path": ((1.0, "open"), (1.0, "grasp"))}, "descending"),
        ({"path": ((1.0, "open"),)}, "two or more"),
        ({"path": ((np.nan, "open"), (0.0, "grasp"))}, "path: expected finite"),
    ],
)
def test_a_hand_that_does_not_fit_together_is_named(change, named):
    with pytest.raises(ArgumentError, match=named):
        replace(TWO, **change)


def test_the_icub_s_hand_stays_within_its_motors_ranges():
    hand = ICUB.hand
    limits = ICUB.limits(hand.motors)
    assert len(hand.motors) == 9
    for slim in (0.0, 0.5, 1.0):
        for opening in np.linspace(hand.tightest, hand.widest, 31):
            targets = np.array(list(hand.targets(opening, slim=slim).values()))
            assert (targets >= limits[:, 0]).all() and (targets <= limits[:, 1]).all()


def test_every_finger_of_the_icub_s_hand_flexes_further_the_less_the_opening():
    hand = ICUB.hand
    bends = [motor for motor in hand.motors if motor not in ("r_hand_finger", "r_thumb_oppose")]
    rows = np.array(
        [
            [hand.targets(opening)[motor] for motor in bends]
            for opening in np.linspace(hand.widest, hand.tightest, 31)
        ]
    )
    assert (np.diff(rows, axis=0) >= -1e-12).all()
    assert (rows[-1] - rows[0] > 0.2).all()


def test_nine_motors_move_the_nineteen_joints_of_the_icub_s_hand_and_count_what_they_move():
    """A motor that bends several joints in a row counts their sum, so their shares of it add up to 1."""
    hand = ICUB.hand
    driven = {joint: terms for joint, terms in ICUB.couplings.items() if set(terms) & set(hand.motors)}
    assert len(driven) == 19
    assert {motor for terms in driven.values() for motor in terms} == set(hand.motors)
    for motor in hand.motors:
        if motor == "r_hand_finger":
            continue
        for finger in ("thumb", "index", "middle", "ring", "little"):
            shares = [
                terms[motor] for joint, terms in driven.items() if f"r_{finger}_" in joint and motor in terms
            ]
            assert not shares or sum(shares) == pytest.approx(1.0)


def test_spreading_moves_index_and_little_finger_apart():
    factor = {joint: terms.get("r_hand_finger", 0.0) for joint, terms in ICUB.couplings.items()}
    assert factor["r_index_adduction_joint"] < 0.0 < factor["r_little_adduction_joint"]
