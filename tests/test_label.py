"""Finding a thing by its label: what counts as read, and a bottle among boxes in the simulator."""

from __future__ import annotations

import numpy as np
import pytest

import motorprime as mp
from motorprime import Detections, Everywhere
from motorprime.tasks.label import find_label
from motorprime.views import Views

SHAPE = (480, 640)
PLACE = np.array([0.02, -0.03, 0.1])


def views():
    intrinsics = np.array([[500.0, 0, 320], [0, 500.0, 240], [0, 0, 1]])
    rig = {
        name: intrinsics @ np.column_stack([np.eye(3), [-x, 0.0, 0.5]])
        for name, x in (("left", -0.04), ("right", 0.04))
    }
    return Views(mp.PinholeProjection(rig, shape=SHAPE))


class Told:
    """Reads what it was told to, around the place's pixel in the first and somewhere else in the others."""

    def __init__(self, *words):
        self.words, self.asked = words, []

    def detect(self, image, where):
        self.asked.append(where)
        camera = "left" if image[0, 0, 0] == 0 else "right"
        u, v = views().project(PLACE[None])[camera][0]
        boxes = [(u - 20 + 60 * k, v - 5, u + 21 + 60 * k, v + 6) for k in range(len(self.words))]
        return Detections(
            np.array(boxes, np.float32).reshape(-1, 4), np.ones(len(boxes), np.float32), self.words
        )


IMAGES = {"left": np.zeros((*SHAPE, 3), np.uint8), "right": np.ones((*SHAPE, 3), np.uint8)}
EVERYWHERE = {"left": Everywhere(), "right": Everywhere()}


def test_a_label_lies_where_its_middles_meet():
    detector = Told("MILK", "RICE")
    found = find_label("milk", IMAGES, EVERYWHERE, detector, views())
    np.testing.assert_allclose(found.place, PLACE, atol=1e-4)
    assert set(found.boxes) == {"left", "right"} and detector.asked == list(EVERYWHERE.values())
    other = find_label("RICE", IMAGES, EVERYWHERE, detector, views())
    assert other.place[0] > PLACE[0] + 0.03


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("MIlk",), True),
        (("M1LK",), True),
        (("AILK", "RICE"), True),
        (("MI",), False),
        (("SALT",), False),
        ((), False),
    ],
)
def test_a_letter_may_be_misread_and_a_word_not(words, found):
    assert (find_label("MILK", IMAGES, EVERYWHERE, Told(*words), views()) is not None) == found


def test_what_reads_most_alike_is_it():
    found = find_label("MILK", IMAGES, EVERYWHERE, Told("MILK", "MILL"), views())
    np.testing.assert_allclose(found.place, PLACE, atol=1e-4)
    assert find_label("MILK", IMAGES, EVERYWHERE, Told("MIK"), views(), least=0.99) is None


def test_an_eye_that_does_not_read_it_leaves_it_not_found():
    class OneEyed(Told):
        def detect(self, image, where):
            return super().detect(image, where) if image[0, 0, 0] == 0 else Detections()

    assert find_label("MILK", IMAGES, EVERYWHERE, OneEyed("MILK"), views()) is None
