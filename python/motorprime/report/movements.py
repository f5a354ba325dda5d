"""The report of a learned eye-arm-hand controller: what was shown, what it does, and why it arrives."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._arrays import Floats
from ..control.cds import CoupledDynamics, Goal, RollOut, State
from ..control.coupling import Coupling
from ..control.demonstrations import Demonstration
from ..learning.movements import palm_movement
from ..recordings.reaches import Reach, Reaches
from .document import Shot, new_figure, plotted
from .plots import FULL, GOOD, INK, LINE, styled
from .sheet import Section, Sheet

PLANES = ((0, 1, "along the fingers", "across the palm"), (0, 2, "along the fingers", "out of the palm"))
REACHED = 0.01
"""A roll-out's time is told until the palm is so near [m]."""


def movement_sheet(model: CoupledDynamics, found: Reaches, *, seed: int) -> Sheet:
    """What was learned from these reaches, as a page."""
    shown = [palm_movement(reach) for reach in found.reaches]
    made = [reproduce(model, reach) for reach in found.reaches]
    times = [_time_near(path.path - path.path[-1], path.times) for path in made]
    shown_times = [_time_near(one.states[:, :3], one.times) for one in shown]
    arrived = sum(path.arrived for path in made)
    arm = model.arm.certificate()
    return Sheet(
        "An eye-arm-hand controller from demonstrations",
        (
            "Learned from ",
            f"{len(found)} reaches",
            ", certified to come to rest at the goal from anywhere: once the eye is there the palm "
            "comes nearer all the time, at ",
            f"{-arm.continuous:.2g} 1/s",
            " or more.",
        ),
        (
            (f"{arrived} of {len(made)}", "reproductions that arrived in 10 s"),
            (
                f"{np.mean(times):.2f} s",
                f"to 1 cm from the goal; the person took {np.mean(shown_times):.2f} s",
            ),
            (f"{float(model.arm_hand.expected(0.02)):.2f}", "opening at 2 cm from the goal, 1 is wide open"),
            (f"{1e3 * model.largest_step:.3g} ms", "largest time step that is certified"),
        ),
        (
            Section("What was shown, and what it does", shots=(paths_shot(model, shown, made),)),
            Section("In time", shots=(time_shot(shown, found, made),)),
            Section("How the parts go together", COUPLED, shots=(coupling_shot(model, shown, found),)),
            Section(
                "Why it must arrive", certificate_text(model), header=HEADER, rows=certificate_rows(model)
            ),
        ),
        f"seed {seed}; gaze is synthetic: minimum-jerk saccades that land 188 ms before the hand sets off. "
        f"Reaches left out: {sum(found.dropped.values())}.",
    )


COUPLED = (
    "Left: while the eye is far from the target the arm is expected to be far, and so it waits. No "
    "gaze was recorded; the saccades are synthetic. Right: how open the hand was at each "
    "distance of the palm, and what the coupling expects. It goes to zero with the distance, so that "
    "all come to rest together."
)
HEADER = ("system", "components", "rate [1/s]", "factor a step", "step [ms]")


def certificate_text(model: CoupledDynamics) -> str:
    """Why the model converges, in a paragraph with its numbers."""
    slowest = min(-system.certificate().continuous for system in model.systems.values())
    return (
        "Each system mixes linear ones by weights that are positive and sum to one. For all of its "
        "matrices A there is one matrix P by which the distance sqrt(x' P x) to the goal falls: the "
        "symmetric part of P^1/2 A P^-1/2 has no eigenvalue above minus the rate in the table, and "
        "one time step multiplies the distance by the factor in the table at most. Both hold for "
        "every mixture too, wherever the state is and however the mixture was fitted, so the distance"
        f" falls in every step, by {slowest:.2g} 1/s at least, until nothing is left. The arm's gate "
        "only scales the arm's state between 0 and 1; it opens when the eye has arrived, and the "
        "hand's wish is 0 when the arm has arrived. So first the eye comes to rest, then the arm, "
        "then the hand. The numbers were computed from the model as it is stored, after the fit, and "
        "are checked whenever it is loaded."
    )


def certificate_rows(model: CoupledDynamics) -> list[list[str]]:
    """A row for each system."""
    rows = []
    for name, system in model.systems.items():
        c = system.certificate()
        rows.append(
            [
                name,
                str(len(system.weights)),
                f"{c.continuous:.3f}",
                f"{c.discrete:.6f}",
                f"{1e3 * c.step:g}",
            ]
        )
    return rows


def reproduce(model: CoupledDynamics, reach: Reach) -> RollOut:
    """The model's movement from where a reach began, the eye on the target already."""
    goal = Goal(reach.palms[-1][:3, 3], _rigid(reach.palms[-1]))
    start = State(goal.fixation, _rigid(reach.palms[0]), float(np.clip(reach.openings[0], -0.5, 2.0)))
    return model.roll_out(start, goal, dt=model.largest_step)


def paths_shot(model: CoupledDynamics, shown: list[Demonstration], made: list[RollOut]) -> Shot:
    """The palm's paths in the goal palm's axes, over the streamlines of the learned system."""
    with styled():
        figure = new_figure(4.2)
        panels: Any = figure.subplots(1, 2)
        for panel, (a, b, first, second) in zip(panels, PLANES, strict=True):
            places = np.concatenate([one.states[:, :3] for one in shown])
            low, high = places.min(axis=0) - 0.02, places.max(axis=0) + 0.02
            across, up = np.meshgrid(np.linspace(low[a], high[a], 40), np.linspace(low[b], high[b], 40))
            flow = model.arm.velocity(_slice(shown, across.ravel(), up.ravel(), a, b))
            panel.streamplot(
                100 * across,
                100 * up,
                flow[:, a].reshape(across.shape),
                flow[:, b].reshape(across.shape),
                color="#d5dbe5",
                density=1.1,
                linewidth=0.7,
                arrowsize=0.6,
            )
            for k, (one, path) in enumerate(zip(shown, made, strict=True)):
                goal = path.palms[-1]
                places = (path.path - goal[:3, 3]) @ goal[:3, :3]
                panel.plot(
                    *(100 * one.states[:, [a, b]].T), color=FULL, lw=1, label="" if k else "the person"
                )
                panel.plot(*(100 * places[:, [a, b]].T), color=LINE, lw=1.2, label="" if k else "the model")
            panel.plot(0, 0, "o", color=GOOD, ms=7, label="grasp")
            panel.set_xlabel(f"{first} [cm]")
            panel.set_ylabel(f"{second} [cm]")
            panel.set_aspect("equal")
        panels[0].legend(loc="lower left")
        return plotted(
            figure,
            "The palm's way to the grasp",
            "In the axes of the palm at the grasp, so that a turned grasp is approached the same way,"
            " turned. Streamlines are cut through the mean path in the third direction.",
            "Paths of the person and of the model, on streamlines",
        )


def time_shot(shown: list[Demonstration], found: Reaches, made: list[RollOut]) -> Shot:
    """Distance and opening over time."""
    with styled():
        figure = new_figure(3.2)
        panels: Any = figure.subplots(1, 2)
        for k, (one, reach, path) in enumerate(zip(shown, found.reaches, made, strict=True)):
            person, ours = ("the person", "the model") if k == 0 else ("", "")
            far = np.linalg.norm(path.path - path.path[-1], axis=1)
            panels[0].plot(
                one.times, 100 * np.linalg.norm(one.states[:, :3], axis=1), color=FULL, lw=1, label=person
            )
            panels[0].plot(path.times, 100 * far, color=LINE, lw=1, label=ours)
            panels[1].plot(one.times, reach.openings, color=FULL, lw=1)
            panels[1].plot(path.times, path.openings, color=LINE, lw=1)
        for panel, label in zip(panels, ("distance of the palm [cm]", "opening of the hand"), strict=True):
            panel.set_xlim(0.0, 3.0)
            panel.set_xlabel("time [s]")
            panel.set_ylabel(label)
        panels[0].legend()
        return plotted(
            figure,
            "Distance and opening over time",
            "From where each reach began. A model that only knows where it is starts at once where "
            "a person speeds up from rest.",
            "Curves of the person and of the model",
        )


def coupling_shot(model: CoupledDynamics, shown: list[Demonstration], found: Reaches) -> Shot:
    """What the couplings expect, over what the person did."""
    with styled():
        figure = new_figure(3.2)
        panels: Any = figure.subplots(1, 2)
        eye = np.linspace(0.0, 0.4, 300)
        panels[0].plot(100 * eye, 100 * _expected(model.eye_arm, eye), color=LINE, lw=2)
        panels[0].set_xlabel("distance of the fixation point [cm] (synthetic)")
        panels[0].set_ylabel("distance of the palm [cm]")
        for k, (one, reach) in enumerate(zip(shown, found.reaches, strict=True)):
            far = np.linalg.norm(one.states[:, :3], axis=1)
            panels[1].plot(100 * far, reach.openings, color=FULL, lw=0.8, label="" if k else "the person")
        arm = np.linspace(0.0, 0.25, 300)
        panels[1].plot(100 * arm, _expected(model.arm_hand, arm), color=LINE, lw=2, label="expected")
        panels[1].axhline(0.1, color=INK, lw=0.8, ls=":")
        panels[1].set_xlabel("distance of the palm [cm]")
        panels[1].set_ylabel("opening of the hand")
        panels[1].legend(loc="lower right")
        return plotted(
            figure,
            "Eye to arm, arm to hand",
            f"Below {100 * model.arm_hand.near:g} cm each is drawn to zero in proportion.",
            "The two couplings",
        )


def _expected(coupling: Coupling, psi: Floats) -> Floats:
    return np.asarray(coupling.expected(psi))


def _slice(shown: list[Demonstration], across: Floats, up: Floats, a: int, b: int) -> Floats:
    """States (N, 6) in a plane; the third coordinate is that of the person at the same first one, the "
    "turn is 0."""
    third = 3 - a - b
    places = np.concatenate([one.states[:, :3] for one in shown])
    slope = float(places[:, a] @ places[:, third] / (places[:, a] @ places[:, a]))
    states = np.zeros((len(across), 6))
    states[:, a], states[:, b], states[:, third] = across, up, slope * across
    return states


def _time_near(relative: Floats, times: Floats) -> float:
    far = np.flatnonzero(np.linalg.norm(relative[:, :3], axis=1) > REACHED)
    return float(times[min(far[-1] + 1, len(times) - 1)] - times[0]) if len(far) else 0.0


def _rigid(pose: Floats) -> Floats:
    """The pose with its rotation made orthonormal to the last digit."""
    left, _, right = np.linalg.svd(pose[:3, :3])
    exact: Floats = pose.copy()
    exact[:3, :3] = left @ right
    return exact
