"""The store: whole parts or none, nothing lost or doubled when killed, and every bad folder named."""

import errno
import os
import resource
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from motorprime import ArgumentError, NotInViewError, StateError
from motorprime.errors import MissingExtraError
from motorprime.learning import store as stores
from motorprime.learning.babbling import babble
from motorprime.learning.manifest import COUNT, GAP, NUMBER, WORD, Manifest
from motorprime.learning.store import Piece, Store
from store_filler import MANIFEST, Numbers, columns, contents, filled

pytestmark = pytest.mark.learn

HERE = Path(__file__).parent


# What is written is what is read.


def test_samples_come_back_bit_for_bit_in_the_order_of_their_index(tmp_path):
    store = filled(tmp_path, 20)
    found, expected = store.read(), columns(0, 20)
    assert list(found) == list(expected)
    for name, values in expected.items():
        assert np.array_equal(found[name], values, equal_nan=True), name
    assert len(store) == 20
    assert sorted(contents(tmp_path)) == [f"part-{k:05d}.parquet" for k in range(3)]


def test_a_gap_is_a_null_for_sql(tmp_path):
    store = filled(tmp_path, 20)
    seen = int((columns(0, 20)["a"] >= 0).sum())
    assert 0 < seen < 20
    found = store.query("SELECT count(*) AS n, count(left_u) AS seen FROM samples")
    assert (found["n"][0], found["seen"][0]) == (20, seen)


def test_a_condition_and_chosen_columns(tmp_path):
    found = filled(tmp_path, 20).read("a > 0 AND i < 10", ["i", "b"])
    expected = columns(0, 10)
    assert list(found) == ["i", "b"]
    assert found["i"].tolist() == expected["i"][expected["a"] > 0].tolist()
    assert np.array_equal(found["b"], expected["b"][expected["a"] > 0])


def test_integers_and_words_keep_their_kind_and_missing_ones_do_not_pass_as_numbers(tmp_path):
    manifest = replace(MANIFEST, columns={**MANIFEST.columns, "pixels": COUNT, "outcome": WORD})
    store = Store.create(tmp_path, manifest)
    rows = columns(0, 3) | {"pixels": np.array([4, 0, 2]), "outcome": np.array(["seen", "cut", "seen"])}
    store.write(0, rows)
    found = store.read()
    assert found["pixels"].tolist() == [4, 0, 2] and found["pixels"].dtype.kind == "i"
    assert found["outcome"].tolist() == ["seen", "cut", "seen"]
    with pytest.raises(ArgumentError, match=r"columns\['pixels'\]: a count \(n,\) expected, got float64"):
        store.write(1, columns(7, 8) | {"pixels": np.array([1.5]), "outcome": np.array(["seen"])})
    lagged = store.query(
        "SELECT lag(pixels) OVER (ORDER BY i) p, lag(outcome) OVER (ORDER BY i) o FROM samples"
    )
    assert np.isnan(lagged["p"][0]) and lagged["p"][1:].tolist() == [4.0, 0.0]
    assert lagged["o"].tolist() == [None, "seen", "cut"]


@pytest.mark.parametrize(
    ("seen_by", "rows"), [("any", "seen"), ("left", "seen"), ("all", "seen"), (None, "all")]
)
def test_samples_to_learn_from(tmp_path, seen_by, rows):
    samples = filled(tmp_path, 20).samples(seen_by)
    expected = columns(0, 20)
    kept = expected["a"] >= 0 if rows == "seen" else np.ones(20, bool)
    assert samples.names == ("a", "b")
    assert np.array_equal(samples.joints, np.column_stack([expected["a"], expected["b"]])[kept])
    assert np.array_equal(samples.points, np.column_stack([expected[k] for k in "xyz"])[kept])
    pixels = np.column_stack([expected["left_u"], expected["left_v"]])[kept]
    assert np.array_equal(samples.pixels["left"], pixels, equal_nan=True)
    assert samples.seen("left").all() == (rows == "seen")


def test_samples_seen_by_all_need_both_cameras_and_by_any_need_one(tmp_path):
    wide = dict.fromkeys("ab", NUMBER) | dict.fromkeys(("l_u", "l_v", "r_u", "r_v"), GAP)
    manifest = replace(MANIFEST, cameras=("l", "r"), columns=wide)
    store = Store.create(tmp_path, manifest)
    nan = np.nan
    one = {"l_u": [1.0, nan, 1.0, nan], "r_u": [1.0, 1.0, nan, nan]}
    pixels = {f"{camera}_{axis}": np.array(one[f"{camera}_u"]) for camera in "lr" for axis in "uv"}
    store.write(0, {"i": np.arange(4), "a": np.arange(4.0), "b": np.zeros(4)} | pixels)
    rows = {by: store.samples(by).joints[:, 0].tolist() for by in ("any", "all", "l", "r")}
    assert rows == {"any": [0.0, 1.0, 2.0], "all": [0.0], "l": [0.0, 2.0], "r": [0.0, 1.0]}
    assert store.samples().points is None
    assert store.samples("any", "a > 1").joints[:, 0].tolist() == [2.0]


# Growing and being killed.


def test_more_samples_extend_and_fewer_change_nothing(tmp_path):
    at_once = filled(tmp_path / "once", 33)
    grown = filled(tmp_path / "grown", 3)
    for count in (5, 16, 33, 8):
        babble(grown, Numbers(), count)
    assert contents(grown.folder) == contents(at_once.folder)
    assert len(grown) == 33


def test_what_is_missing_is_said_piece_by_piece(tmp_path):
    store = Store.create(tmp_path, MANIFEST)
    assert store.missing(0) == []
    assert store.missing(9) == [Piece(0, 0, 7), Piece(1, 7, 9)]
    store.write(1, columns(7, 9))
    assert store.missing(9) == [Piece(0, 0, 7)]
    assert store.missing(20) == [Piece(0, 0, 7), Piece(1, 9, 14), Piece(2, 14, 20)]


def test_babbling_says_how_far_it_is_and_computes_only_what_is_missing(tmp_path):
    store, told = filled(tmp_path, 10), []
    assert babble(store, Numbers(), 20, progress=told.append) == 10
    assert told == [10, 14, 20]
    assert babble(store, Numbers(), 20, progress=told.append) == 0
    assert told[3:] == [20]


def test_processes_write_what_one_process_writes(tmp_path):
    alone, together = filled(tmp_path / "1", 40), filled(tmp_path / "2", 40, workers=2)
    assert contents(alone.folder) == contents(together.folder)


def start_filling(folder, count, workers):
    command = [
        sys.executable,
        "-W",
        "error",
        str(HERE / "store_filler.py"),
        str(folder),
        str(count),
        str(workers),
    ]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path[1:])}
    return subprocess.Popen(
        command, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


@pytest.mark.parametrize("workers", [1, 2])
def test_a_killed_run_goes_on_and_neither_loses_nor_doubles_a_sample(tmp_path, workers):
    folder, count = tmp_path / "killed", 400
    for at_least in (4, 20):
        process = start_filling(folder, count, workers)
        deadline = time.monotonic() + 60
        while len(list(folder.glob("part-*"))) < at_least:
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.001)
        os.killpg(process.pid, signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
        process.stderr.close()
    assert 0 < len(Store.open(folder)) < count
    (folder / ".part-00050.parquet-abc.tmp").write_bytes(b"half of it")
    process = start_filling(folder, count, workers)
    assert (process.communicate()[1], process.returncode) == ("", 0)
    assert contents(folder) == contents(filled(tmp_path / "whole", count).folder)
    assert not list(folder.glob(".*.tmp"))


def test_two_processes_do_not_write_into_one_folder(tmp_path):
    store = filled(tmp_path, 7)
    with store.writing():
        process = start_filling(tmp_path, 14, 1)
        _, errors = process.communicate()
    assert process.returncode != 0
    assert f"folder: another process is adding samples to {tmp_path}" in errors
    assert len(store) == 7
    assert len(filled(tmp_path, 14)) == 14  # the lock has gone with its holder


def test_a_part_is_there_whole_or_not_at_all_on_a_full_disk(tmp_path, monkeypatch):
    store = filled(tmp_path, 14)
    before = contents(tmp_path)

    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as broken:
        broken.setattr(stores.os, "fsync", full)
        for count in (20, 15):
            words = (
                rf"no space left in {tmp_path}; the 2 finished parts are kept; make room, and the same call"
            )
            with pytest.raises(StateError, match=words):
                babble(store, Numbers(), count)
    assert contents(tmp_path) == before
    assert not list(tmp_path.glob(".*.tmp"))
    babble(store, Numbers(), 20)
    assert contents(tmp_path) == contents(filled(tmp_path / "whole", 20).folder)


def test_a_file_that_may_not_grow_is_like_a_full_disk(tmp_path):
    """The kernel itself refuses in the middle of a write."""
    store = filled(tmp_path, 7)
    size = (tmp_path / "part-00000.parquet").stat().st_size
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    usual = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size // 2, limits[1]))
        with pytest.raises(StateError, match=r"no space left in .*; the 1 finished parts are kept"):
            babble(store, Numbers(), 14)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, usual)
    assert len(store) == 7 and not list(tmp_path.glob(".*.tmp"))


# Damaged parts and bad samples.


def damage(path, kind):
    data = bytearray(path.read_bytes())
    if kind == "cut off":
        del data[len(data) // 2 :]
    elif kind == "empty":
        data.clear()
    elif kind == "a flipped bit":
        # In the middle of the pages, where neither header nor footer would tell.
        at = data.find(np.float64(columns(7, 14)["b"][3]).tobytes())
        assert at > 0
        data[at] ^= 1
    path.write_bytes(bytes(data))


@pytest.mark.parametrize("kind", ["cut off", "empty", "a flipped bit"])
def test_a_damaged_part_is_named_and_deleting_it_brings_it_back(tmp_path, kind):
    store = filled(tmp_path, 20)
    before, path = contents(tmp_path), tmp_path / "part-00001.parquet"
    damage(path, kind)
    words = rf"store: {path} is damaged \(.+\); delete it, and the next run computes it again"
    with pytest.raises(StateError, match=words):
        babble(store, Numbers(), 30)
    with pytest.raises(StateError, match=words):
        store.samples()
    assert len(contents(tmp_path)) == 3
    path.unlink()
    babble(store, Numbers(), 20)
    assert contents(tmp_path) == before


def test_a_part_of_other_columns_or_another_place_is_damaged_too(tmp_path):
    store = filled(tmp_path, 20)
    table = pq.read_table(tmp_path / "part-00001.parquet")
    pq.write_table(table.drop_columns(["b"]), tmp_path / "part-00001.parquet")
    with pytest.raises(StateError, match=r"part-00001\.parquet is damaged \(its columns are not those"):
        store.missing(20)
    (tmp_path / "part-00001.parquet").write_bytes((tmp_path / "part-00000.parquet").read_bytes())
    with pytest.raises(StateError, match=r"part-00001\.parquet is damaged \(it holds other samples"):
        store.missing(20)
    with pytest.raises(StateError, match=r"part-00001\.parquet is damaged \(it holds other samples"):
        store.read()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["a", "z"])
def test_numbers_that_are_none_do_not_pass(tmp_path, bad, name):
    rows = columns(0, 7)
    rows[name][4] = bad
    store = Store.create(tmp_path, MANIFEST)
    with pytest.raises(
        ArgumentError, match=rf"columns\['{name}'\]: finite numbers expected, got {bad} in sample 4"
    ):
        store.write(0, rows)
    assert contents(tmp_path) == {}


def test_infinity_does_not_pass_as_a_gap(tmp_path):
    rows = columns(0, 7)
    rows["left_u"][4] = np.inf
    with pytest.raises(
        ArgumentError, match=r"columns\['left_u'\]: finite numbers expected, got inf in sample 4"
    ):
        Store.create(tmp_path, MANIFEST).write(0, rows)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda rows: rows.pop("b"), r"columns: .* missing or strange: b"),
        (lambda rows: rows.update(c=rows["b"]), r"columns: .* missing or strange: c"),
        (lambda rows: rows.update(b=rows["b"][:3]), "columns: the same length everywhere expected"),
        (
            lambda rows: rows.update(b=rows["b"][None]),
            r"columns\['b'\]: a number \(n,\) expected, got float64 \(1,",
        ),
        (
            lambda rows: rows.update(b=np.array(list("abcdefg"))),
            r"columns\['b'\]: a number \(n,\) expected, got <U1",
        ),
        (lambda rows: rows.update(i=rows["i"] + 1), r"columns\['i'\]: expected 0, 1, \.\.\. in part 0"),
        (lambda rows: rows.update(i=rows["i"][::-1]), r"columns\['i'\]: expected 0, 1, \.\.\. in part 0"),
        (lambda rows: rows.update(columns(0, 8)), r"columns\['i'\]: expected 0, 1, \.\.\. in part 0"),
    ],
)
def test_columns_that_do_not_fit_are_named_and_nothing_is_written(tmp_path, change, words):
    rows = columns(0, 7)
    change(rows)
    with pytest.raises(ArgumentError, match=words):
        Store.create(tmp_path, MANIFEST).write(0, rows)
    assert contents(tmp_path) == {}


def test_a_sample_is_not_written_twice(tmp_path):
    store = filled(tmp_path, 7)
    before = contents(tmp_path)
    with pytest.raises(ArgumentError, match=r"columns\['i'\]: expected 0, 1, \.\.\. in part 0 of at most 7"):
        store.write(0, columns(0, 7))
    assert contents(tmp_path) == before


def test_a_sample_function_that_changes_its_columns_is_an_error(tmp_path):
    def fickle(seed, i):
        row = Numbers()(seed, i)
        return row if i < 3 else dict(reversed(row.items()))

    with pytest.raises(ArgumentError, match=r"sample: columns .* as before expected, got .* in 3"):
        babble(Store.create(tmp_path, MANIFEST), fickle, 7)


@pytest.mark.parametrize("count", [0, -1])
def test_no_samples_at_all_make_no_sense(tmp_path, count):
    with pytest.raises(ArgumentError, match="count: expected an integer >= 1"):
        babble(Store.create(tmp_path, MANIFEST), Numbers(), count)


# Questions that have no answer.


def test_samples_of_which_none_was_seen_are_an_error(tmp_path):
    store = Store.create(tmp_path, MANIFEST)
    with pytest.raises(StateError, match=r"there are no samples in .* yet"):
        store.samples()
    rows = columns(0, 7)
    rows["left_u"][:] = rows["left_v"][:] = np.nan
    store.write(0, rows)
    with pytest.raises(NotInViewError, match=r"none of the 7 samples in .* was seen by any camera"):
        store.samples()
    with pytest.raises(NotInViewError, match=r"none of the 7 samples in .* was seen by 'left'"):
        store.samples("left")
    with pytest.raises(NotInViewError, match=r"none of the 7 samples in .* where i > 100"):
        store.samples(None, "i > 100")
    assert len(store.samples(None)) == 7


def test_questions_that_are_none_are_errors(tmp_path):
    store = filled(tmp_path, 7)
    with pytest.raises(ArgumentError, match="seen_by: one of left, any, all or None expected, got 'right'"):
        store.samples("right")
    with pytest.raises(ArgumentError, match="columns: no column 'c'; there are i, a, b"):
        store.read(columns=["c"])
    for call in (lambda: store.read("nonsense ="), lambda: store.query("SELECT nothing FROM nowhere")):
        with pytest.raises(ArgumentError, match="sql: "):
            call()


def test_a_folder_s_name_may_have_quotes_and_spaces(tmp_path):
    assert len(filled(tmp_path / "a 'quoted' name [1] *", 7).read()["i"]) == 7


def test_samples_without_cameras_are_read_not_learned_from(tmp_path):
    manifest = Manifest("arm", "uniform", "r", "0", 1, ("a",), (), {"a": NUMBER})
    store = Store.create(tmp_path, manifest)
    store.write(0, {"i": np.arange(2), "a": np.zeros(2)})
    with pytest.raises(ArgumentError, match=r"samples of kind 'arm' have no cameras; use read\(\)"):
        store.samples()


@pytest.mark.parametrize("module", ["pyarrow", "duckdb"])
def test_without_its_extra_the_store_says_what_to_install(tmp_path, monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    for call in (Store.open, lambda folder: Store.create(folder, MANIFEST)):
        with pytest.raises(MissingExtraError, match=r"pip install 'motorprime\[learn\]'"):
            call(tmp_path)
    assert not list(tmp_path.iterdir())
