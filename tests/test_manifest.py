"""What a store says of itself: other samples do not mix into it, and a folder that is none is named."""

import json
from dataclasses import replace

import pytest

from motorprime import ArgumentError
from motorprime.learning.manifest import GAP, NUMBER, versions
from motorprime.learning.store import Store
from store_filler import MANIFEST, contents, filled

pytestmark = pytest.mark.learn


def test_a_folder_that_is_no_store_is_named(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ArgumentError, match=r"is not empty and has no manifest\.json"):
        Store.create(tmp_path, MANIFEST)
    with pytest.raises(ArgumentError, match=r"is no store of samples: it has no manifest\.json"):
        Store.open(tmp_path)
    with pytest.raises(ArgumentError, match="is no store of samples: it does not exist"):
        Store.open(tmp_path / "nowhere")
    with pytest.raises(ArgumentError, match="folder: cannot write into"):
        Store.create(tmp_path / "notes.txt" / "below", MANIFEST)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_parts_without_their_manifest_are_not_taken_over(tmp_path):
    filled(tmp_path, 7)
    (tmp_path / "manifest.json").unlink()
    with pytest.raises(ArgumentError, match=r"is not empty and has no manifest\.json"):
        Store.create(tmp_path, MANIFEST)
    assert len(contents(tmp_path)) == 1


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"seed": 6}, "seed 5, asked for 6"),
        ({"kind": "arm"}, "kind 'numbers', asked for 'arm'"),
        ({"mode": "near"}, "mode 'uniform', asked for 'near'"),
        ({"fingerprint": "1" * 64}, "another robot 'none': its URDF or its cameras differ"),
        ({"settings": {"noise": 2.0}}, r"settings\.noise 0\.0, asked for 2\.0"),
        ({"versions": {**versions(), "numpy": "1.0"}}, r"versions\.numpy '.*', asked for '1\.0'"),
        ({"versions": {**versions(), "extra": "1"}}, r"versions\.extra None, asked for '1'"),
        ({"chunk": 8}, "chunk 7, asked for 8"),
        ({"columns": {**MANIFEST.columns, "x": GAP}}, r"columns\.x 'number', asked for 'number or none'"),
    ],
)
def test_other_samples_do_not_mix_into_a_folder(tmp_path, changes, words):
    store = filled(tmp_path, 7)
    with pytest.raises(ArgumentError, match=rf"holds samples with {words}; the two must not mix"):
        Store.create(tmp_path, replace(MANIFEST, **changes))
    assert len(store) == 7


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"format": 1, "kind": "gaze"}', '{"format": 99}'])
def test_a_manifest_that_is_none_is_named(tmp_path, text):
    (tmp_path / "manifest.json").write_text(text)
    for call in (Store.open, lambda folder: Store.create(folder, MANIFEST)):
        with pytest.raises(
            ArgumentError, match=r"folder: .*manifest\.json (is no manifest|has another format)"
        ):
            call(tmp_path)


def test_a_manifest_survives_its_file(tmp_path):
    store = Store.create(tmp_path, MANIFEST)
    assert store.manifest == Store.open(tmp_path).manifest == MANIFEST
    assert json.loads((tmp_path / "manifest.json").read_text())["format"] == 1


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"seed": -1}, "seed: expected an integer >= 0"),
        ({"chunk": 0}, "chunk: expected an integer >= 1"),
        ({"joints": ("a", "c")}, "columns: 'c' expected among them"),
        ({"cameras": ("right",)}, "columns: 'right_u' expected among them"),
        ({"columns": {**MANIFEST.columns, "i": NUMBER}}, "columns: 'i' is the index"),
        ({"columns": {**MANIFEST.columns, "w": "text"}}, "columns: no such kind of column"),
    ],
)
def test_a_manifest_that_contradicts_itself_is_an_error(changes, words):
    with pytest.raises(ArgumentError, match=words):
        replace(MANIFEST, **changes)
