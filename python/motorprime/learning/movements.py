"""Learn the five blocks of the eye-arm-hand controller from reaches that people made.

No public recording has gaze, arm and hand together. Arm and hand are recorded; the gaze is synthetic: a
minimum-jerk saccade to the target that lands before the hand sets off by the published median.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, generator
from ..control.cds import CoupledDynamics
from ..control.demonstrations import Demonstration, stacked
from ..control.lpvds import LpvDs
from ..control.path import minimum_jerk
from ..errors import ArgumentError
from ..recordings.reaches import Reach
from ..rotations import rotation_vectors
from .couplings import fit_coupling
from .mixtures import COMPONENTS
from .stable import fit_lpvds

LEAD = 0.188
"""Gaze lands on the target so long [s] before the hand sets off (median of people, see the docs)."""
AWAY = (0.1, 0.4)
"""How far [m] from the target a synthetic gaze begins."""
VIEWED = 0.5
"""How far [m] the eyes are from the target, for the angle that a saccade has to turn."""
SACCADE = (0.021, 0.0022)
"""A saccade takes 21 ms and 2.2 ms for each degree (Carpenter, Movements of the Eyes, 1988)."""
PERIOD = 0.002
"""Between two samples of a synthetic saccade [s]: some last 40 ms."""
CLOSING = 0.9
"""The hand's closing begins where the opening is last this share of the reach's widest."""
DECAYS = {"eye": 2.0, "arm": 0.3, "hand": 1.0}
"""Least certified rates [1/s]: no part may take for ever. More forbids the slow end of a reach."""
REGULARISATION = 0.025
"""Of the arm's mixture, see :func:`fit_mixture`."""


@dataclass(frozen=True, eq=False)
class Shown:
    """Reaches as the three systems see them.

    Attributes:
        eyes: synthetic saccades, (N, 3) [m] from the target, in the goal palm's axes.
        arms: (N, 6): place [m] and rotation vector [rad] of the palm in the axes of the palm at the grasp.
        hands: (N, 1) openings, from the start of closing to the grasp.
        openings: (N,) of the whole reaches, beside ``arms``.
    """

    eyes: tuple[Demonstration, ...]
    arms: tuple[Demonstration, ...]
    hands: tuple[Demonstration, ...]
    openings: tuple[Floats, ...]


def learn_cds(
    reaches: Sequence[Reach],
    *,
    near: float = 0.02,
    step: float = 0.01,
    components: Iterable[int] = COMPONENTS,
    n_init: int = 10,
    seed: int | np.random.Generator | None = None,
) -> CoupledDynamics:
    """The coupled dynamical systems of these reaches.

    Args:
        reaches: at least two.
        near: distance [m] below which eye and palm count as there, see :class:`Coupling`. Below it the hand
            closes whatever the demonstrations did.
        step: the largest Euler step [s] that is to be certified.
        components: numbers of components to try for the arm.
        n_init: starts of the arm's mixture.
        seed: draws where synthetic gazes begin, and the starts of the mixtures.

    Raises:
        ArgumentError: fewer than two reaches.
        StateError: no certified system was found.
        MissingExtraError: scikit-learn or cvxpy is not installed.
    """
    draws = generator(seed)
    shown = as_shown(reaches, seed=draws)
    eye = fit_lpvds(shown.eyes, step=step, decay=DECAYS["eye"], components=(1,), seed=draws)
    arm = fit_arm(shown.arms, blocks=(3, 3), step=step, components=components, n_init=n_init, seed=draws)
    hand = fit_lpvds(
        shown.hands, step=step, decay=DECAYS["hand"], components=range(1, 6), method="identity", seed=draws
    )
    distance = [np.linalg.norm(one.states[:, :3], axis=1) for one in shown.arms]
    # While the eye moves the arm is where it will set off from.
    psi = [np.linalg.norm(one.states, axis=1) for one in shown.eyes]
    waiting = [np.full(len(eyes), arm[0]) for eyes, arm in zip(psi, distance, strict=True)]
    eye_arm = fit_coupling(
        np.concatenate(psi), np.concatenate(waiting), components=(1,), near=near, seed=draws
    )
    open_from = [int(np.argmax(wide)) for wide in map(_wide, shown.openings)]
    palms = np.concatenate([one[k:] for one, k in zip(distance, open_from, strict=True)])
    openings = np.concatenate([one[k:] for one, k in zip(shown.openings, open_from, strict=True)])
    arm_hand = fit_coupling(palms, openings, near=near, seed=draws)
    about = {
        "reaches": len(shown.arms),
        "gaze": "synthetic: minimum-jerk saccades that land 188 ms before the hand sets off",
    }
    return CoupledDynamics(eye, arm, hand, eye_arm, arm_hand, about=about)


def fit_arm(
    shown: Sequence[Demonstration],
    *,
    blocks: Sequence[int] | None = None,
    step: float = 0.01,
    components: Iterable[int] = COMPONENTS,
    n_init: int = 10,
    seed: int | np.random.Generator | None = None,
) -> LpvDs:
    """The arm's system, with the settings that held for reaches; arguments as of :func:`fit_lpvds`."""
    return fit_lpvds(
        shown,
        blocks=blocks,
        step=step,
        components=components,
        decay=DECAYS["arm"],
        regularisation=REGULARISATION,
        n_init=n_init,
        seed=seed,
    )


def as_shown(reaches: Sequence[Reach], *, seed: int | np.random.Generator | None = None) -> Shown:
    """The reaches relative to their grasps, with a synthetic saccade for each.

    Raises:
        ArgumentError: fewer than two reaches.
    """
    if len(reaches) < 2:
        raise ArgumentError(f"reaches: expected at least 2, got {len(reaches)}")
    draws = generator(seed)
    return Shown(
        tuple(synthetic_saccade(draws) for _ in reaches),
        tuple(palm_movement(reach) for reach in reaches),
        tuple(closing(reach) for reach in reaches),
        tuple(reach.openings for reach in reaches),
    )


def palm_movement(reach: Reach) -> Demonstration:
    """Place [m] and rotation vector [rad] (N, 6) of the palm in the axes of the palm at the grasp."""
    goal = reach.palms[-1]
    places = (reach.palms[:, :3, 3] - goal[:3, 3]) @ goal[:3, :3]
    turns = rotation_vectors(goal[:3, :3].T @ reach.palms[:, :3, :3])
    return Demonstration(reach.times - reach.times[0], np.hstack([places, turns]))


def closing(reach: Reach) -> Demonstration:
    """Openings (N, 1) from where the hand begins to close: before, it waits, and shows nothing of its own."""
    last = int(np.flatnonzero(_wide(reach.openings))[-1])
    begin = min(last, len(reach.times) - 3)
    return Demonstration(reach.times[begin:], reach.openings[begin:, None])


def synthetic_saccade(seed: int | np.random.Generator | None = None) -> Demonstration:
    """A minimum-jerk saccade (N, 3) [m] to the target, from a direction and distance that are drawn.

    Times are those of the reach: it lands ``LEAD`` before 0, when the hand sets off.
    """
    draws = generator(seed)
    direction = draws.normal(size=3)
    start = draws.uniform(*AWAY) * direction / np.linalg.norm(direction)
    angle = np.rad2deg(np.arctan2(np.linalg.norm(start), VIEWED))
    duration = SACCADE[0] + SACCADE[1] * angle
    count = max(3, 1 + round(duration / PERIOD))
    phase = np.linspace(0.0, 1.0, count)
    # 30 t^2 (1 - t)^2 is the derivative of minimum_jerk.
    speed = 30.0 * phase**2 * (1.0 - phase) ** 2 / duration
    times = -LEAD - duration + duration * phase
    return Demonstration(times, np.outer(1.0 - minimum_jerk(phase), start), np.outer(speed, -start))


def _wide(openings: Floats) -> npt.NDArray[np.bool_]:
    """Where the hand is open. Before it first is, it opens from wherever it was, at any distance."""
    wide: npt.NDArray[np.bool_] = openings >= CLOSING * openings.max()
    return wide


def arm_places(demonstrations: Sequence[Demonstration]) -> list[Demonstration]:
    """Of arm movements (N, 6), the places (N, 3) alone."""
    stacked(demonstrations)
    return [Demonstration(one.times, one.states[:, :3], one.speeds[:, :3]) for one in demonstrations]
