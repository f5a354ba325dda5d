"""The code in docs/your-robot.md runs as it stands there."""

import os
import re
from pathlib import Path

import numpy as np
import pytest

from yarp_folder import write_encoders, write_images

TEXT = (Path(__file__).parents[1] / "docs" / "your-robot.md").read_text()
DATA = os.environ.get("MOTORPRIME_DATA")


def block(heading):
    """The Python code below a heading."""
    section = TEXT.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    (code,) = re.findall(r"```python\n(.*?)```", section, re.S)
    return code


def run(code):
    scope = {}
    exec(compile(code, "docs/your-robot.md", "exec"), scope)
    return scope


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_block_of_code_is_run_by_one_of_these_tests():
    headings = ("From a table", "From a YARP recording", "With a URDF")
    assert len(re.findall("```python", TEXT)) == len([block(heading) for heading in headings])


def test_the_table_becomes_a_landscape_in_twenty_lines(here, capsys):
    code = block("From a table")
    statements = [line for line in code.splitlines() if line.strip() and "import" not in line]
    assert len(statements) <= 20
    rng = np.random.default_rng(2)
    joints = np.column_stack([rng.uniform(-0.5, 0.5, (80, 2)), np.full(80, 0.4)])
    left = 150 + 90 * joints[:, :2] + 20 * joints[:, 1:2] ** 2
    rows = np.hstack([joints, left, left - 30]).tolist()
    lines = [",".join(f"{value:.4f}" for value in row) for row in rows]
    lines[7] = ",".join(lines[7].split(",")[:5]) + ",,"
    header = "shoulder,elbow,wrist,left_u,left_v,right_u,right_v"
    (here / "table.csv").write_text("\n".join([header, *lines]))
    scope = run(code)
    printed = capsys.readouterr().out
    assert "80 postures; joints that never moved: ['wrist']" in printed
    assert "100% of the path is known" in printed
    np.testing.assert_allclose(scope["pixels"]["left"][0], left[0], atol=2.0)
    np.testing.assert_allclose(scope["looks"]["left"].landscape, scope["landscape"], rtol=1e-5)


def test_the_example_of_a_table_is_a_table(here):
    from motorprime.recordings import read_table

    (text,) = re.findall(r"\n    (shoulder,.*?)\n\n", TEXT, re.S)
    (here / "table.csv").write_text(text.replace("\n    ", "\n"))
    samples = read_table("table.csv")
    assert samples.names == ("shoulder", "elbow", "wrist")
    assert samples.seen("right").tolist() == [True, False]


def test_the_yarp_recording_becomes_a_hand_map(here, capsys):
    rng = np.random.default_rng(3)
    postures = np.column_stack([rng.uniform(-30, 30, (30, 2)), np.full(30, 5.0)])
    write_encoders(here / "recording" / "arm", postures)
    write_images(here / "recording" / "images" / "eye", postures[:, :2] + (80.0, 50.0))
    scope = run(block("From a YARP recording"))
    assert "30 held postures, 0 outliers" in capsys.readouterr().out
    predicted = scope["hand_map"].hand_pixels(np.deg2rad([0.0, 0.0]))["eye"][0]
    np.testing.assert_allclose(predicted, (80.0, 50.0), atol=3.0)


@pytest.mark.sim
@pytest.mark.skipif(not DATA, reason="set MOTORPRIME_DATA to the folder that holds icub_babbling")
def test_the_urdf_is_calibrated_by_the_recording(here, icub, capsys):
    (here / "icub.urdf").symlink_to(icub.urdf)
    (here / "icub_babbling").symlink_to(Path(DATA) / "icub_babbling", target_is_directory=True)
    run(block("With a URDF"))
    found = re.search(r"median (\S+) px", capsys.readouterr().out)
    assert float(found.group(1)) < 0.5
