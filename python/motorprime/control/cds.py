"""Eye, arm and hand that move together: three dynamical systems and two couplings (Section III-C1).

    eye   e' = alpha_e f_e(beta_e e)
    arm   a' = alpha_a f_a(beta_a g a),    g = 1 - min(1, rho / max(|p|, 1 mm)),  rho = max(0, E(|p| | |e|))
    hand  h' = alpha_h f_h(beta_h (h - d)),    d = amplitude min(1, max(0, E(h | |p|)))

e is the fixation point, a = (p, r) the palm's place and rotation vector, h the opening, all relative to the
goal and in the goal palm's axes. While the eye is far the arm waits (g = 0), and while the arm is far the
hand stays as open as it was in the demonstrations. Every system moves by Euler steps that its certificate
covers: what stands before each is a convex mixture of certified matrices times at most 1, so each comes to
rest at its goal wherever it starts, and whenever the goal moves. After Lukic, Santos-Victor and Billard
(Biological Cybernetics, 2014).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, finite, fixed, not_negative, numbers, positive, rows
from .._core import CoupledSystem
from ..errors import ArgumentError, ArgumentTypeError
from ..model_files import read_model, write_model
from .coupling import Coupling
from .lpvds import LpvDs
from .movement import LEAST_OPEN, MOST_OPEN, Ends, Goal, RollOut, State, Tolerance

__all__ = ["CoupledDynamics", "Ends", "Goal", "RollOut", "State", "Tolerance"]

KIND = "coupled dynamics"
CLOSE = 0.001
"""Distance [m] below which the palm's place counts as reached. The arm's wait is measured against no less: a
palm that only has to turn would else wait for the eye for ever."""
MAX_STEPS = 1_000_000

_NEAR, _NEVER = Tolerance(), np.zeros(4)
_SYSTEMS = {"eye": 3, "arm": 6, "hand": 1}
_COUPLINGS = ("eye_arm", "arm_hand")


class CoupledDynamics:
    """A learned eye-arm-hand controller. It keeps no state: another goal may be given at any instant.

    Args:
        eye: of the fixation point, in 3 dimensions.
        arm: of the palm's place and rotation vector, in 6; place and rotation may not mix.
        hand: of the opening, in 1.
        eye_arm: the palm's expected distance from its goal [m], given that of the fixation point [m].
        arm_hand: the hand's expected opening, given the palm's distance [m].
        alpha: (3,) speeds of eye, arm and hand, > 0; 1 is that of the demonstrations.
        beta: (3,) how soon each reacts, > 0; it scales the state that a system sees.
        about: what else to keep in the model's file, for example where the demonstrations come from.

    Raises:
        ArgumentError: systems of other dimensions, alpha or beta not > 0.

    Attributes:
        largest_step: the largest ``dt`` [s] that all certificates cover, min of step / (alpha beta).
        kernel: the compiled systems, for states that are relative to the goal. It knows no certificates.

    For example, at every cycle of a control loop and of vision::

        state = model.step(state, goal, dt=0.01)
        plan = model.roll_out(state, goal)
        landscape_of(plan.path)
    """

    def __init__(
        self,
        eye: LpvDs,
        arm: LpvDs,
        hand: LpvDs,
        eye_arm: Coupling,
        arm_hand: Coupling,
        *,
        alpha: npt.ArrayLike = (1.0, 1.0, 1.0),
        beta: npt.ArrayLike = (1.0, 1.0, 1.0),
        about: Mapping[str, Any] | None = None,
    ) -> None:
        for (name, size), system in zip(_SYSTEMS.items(), (eye, arm, hand), strict=True):
            if not isinstance(system, LpvDs):
                raise ArgumentTypeError(f"{name}: expected an LpvDs, got {type(system).__name__}")
            if system.dimensions != size:
                raise ArgumentError(
                    f"{name}: expected a system in {size} dimensions, got {system.dimensions}"
                )
        for name, coupling in zip(_COUPLINGS, (eye_arm, arm_hand), strict=True):
            if not isinstance(coupling, Coupling):
                raise ArgumentTypeError(f"{name}: expected a Coupling, got {type(coupling).__name__}")
        if arm.matrices[:, :3, 3:].any() or arm.matrices[:, 3:, :3].any():
            # A rotation vector past a half turn is replaced by the short way round. That lowers the energy of
            # the rotation, and would not if place and rotation shared one.
            raise ArgumentError("arm: expected matrices without terms between place and rotation")
        self.eye, self.arm, self.hand = eye, arm, hand
        self.eye_arm, self.arm_hand = eye_arm, arm_hand
        self.alpha, self.beta = _rates("alpha", alpha), _rates("beta", beta)
        self.about = dict(about or {})
        steps = np.array([system.step for system in self.systems.values()])
        self.largest_step = float(np.min(steps / (self.alpha * self.beta)))
        self.kernel = self._compiled()

    @property
    def systems(self) -> dict[str, LpvDs]:
        """The three systems by name."""
        return {"eye": self.eye, "arm": self.arm, "hand": self.hand}

    def with_speed(self, factor: npt.ArrayLike) -> CoupledDynamics:
        """The same model, ``factor`` times as fast: one number, or one each for eye, arm and hand.

        Of a faster model :attr:`largest_step` is smaller.

        Raises:
            ArgumentError: a factor that is not > 0.
        """
        factors = _rates("factor", np.broadcast_to(factor, (3,)) if np.ndim(factor) == 0 else factor)
        return CoupledDynamics(
            self.eye,
            self.arm,
            self.hand,
            self.eye_arm,
            self.arm_hand,
            alpha=self.alpha * factors,
            beta=self.beta,
            about=self.about,
        )

    def step(self, state: State, goal: Goal, dt: float = 0.01) -> State:
        """Where eye, arm and hand shall be ``dt`` [s] later.

        Raises:
            ArgumentError: ``dt`` is larger than :attr:`largest_step`, or not > 0.
        """
        dt = self._checked(dt)
        states, _ = self.kernel.roll_out(_given(state, goal), goal.amplitude, dt, 1, _NEVER)
        fixations, palms, openings = goal.absolute(states[1:])
        # Without this a system that overshoots could leave the range in which a state is accepted again.
        opening = min(max(float(openings[0]), LEAST_OPEN), MOST_OPEN)
        return State(fixations[0], palms[0], opening)

    def roll_out(
        self,
        state: State,
        goal: Goal,
        *,
        dt: float = 0.01,
        seconds: float = 10.0,
        tolerance: Tolerance | None = None,
    ) -> RollOut:
        """Imagine the movement from a state to the goal.

        Args:
            state: where eye, arm and hand are.
            goal: where they shall come to rest.
            dt: Euler step [s], at most :attr:`largest_step`.
            seconds: when to give up.
            tolerance: what counts as there; :class:`Tolerance`'s own values when not given.

        Returns:
            The movement up to the first instant at which everything is within its tolerance, or to the end of
            the time. The start is its first row.

        Raises:
            ArgumentError: ``dt`` is larger than the certificates cover or not > 0; more than a million steps.
        """
        dt = self._checked(dt)
        steps = _steps(seconds, dt)
        limits = (tolerance or _NEAR).array()
        states, arrived = self.kernel.roll_out(_given(state, goal), goal.amplitude, dt, steps, limits)
        fixations, palms, openings = goal.absolute(states)
        times = np.arange(len(states), dtype=np.float64) * dt
        return RollOut(times, fixations, palms, openings, arrived)

    def ends(
        self,
        relative: npt.ArrayLike,
        *,
        amplitude: float = 1.0,
        dt: float = 0.01,
        seconds: npt.ArrayLike = 10.0,
        tolerance: Tolerance | None = None,
        early: tuple[float, float] = (0.1, 0.02),
    ) -> Ends:
        """How movements from many states end, computed on all processors.

        Args:
            relative: (N, 10) starts as :meth:`Goal.relative` gives them.
            amplitude: of the hand's opening, as in :class:`Goal`.
            dt: Euler step [s], at most :attr:`largest_step`.
            seconds: when to give up: one number, or one for each start (N,); may be 0.
            tolerance: what counts as there; :class:`Tolerance`'s own values when not given.
            early: opening and distance [m]; a hand that is open less while the palm is farther closed early.

        Returns:
            Where each ended, when it arrived, and whether its hand closed early.

        Raises:
            ArgumentError: as for :meth:`roll_out`, and for states of another shape.
        """
        dt = self._checked(dt)
        states = rows("relative", relative, 10)
        each = finite("seconds", numbers("seconds", seconds))
        if each.shape not in ((), (len(states),)):
            raise ArgumentError(f"seconds: expected one number or shape ({len(states)},), got {each.shape}")
        if (each < 0.0).any() or (each > MAX_STEPS * dt).any():
            raise ArgumentError(f"seconds: expected 0 to {MAX_STEPS} steps of dt = {dt} s")
        steps = np.broadcast_to(np.ceil(each / dt - 1e-9), (len(states),)).astype(np.int64)
        limits = (tolerance or _NEAR).array()
        amplitude = not_negative("amplitude", amplitude)
        last, arrived, closed = self.kernel.ends(states, amplitude, dt, steps.tolist(), limits, early)
        return Ends(last, np.where(arrived < 0, np.nan, arrived * dt), closed)

    def save(self, path: str | Path) -> None:
        """Write the model to a safetensors file.

        Raises:
            ArgumentError: the file cannot be written.
        """
        arrays = {"alpha": self.alpha, "beta": self.beta}
        for name in (*_SYSTEMS, *_COUPLINGS):
            arrays |= getattr(self, name).arrays(f"{name}.")
        write_model(path, KIND, arrays, {"about": self.about})

    @classmethod
    def load(cls, path: str | Path) -> CoupledDynamics:
        """Read a model that :meth:`save` wrote; its certificates are checked again.

        Raises:
            ArgumentError: the file is missing or holds something else.
            StateError: a certificate does not hold.
        """
        arrays, about = read_model(path, KIND)
        missing = [name for name in ("alpha", "beta") if name not in arrays]
        if missing:
            raise ArgumentError(f"path: {path} has no '{missing[0]}'")
        eye, arm, hand = (LpvDs.from_arrays(arrays, f"{name}.") for name in _SYSTEMS)
        eye_arm, arm_hand = (Coupling.from_arrays(arrays, f"{name}.") for name in _COUPLINGS)
        alpha, beta = arrays["alpha"], arrays["beta"]
        return cls(eye, arm, hand, eye_arm, arm_hand, alpha=alpha, beta=beta, about=about.get("about"))

    def _compiled(self) -> CoupledSystem:
        eye, arm, hand = (
            (system.weights, system.means, system.covariances, system.matrices)
            for system in self.systems.values()
        )
        eye_arm, arm_hand = (
            (coupling.weights, coupling.means, coupling.covariances, coupling.near)
            for coupling in (self.eye_arm, self.arm_hand)
        )
        return CoupledSystem(eye, arm, hand, eye_arm, arm_hand, self.alpha, self.beta, CLOSE)

    def __getstate__(self) -> dict[str, Any]:
        """For copies and pickles: the kernel is compiled again."""
        return {name: value for name, value in vars(self).items() if name != "kernel"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.kernel = self._compiled()

    def _checked(self, dt: float) -> float:
        dt = positive("dt", dt)
        # A hair more than the limit is what division by alpha and beta may have rounded off.
        if dt > self.largest_step * (1.0 + 1e-9):
            raise ArgumentError(
                f"dt: expected at most {self.largest_step:.6g} s, the certified step, got {dt}"
            )
        return dt


def _rates(name: str, value: npt.ArrayLike) -> Floats:
    rates: Floats = fixed(name, value, (3,)).copy()
    if (rates <= 0.0).any():
        raise ArgumentError(f"{name}: expected three numbers > 0, got {rates.tolist()}")
    rates.flags.writeable = False
    return rates


def _given(state: State, goal: Goal) -> Floats:
    for name, value, kind in (("state", state, State), ("goal", goal, Goal)):
        if not isinstance(value, kind):
            raise ArgumentTypeError(f"{name}: expected a {kind.__name__}, got {type(value).__name__}")
    return goal.relative(state)


def _steps(seconds: float, dt: float) -> int:
    steps = math.ceil(positive("seconds", seconds) / dt - 1e-9)
    if steps > MAX_STEPS:
        raise ArgumentError(f"seconds: expected at most {MAX_STEPS} steps of dt = {dt} s, got {seconds} s")
    return steps
