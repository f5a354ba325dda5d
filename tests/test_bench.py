"""The bench: what it writes, what it asks of peers. No test depends on how long anything takes."""

import dataclasses
import itertools
import json
import os
import subprocess
import sys

import numpy as np
import pytest

from motorprime import ArgumentError, StateError, cli
from motorprime.bench import child, face, suite, table
from motorprime.bench.cases import Contender
from motorprime.bench.checks import InexactPeerError
from motorprime.bench.copying import Copy
from motorprime.bench.peers import networks, onnx, sampling
from motorprime.bench.scene import LARGE, Scene
from motorprime.bench.timing import Effort, Times, interleave

NAMES = [
    "triangular",
    "triangular_wide",
    "triangular_400",
    "gaussian",
    "gibbs",
    "sample",
    "threshold",
    "threshold_quicksort_4800",
    "threshold_select_4800",
    "mlp",
    "attention_step",
]
ENTRY = {
    *("what", "ours_us", "spread", "memcpy_ratio", "copy_us", "disturbed", "best_peer", "best_peer_us"),
    *("speedup", "peers", "absent_peers", "bound", "may_lose", "targets"),
}


def run_bench(folder, *arguments, **environment):
    command = [sys.executable, "-c", "from motorprime.cli import main; main()", "bench", *map(str, arguments)]
    return subprocess.run(
        command,
        capture_output=True,
        text=True,
        cwd=folder,
        env={**os.environ, "COLUMNS": "160", "PYTHONIOENCODING": "utf-8", **environment},
        encoding="utf-8",
        timeout=300,
        check=False,
    )


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """One quick run of everything: (folder, process)."""
    folder = tmp_path_factory.mktemp("bench")
    return folder, run_bench(folder, "--quick", "--json", "new/b.json", "--markdown", "b.md")


@pytest.fixture(scope="module")
def result(quick):
    return json.loads((quick[0] / "new" / "b.json").read_text())


def test_it_ends_with_0_and_says_what_it_wrote_whether_or_not_a_target_is_missed(quick):
    _, done = quick
    assert done.returncode == 0, done.stderr
    assert "wrote new/b.json" in done.stderr.replace("\\", "/") and "wrote b.md" in done.stderr
    assert "arget" in done.stdout.splitlines()[-1]
    for name in [*NAMES, *table.COLUMNS, *table.SIZE_COLUMNS]:
        assert name in done.stdout


def test_the_json_has_every_kernel_and_every_key(result):
    assert {"machine", "memcpy_us", "kernels", "sizes", "seed", "quick"} == set(result)
    assert list(result["kernels"]) == NAMES
    assert result["memcpy_us"] > 0 and result["machine"]["threads"] == 1
    for key in ("cpu", "simd", "numpy", "opencv", "python"):
        assert result["machine"][key]
    for name, seen in result["kernels"].items():
        assert set(seen) >= ENTRY, name
        assert seen["best_peer_us"] == min(peer["us"] for peer in seen["peers"].values())
        assert seen["bound"]["us"] > 0
        for target in seen["targets"]:
            assert set(target) == {"figure", "limit", "seen", "met"}
            assert (target["met"] is None) == (target["seen"] is None) == (seen["ours_us"] is None)


def test_what_was_measured_fits_together(result):
    for seen in result["kernels"].values():
        if seen["ours_us"] is None:
            assert seen["memcpy_ratio"] is seen["speedup"] is None
        elif "details" not in seen:
            assert seen["memcpy_ratio"] == pytest.approx(seen["ours_us"] / result["memcpy_us"])
            assert seen["spread"]["q1"] <= seen["ours_us"] <= seen["spread"]["q3"]


def test_the_threshold_keeps_both_inputs_and_the_worse_ratios_count(result):
    seen = result["kernels"]["threshold"]
    assert set(seen["details"]) == {"landscape", "random"}
    details = seen["details"].values()
    assert seen["speedup"] == min(one["speedup"] for one in details)
    assert seen["memcpy_ratio"] == max(one["memcpy_ratio"] for one in details)


def test_larger_images_are_measured_in_copies_of_their_own_size(result):
    large = result["sizes"]["1920x1080"]
    assert set(large["kernels"]) == set(suite.SIZED)
    seen = large["kernels"]["triangular"]
    assert seen["memcpy_ratio"] == pytest.approx(seen["ours_us"] / large["memcpy_us"])
    assert seen["growth"] == pytest.approx(
        seen["memcpy_ratio"] / result["kernels"]["triangular"]["memcpy_ratio"]
    )


def test_the_markdown_is_that_of_the_json(quick, result):
    text = (quick[0] / "b.md").read_text(encoding="utf-8")
    assert text == table.markdown(result)
    assert all(f"| {name} |" in text for name in NAMES)


def test_markdown_replaces_what_stands_between_the_marks_and_nothing_else(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n\n{face.BEGIN}\n\nold\n\n{face.END}\n\nafter\n")
    for _ in range(2):
        face._write(page, "| new |\n")
        assert page.read_text() == f"before\n\n{face.BEGIN}\n\n| new |\n\n{face.END}\n\nafter\n"


@pytest.mark.viz
@pytest.mark.parametrize("kind", ["png", "svg"])
def test_the_picture_is_drawn_from_any_result(result, tmp_path, kind):
    from motorprime.bench.picture import draw

    path = tmp_path / f"b.{kind}"
    draw(result, path)
    assert path.read_bytes().startswith(b"\x89PNG" if kind == "png" else b"<?xml")


def test_only_the_kernels_that_are_asked_for(tmp_path):
    done = run_bench(tmp_path, "--quick", "--kernel", "mlp", "--kernel", "gaussian", "--json", "b.json")
    assert done.returncode == 0, done.stderr
    written = json.loads((tmp_path / "b.json").read_text())
    assert list(written["kernels"]) == ["gaussian", "mlp"]
    assert list(written["sizes"]["1920x1080"]["kernels"]) == ["gaussian"]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--kernel", "fast"], "kernel: one of triangular, "),
        (["--json", "file/b.json"], "json: cannot write file"),
        (["--markdown", "file/b.md"], "markdown: cannot write file"),
        (["--picture", "b.gif"], "picture: a file name that ends with .png or .svg expected, got b.gif"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_an_error_is_one_line_before_anything_is_measured(tmp_path, monkeypatch, capsys, arguments, named):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("motorprime.bench.face.measure_in_child", lambda *_: pytest.fail("measured first"))
    monkeypatch.setattr(sys, "argv", ["motorprime", "bench", *arguments])
    with pytest.raises(SystemExit) as end:
        cli.main()
    err = capsys.readouterr().err
    assert end.value.code == 2 and err.count("\n") == 1
    assert err.startswith(f"motorprime: {named}")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_help_teaches(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["motorprime", "bench", "--help"])
    with pytest.raises(SystemExit):
        cli.main()
    out = capsys.readouterr().out
    for part in (
        "copy",
        "peer",
        "target",
        "Exit code",
        "--json",
        "--picture",
        "--markdown",
        "--quick",
        *NAMES,
    ):
        assert part in out.replace("\n  ", " ")


def test_the_child_loads_its_libraries_with_one_thread(monkeypatch, tmp_path):
    (tmp_path / "child.py").write_text(
        "import json, os, sys\n"
        "print(json.dumps({'result': {name: os.environ[name] for name in sys.argv[-1].split()}}))"
    )
    real = subprocess.Popen
    script = [sys.executable, str(tmp_path / "child.py"), " ".join(child.ONE_THREAD)]
    monkeypatch.setattr(child.subprocess, "Popen", lambda command, **options: real(script, **options))
    seen = child.measure_in_child([], 0, True, lambda *_: None)
    assert seen == dict.fromkeys(child.ONE_THREAD, "1")


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ('print(\'{"error": "gibbs: not exact"}\')', "gibbs: not exact"),
        ("raise SystemExit('killed')", "bench: the measuring process ended early: killed"),
        ("pass", "bench: the measuring process ended early: it said nothing"),
    ],
)
def test_a_child_that_fails_is_a_clear_error(monkeypatch, script, message):
    real = subprocess.Popen
    monkeypatch.setattr(
        child.subprocess, "Popen", lambda command, **options: real([sys.executable, "-c", script], **options)
    )
    with pytest.raises(StateError, match=f"^{message}$"):
        child.measure_in_child([], 0, True, lambda *_: None)


# Exactness

CASES = [case for build in suite.SUITE.values() for case in build(Scene())]
IDS = [f"{case.name} {case.variant}".strip() for case in CASES]


def spoiled(answer):
    """An answer that is wrong in a small way, whatever it is."""
    if isinstance(answer, float):
        return float(np.nextafter(np.float32(answer), np.float32(0)))
    if isinstance(answer, tuple):
        return spoiled(answer[0]), answer[1]
    if isinstance(answer, list):
        return [spoiled(one) for one in answer]
    answer = np.array(answer)
    if (
        answer.dtype == np.int32 and len(answer) > 1000
    ):  # independent samples: a few rows that are never drawn
        answer[:, 1] = np.minimum(answer[:, 1], np.percentile(answer[:, 1], 80))
    elif answer.dtype == np.int32:
        answer[-1, 0] += 1
    else:
        answer[np.unravel_index(answer.argmax(), answer.shape)] *= np.float32(1.001)
    return answer


@pytest.mark.parametrize("case", CASES, ids=IDS)
def test_every_peer_is_exact(case):
    case.check()


@pytest.mark.parametrize("case", CASES, ids=IDS)
def test_a_wrong_peer_is_caught(case):
    right = next(iter(case.peers.values()))
    wrong = Contender(right.run, lambda: spoiled(right.answer()))
    with pytest.raises(InexactPeerError, match=f"^{case.name}: peer 'quick and wrong' is not exact: "):
        dataclasses.replace(case, peers={**case.peers, "quick and wrong": wrong}).check()


@pytest.mark.parametrize("wrong", [np.full((240, 320), np.nan, np.float32), np.zeros((320, 240), np.float32)])
def test_nan_and_a_wrong_shape_are_caught(wrong):
    case = CASES[0]
    with pytest.raises(InexactPeerError):
        dataclasses.replace(case, peers={"wrong": Contender.plain(lambda: wrong)}).check()


def test_a_wrong_kernel_is_caught_too():
    case = next(case for case in CASES if case.name == "sample")
    lazy = Contender.plain(lambda: np.zeros((100, 2), np.int32))
    with pytest.raises(InexactPeerError, match="a sample lies where the landscape is 0"):
        dataclasses.replace(case, ours=lazy).check()


@pytest.mark.parametrize("name", ["triangular", "triangular_400", "gaussian"])
def test_the_landscapes_peers_are_exact_in_larger_images(name):
    for case in suite.SUITE[name](Scene(LARGE)):
        case.check()


def test_the_ellipse_covers_a_third_of_the_image():
    case = next(case for case in CASES if case.name == "gaussian")
    assert (case.truth() > 0).mean() == pytest.approx(1 / 3, abs=0.005)


def test_the_networks_outputs_lie_in_the_image():
    scene = Scene(seed=5)
    for eye in range(2):
        network = networks.Augmented(scene.network(eye), len(scene.plan))
        network.inputs[:, :3], network.inputs[:, 3:-1] = scene.plan, scene.joints
        points = network.filled()
        assert (points > 0).all() and (points < (320, 240)).all()


def test_the_uniform_numbers_are_those_of_the_kernels():
    """Published first output of xoshiro256++ for the state that splitmix64 makes of the seed 0."""
    first = next(sampling.uniforms(0))
    assert first == (0x53175D61490B23DF >> 11) * 2.0**-53


def test_the_onnx_bytes_are_read_by_others():
    scene = Scene()
    content = onnx.network_bytes(*networks.folded(scene.network()), 50)
    assert content.startswith(b"\x08\x08")  # ir_version 8
    truth = networks.Layers(scene.network(), 50)(scene.inputs)
    np.testing.assert_allclose(networks.opencv(scene.network(), 50)(scene.inputs), truth, rtol=1e-4)


def test_without_onnx_runtime_the_bench_says_so_and_goes_on(monkeypatch):
    monkeypatch.setattr(networks, "onnxruntime_installed", lambda: False)
    (case,) = suite.SUITE["mlp"](Scene())
    assert "ONNX Runtime" not in case.peers
    assert case.absent == {"ONNX Runtime": "onnxruntime is not installed"}
    case.check()


# Timing


def test_the_kernels_are_chosen_by_name_in_the_suite_s_order():
    assert suite.chosen([]) == NAMES
    assert suite.chosen(["mlp", "gibbs"]) == ["gibbs", "mlp"]
    with pytest.raises(ArgumentError, match="got 'fast'"):
        suite.chosen(["mlp", "fast"])


def test_functions_take_turns_and_every_round_has_another_order():
    order = []
    clock = itertools.count(0, 1000).__next__  # every call takes 1 us
    calls = {name: lambda name=name: order.append(name) for name in "abc"}
    times = interleave(calls, Effort(rounds=3, batch_us=2.0, least=2, most=9), clock)
    turns = order[-3 * 3 * 3 :]  # an untimed and two timed calls, three functions, three rounds
    assert "".join(turns[::3]) == "abc" + "bca" + "cab"
    assert all(one.us.shape == (3, 2) and (one.us == 1.0).all() for one in times.values())


def test_a_ratio_is_the_median_of_the_rounds_ratios():
    """A slow phase hits both and drops out."""
    slow = np.repeat([[1.0], [1.0], [50.0], [1.0], [1.0]], 4, axis=1)
    ours, peer = Times(2.0 * slow), Times(6.0 * slow)
    assert peer.over(ours) == 3.0
    assert ours.median == 2.0 and ours.quartiles == (2.0, 2.0)


def test_the_copy_is_a_copy():
    landscape = Scene().landscape
    copy = Copy(landscape)
    copy.target.fill(0.0)
    copy()
    np.testing.assert_array_equal(copy.target, landscape)
    assert not np.shares_memory(copy.target, copy.source)
