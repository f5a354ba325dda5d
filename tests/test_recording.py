"""The run folder: complete after a run, readable after half of one."""

import json

import numpy as np
import pytest

import synthetic_run
from motorprime import ArgumentError, MissingExtraError, StateError
from motorprime.recording import Recording, fresh_folder
from motorprime.report import plots
from motorprime.summary import spread, summarise

pytestmark = pytest.mark.viz


def start(folder, **changes):
    return Recording(folder, **({"title": "Reach", "meta": {"seed": 1}, "video": False} | changes))


def result(folder):
    return json.loads((folder / "result.json").read_text())


def test_fresh_names_never_touch_an_old_folder(tmp_path):
    base = tmp_path / "runs"
    assert [fresh_folder(base, "demo").name for _ in range(3)] == ["demo", "demo-2", "demo-3"]
    (base / "note").write_text("a file")
    assert fresh_folder(base, "note").name == "note-2"


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "/etc", "../up"])
def test_a_name_is_no_path(tmp_path, name):
    with pytest.raises(ArgumentError, match="plain folder name"):
        fresh_folder(tmp_path, name)


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ArgumentError, match=r"cannot write into .*demo"):
        fresh_folder(tmp_path / "file", "demo")
    with pytest.raises(ArgumentError, match=r"cannot write into .*demo"):
        start(tmp_path / "file" / "demo")


def test_a_finished_run(tmp_path):
    view = np.zeros((48, 64, 3), np.uint8)
    with start(tmp_path / "demo", video=True, bystander=lambda: view) as recording:
        for cycle in synthetic_run.run():
            recording.add(cycle, truth=np.array([-0.3, 0.1, 0.051]))
        recording.finish("reached", "", {"palm_error_mm": np.float64(1.5), "nothing": np.nan})
    assert sorted(p.name for p in (tmp_path / "demo").iterdir()) == [
        "picture.jpg",
        "report.html",
        "result.json",
        "video.webm",
    ]
    data = result(tmp_path / "demo")
    assert data["outcome"] == "reached"
    assert data["meta"] == {"seed": 1}
    assert data["judged"] == {"palm_error_mm": 1.5, "nothing": None}
    assert data["cycles"] == {"total": 9, "search": 2, "fixate": 1, "reach": 6}
    assert data["stages_ms"]["detection"]["median"] == pytest.approx(2.0)
    assert data["attended_ms"]["median"] == pytest.approx(6.0)
    assert data["full_frame_ms"]["median"] == pytest.approx(60.0)
    assert data["back_projection_ms"]["median"] == pytest.approx(1.0)
    assert data["speed_up"] == pytest.approx(10.0)
    assert data["attended_fraction"]["median"] == pytest.approx(0.2)
    assert data["located"] == {"attended": 8, "full_frame": 8}
    assert set(data["versions"]) == {"motorprime", "numpy", "opencv", "python"}
    assert len(data["history"]) == 9
    assert data["history"][4]["truth"] == [-0.3, 0.1, 0.051]
    assert data["history"][0]["goal"] is None
    assert data["certificates"] == {}


def test_what_is_known_of_a_pick_is_recorded(tmp_path):
    with start(tmp_path / "demo", certificates=synthetic_run.CERTIFICATES) as recording:
        for cycle in synthetic_run.pick():
            recording.add(cycle)
        recording.finish("lifted")
    data = result(tmp_path / "demo")
    assert data["certificates"] == synthetic_run.CERTIFICATES
    assert [r["phase"] for r in data["history"]][-3:] == ["reach", "grasp", "lift"]
    assert [len(r["legs"]) for r in data["history"]] == [0, 0, 0, 3, 3, 2, 1, 1, 1]
    assert [r["opening"] for r in data["history"]] == [None, None, None, 1.0, 1.0, 1.0, 0.6, 0.1, -0.5]
    assert [r["event"] for r in data["history"]].count("The glass jumps 10 cm") == 1
    assert data["history"][0]["obstacles"] == []
    assert data["history"][2]["obstacles"] == [
        {"centre": [-0.25, 0.2, 0.005], "radius": 0.03, "height": 0.13}
    ]


def test_the_bystander_is_asked_only_for_a_video(tmp_path):
    def never():
        raise AssertionError("asked")

    with start(tmp_path / "demo", bystander=never) as recording:
        recording.add(synthetic_run.cycle())
        recording.finish("missed")
    assert not (tmp_path / "demo" / "video.webm").exists()


def test_ctrl_c_leaves_a_readable_folder(tmp_path):
    with pytest.raises(KeyboardInterrupt), start(tmp_path / "demo", video=True) as recording:
        for cycle in synthetic_run.run()[:3]:
            recording.add(cycle)
        raise KeyboardInterrupt
    data = result(tmp_path / "demo")
    assert data["outcome"] == "interrupted"
    assert data["cycles"]["total"] == 3
    report = (tmp_path / "demo" / "report.html").read_text()
    assert report.index("This run was not completed") < report.index("<h1>")
    assert (tmp_path / "demo" / "video.webm").stat().st_size > 0


def test_an_error_is_told_and_passed_on(tmp_path):
    with pytest.raises(ZeroDivisionError), start(tmp_path / "demo") as recording:
        recording.add(synthetic_run.cycle())
        raise ZeroDivisionError("<b>oh</b>")
    data = result(tmp_path / "demo")
    assert (data["outcome"], data["reason"]) == ("failed", "ZeroDivisionError: <b>oh</b>")
    report = (tmp_path / "demo" / "report.html").read_text()
    assert "&lt;b&gt;oh&lt;/b&gt;" in report and "<b>oh</b>" not in report


def test_an_error_before_the_first_cycle(tmp_path):
    with pytest.raises(ValueError, match="early"), start(tmp_path / "demo", video=True):
        raise ValueError("early")
    assert result(tmp_path / "demo")["cycles"] == {"total": 0}
    assert "No vision cycle was recorded" in (tmp_path / "demo" / "report.html").read_text()


def test_the_first_error_is_not_hidden_by_one_of_writing(tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    with pytest.raises(ZeroDivisionError), start(tmp_path / "demo"):
        monkeypatch.setattr("motorprime.recording.write_report", full)
        raise ZeroDivisionError


def test_a_full_disk_is_named(tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    with start(tmp_path / "demo") as recording:
        recording.add(synthetic_run.cycle())
        with monkeypatch.context() as patch:
            patch.setattr("motorprime.recording.write_report", full)
            with pytest.raises(StateError, match="No space left"):
                recording.finish("reached")


def test_a_killed_run_leaves_a_result_that_says_so(tmp_path):
    start(tmp_path / "demo")
    assert result(tmp_path / "demo")["outcome"] == "running"


def test_a_result_that_cannot_be_replaced_stays(tmp_path, monkeypatch):
    recording = start(tmp_path / "demo")

    def torn(*_):
        raise OSError(5, "Input/output error")

    with monkeypatch.context() as patch:
        patch.setattr("os.replace", torn)
        with pytest.raises(StateError, match="Input/output"):
            recording.finish("reached")
    assert result(tmp_path / "demo")["outcome"] == "running"
    assert [p.name for p in (tmp_path / "demo").iterdir()] == ["result.json"]


def test_an_old_run_is_not_overwritten(tmp_path):
    start(tmp_path / "demo").finish("reached")
    with pytest.raises(ArgumentError, match="holds a run already"):
        start(tmp_path / "demo")
    assert result(tmp_path / "demo")["outcome"] == "reached"


def test_a_missing_matplotlib_is_told_before_the_run(tmp_path, monkeypatch):
    monkeypatch.setattr(plots.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"motorprime\[viz\]"):
        start(tmp_path / "demo")
    assert not (tmp_path / "demo").exists()


def test_without_a_full_scan_there_is_no_speed_up(tmp_path):
    with start(tmp_path / "demo") as recording:
        recording.add(synthetic_run.cycle(full=False))
        recording.finish("reached")
    data = result(tmp_path / "demo")
    assert data["full_frame_ms"] is None and data["speed_up"] is None
    assert data["located"] == {"attended": 1, "full_frame": None}


def test_summary_of_nothing_and_of_unknown_stages():
    assert spread([]) is None
    assert summarise([])["attended_ms"] is None
    record = {"phase": "x", "seconds": {"zoom": 0.001, "detection": 0.002}, "attended": 0.5, "located": False}
    stages = summarise([record | {"full_frame": None}])["stages_ms"]
    assert list(stages) == ["detection", "zoom"]
