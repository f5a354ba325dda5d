"""Kinematic calibration: the corrections of a robot's model that explain where its cameras saw a point."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, integer, positive
from ..errors import ArgumentError, ArgumentTypeError
from ..robot import Robot
from ..samples import Samples
from .calibration import Calibration
from .observations import Observations
from .parameters import Parameters, Priors

MIN_SAMPLES = 10
"""Samples that some camera saw, for a robot of which only the model is known."""
SOFT = 2.5
"""Residuals count less from about this many standard deviations on (Cauchy's loss)."""
OUTLIER = 5.0
"""Residuals beyond this many standard deviations are reported as outliers."""

_STILL = 1e-4  # [rad], a joint that moves less did not move
_LOST = 1e3  # [px], the residual of a sample that the model puts behind its camera
_BEYOND = 1.0  # [rad], so far beyond its limits no joint gets, whatever its offset
_REMOTE = 50.0  # [m], farther from the root no hand reaches
_ENOUGH = 1e-4  # promised decrease of the cost, in units of half a squared standard deviation
_MEDIAN = 1.1774  # the median length of two standard normal numbers


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """What came out of :func:`calibrate`.

    Attributes:
        calibration: the corrections, with their covariance, so that a later calibration can go on from them.
        used: {camera: samples that it saw}.
        median, rms: {camera: length of the residuals [px]}, the rms without outliers; NaN without samples.
        outliers: {camera: (N,) bool}, samples whose label is not believed.
        spread: standard deviation [px] of the labels in u and in v, as estimated; few samples that follow
            many parameters make it too low.
        iterations: steps that were tried.
        converged: whether no further step promised anything.
        constant: joints that never moved; the prior alone tells their offset from other errors.
    """

    calibration: Calibration
    used: Mapping[str, int]
    median: Mapping[str, float]
    rms: Mapping[str, float]
    outliers: Mapping[str, npt.NDArray[np.bool_]] = field(repr=False)
    spread: float
    iterations: int
    converged: bool
    constant: tuple[str, ...]


def calibrate(
    robot: Robot,
    samples: Samples,
    *,
    priors: Priors | None = None,
    start: Calibration | None = None,
    noise: float = 0.3,
    iterations: int = 60,
) -> CalibrationResult:
    """Find the corrections t of a robot's model that minimise ::

        sum_i  c^2 / 2 log(1 + (|r_i(t)| / (c s))^2)  +  1/2 (t - m)^T P^-1 (t - m)

    r_i [px] are the residuals of all labels, c = 2.5, s the standard deviation of the labels, which is
    estimated by the median of |r_i| and at least ``noise``; m and P are the prior. Levenberg-Marquardt steps,
    the loss as weights.

    Args:
        robot: as its model says, with its URDF.
        samples: of some of the robot's cameras. With ``points``, they are taken as exact. Without, the
            samples show one point of the hand, their joints include the arm's, and the arm's offsets and
            links and the point itself are estimated too; the torso moves eyes and hand alike and shows
            nothing then.
        priors: standard deviations around the nominal model (m = 0); what is held fixed stays as ``start``
            has it. None: ``Priors()``, or, where ``start`` has a covariance, m and P are those of ``start``:
            samples that gave it need not be given again.
        start: corrections to begin with.
        noise: smallest standard deviation [px] that labels are believed to have.
        iterations: steps to try at most.

    Raises:
        ArgumentError: too few samples, none in view, joints, cameras or corrections that the robot does not
            have, a camera whose sensor is tilted.
    """
    if not isinstance(samples, Samples):
        raise ArgumentTypeError(f"samples: expected Samples, got {type(samples).__name__}")
    noise, iterations = positive("noise", noise), integer("iterations", iterations, at_least=1)
    parameters = Parameters(robot)
    start = Calibration(robot.name) if start is None else start
    start.check(robot)
    goes_on = priors is None and start.covariance is not None
    _check_samples(robot, samples, 1 if goes_on else MIN_SAMPLES)
    begin = parameters.pack(start)
    if goes_on:
        prior = _Prior(begin, _factor(start, parameters.size))
    else:
        sigmas = parameters.sigmas(priors or Priors())
        prior = _Prior(np.where(sigmas == 0.0, begin, 0.0), np.diag(sigmas))
    problem = _Problem(parameters, Observations(parameters, samples), start, prior)
    fit = _minimise(problem, prior.whitened(begin), noise, iterations)
    return _report(problem, samples, fit)


@dataclass(frozen=True, eq=False)
class _Prior:
    """t = mean + factor x, with x standard normal; a row of zeros holds its parameter fixed."""

    mean: Floats
    factor: Floats

    def whitened(self, vector: Floats) -> Floats:
        """The x of a vector; what the prior holds fixed is its mean's."""
        return np.asarray(np.linalg.lstsq(self.factor, vector - self.mean, rcond=None)[0])


@dataclass(frozen=True, eq=False)
class _State:
    x: Floats
    calibration: Calibration
    residuals: Floats  # (R, 2) of all cameras, one after the other
    slopes: Floats  # (R, 2, P) by x

    @property
    def lengths(self) -> Floats:
        return np.asarray(np.linalg.norm(self.residuals, axis=1))

    def cost(self, spread: float) -> float:
        loss = SOFT**2 / 2.0 * np.log1p((self.lengths / (SOFT * spread)) ** 2).sum()
        return float(loss + self.x @ self.x / 2.0)

    def system(self, spread: float) -> tuple[Floats, Floats]:
        """Gradient (P,) and Gauss-Newton Hessian (P, P) of the cost."""
        weights = 1.0 / (1.0 + (self.lengths / (SOFT * spread)) ** 2) / spread**2
        rows = self.slopes.reshape(-1, len(self.x))
        weighted = (self.slopes * weights[:, None, None]).reshape(rows.shape)
        gradient = weighted.T @ self.residuals.reshape(-1) + self.x
        return gradient, weighted.T @ rows + np.eye(len(self.x))


class _Problem:
    def __init__(
        self, parameters: Parameters, observations: Observations, start: Calibration, prior: _Prior
    ) -> None:
        self.parameters, self.observations = parameters, observations
        self.start, self.prior = start, prior

    def at(self, x: Floats) -> _State:
        calibration = self.parameters.unpack(self.prior.mean + self.prior.factor @ x, self.start)
        residuals, slopes = [], []
        for name, predicted in self.observations.predict(calibration).items():
            error = predicted.pixels - self.observations.labels[name]
            residuals.append(np.where(np.isnan(error), _LOST, error))
            slopes.append(predicted.slopes @ self.prior.factor)
        return _State(x, calibration, np.concatenate(residuals), np.concatenate(slopes))


@dataclass(frozen=True, eq=False)
class _Fit:
    state: _State
    spread: float
    iterations: int
    converged: bool


def _minimise(problem: _Problem, x: Floats, noise: float, iterations: int) -> _Fit:
    """Levenberg-Marquardt; the spread falls with the residuals, so that the loss is soft at first."""
    state = problem.at(x)
    spread = max(noise, _spread(state))
    damping, converged, tried = 1e-3, False, 0
    gradient, hessian = state.system(spread)
    while tried < iterations and not converged:
        tried += 1
        step = -np.linalg.solve(hessian + damping * np.diag(np.diag(hessian)), gradient)
        new = problem.at(state.x + step)
        promised = float(gradient @ np.linalg.solve(hessian, gradient)) / 2.0
        if new.cost(spread) <= state.cost(spread):
            state, damping = new, max(damping / 10.0, 1e-9)
            tighter = min(spread, max(noise, _spread(state)))
            converged = promised < _ENOUGH and tighter > 0.99 * spread
            spread = tighter
            gradient, hessian = state.system(spread)
        else:
            converged = promised < _ENOUGH  # at the minimum rounding decides whether a step is better
            damping *= 10.0
    return _Fit(state, spread, tried, converged)


def _spread(state: _State) -> float:
    return float(np.median(state.lengths)) / _MEDIAN


def _report(problem: _Problem, samples: Samples, fit: _Fit) -> CalibrationResult:
    factor = problem.prior.factor
    covariance = factor @ np.linalg.inv(fit.state.system(fit.spread)[1]) @ factor.T
    lengths, begin = fit.state.lengths, 0
    used: dict[str, int] = {}
    median: dict[str, float] = {}
    rms: dict[str, float] = {}
    outliers: dict[str, npt.NDArray[np.bool_]] = {}
    for name, rows in problem.observations.rows.items():
        mine = lengths[begin : begin + len(rows)]
        begin += len(rows)
        bad = mine > OUTLIER * fit.spread
        outliers[name] = np.zeros(len(samples), dtype=bool)
        outliers[name][rows[bad]] = True
        used[name] = len(rows)
        median[name] = float(np.median(mine)) if mine.size else np.nan
        rms[name] = float(np.sqrt((mine[~bad] ** 2).mean())) if (~bad).any() else np.nan
    still = np.ptp(problem.observations.joints, axis=0) < _STILL
    names = problem.parameters.offsets
    return CalibrationResult(
        calibration=replace(fit.state.calibration, covariance=(covariance + covariance.T) / 2.0),
        used=used,
        median=median,
        rms=rms,
        outliers=outliers,
        spread=fit.spread,
        iterations=fit.iterations,
        converged=fit.converged,
        constant=tuple(name for name, flag in zip(names, still.tolist(), strict=False) if flag),
    )


def _factor(start: Calibration, size: int) -> Floats:
    """A square root of the covariance; eigenvalues that rounding made negative are zero."""
    covariance = np.asarray(start.covariance)
    if covariance.shape != (size, size):
        raise ArgumentError(
            f"start: expected a covariance of {size} parameters, got shape {covariance.shape}; "
            "the robot has changed since"
        )
    scale = np.sqrt(np.diag(covariance))
    safe = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(safe, safe))
    root: Floats = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return root


def _check_samples(robot: Robot, samples: Samples, needed: int) -> None:
    unknown = [name for name in samples.cameras if name not in robot.cameras]
    if unknown:
        raise ArgumentError(f"samples: no camera '{unknown[0]}'; there are {', '.join(robot.cameras)}")
    seen = int(np.any([samples.seen(name) for name in samples.cameras], axis=0).sum())
    if len(samples) and not seen:
        raise ArgumentError(f"samples: no camera saw the point in any of {len(samples)} samples")
    if seen < needed:
        raise ArgumentError(f"samples: at least {needed} in view are needed, got {seen}")
    _check_units(robot, samples)
    for name, mount in robot.cameras.items():
        if any(mount.camera.distortion[12:]):
            raise ArgumentError(f"robot: camera '{name}' has a tilted sensor, which cannot be calibrated")


def _check_units(robot: Robot, samples: Samples) -> None:
    """Raise an :class:`ArgumentError` for degrees or millimetres."""
    known = tuple(name for name in samples.names if name in (*robot.gaze, *robot.arm))
    angles, limits = samples.columns(known), robot.limits(known)
    wild = (angles < limits[:, 0] - _BEYOND) | (angles > limits[:, 1] + _BEYOND)
    if wild.any():
        row, column = (int(k) for k in np.argwhere(wild)[0])
        raise ArgumentError(
            f"samples: {known[column]} = {angles[row, column]:g} in row {row} is far beyond its limits; "
            "radians expected"
        )
    if samples.points is not None and np.abs(samples.points).max(initial=0.0) > _REMOTE:
        row = int(np.argmax(np.abs(samples.points).max(axis=1)))
        raise ArgumentError(
            f"samples: the point of row {row} is at {samples.points[row].tolist()}; metres expected"
        )
