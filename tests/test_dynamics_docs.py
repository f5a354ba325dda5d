"""The code in docs/coupled-dynamics.md runs as it stands there."""

import re
from pathlib import Path

import numpy as np

TEXT = (Path(__file__).parents[1] / "docs" / "coupled-dynamics.md").read_text()


def test_its_loop_goes_where_its_mental_simulation_goes(capsys):
    (code,) = re.findall(r"```python\n(.*?)```", TEXT, re.S)
    scope = {}
    exec(compile(code, "docs/coupled-dynamics.md", "exec"), scope)
    plan, state, goal = scope["plan"], scope["state"], scope["goal"]
    assert capsys.readouterr().out.startswith("True ")
    np.testing.assert_allclose(plan.palms[100], state.palm, atol=1e-9)
    assert np.linalg.norm(state.palm[:3, 3] - goal.palm[:3, 3]) < 0.3 * np.linalg.norm(
        plan.path[0] - goal.palm[:3, 3]
    )
