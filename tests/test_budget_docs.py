"""The code in docs/budget.md runs as it stands there."""

import re
from pathlib import Path

TEXT = (Path(__file__).parents[1] / "docs" / "budget.md").read_text()


def test_the_code_finds_the_thing_and_says_what_it_looked_at(capsys):
    (code,) = re.findall(r"```python\n(.*?)```", TEXT, re.S)
    scope = {}
    exec(compile(code, "docs/budget.md", "exec"), scope)
    glance = scope["glance"]
    assert glance.failure is None and glance.looks and 0.0 < glance.looked < 1.0
    assert "of the image" in capsys.readouterr().out
    found = scope["detector"].detect(scope["image"], scope["glance"].looks[0])
    assert found.boxes.tolist() in ([], [[150, 100, 180, 130]])


def test_the_wrapper_is_three_lines():
    (code,) = re.findall(r"```python\n(.*?)```", TEXT, re.S)
    start = code.index("costs = calibrate_costs(")
    assert len(code[start:].split("\n\n")[0].splitlines()) == 3
