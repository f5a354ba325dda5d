"""Where a person's elbow would be: its swivel about the line from shoulder to wrist, learned from movements.

Shoulder S, elbow E and wrist W, gravity's direction g, and n = (W - S) / |W - S|. With what g and E - S have
across n::

    u = g - n (n g),    v = (E - S) - n (n (E - S)),    swivel = atan2(n (u x v), u v)

An elbow that hangs straight down has 0; a right one that is lifted outwards has a negative swivel.
The swivel is learned as a linear function of (W - S) / reach, reach being the length of the stretched arm, in
axes that point forward, to the left and up; so it carries over to arms of another size. Beyond the wrists
that were shown it is that of the nearest one of their range.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, fixed, not_negative, positive, rows
from ..errors import ArgumentError
from ..model_files import read_model, write_model
from ..robot import Robot
from .arm import Arm, Points, Posture

KIND = "elbow swivel"
STRETCHED = 0.02
"""An elbow nearer to the line [m] than this has no swivel worth learning or asking for."""
WEIGHT = 0.3
"""Of a radian of swivel, against a pose solver's 0.12 of a radian of an arm's joint."""
RIDGE = 1e-4  # of the slopes, against the mean square of the places
GRAVITY = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True, eq=False)
class Swivel:
    """Swivel of a right elbow as a linear function of where the wrist is.

    Args:
        middle: (3,) mean of the wrists that it was learned from, from the shoulder, in lengths of the arm:
            forward, left, up.
        constant: swivel [rad] there.
        slope: (3,) [rad] per length of the arm.
        shown: (2, 3) least and largest of those wrists; the swivel goes on with no slope beyond.
        error: root mean square [rad] on reaches that were left out; NaN where there was only one.
        spread: the same of a constant swivel, without any slope.

    Raises:
        ArgumentError: NaN or shapes that do not fit.
    """

    middle: Floats
    constant: float
    slope: Floats
    shown: Floats
    error: float = np.nan
    spread: float = np.nan

    def __post_init__(self) -> None:
        for name in ("middle", "slope"):
            object.__setattr__(self, name, fixed(name, getattr(self, name), (3,)))
        fixed("constant", self.constant, ())
        object.__setattr__(self, "shown", fixed("shown", self.shown, (2, 3)))
        if (self.shown[0] > self.shown[1]).any():
            raise ArgumentError(f"shown: expected the least and then the largest, got {self.shown.tolist()}")

    def at(self, wrists: npt.ArrayLike) -> Floats:
        """Swivels (N,) [rad] of wrists (N, 3), from the shoulder in lengths of the arm: forward, left, up."""
        within = np.clip(rows("wrists", wrists, 3), self.shown[0], self.shown[1])
        values: Floats = self.constant + (within - self.middle) @ self.slope
        return values

    def slope_at(self, wrist: Floats) -> Floats:
        """Derivative (3,) of :meth:`at` by one wrist (3,): 0 along each axis on which it is out of range."""
        return np.where((wrist >= self.shown[0]) & (wrist <= self.shown[1]), self.slope, 0.0)

    def save(self, path: str | Path) -> None:
        """Write it to a model file."""
        arrays = {
            "middle": self.middle,
            "slope": self.slope,
            "shown": self.shown,
            "constant": np.array([self.constant]),
        }
        errors = {name: _or_none(getattr(self, name)) for name in ("error", "spread")}
        write_model(path, KIND, arrays, errors)

    @classmethod
    def load(cls, path: str | Path) -> Swivel:
        """Read a model file.

        Raises:
            ArgumentError: the file is missing, damaged or holds something else.
        """
        arrays, about = read_model(path, KIND)
        return cls.from_arrays(arrays, about)

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Floats], about: Mapping[str, Any]) -> Swivel:
        """What a model file holds."""
        missing = {"middle", "slope", "shown", "constant"} - set(arrays)
        if missing:
            raise ArgumentError(f"arrays: an elbow's swivel needs {sorted(missing)[0]}")
        errors = {
            name: np.nan if about.get(name) is None else float(about[name]) for name in ("error", "spread")
        }
        constant = float(fixed("constant", arrays["constant"], (1,))[0])
        return cls(arrays["middle"], constant, arrays["slope"], arrays["shown"], **errors)


def swivels(shoulders: npt.ArrayLike, elbows: npt.ArrayLike, wrists: npt.ArrayLike) -> tuple[Floats, Floats]:
    """Swivels (N,) [rad] of elbows and their distances (N,) [m] from the line between shoulder and wrist.

    Args:
        shoulders, elbows, wrists: (N, 3) [m] in axes whose third one points up.
    """
    shoulder, elbow, wrist = (
        rows(name, value, 3)
        for name, value in (("shoulders", shoulders), ("elbows", elbows), ("wrists", wrists))
    )
    if not len(shoulder) == len(elbow) == len(wrist):
        raise ArgumentError(
            f"wrists: as many as the {len(shoulder)} shoulders and the elbows expected, "
            f"got {len(wrist)} and {len(elbow)} elbows"
        )
    line = wrist - shoulder
    length = np.linalg.norm(line, axis=1, keepdims=True)
    if (length < 1e-6).any():
        raise ArgumentError(f"wrists: a wrist in the shoulder at [{int(np.argmin(length))}]")
    n = line / length
    u = GRAVITY - n * (n @ GRAVITY)[:, None]
    v = _across(elbow - shoulder, n)
    return np.arctan2(_dots(n, np.cross(u, v)), _dots(u, v)), np.linalg.norm(v, axis=1)


def learn_swivel(
    reaches: Sequence[tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike]], *, ridge: float = RIDGE
) -> Swivel:
    """Learn the swivel of a person's right elbow.

    Args:
        reaches: of each movement the shoulders, elbows and wrists (N, 3) [m], forward, left and up. Where
            the arm is stretched, the elbow nearer than 2 cm to the line, it is left out.
        ridge: weight of the slopes' squares.

    Returns:
        The swivel, with its error on each reach when learned from the others.

    Raises:
        ArgumentError: no reaches, NaN, shapes that do not fit, fewer than ten bent postures.
    """
    ridge = not_negative("ridge", ridge)
    if not reaches:
        raise ArgumentError("reaches: expected at least one, got none")
    arms = [[rows(name, part, 3) for name, part in zip(_PARTS, reach, strict=True)] for reach in reaches]
    every = [np.concatenate(parts) for parts in zip(*arms, strict=True)]
    reach = positive("reaches", _stretched(*every))
    places, angles = [], []
    for shoulder, elbow, wrist in arms:
        swivel, off = swivels(shoulder, elbow, wrist)
        bent = off >= STRETCHED
        places.append(((wrist - shoulder) / reach)[bent])
        angles.append(swivel[bent])
    if sum(map(len, angles)) < 10:
        raise ArgumentError(f"reaches: ten bent postures or more expected, got {sum(map(len, angles))}")
    missed: dict[str, list[Floats]] = {"error": [], "spread": []}
    for k in range(len(arms)):
        others = [i for i in range(len(arms)) if i != k and len(angles[i])]
        if not others or not len(angles[k]):
            continue
        x, y = (np.concatenate([part[i] for i in others]) for part in (places, angles))
        missed["error"].append(angles[k] - _fit(x, y, ridge).at(places[k]))
        missed["spread"].append(angles[k] - y.mean())
    whole = _fit(np.concatenate(places), np.concatenate(angles), ridge)
    return replace(whole, error=_rms(missed["error"]), spread=_rms(missed["spread"]))


class SwivelPreference:
    """A learned swivel as a preference of a :class:`.pose.PoseSolver`.

    Args:
        robot: whose elbow and wrist are the first two of its guarded links; its shoulder is where the joint
            before the elbow sits.
        swivel: what the elbow is to do.
        weight: per radian.
        forward: (3,) unit vector in the root frame, level, the way the robot faces; the iCub's is -x.

    Raises:
        ArgumentError: the robot guards fewer than two links, a weight that is negative, a direction that is
            not level or of length 0.
    """

    def __init__(
        self,
        robot: Robot,
        swivel: Swivel,
        *,
        weight: float = WEIGHT,
        forward: npt.ArrayLike = (-1.0, 0.0, 0.0),
    ) -> None:
        self.swivel, self.weight = swivel, not_negative("weight", weight)
        ahead = fixed("forward", forward, (3,))
        if ahead[2] != 0.0 or abs(float(np.linalg.norm(ahead)) - 1.0) > 1e-6:
            raise ArgumentError(f"forward: expected a level unit vector, got {ahead.tolist()}")
        self._axes = np.array([ahead, np.cross([0.0, 0.0, 1.0], ahead), [0.0, 0.0, 1.0]])
        if len(robot.guarded) < 2:
            raise ArgumentError(f"robot: '{robot.name}' guards no elbow and wrist: {list(robot.guarded)}")
        arm = Arm(robot)
        elbow, wrist = (arm.on_link(link, np.zeros((1, 3))) for link in list(robot.guarded)[:2])
        shoulder = Points.carried(int(elbow.carriers[0]) - 1, np.zeros((1, 3)))
        self._points = shoulder.joined(elbow).joined(wrist)
        places = arm.at(np.zeros(len(arm.names))).places(self._points)
        self._reach = float(sum(np.linalg.norm(np.diff(places, axis=0), axis=1)))

    def error(self, posture: Posture) -> float:
        """By how much [rad] the elbow's swivel is more than the preferred one, within a half turn."""
        return self._compare(posture.places(self._points))[0]

    def __call__(self, posture: Posture) -> tuple[Floats, Floats]:
        """The residual (1,) and its derivative (1, n), both 0 where the arm is stretched.

        The swivel's derivative: of v's turn about n minus u's. A turn of n tilts both alike; what is left is
        the rate of each across n, over its length.
        """
        places = posture.places(self._points)
        error, bent, by_places = self._compare(places)
        if not bent:
            return np.zeros(1), np.zeros((1, len(posture.frames)))
        velocities = posture.velocities(self._points, places)
        slope = np.einsum("kc,kcn->n", by_places, velocities)
        return np.array([self.weight * error]), self.weight * slope[None]

    def _compare(self, places: Floats) -> tuple[float, bool, Floats]:
        """Error [rad], whether the arm is bent, and the error's derivative by the three places (3, 3)."""
        shoulder, elbow, wrist = places
        line, upper = wrist - shoulder, elbow - shoulder
        length = float(np.linalg.norm(line))
        n = line / length
        along, down = float(upper @ n), float(GRAVITY @ n)
        v, u = upper - along * n, GRAVITY - down * n
        off, level = float(np.linalg.norm(v)), float(np.linalg.norm(u))
        if off < STRETCHED or level < 0.05:
            return 0.0, False, np.zeros((3, 3))
        turn_v, turn_u = np.cross(n, v) / off**2, np.cross(n, u) / level**2
        swivel = float(np.arctan2(n @ np.cross(u, v), u @ v))
        wrist_place = self._axes @ line / self._reach
        wanted = float(self.swivel.at(wrist_place[None])[0])
        error = float((swivel - wanted + np.pi) % (2.0 * np.pi) - np.pi)
        by_n = -along * turn_v + down * turn_u
        by_line = by_n / length - self._axes.T @ self.swivel.slope_at(wrist_place) / self._reach
        return error, True, np.array([-turn_v - by_line, turn_v, by_line])


_PARTS = ("shoulders", "elbows", "wrists")


def _fit(places: Floats, angles: Floats, ridge: float) -> Swivel:
    middle, constant = places.mean(axis=0), float(angles.mean())
    x = places - middle
    slope = np.linalg.solve(x.T @ x / len(x) + ridge * np.eye(3), x.T @ (angles - constant) / len(x))
    return Swivel(middle, constant, slope, np.array([places.min(axis=0), places.max(axis=0)]))


def _stretched(shoulders: Floats, elbows: Floats, wrists: Floats) -> float:
    """Length [m] of the stretched arm: upper arm and forearm, by their medians."""
    upper = np.linalg.norm(elbows - shoulders, axis=1)
    fore = np.linalg.norm(wrists - elbows, axis=1)
    return float(np.median(upper) + np.median(fore))


def _across(vectors: Floats, n: Floats) -> Floats:
    return vectors - n * _dots(vectors, n)[:, None]


def _dots(a: Floats, b: Floats) -> Floats:
    products: Floats = np.sum(a * b, axis=1)
    return products


def _rms(parts: list[Floats]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2))) if parts else np.nan


def _or_none(value: float) -> float | None:
    return None if np.isnan(value) else value
