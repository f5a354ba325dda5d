"""The code in docs/inverse-kinematics.md runs as it stands there."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.sim

TEXT = (Path(__file__).parents[1] / "docs" / "inverse-kinematics.md").read_text()


def test_the_example_grasps_the_glass_and_follows_to_it(capsys):
    (code,) = re.findall(r"```python\n(.*?)```", TEXT, re.S)
    scope = {}
    exec(compile(code, "docs/inverse-kinematics.md", "exec"), scope)
    assert re.fullmatch(r"\d\.\d mm, \d\.\d deg, solved: True\n", capsys.readouterr().out)
    palm, grasp = scope["solver"].palm(scope["angles"]), scope["grasp"].palm
    assert np.linalg.norm(palm[:3, 3] - grasp[:3, 3]) < 0.002
