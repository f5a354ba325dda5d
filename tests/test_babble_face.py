"""``motorprime babble`` as people and scripts use it."""

import io
import json
import os
import signal
import subprocess
import sys
import time

import cv2
import numpy as np
import pytest
from rich.console import Console

from motorprime import babble_face, cli
from motorprime.babble_face import figures_of
from motorprime.learning.store import Store
from motorprime.tasks.studio import close_studio

pytestmark = pytest.mark.sim

pytest.importorskip("duckdb")
pytest.importorskip("pyarrow")


@pytest.fixture
def run(monkeypatch, capfd, tmp_path):
    """Run ``motorprime babble`` in an empty folder: (exit code, stdout, stderr)."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["motorprime", "babble", *map(str, arguments)])
        try:
            cli.main()
            code = 0
        except SystemExit as end:
            code = end.code
        captured = capfd.readouterr()
        return code, captured.out, captured.err

    return run


def test_help_teaches(run):
    code, out, err = run("--help")
    assert (code, err) == (0, "")
    for part in ("gaze:", "arm:", "marker:", "manifest.json", "Parquet", "Exit code", "130", "--workers"):
        assert part in out
    assert max(map(len, out.splitlines())) <= 120


def test_a_run_leaves_samples_a_table_and_a_picture(run, tmp_path):
    code, out, err = run("here", "--samples", 20, "--seed", 3, "--picture", "sheet.png")
    assert (code, err) == (0, "")
    for part in ("seen_by_any", "left.seen", "pictures_taken", "label_to_geometry_median_px", "sheet.png"):
        assert part in out
    assert len(Store.open(tmp_path / "here")) == 20
    sheet = cv2.imread(str(tmp_path / "sheet.png"))
    assert sheet.shape == (4 * 240, 3 * 640, 3)
    red = (sheet[..., 2] > 180) & (sheet[..., 1] < 60) & (sheet[..., 0] < 60)
    assert red.sum() > 12 * 5  # the labels' crosses


def test_json_on_stdout_says_what_the_store_says(run, tmp_path):
    code, out, err = run("here", "--samples", 20, "--json")
    result = json.loads(out)
    assert code == 0 and "babble gaze" in err
    found = Store.open(tmp_path / "here").read()
    seen = {camera: ~np.isnan(found[f"{camera}_u"]) for camera in ("left", "right")}
    assert result["outcome"] == "complete"
    assert (result["samples"], result["computed"]) == (20, 20)
    assert result["seen_by_any"] == (seen["left"] | seen["right"]).sum()
    assert result["seen_by_all"] == (seen["left"] & seen["right"]).sum()
    assert result["left"]["seen"] == seen["left"].sum() and sum(result["left"].values()) == 20
    assert result["pictures_taken"] == sum(20 - result[camera]["outside"] for camera in seen)
    off = np.concatenate(
        [
            np.hypot(
                *(found[f"{c}_{axis}"][seen[c]] - found[f"{c}_predicted_{axis}"][seen[c]] for axis in "uv")
            )
            for c in seen
        ]
    )
    assert result["label_to_geometry_median_px"] == pytest.approx(np.median(off))
    assert result["label_to_geometry_p95_px"] == pytest.approx(np.percentile(off, 95))
    assert result["label_to_geometry_median_px"] < 0.15
    assert result["samples_per_second"] > 0


def test_the_same_command_goes_on_and_another_does_not_mix(run, tmp_path):
    assert run("here", "--samples", 10)[0] == 0
    code, out, _ = run("here", "--samples", 15, "--json")
    assert code == 0 and json.loads(out)["computed"] == 5
    code, out, _ = run("here", "--samples", 15, "--json")
    assert code == 0 and json.loads(out)["computed"] == 0 and json.loads(out)["samples_per_second"] is None
    for other in (
        ["--seed", 2],
        ["--mode", "uniform"],
        ["--what", "marker"],
        ["--what", "arm"],
        ["--noise", 1],
    ):
        code, out, err = run("here", "--samples", 15, *other)
        assert (code, out) == (2, "")
        assert err.startswith("motorprime: folder: here holds samples with ") and err.count("\n") == 1


@pytest.mark.parametrize("what", ["arm", "marker"])
def test_the_other_kinds(run, tmp_path, what):
    code, out, _ = run("here", "--samples", 5, "--what", what)
    assert code == 0 and f"babble {what}" in out
    assert Store.open(tmp_path / "here").manifest.kind == what


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["here", "--what", "legs"], "what: one of gaze, arm, marker expected, got 'legs'"),
        (["here", "--mode", "far"], "mode: one of near, uniform expected, got 'far'"),
        (["here", "--picture", "sheet.gif"], "picture: a .png or .jpg file expected"),
        (["here", "--picture", "file/sheet.png"], "picture: cannot write file/sheet.png"),
        (["here", "--what", "arm", "--picture", "sheet.png"], "picture: the arm's samples have no pictures"),
        (["file", "--samples", 5], "folder: cannot write into file"),
        (["here", "--samples", 0], "--samples"),
        (["here", "--workers", 0], "--workers"),
        (["here", "--noise", -1], "--noise"),
        ([], "older"),
    ],
)
def test_bad_options_are_one_clear_error_and_leave_no_folder(run, tmp_path, arguments, words):
    (tmp_path / "file").write_text("in the way")
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert words in err and "Traceback" not in err
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_damaged_part_is_one_clear_error(run, tmp_path):
    run("here", "--samples", 5)
    (tmp_path / "here" / "part-00000.parquet").write_bytes(b"PAR1")
    code, _, err = run("here", "--samples", 10)
    assert code == 2 and err.count("\n") == 1
    assert "part-00000.parquet is damaged" in err and "delete it" in err


@pytest.mark.scale
def test_a_scheduler_that_is_not_there_is_one_clear_error(run):
    pytest.importorskip("distributed")
    code, _, err = run("here", "--samples", 5, "--scheduler", "tcp://127.0.0.1:9")
    assert code == 2 and err.count("\n") == 1
    assert "scheduler: tcp://127.0.0.1:9 does not answer" in err


@pytest.mark.parametrize("workers", [1, 2])
def test_ctrl_c_keeps_what_is_done_and_the_same_command_goes_on(tmp_path, workers):
    command = [sys.executable, "-W", "error", "-c", "from motorprime.cli import main; main()", "babble"]
    process = subprocess.Popen(
        [*command, "here", "--samples", "100000", "--workers", str(workers), "--mode", "uniform", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path[1:])},
    )
    deadline = time.monotonic() + 120
    while not list((tmp_path / "here").glob("part-*")):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    result, held = json.loads(out), len(Store.open(tmp_path / "here"))
    assert result["outcome"] == "interrupted" and result["samples"] == held > 0
    assert f"Interrupted: {held} of 100000 samples are kept; the same command goes on" in " ".join(
        err.split()
    )
    assert "Traceback" not in err
    assert not list((tmp_path / "here").glob(".*.tmp"))


def test_the_rate_counts_only_what_this_run_computed():
    class Bars:
        def update(self, task, **shown):
            self.shown = shown

    times, bars = iter((10.0, 12.0, 14.0)), Bars()
    rate = babble_face._Rate(bars, 0, lambda: next(times))
    rate(100)
    assert bars.shown == {"completed": 100, "rate": ""}
    rate(140)
    assert bars.shown == {"completed": 140, "rate": "20 samples/s"}
    rate(180)
    assert bars.shown["rate"] == "20 samples/s" and rate.computed == 80


def test_figures_of_a_store_in_which_nothing_was_seen_are_none_not_nan(icub, tmp_path):
    from motorprime.tasks.babble import GazeBabble

    source = GazeBabble(icub, mode="uniform")
    store = Store.create(tmp_path, source.manifest(0))
    blind = next(i for i in range(100) if all(source(0, i)[f"{c}_outcome"] != "seen" for c in icub.cameras))
    row = source(0, blind)
    store.write(0, {"i": np.arange(1)} | {name: np.array([value]) for name, value in row.items()})
    figures = figures_of(store)
    assert figures["seen_by_any"] == 0
    assert figures["label_to_geometry_median_px"] is None and figures["label_to_geometry_p95_px"] is None
    close_studio()


def test_two_workers_are_measured_beside_one(icub):
    from motorprime.evaluate.babble_rate import two_worker_ratio
    from motorprime.evaluate.common import Progress

    shown, ticks = Console(file=io.StringIO(), width=100), iter(range(1000))
    found = two_worker_ratio(
        icub, 1, 20, rounds=2, progress=Progress(shown), clock=lambda: float(next(ticks))
    )
    assert found["ratio"] == 1.0 and found["ratios"] == [1.0] * found["rounds"]
    assert found["one_worker_per_s"] == found["two_workers_per_s"] == 20.0
