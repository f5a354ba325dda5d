"""What the README and the examples promise runs as it stands there."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

import motorprime as mp
from motorprime.control.movement import Goal, State

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_examples_run(example: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(example), run_name="__main__")
    assert capsys.readouterr().out


def test_own_robot_finds_its_disc_where_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(ROOT / "examples" / "01_own_robot.py"), run_name="__main__")
    found = re.search(r"the disc is at \[(.*?)\] m, truly at \[(.*?)\] m", capsys.readouterr().out)
    assert found is not None
    seen, true = (np.array(group.split(), dtype=float) for group in found.groups())
    np.testing.assert_allclose(seen, true, atol=2e-3)


def test_readme_code_runs_as_printed(capsys: pytest.CaptureFixture[str]) -> None:
    code = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.S)
    assert code is not None
    lines = [line for line in code.group(1).splitlines() if line.strip()]
    assert len(lines) <= 11, "the README promises ten lines and the import"
    example = runpy.run_path(str(ROOT / "examples" / "01_own_robot.py"))
    matrices, disc = example["rig"](), np.array([-0.05, -0.03, 0.0])
    images = {name: example["picture"](matrix, disc) for name, matrix in matrices.items()}
    blue = np.tile(np.array([[40, 70, 200]], np.uint8), (100, 1))
    given = {
        "P_left": matrices["left"],
        "P_right": matrices["right"],
        "images": images,
        "path": np.linspace([0.15, -0.12, 0.1], disc, 60),
        "detector": mp.HistogramDetector(blue),
    }
    exec(compile(code.group(1), "README.md", "exec"), given)
    out = capsys.readouterr().out
    assert "left: 1 found" in out
    assert "right: 1 found" in out


def test_readme_code_of_the_dynamics_runs_as_printed(capsys: pytest.CaptureFixture[str]) -> None:
    _, code = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.S)
    palm = np.eye(4)
    palm[:3, 3] = (-0.3, 0.1, 0.0)
    start = palm.copy()
    start[:3, 3] = (-0.2, 0.3, 0.1)
    given = {"state": State(start[:3, 3], start, 1.0), "goal": Goal(palm[:3, 3], palm)}
    exec(compile(code, "README.md", "exec"), given)
    np.testing.assert_allclose(given["way"][-1], palm[:3, 3], atol=0.002)
    assert "Certificate(continuous=-" in capsys.readouterr().out
