"""The code in docs/detectors.md runs as it stands there, and its table is the evaluation's."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

import motorprime as mp
from motorprime.evaluate.regions import DETECTORS

TEXT = (Path(__file__).parents[1] / "docs" / "detectors.md").read_text()


def test_a_detector_of_one_s_own_is_wrapped_as_it_says(capsys):
    (code,) = re.findall(r"```python\n(.*?)```", TEXT, re.S)
    image = np.zeros((240, 320, 3), np.uint8)
    image[100:110, 150:170] = (230, 10, 10)
    image[10:20, 10:20] = (230, 10, 10)
    path = np.array([[80.0, 60.0], [160.0, 105.0]], np.float32)
    look = mp.Look(mp.kernel_landscape(path, (240, 320), width=40.0))
    scope = {"image": image, "look": look}
    exec(compile(code, "docs/detectors.md", "exec"), scope)
    assert scope["found"].boxes.tolist() == [[150, 100, 170, 110]]
    assert capsys.readouterr().out.startswith("1 ") and scope["found"].failure is None
    assert scope["found"].attended < 0.5 * 240 * 320


def test_the_table_has_every_detector_that_is_measured():
    rows = re.findall(r"\n\| (\w+) \| [\d.]+ \| [\d.]+ % \|", TEXT)
    assert rows == [*DETECTORS, "text", "cascade"]
