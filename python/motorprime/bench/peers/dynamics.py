"""Coupled dynamics in NumPy, as quick as plain NumPy gets: the peer of the kernel.

A step is a few dozen operations on a few numbers, and each costs NumPy about a microsecond whatever its
size. So everything that does not depend on the state is computed beforehand, every mixture is one matrix
product, and the mean of the matrices another.
"""

from __future__ import annotations

import math

import numpy as np

from ..._arrays import Floats
from ...control.cds import CLOSE, CoupledDynamics
from ...control.coupling import Coupling
from ...control.lpvds import LpvDs
from ...control.movement import Goal, RollOut, State, Tolerance


class NumpyCoupledDynamics:
    """Rolls a model out in NumPy, with the arguments and the result of :meth:`CoupledDynamics.roll_out`."""

    def __init__(self, model: CoupledDynamics) -> None:
        self.eye, self.arm, self.hand = (_System(system) for system in model.systems.values())
        self.eye_arm, self.arm_hand = _Line(model.eye_arm), _Line(model.arm_hand)
        self.alpha, self.beta = model.alpha.tolist(), model.beta.tolist()

    def roll_out(
        self, state: State, goal: Goal, *, dt: float, seconds: float, tolerance: Tolerance
    ) -> RollOut:
        """As :meth:`CoupledDynamics.roll_out`."""
        steps = math.ceil(seconds / dt - 1e-9)
        states, arrived = self.states(goal.relative(state), goal.amplitude, dt, steps, tolerance)
        fixations, palms, openings = goal.absolute(states)
        times = np.arange(len(states), dtype=np.float64) * dt
        return RollOut(times, fixations, palms, openings, arrived)

    def states(
        self, start: Floats, amplitude: float, dt: float, steps: int, tolerance: Tolerance
    ) -> tuple[Floats, bool]:
        """States (N, 10) relative to the goal, and whether they arrived."""
        states = np.empty((steps + 1, 10))
        states[0] = start
        eye, arm, hand = start[:3], start[3:9], start[9:]
        for n in range(steps + 1):
            to_look, to_go = math.sqrt(eye @ eye), math.sqrt(arm[:3] @ arm[:3])
            arrived = bool(
                to_go < tolerance.place
                and abs(float(hand[0])) < tolerance.opening
                and math.sqrt(arm[3:] @ arm[3:]) < tolerance.turn
                and to_look < tolerance.fixation
            )
            if arrived or n == steps:
                return states[: n + 1], arrived
            rho = max(0.0, self.eye_arm.expected(to_look))
            gate = 1.0 - min(1.0, rho / max(to_go, CLOSE))
            off = hand - amplitude * min(1.0, max(0.0, self.arm_hand.expected(to_go)))
            eye = eye + (dt * self.alpha[0]) * self.eye.velocity(self.beta[0] * eye)
            arm = arm + (dt * self.alpha[1]) * self.arm.velocity((self.beta[1] * gate) * arm)
            hand = hand + (dt * self.alpha[2]) * self.hand.velocity(self.beta[2] * off)
            angle = math.sqrt(arm[3:] @ arm[3:])
            if angle > math.pi:
                arm[3:] *= 1.0 - 2.0 * math.pi / angle
            row = states[n + 1]
            row[:3], row[3:9], row[9:] = eye, arm, hand
        raise AssertionError("the loop returns")


class _Mixture:
    """Weights of Gaussians: ``exp(offsets - |W x - W mu|^2 / 2)``, normalised."""

    def __init__(self, weights: Floats, means: Floats, covariances: Floats) -> None:
        count, self.m = means.shape
        factors = np.linalg.cholesky(covariances)
        whitening = np.linalg.inv(factors)
        self.offsets = np.log(weights) - np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1)
        self.whitening = np.ascontiguousarray(whitening.reshape(count * self.m, self.m))
        self.shifts = (whitening @ means[:, :, None]).reshape(-1)
        # Sums the squares of each component's coordinates.
        self.halves = np.repeat(0.5 * np.eye(count), self.m, axis=1)

    def shares(self, x: Floats) -> Floats:
        white = self.whitening @ x - self.shifts
        white *= white
        logs: Floats = self.offsets - self.halves @ white
        logs -= logs.max()
        np.exp(logs, out=logs)
        shares: Floats = logs / logs.sum()
        return shares


class _System:
    def __init__(self, system: LpvDs) -> None:
        self.mixture = _Mixture(system.weights, system.means, system.covariances)
        self.d = system.dimensions
        self.matrices = np.ascontiguousarray(system.matrices.reshape(len(system.weights), -1))

    def velocity(self, x: Floats) -> Floats:
        mean = self.mixture.shares(x[: self.mixture.m]) @ self.matrices
        velocity: Floats = mean.reshape(self.d, self.d) @ x
        return velocity


class _Line:
    def __init__(self, coupling: Coupling) -> None:
        self.mixture = _Mixture(coupling.weights, coupling.means[:, :1], coupling.covariances[:, :1, :1])
        self.slopes = coupling.covariances[:, 1, 0] / coupling.covariances[:, 0, 0]
        self.starts = coupling.means[:, 1] - self.slopes * coupling.means[:, 0]
        self.near = coupling.near

    def expected(self, psi: float) -> float:
        shares = self.mixture.shares(np.array([psi]))
        return float(shares @ self.starts + psi * (shares @ self.slopes)) * min(1.0, psi / self.near)
