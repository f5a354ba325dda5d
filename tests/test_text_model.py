"""Fetching the text detector and the reader at set-up, without a network."""

from __future__ import annotations

import hashlib
import subprocess
import zipfile

import pytest

from motorprime.errors import StateError
from motorprime.evaluate import text_model


@pytest.fixture
def pip(monkeypatch, tmp_path):
    """A pip that brings a wheel with two small files, and counts how often it is asked."""
    places = {tmp_path / "share" / f"text_{kind}.onnx": part for kind, part in (("d", "det"), ("r", "rec"))}
    models = {path: (part, hashlib.sha256(part.encode()).hexdigest()) for path, part in places.items()}
    monkeypatch.setattr(text_model, "MODELS", models)
    monkeypatch.setattr(text_model, "PLACE", next(iter(models)))
    calls = []

    def run(command, **options):
        calls.append(command)
        folder = command[command.index("--dest") + 1]
        if run.code == 0:
            with zipfile.ZipFile(f"{folder}/some-1-py3-none-any.whl", "w") as wheel:
                for part in places.values():
                    name = f"rapidocr_onnxruntime/models/ch_PP-OCRv4_{part}_infer.onnx"
                    wheel.writestr(name, run.content or part)
        return subprocess.CompletedProcess(command, run.code, "", "no network")

    run.code, run.content, run.calls, run.models = 0, None, calls, models
    monkeypatch.setattr(text_model.subprocess, "run", run)
    return run


def test_models_are_read_out_of_the_wheel_once_and_nothing_is_installed(pip, capsys):
    assert text_model.main() == 0
    assert all(path.read_text() == part for path, (part, _) in pip.models.items())
    assert str(next(iter(pip.models)).parent) in capsys.readouterr().out
    text_model.fetch()
    assert len(pip.calls) == 1
    assert "download" in pip.calls[0] and "install" not in pip.calls[0] and "--no-deps" in pip.calls[0]


def test_without_a_network_it_says_so_and_leaves_nothing(pip, capsys):
    pip.code = 1
    assert text_model.main() == 1
    assert "pip cannot fetch" in capsys.readouterr().err
    assert not any(path.exists() for path in pip.models)


def test_another_model_is_refused(pip):
    pip.content = "another"
    with pytest.raises(StateError, match="not the one expected"):
        text_model.fetch()
    assert not any(path.exists() for path in pip.models)
