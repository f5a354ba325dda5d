"""Fitting certified dynamical systems, couplings and mixtures to demonstrations."""

import cvxpy
import numpy as np
import pytest

from motorprime.control.demonstrations import Demonstration
from motorprime.errors import ArgumentError, StateError
from motorprime.learning.couplings import fit_coupling
from motorprime.learning.mixtures import fit_mixture
from motorprime.learning.stable import fit_lpvds, fit_matrices, fit_metric

pytestmark = pytest.mark.learn

SPIRAL = np.array([[-1.0, -2.0], [2.0, -1.0]])
SHEARED = np.array([[-1.0, 4.0], [0.0, -1.0]])


def motions(matrix, count=5, seconds=4.0, seed=3):
    """Exact motions of x' = A x from starts round the goal."""
    draws = np.random.default_rng(seed)
    times = np.arange(0.0, seconds, 0.02)
    values, vectors = np.linalg.eig(matrix + 1e-9 * np.diag(np.arange(len(matrix))))
    shown = []
    for start in draws.normal(size=(count, len(matrix))):
        amplitudes = np.linalg.solve(vectors, start.astype(complex))
        states = (vectors @ (amplitudes[:, None] * np.exp(np.outer(values, times)))).real.T
        shown.append(Demonstration(times, states, states @ matrix.T))
    return shown


def fit(shown, **options):
    return fit_lpvds(shown, **{"components": (1,), "n_init": 1, "tube": 0.0, "seed": 0, **options})


@pytest.mark.parametrize("matrix", [SPIRAL, SHEARED, np.diag([-1.0, -3.0])], ids=["spiral", "shear", "node"])
def test_a_stable_linear_motion_is_found_as_it_is(matrix):
    ds = fit(motions(matrix))
    np.testing.assert_allclose(ds.matrices[0], matrix, atol=2e-3)
    assert ds.certificate().holds


def test_with_the_plain_norm_a_shear_cannot_be_followed():
    """Its motions go away from the goal at first, as lengths are measured by P = I."""
    shown = motions(SHEARED)
    free, plain = fit(shown), fit(shown, method="identity")
    np.testing.assert_array_equal(plain.lyapunov, np.eye(2))
    errors = [
        np.mean([np.linalg.norm(ds.velocity(one.states) - one.velocities, axis=1).mean() for one in shown])
        for ds in (free, plain)
    ]
    assert errors[0] < 0.02 * errors[1]
    assert plain.certificate().holds


@pytest.mark.parametrize("matrix", [-SPIRAL, np.diag([0.5, -1.0]), np.array([[0.0, 1.0], [-1.0, 0.0]])])
def test_a_motion_that_does_not_end_at_the_goal_still_gives_a_system_that_does(matrix):
    ds = fit(motions(matrix, seconds=1.0), decay=0.2)
    assert ds.certificate().continuous <= -0.2 + 1e-4
    x = np.array([1.0, -1.0])
    for _ in range(5000):
        x = x + ds.step * ds.velocity(x)
    assert np.linalg.norm(x) < 1e-3


@pytest.mark.parametrize("decay", [0.05, 0.5, 2.0])
def test_the_least_rate_is_kept_in_continuous_and_in_discrete_time(decay):
    certificate = fit(motions(np.diag([-0.02, -1.0])), decay=decay).certificate()
    assert certificate.continuous == pytest.approx(-decay, rel=1e-3)
    assert certificate.discrete == pytest.approx(1.0 - decay * 0.01, abs=1e-6)


def test_the_step_that_is_asked_for_is_certified():
    """A fast spiral: in continuous time it is fine as it is, by steps of 0.2 s it would grow."""
    fast = 4.0 * SPIRAL
    assert np.linalg.norm(np.eye(2) + 0.2 * fast, 2) > 1.5
    ds = fit(motions(fast), step=0.2)
    assert ds.step == 0.2 and ds.certificate().discrete < 1.0
    np.testing.assert_allclose(fit(motions(fast), step=0.001).matrices[0], fast, atol=0.01)


def test_several_components_follow_a_motion_that_bends():
    """Two systems for two halves of the plane: one linear system errs much more."""
    draws = np.random.default_rng(5)
    states = np.concatenate(
        [draws.normal([3.0, 0.0], 0.3, (200, 2)), draws.normal([0.0, 3.0], 0.3, (200, 2))]
    )
    velocities = np.concatenate([states[:200] @ SPIRAL.T, states[200:] @ np.diag([-3.0, -1.0])])
    shown = [Demonstration(np.arange(400) * 0.01, states, velocities)]
    errors = [
        np.linalg.norm(fit(shown, components=(count,)).velocity(states) - velocities, axis=1).mean()
        for count in (1, 2)
    ]
    assert errors[1] < 0.3 * errors[0]


def test_blocks_do_not_mix_and_only_the_first_coordinates_weigh():
    shown = [
        Demonstration(one.times, np.hstack([one.states, other.states]), np.hstack([one.speeds, other.speeds]))
        for one, other in zip(motions(SPIRAL), motions(SHEARED, seed=8), strict=True)
    ]
    ds = fit(shown, blocks=(2, 2), components=(2,))
    assert ds.mixture.dimensions == 2 and ds.dimensions == 4
    np.testing.assert_array_equal(ds.matrices[:, :2, 2:], 0.0)
    np.testing.assert_array_equal(ds.lyapunov[2:, :2], 0.0)
    states = np.concatenate([one.states for one in shown])
    np.testing.assert_allclose(ds.velocity(states), np.concatenate([one.speeds for one in shown]), atol=0.02)


def test_a_mixture_that_is_there_is_taken_as_it_is():
    shown = motions(SPIRAL)
    first = fit(shown, components=(3,))
    plain = fit(shown, mixture=first.mixture, method="identity")
    np.testing.assert_array_equal(plain.means, first.means)
    with pytest.raises(ArgumentError, match="mixture: expected one over 1 coordinates, got 2"):
        fit(shown, mixture=first.mixture, mixed=1)


def test_off_the_shown_paths_motion_comes_back_to_them():
    """One straight motion says nothing about the direction across it."""
    times = np.arange(0.0, 3.0, 0.01)
    line = np.column_stack([np.exp(-0.8 * times), np.zeros_like(times)])
    shown = [Demonstration(times, line, -0.8 * line)]
    across = fit(shown, tube=0.1, components=(1,)).velocity([0.0, 1.0])
    np.testing.assert_allclose(across, [0.0, -1.0], atol=1e-3)


def test_metric_and_matrices_are_fitted_in_any_unit():
    shown = motions(SPIRAL)
    small = [Demonstration(one.times, 1e-3 * one.states, 1e-3 * one.speeds) for one in shown]
    np.testing.assert_allclose(fit(small).matrices, fit(shown).matrices, atol=2e-3)
    states = np.concatenate([one.states for one in motions(SHEARED)])
    metric = fit_metric(states, states @ SHEARED.T)
    assert np.trace(metric) == pytest.approx(2.0) and np.linalg.eigvalsh(metric)[0] > 0.0
    turned = SHEARED.T @ metric + metric @ SHEARED
    assert np.linalg.eigvalsh(turned)[-1] < 0.0
    np.testing.assert_allclose(fit_metric(1e-3 * states, 1e-3 * states @ SHEARED.T), metric, atol=1e-3)


def test_the_same_seed_gives_the_same_system():
    shown = motions(SPIRAL)
    one, same = (fit(shown, components=(3,), seed=7) for _ in range(2))
    np.testing.assert_array_equal(one.matrices, same.matrices)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"step": 0.0}, "step: "),
        ({"decay": 0.0}, "decay: "),
        ({"decay": 100.0}, r"decay: expected decay \* step < 1"),
        ({"method": "seds"}, "method: expected one of"),
        ({"mixed": 3}, "mixed: expected at most the states' 2"),
        ({"blocks": (1, 2)}, "blocks: expected sizes that sum to 2"),
        ({"components": ()}, "components: "),
        ({"components": (0,)}, "components: expected an integer >= 1"),
        ({"components": (500,)}, "components: 1000 points are too few"),
        ({"regularisation": 0.0}, "regularisation: "),
        ({"tube": -0.1}, "tube: "),
        ({"n_init": 0}, "n_init: "),
        ({"seed": -1}, "seed: "),
    ],
)
def test_wrong_arguments_are_named(options, message):
    with pytest.raises(ArgumentError, match=message):
        fit(motions(SPIRAL), **options)


def test_demonstrations_that_say_nothing_are_an_error():
    with pytest.raises(ArgumentError, match="at least one"):
        fit([])
    with pytest.raises(ArgumentError, match="expected one dimension"):
        fit([*motions(SPIRAL), *motions(np.diag([-1.0, -1.0, -1.0]))])
    still = Demonstration(np.arange(50.0), np.tile([1.0, 2.0], (50, 1)))
    with pytest.raises(ArgumentError, match="points: expected different points"):
        fit([still])
    draws = np.random.default_rng(0)
    with pytest.raises(StateError, match="nothing moves"):
        fit([Demonstration(np.arange(50.0), draws.normal(size=(50, 2)), np.zeros((50, 2)))])


def test_what_the_solver_cannot_do_is_an_error_that_says_what_to_change(monkeypatch):
    """An answer that is not certified is refused, however the solver came to it."""
    unstable = lambda *args, **kwargs: np.eye(2)[None]  # noqa: E731
    monkeypatch.setattr("motorprime.learning.stable.fit_matrices", unstable)
    with pytest.raises(StateError, match=r"not certified: rate 1 1/s.*larger decay"):
        fit(motions(SPIRAL))
    monkeypatch.undo()

    def gives_up(self, **options):
        raise cvxpy.SolverError("no")

    monkeypatch.setattr(cvxpy.Problem, "solve", gives_up)
    with pytest.raises(StateError, match="fit: the solver gave up on P: no"):
        fit(motions(SPIRAL))
    monkeypatch.setattr(cvxpy.Problem, "solve", lambda self, **options: None)
    with pytest.raises(StateError, match="fit: no P found"):
        fit(motions(SPIRAL))


def test_states_without_a_value_never_reach_the_solver():
    states = np.full((10, 2), np.nan)
    with pytest.raises(ArgumentError, match="states: expected finite"):
        fit_matrices(states, states, np.ones((10, 1)), np.eye(2), step=0.01, decay=0.1, tube=0.0)
    with pytest.raises(ArgumentError, match="velocities: expected finite"):
        fit_metric(np.ones((10, 2)), states)


def test_a_mixture_has_as_many_components_as_there_are_clusters(rng):
    centres = np.array([[0.0, 0.0], [5.0, 0.0], [0.0, 5.0]])
    points = np.concatenate([rng.normal(c, 0.3, (100, 2)) for c in centres])
    mixture = fit_mixture(points, components=range(1, 7), regularisation=1e-3, seed=0)
    assert len(mixture) == 3
    np.testing.assert_allclose(sorted(mixture.means.tolist()), sorted(centres.tolist()), atol=0.15)
    np.testing.assert_allclose(mixture.weights, 1 / 3, atol=0.02)


def test_regularisation_is_a_share_of_the_spread(rng):
    points = rng.normal(size=(300, 2)) * [1.0, 3.0]
    plain, wide = (fit_mixture(points, components=(1,), regularisation=r, seed=0) for r in (1e-9, 0.1))
    grown = wide.covariances[0] - plain.covariances[0]
    np.testing.assert_allclose(grown, 0.1 * points.var(axis=0).mean() * np.eye(2), atol=1e-6)


@pytest.mark.parametrize("points", [np.zeros((0, 2)), np.zeros(5), [[np.nan, 1.0]], [["a"]]])
def test_points_that_are_none_are_refused(points):
    with pytest.raises((ArgumentError, TypeError), match="points: expected"):
        fit_mixture(points)


def test_a_coupling_follows_a_curve_in_the_units_it_is_given(rng):
    """A curve in a range of 0.3 m and openings up to 1: neither may drown the other."""
    psi = rng.uniform(0.0, 0.3, 600)
    slave = np.minimum(1.0, psi / 0.1)
    coupling = fit_coupling(psi, slave + 0.01 * rng.normal(size=600), seed=0)
    at = np.array([0.03, 0.06, 0.09, 0.15, 0.25])
    np.testing.assert_allclose(coupling.expected(at), np.minimum(1.0, at / 0.1), atol=0.05)
    scaled = fit_coupling(1000.0 * psi, slave, near=20.0, seed=0)
    np.testing.assert_allclose(scaled.expected(1000.0 * at), np.minimum(1.0, at / 0.1), atol=0.05)
    assert coupling.near == 0.02 and coupling.expected(0.0) == 0.0


@pytest.mark.parametrize(
    ("psi", "slave", "message"),
    [
        ([0.1, 0.2], [1.0], "slave: expected shape"),
        ([[0.1]], [[1.0]], "psi: expected shape"),
        ([0.1, -0.2], [1.0, 0.0], "psi: expected distances >= 0"),
        ([0.1, np.nan], [1.0, 0.0], "psi: expected finite"),
        ([0.1, 0.1], [1.0, 0.0], "psi: expected different"),
        ([0.1, 0.2], [1.0, 1.0], "slave: expected different"),
    ],
)
def test_couplings_of_nothing_are_refused(psi, slave, message):
    with pytest.raises(ArgumentError, match=message):
        fit_coupling(psi, slave)
