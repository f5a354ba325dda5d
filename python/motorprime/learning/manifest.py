"""What a store of samples holds, written beside them: whoever adds samples must be about to add the same."""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np

from .. import __version__
from .._arrays import integer
from ..errors import ArgumentError
from ..robot import Robot

FORMAT = 1
NUMBER, GAP, COUNT, WORD = "number", "number or none", "count", "word"
"""Kinds of columns: a finite number, a number that may be missing, an integer, a short text."""
POINT = ("x", "y", "z")
INDEX = "i"


def versions() -> dict[str, str]:
    """Versions of what a sample depends on; pybullet's only where it is installed."""
    found = {"motorprime": __version__, "numpy": np.__version__}
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        found["pybullet"] = importlib.metadata.version("pybullet")
    return found


def robot_fingerprint(robot: Robot) -> str:
    """SHA-256 of a robot: its URDF's bytes, its cameras, and every other field but the hand, which rests."""
    described: dict[str, Any] = {
        item.name: getattr(robot, item.name)
        for item in fields(robot)
        if item.name not in ("urdf", "palm", "hand")
    }
    described["cameras"] = {
        name: {"link": mount.link, **asdict(mount.camera)} for name, mount in robot.cameras.items()
    }
    described["palm"] = {"link": robot.palm.link, "frame": robot.palm.frame.tolist()}
    text = json.dumps(described, sort_keys=True).encode()
    try:
        urdf = b"" if robot.urdf is None else robot.urdf.read_bytes()
    except OSError as error:
        raise ArgumentError(f"robot: cannot read its URDF {robot.urdf}: {error.strerror}") from None
    return hashlib.sha256(text + b"\0" + urdf).hexdigest()


@dataclass(frozen=True)
class Manifest:
    """What the samples of a store are.

    Args:
        kind: what was babbled, e.g. 'gaze'.
        mode: how postures were drawn.
        robot: its name, for people.
        fingerprint: of the robot, see :func:`robot_fingerprint`.
        seed: sample i is drawn by ``default_rng([seed, i])``.
        joints: names of the columns with joint angles [rad].
        cameras: those that looked; camera c has the columns c_u, c_v [px], missing where it saw nothing.
        columns: {name: kind} of all columns but the index.
        settings: whatever else a sample depends on; plain values.
        chunk: samples per part.
        versions: of the software, see :func:`versions`.
    """

    kind: str
    mode: str
    robot: str
    fingerprint: str
    seed: int
    joints: tuple[str, ...]
    cameras: tuple[str, ...]
    columns: Mapping[str, str]
    settings: Mapping[str, Any] = field(default_factory=dict)
    chunk: int = 100
    versions: Mapping[str, str] = field(default_factory=versions)

    def __post_init__(self) -> None:
        """Check what a store relies on."""
        integer("seed", self.seed, at_least=0)
        integer("chunk", self.chunk, at_least=1)
        object.__setattr__(self, "joints", tuple(self.joints))
        object.__setattr__(self, "cameras", tuple(self.cameras))
        needed = [*self.joints, *(f"{camera}_{axis}" for camera in self.cameras for axis in "uv")]
        missing = [name for name in needed if name not in self.columns]
        if missing:
            raise ArgumentError(f"columns: '{missing[0]}' expected among them, got {', '.join(self.columns)}")
        if INDEX in self.columns:
            raise ArgumentError(f"columns: '{INDEX}' is the index of the samples and cannot be one of them")
        strange = set(self.columns.values()) - {NUMBER, GAP, COUNT, WORD}
        if strange:
            raise ArgumentError(f"columns: no such kind of column: {sorted(strange)}")

    def to_json(self) -> str:
        """The text of manifest.json."""
        return json.dumps({"format": FORMAT, **asdict(self)}, indent=2) + "\n"

    @classmethod
    def from_json(cls, text: str, where: str) -> Manifest:
        """Read what :meth:`to_json` wrote; ``where`` names the file in messages.

        Raises:
            ArgumentError: it is no manifest, or one of another format.
        """
        try:
            given = json.loads(text)
            if given.pop("format") != FORMAT:
                raise ArgumentError(f"folder: {where} has another format; this version reads {FORMAT}")
            return cls(**given)
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            if isinstance(error, ArgumentError):
                raise
            raise ArgumentError(f"folder: {where} is no manifest of samples: {error}") from None

    def check_same(self, other: Manifest, where: str) -> None:
        """Make sure that samples of ``other`` may be added to this store.

        Raises:
            ArgumentError: they are of another robot, seed, kind, mode or version; the message says which.
        """
        mine, theirs = _flat(asdict(self)), _flat(asdict(other))
        for name in mine | theirs:
            held, asked = mine.get(name), theirs.get(name)
            if held == asked:
                continue
            what = f"{name} {held!r}, asked for {asked!r}"
            if name == "fingerprint":
                what = f"another robot '{self.robot}': its URDF or its cameras differ"
            raise ArgumentError(
                f"folder: {where} holds samples with {what}; the two must not mix, choose another folder"
            )


def _flat(described: Mapping[str, Any]) -> dict[str, Any]:
    """One level of names, 'settings.noise' for example; lists as JSON has them."""
    flat: dict[str, Any] = {}
    for name, value in json.loads(json.dumps(described)).items():
        nested = isinstance(value, dict)
        flat |= {f"{name}.{key}": each for key, each in value.items()} if nested else {name: value}
    return flat
