"""Fit a certified dynamical system to demonstrations, by convex optimisation.

Three steps, after Figueroa and Billard (CoRL 2018), with their non-convex search replaced by two convex ones:

1. a Gaussian mixture over the places, with as many components as the data are worth;
2. P = P^T > 0 in whose metric the demonstrations come nearer all the time, as far as one P can have it:
   the least sum of max(0, x^T P v + margin) over unit vectors x, v of states and velocities;
3. the A_k with the least error of velocity for which ||I + step B_k||_2 <= 1 - decay step, where
   B_k = P^1/2 A_k P^-1/2. That implies (B_k + B_k^T) / 2 <= -decay I, the condition in continuous time.

Step 3 also wants motion to come back from off the shown paths: each sample stands for a ball of states round
it, from which the velocity gains -RETURN times the distance. As the mixture's weights sum to 1 that costs at
most ``tube``^2 sum_k N_k ||A_k + RETURN I||^2 in the squared error.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from .._arrays import Floats, finite, integer, not_negative, positive
from ..control.demonstrations import Demonstration, stacked
from ..control.lpvds import LpvDs, certify
from ..control.mixture import Mixture
from ..errors import ArgumentError, MissingExtraError, StateError
from .mixtures import COMPONENTS, fit_mixture

RETURN = 1.0
"""How fast [1/s] a motion comes back to the shown paths, where the data do not say."""
PROGRESS = 0.05
"""How much a demonstration should come nearer, as the cosine of its angle to -P x."""
ROUNDNESS = 0.02
"""Least eigenvalue of P, whose eigenvalues have the mean 1."""
METHODS = ("pqlf", "identity")


def fit_lpvds(
    demonstrations: Sequence[Demonstration],
    *,
    blocks: Sequence[int] | None = None,
    mixed: int | None = None,
    components: Iterable[int] = COMPONENTS,
    step: float = 0.01,
    decay: float = 0.01,
    method: str = "pqlf",
    regularisation: float = 0.02,
    tube: float = 0.03,
    n_init: int = 10,
    mixture: Mixture | None = None,
    seed: int | np.random.Generator | None = None,
) -> LpvDs:
    """The certified system that moves as the demonstrations do, as nearly as it can.

    Args:
        demonstrations: states relative to the goal, which is zero.
        blocks: sizes of the parts of a state that move by themselves, e.g. (3, 3) for a place and a rotation
            vector; their sum is d. Default one block of all.
        mixed: m, how many of the first coordinates the mixture is over; default the first block.
        components: numbers of components to try.
        step: the largest Euler step [s] that is to be certified.
        decay: least certified rate [1/s] at which a motion comes nearer, everywhere. Much of it makes motions
            that wander slowly or turn away impossible, none of it lets them take for ever.
        method: 'pqlf' fits P; 'identity' takes P = I, by which motions come nearer in the plain norm.
        regularisation: of the mixture, see :func:`fit_mixture`.
        tube: radius of the ball that each sample stands for, as a share of the states' spread.
        n_init: starts of the mixture.
        mixture: one that is there already, over the first ``mixed`` coordinates; then nothing is drawn.
        seed: draws them.

    Raises:
        ArgumentError: an argument is wrong; ``decay`` times ``step`` leaves no room.
        StateError: the solver found nothing, or nothing that is certified.
        MissingExtraError: scikit-learn or cvxpy is not installed.
    """
    states, velocities = stacked(demonstrations)
    parts = _slices(blocks, states.shape[1])
    m = integer("mixed", parts[0].stop if mixed is None else mixed, at_least=1)
    if m > states.shape[1]:
        raise ArgumentError(f"mixed: expected at most the states' {states.shape[1]} coordinates, got {m}")
    step, decay, tube = positive("step", step), positive("decay", decay), not_negative("tube", tube)
    if decay * step >= 1.0:
        raise ArgumentError(f"decay: expected decay * step < 1, got {decay:g} 1/s * {step:g} s")
    if method not in METHODS:
        raise ArgumentError(f"method: expected one of {METHODS}, got {method!r}")
    if mixture is None:
        mixture = fit_mixture(
            states[:, :m], components=components, regularisation=regularisation, n_init=n_init, seed=seed
        )
    elif mixture.dimensions != m:
        raise ArgumentError(f"mixture: expected one over {m} coordinates, got {mixture.dimensions}")
    shares = mixture.posterior(states[:, :m])
    lyapunov = np.zeros((states.shape[1], states.shape[1]))
    matrices = np.zeros((len(mixture), *lyapunov.shape))
    for part in parts:
        x, v = states[:, part], velocities[:, part]
        metric = fit_metric(x, v) if method == "pqlf" else np.eye(x.shape[1])
        lyapunov[part, part] = metric
        matrices[:, part, part] = fit_matrices(x, v, shares, metric, step=step, decay=decay, tube=tube)
    found = certify(matrices, lyapunov, step)
    if not found.holds:
        raise StateError(
            f"not certified: rate {found.continuous:.3g} 1/s, factor {found.discrete:.9g} at {step:g} s; "
            "a larger decay or regularisation, or a smaller step, gives the solver room"
        )
    return LpvDs(mixture.weights, mixture.means, mixture.covariances, matrices, lyapunov, step)


def fit_metric(states: Floats, velocities: Floats) -> Floats:
    """P (d, d) by which the demonstrations come nearer to zero; its trace is d.

    Args:
        states: (N, d).
        velocities: (N, d).

    Raises:
        StateError: nothing moves, or the solver found nothing.
        MissingExtraError: cvxpy or Clarabel is not installed.
    """
    cp = _cvxpy()
    states, velocities = finite("states", states), finite("velocities", velocities)
    d = states.shape[1]
    far, fast = np.linalg.norm(states, axis=1), np.linalg.norm(velocities, axis=1)
    moving = (far > 1e-9 * far.max()) & (fast > 1e-9 * fast.max())
    if not moving.any():
        raise StateError("fit: nothing moves in the demonstrations, or they never leave the goal")
    x, v = states[moving] / far[moving, None], velocities[moving] / fast[moving, None]
    metric = cp.Variable((d, d), symmetric=True)
    nearing = (x[:, :, None] * v[:, None, :]).reshape(len(x), d * d) @ cp.vec(metric, order="C")
    constraints = [metric >> ROUNDNESS * np.eye(d), cp.trace(metric) == d]
    _solve(cp.Problem(cp.Minimize(cp.sum(cp.pos(nearing + PROGRESS)) / len(x)), constraints), "P")
    found = np.asarray(metric.value, dtype=np.float64)
    metric_found: Floats = (found + found.T) / 2
    return metric_found


def fit_matrices(
    states: Floats,
    velocities: Floats,
    shares: Floats,
    metric: Floats,
    *,
    step: float,
    decay: float,
    tube: float,
) -> Floats:
    """A_k (K, d, d) [1/s] with the least squared error of velocity under the condition of step 3.

    Args:
        states: (N, d).
        velocities: (N, d).
        shares: g_k of each state (N, K).
        metric: P (d, d).
        step: [s].
        decay: [1/s].
        tube: share of the states' spread.

    Raises:
        StateError: the solver found nothing.
        MissingExtraError: cvxpy or Clarabel is not installed.
    """
    cp = _cvxpy()
    states, velocities = finite("states", states), finite("velocities", velocities)
    count, d = shares.shape[1], states.shape[1]
    mixed = (shares[:, :, None] * states[:, None, :]).reshape(len(states), count * d)
    ball = np.repeat(tube * np.sqrt(shares.sum(axis=0) * states.var(axis=0).mean()), d)
    back = np.tile(-RETURN * np.eye(d), (count, 1))
    # The error only depends on the triangular factor: K d rows instead of one for each sample.
    q, r = np.linalg.qr(np.vstack([mixed, np.diag(ball)]))
    wanted = q.T @ np.vstack([velocities, ball[:, None] * back])
    scale = np.abs(r).max()  # the solver's tolerances are for numbers about 1
    eigenvalues, vectors = np.linalg.eigh(metric)
    root = (vectors * np.sqrt(eigenvalues)) @ vectors.T
    inverse = (vectors / np.sqrt(eigenvalues)) @ vectors.T
    turned = [cp.Variable((d, d)) for _ in range(count)]
    matrices = cp.vstack([(inverse @ b @ root).T for b in turned])
    constraints = [cp.sigma_max(np.eye(d) + step * b) <= 1.0 - decay * step for b in turned]
    error = cp.sum_squares((r / scale) @ matrices - wanted / scale)
    _solve(cp.Problem(cp.Minimize(error), constraints), "A")
    return np.stack([inverse @ np.asarray(b.value, dtype=np.float64) @ root for b in turned])


def _slices(blocks: Sequence[int] | None, d: int) -> list[slice]:
    sizes = [integer("blocks", size, at_least=1) for size in ((d,) if blocks is None else blocks)]
    if sum(sizes) != d:
        raise ArgumentError(f"blocks: expected sizes that sum to {d}, the length of a state, got {sizes}")
    ends = np.cumsum(sizes).tolist()
    return [slice(end - size, end) for size, end in zip(sizes, ends, strict=True)]


def _cvxpy() -> Any:
    try:
        import clarabel  # noqa: F401
        import cvxpy
    except ImportError:
        raise MissingExtraError("fitting stable systems (cvxpy and Clarabel)", "learn") from None
    return cvxpy


def _solve(problem: Any, what: str) -> None:
    cp = _cvxpy()
    try:
        with warnings.catch_warnings():
            # An inaccurate optimum is welcome: what counts is the certificate, which is checked afterwards.
            warnings.simplefilter("ignore", UserWarning)
            problem.solve(solver=cp.CLARABEL)
    except cp.SolverError as error:
        raise StateError(f"fit: the solver gave up on {what}: {error}") from None
    if problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
        raise StateError(
            f"fit: no {what} found, the solver says '{problem.status}'; fewer components or more "
            "regularisation make the problem easier"
        )
