"""The command line as people and scripts use it: clear errors, exit codes, clean output."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

import motorprime
from motorprime import cli

COMMANDS = (
    [],
    ["reach"],
    ["babble"],
    ["train"],
    ["train", "projection"],
    ["train", "peripersonal"],
    ["evaluate"],
    ["evaluate", "maps"],
    ["evaluate", "recording"],
    ["evaluate", "projection"],
    ["evaluate", "search"],
    ["evaluate", "reach"],
    ["evaluate", "rollout"],
    ["evaluate", "stability"],
)
SIM = pytest.mark.sim


@pytest.fixture
def run(monkeypatch, capfd, tmp_path):
    """Run the command line in an empty folder: (exit code, stdout, stderr)."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["motorprime", *map(str, arguments)])
        try:
            cli.main()
            code = 0
        except SystemExit as end:
            code = end.code
        captured = capfd.readouterr()
        return code, captured.out, captured.err

    return run


def motorprime_process(*arguments, **options):
    command = [sys.executable, "-c", "from motorprime.cli import main; main()", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


def wait_for(condition, process):
    """Until a condition holds; a process that ends before, or never gets there, fails the test."""
    deadline = time.monotonic() + 120
    while not condition():
        if process.poll() is not None or time.monotonic() > deadline:
            process.kill()
            pytest.fail(f"the process did not get there: {process.communicate()}")
        time.sleep(0.02)


def test_version(run):
    assert run("--version") == (0, f"motorprime {motorprime.__version__}\n", "")


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_help(run, command):
    code, out, err = run(*command, "--help")
    assert (code, err) == (0, "")
    assert out.startswith("Usage: ")
    assert "--help" in out


@pytest.mark.parametrize("command", [[], ["train"], ["evaluate"]], ids=" ".join)
def test_commands_are_listed_in_whole_sentences_on_80_columns(run, monkeypatch, command):
    monkeypatch.setenv("COLUMNS", "80")
    _, out, _ = run(*command, "--help")
    assert "..." not in out.partition("Commands:")[2]
    assert max(map(len, out.splitlines())) <= 80


def test_help_of_reach_says_what_it_leaves_and_its_exit_codes(run):
    _, out, _ = run("reach", "--help")
    for part in (
        "report.html",
        "result.json",
        "video.webm",
        "Exit code",
        "130",
        "--seed",
        "--no-glass",
        "--obstacle",
        "--perturb",
        "--projection",
        "kinematic|neural|hybrid",
        "--json",
    ):
        assert part in out


def test_help_needs_no_simulator(tmp_path):
    script = "import sys; sys.modules['pybullet'] = None; sys.argv[1:] = ['reach', '--help']; "
    script += "from motorprime.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("command", [["reach"], ["evaluate", "projection"]], ids=" ".join)
def test_without_the_extra_one_line_says_what_to_install(tmp_path, command):
    script = f"import sys; sys.modules['pybullet'] = None; sys.argv[1:] = {command}; "
    script += "from motorprime.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert "pip install 'motorprime[sim]'" in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["reach", "--size", "abc"], "--size"),
        (["reach", "--size", "320"], "--size"),
        (["reach", "--size", "320x"], "--size"),
        (["reach", "--size", "0x240"], "--size"),
        (["reach", "--size", "²x²"], "--size"),
        (["reach", "--size", "-320x240"], "--size"),
        (["reach", "--size", "320x240x3"], "--size"),
        (["reach", "--size", "50000x50000"], "--size"),
        (["reach", "--seed", "-1"], "--seed"),
        (["reach", "--seed", "one"], "--seed"),
        (["reach", "--windows", "0"], "--windows"),
        (["reach", "--width", "0"], "--width"),
        (["reach", "--width", "nan"], "--width"),
        (["reach", "--width", "inf"], "--width"),
        (["reach", "--noise", "-1"], "--noise"),
        (["reach", "--noise", "nan"], "--noise"),
        (["reach", "--noise", "inf"], "--noise"),
        (["reach", "--clutter", "7"], "--clutter"),
        (["reach", "--projection", "psychic"], "--projection"),
        (["reach", "--no-such-option"], "--no-such-option"),
        (["reach", "--no-glass", "--obstacle"], "--obstacle"),
        (["reach", "--no-glass", "--perturb"], "--perturb"),
        (["evaluate", "nothing"], "nothing"),
        (["nothing"], "nothing"),
        (["evaluate", "projection", "--poses", "0"], "--poses"),
        (["evaluate", "search", "--scenes", "-3"], "--scenes"),
        (["evaluate", "reach", "--trials", "0"], "--trials"),
        (["evaluate", "reach", "--json", "."], "--json"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_bad_option_is_named_before_anything_is_done(run, tmp_path, arguments, named):
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert "Traceback" not in err
    assert err.strip().splitlines()[-1].startswith("Error: ")
    assert named in err.strip().splitlines()[-1]
    assert not list(tmp_path.iterdir())


@SIM
@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["reach", "--size", "10x10"], "size: 10x10 is smaller than a window of 20 px"),
        (["reach", "--runs", "file/runs"], "folder: cannot write into file/runs/reach-1"),
        (["reach", "--name", "../up"], "name: a plain folder name expected, got '../up'"),
        (["evaluate", "projection", "--json", "file/figures.json"], "json: cannot write file/figures.json"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_an_error_is_one_line_and_exit_code_2(run, tmp_path, arguments, named):
    (tmp_path / "file").write_text("in the way")
    code, _, err = run(*arguments)
    assert code == 2
    assert err.startswith(f"motorprime: {named}")
    assert err.count("\n") == 1
    assert not list(tmp_path.glob("runs/*"))  # no empty folder either


@SIM
def test_missing_weights_are_one_line(run, tmp_path, monkeypatch):
    from motorprime import shipped

    monkeypatch.setattr(shipped, "NEURAL", "absent.safetensors")
    code, _, err = run("reach", "--projection", "neural")
    assert code == 2
    assert err == (
        "motorprime: the package's file weights/absent.safetensors is missing; install motorprime again\n"
    )
    assert not list(tmp_path.glob("runs/*"))


@SIM
def test_a_long_path_does_not_break_the_line(run, tmp_path):
    (tmp_path / "file").write_text("in the way")
    _, _, err = run("evaluate", "projection", "--json", f"file/{'long/' * 40}figures.json")
    assert err.count("\n") == 1


@SIM
def test_an_unwritable_json_is_noticed_before_the_measuring(run, tmp_path, monkeypatch):
    from motorprime.evaluate import projection

    monkeypatch.setattr(projection, "evaluate_projection", lambda *a, **k: pytest.fail("measured first"))
    (tmp_path / "file").write_text("in the way")
    assert run("evaluate", "projection", "--json", "file/figures.json")[0] == 2


@SIM
def test_evaluate_prints_a_table_and_writes_json(run, tmp_path):
    code, out, err = run("evaluate", "projection", "--poses", 5, "--json", "new/figures.json")
    assert code == 0
    assert "median_px" in out
    assert "5/5" in err  # progress is not for stdout
    assert "wrote new/figures.json" in err
    figures = json.loads((tmp_path / "new" / "figures.json").read_text())
    assert set(figures) == {"seed", "poses", "median_px", "p95_px"}
    assert figures["poses"] == 5


@SIM
@pytest.mark.parametrize(
    ("name", "count", "details"), [("search", "scenes", ()), ("reach", "trials", ("details",))]
)
def test_evaluate_passes_its_options_on_and_keeps_details_off_the_table(
    run, tmp_path, monkeypatch, name, count, details
):
    import importlib

    asked = {}

    def evaluation(robot, **options):
        asked.update(options)
        return {"figure": 1.0, **{key: ["a detail"] for key in details}}

    module = importlib.import_module(f"motorprime.evaluate.{name}")
    monkeypatch.setattr(module, f"evaluate_{name}", evaluation)
    code, out, _ = run("evaluate", name, f"--{count}", 3, "--seed", 9, "--json", "f.json")
    assert code == 0
    assert (asked[count], asked["seed"]) == (3, 9)
    assert "detail" not in out
    assert set(json.loads((tmp_path / "f.json").read_text())) == {"figure", *details}


@SIM
def test_reach_json_prints_json_and_nothing_else_on_stdout(tmp_path):
    process = motorprime_process("reach", "--obstacle", "--json", "--no-video", "--seed", 3, cwd=tmp_path)
    out, err = process.communicate(timeout=400)
    result = json.loads(out)
    assert process.returncode == 0
    assert result["outcome"] == "lifted"
    judged = result["judged"]
    assert judged["lifted"] is True and judged["height_m"] >= 0.05
    assert judged["touched_obstacle"] is False and judged["disturbed"] is False
    assert 0.08 <= judged["mass_kg"] <= 0.3 and 0.06 <= judged["width_m"] <= 0.075
    assert "glass" not in judged["touched"]  # to touch it is the aim
    _check_the_story(result["history"])
    assert set(result["certificates"]) == {"eye", "arm", "hand"}
    assert result == json.loads((tmp_path / "runs" / "reach-3" / "result.json").read_text())
    assert "Report: " in err
    for noise in ("argv[0]", "pybullet", "Traceback", "Warning"):
        assert noise not in out + err
    assert sorted(p.name for p in (tmp_path / "runs" / "reach-3").iterdir()) == ["report.html", "result.json"]
    assert set(result["meta"]) >= {
        "seed",
        "windows",
        "size",
        "noise",
        "clutter",
        "glass",
        "obstacle",
        "perturb",
    }


def _check_the_story(history):
    """The way is looked along, the obstacle known before the hand sets out; the hand closes, then lifts."""
    phases = list(dict.fromkeys(record["phase"] for record in history))
    assert phases[-4:] == ["survey", "reach", "grasp", "lift"]
    reach = [record for record in history if record["phase"] == "reach"]
    assert all(record["obstacles"] for record in reach)
    assert len(reach[0]["legs"]) > 1
    assert len(reach[-1]["legs"]) == 1
    assert reach[0]["opening"] > 0.9 > 0.0 > history[-1]["opening"]


@SIM
def test_without_a_glass_it_says_so_and_ends_with_1(run, tmp_path):
    code, out, err = run(
        "reach", "--no-glass", "--no-video", "--size", "80x60", "--clutter", 0, "--name", "none"
    )
    assert code == 1
    assert "Not found: no glass" in out
    assert err == ""
    result = json.loads((tmp_path / "runs" / "none" / "result.json").read_text())
    assert result["outcome"] == "not found"
    assert result["judged"]["lifted"] is False
    assert (tmp_path / "runs" / "none" / "report.html").exists()


@SIM
@pytest.mark.parametrize("presses", [1, 2])
def test_ctrl_c_leaves_a_readable_run(tmp_path, presses):
    process = motorprime_process("reach", "--no-glass", "--seed", 3, "--name", "cut", cwd=tmp_path)
    folder = tmp_path / "runs" / "cut"
    wait_for((folder / "video.webm").exists, process)  # its first picture
    for _ in range(presses):
        process.send_signal(signal.SIGINT)
        time.sleep(0.1)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "Traceback" not in out + err
    assert "Interrupted" in out
    result = json.loads((folder / "result.json").read_text())
    assert result["outcome"] == "interrupted"
    assert result["reason"]
    assert "interrupted" in (folder / "report.html").read_text().lower()
    assert not list(folder.glob(".*"))


@SIM
def test_ctrl_c_during_an_evaluation(tmp_path):
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    process = motorprime_process("evaluate", "projection", "--poses", 10000, env=environment)
    wait_for(lambda: list(tmp_path.glob("motorprime-*/ball.obj")), process)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in out + err
    assert not list(tmp_path.glob("motorprime-*"))  # cleaned up


@SIM
def test_the_same_name_twice_keeps_both_runs(run, tmp_path, monkeypatch):
    from motorprime import StateError, demo

    def stop(*arguments, **options):
        raise StateError("start: enough of it")

    monkeypatch.setattr(demo, "PickTrial", stop)
    (tmp_path / "runs" / "demo").mkdir(parents=True)
    (tmp_path / "runs" / "demo" / "result.json").write_text("{}")
    code, _, err = run("reach", "--name", "demo")
    assert (code, err) == (2, "motorprime: start: enough of it\n")
    assert [p.name for p in (tmp_path / "runs").iterdir()] == ["demo"]
    assert (tmp_path / "runs" / "demo" / "result.json").read_text() == "{}"
