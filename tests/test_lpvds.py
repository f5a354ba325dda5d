"""The dynamical system, its certificate, and the coupling of one part to another."""

import numpy as np
import pytest

from motorprime.control.coupling import Coupling
from motorprime.control.lpvds import LpvDs, certify
from motorprime.control.mixture import Mixture
from motorprime.errors import ArgumentError, StateError

TURN = np.array([[-2.0, -3.0], [3.0, -2.0]])  # falls at 2 1/s while it turns at 3 rad/s
SINK = np.array([[-5.0, 0.0], [0.0, -1.0]])


def arrays(**changes):
    values = {
        "weights": np.array([0.25, 0.75]),
        "means": np.array([[1.0, 0.0], [0.0, 0.5]]),
        "covariances": np.array([[[0.2, 0.05], [0.05, 0.1]], [[0.3, 0.0], [0.0, 0.2]]]),
        "matrices": np.stack([TURN, SINK]),
        "lyapunov": np.eye(2),
        "step": 0.1,
    }
    return {**values, **changes}


def density(x, mean, covariance):
    gap = x - mean
    return np.exp(-0.5 * gap @ np.linalg.solve(covariance, gap)) / (
        2 * np.pi * np.sqrt(np.linalg.det(covariance))
    )


def test_the_velocity_is_the_mixture_of_the_linear_systems(rng):
    """Against the formula, spelled out by densities instead of by their logarithms."""
    ds = LpvDs(**arrays())
    states = rng.normal(size=(20, 2))
    for x, velocity in zip(states, ds.velocity(states), strict=True):
        parts = [w * density(x, m, c) for w, m, c in zip(ds.weights, ds.means, ds.covariances, strict=True)]
        expected = (parts[0] * TURN @ x + parts[1] * SINK @ x) / sum(parts)
        np.testing.assert_allclose(velocity, expected, rtol=1e-12)


def test_one_state_and_no_state_are_answered_in_their_own_shape():
    ds = LpvDs(**arrays())
    assert ds.velocity(np.array([0.3, -0.2])).shape == (2,)
    np.testing.assert_array_equal(ds.velocity([0.3, -0.2]), ds.velocity([[0.3, -0.2]])[0])
    assert ds.velocity(np.zeros((0, 2))).shape == (0, 2)
    np.testing.assert_array_equal(ds.velocity([0.0, 0.0]), 0.0)


def test_where_every_density_underflows_the_nearest_component_takes_over():
    velocity = LpvDs(**arrays()).velocity(np.array([[1e6, 0.0], [0.0, 1e8]]))
    assert np.isfinite(velocity).all()
    np.testing.assert_allclose(velocity[0], SINK @ [1e6, 0.0])  # the wider along x
    np.testing.assert_allclose(velocity[1], SINK @ [0.0, 1e8])


def test_the_mixture_may_be_over_the_first_coordinates_only(rng):
    """As the arm's: where the palm is decides how it moves and turns, how it is turned does not."""
    matrices = np.stack([np.diag([-1.0, -2.0, -3.0]), np.diag([-3.0, -1.0, -0.5])])
    ds = LpvDs(**arrays(matrices=matrices, lyapunov=np.eye(3)))
    flat = LpvDs(**arrays(matrices=matrices[:, :2, :2]))
    states = rng.normal(size=(9, 3))
    np.testing.assert_allclose(ds.velocity(states)[:, :2], flat.velocity(states[:, :2]), rtol=1e-12)
    turned = states * [1.0, 1.0, -2.0]
    np.testing.assert_allclose(ds.velocity(turned)[:, 2], -2.0 * ds.velocity(states)[:, 2], rtol=1e-12)


def test_the_certificate_tells_the_slowest_decay_and_the_largest_factor():
    certificate = LpvDs(**arrays()).certificate()
    assert certificate.continuous == pytest.approx(-1.0)  # the slow axis of SINK
    assert certificate.discrete == pytest.approx(0.9)  # 1 - 0.1 * 1; TURN gives hypot(0.8, 0.3) = 0.854
    assert certificate.step == 0.1 and certificate.holds


def test_the_certificate_measures_in_the_metric_of_the_lyapunov_matrix():
    """A sheared sink grows at first in the plain norm; in the right metric it falls all the way."""
    shear = np.array([[-1.0, 8.0], [0.0, -1.0]])
    matrices = np.stack([shear, shear])
    with pytest.raises(StateError):
        LpvDs(**arrays(matrices=matrices, step=0.01))
    metric = np.diag([1.0, 64.0])  # x^T P x with y measured in eighths: B = [[-1, 1], [0, -1]]
    ds = LpvDs(**arrays(matrices=matrices, lyapunov=metric, step=0.01))
    assert ds.certificate().continuous == pytest.approx(-0.5)
    x = np.array([0.0, 1.0])
    for _ in range(3000):
        before = x @ metric @ x
        x = x + 0.01 * ds.velocity(x)
        assert x @ metric @ x < before
    assert np.abs(x).max() < 1e-9


def test_every_euler_step_up_to_the_certified_one_brings_the_state_nearer(rng):
    ds = LpvDs(**arrays())
    states = 3.0 * rng.normal(size=(200, 2))
    for step in (0.001, 0.05, 0.1):
        after = states + step * ds.velocity(states)
        assert (np.linalg.norm(after, axis=1) < np.linalg.norm(states, axis=1)).all()


@pytest.mark.parametrize(
    "changes",
    [
        {"matrices": -np.stack([TURN, SINK])},
        {"matrices": np.stack([TURN, np.diag([-1.0, 1e-9])])},
        {"matrices": np.stack([TURN, np.zeros((2, 2))])},
        {"step": 0.5},  # TURN: hypot(1 - 1, 1.5) = 1.5
    ],
    ids=["away", "one direction away", "standing still", "step too large"],
)
def test_a_system_that_need_not_converge_is_refused(changes):
    with pytest.raises(StateError, match="matrices: not certified to converge"):
        LpvDs(**arrays(**changes))


def test_a_system_is_not_stable_because_one_of_its_parts_is():
    bad = np.array([[0.5, 0.0], [0.0, -1.0]])
    assert not certify(np.stack([TURN, bad]), np.eye(2), 0.01).holds
    assert certify(np.stack([TURN]), np.eye(2), 0.01).holds


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"weights": np.ones(2)}, "weights: .*sum to 1"),
        ({"weights": np.array([1.0, 0.0])}, "weights: .*> 0"),
        ({"weights": np.array([0.5, np.nan])}, "weights: .*finite"),
        ({"weights": np.zeros(0)}, r"weights: expected shape \(K,\)"),
        ({"means": np.zeros((3, 2))}, r"means: expected shape \(2, m\)"),
        ({"means": np.full((2, 2), np.nan)}, "means: .*finite"),
        ({"covariances": np.zeros((2, 2))}, r"covariances: expected shape \(2, 2, 2\)"),
        ({"covariances": np.zeros((2, 2, 2))}, r"covariances\[0\]: .*positive definite"),
        ({"covariances": np.stack([np.eye(2), [[1.0, 2.0], [2.0, 1.0]]])}, r"covariances\[1\]: .*definite"),
        ({"covariances": np.stack([np.eye(2), [[1.0, 0.2], [0.0, 1.0]]])}, r"covariances\[1\]: .*symmetric"),
        ({"matrices": np.zeros((2, 2, 3))}, r"matrices: expected shape \(2, d, d\)"),
        ({"matrices": -np.ones((2, 1, 1))}, "matrices: expected d >= 2"),
        ({"matrices": np.full((2, 2, 2), np.inf)}, "matrices: .*finite"),
        ({"lyapunov": -np.eye(2)}, "lyapunov: .*positive definite"),
        ({"lyapunov": np.array([[1.0, 0.5], [0.0, 1.0]])}, "lyapunov: .*symmetric"),
        ({"lyapunov": np.eye(3)}, r"lyapunov: expected shape \(2, 2\)"),
        ({"step": 0.0}, "step: expected a number > 0"),
        ({"step": np.nan}, "step: .*finite"),
    ],
)
def test_wrong_arrays_are_named(changes, message):
    with pytest.raises(ArgumentError, match=message):
        LpvDs(**arrays(**changes))


@pytest.mark.parametrize("states", [[np.nan, 0.0], [[0.0, 1.0, 2.0]], 0.0, np.zeros((1, 1, 2))])
def test_states_of_another_shape_or_without_value_are_refused(states):
    with pytest.raises(ArgumentError, match="states: expected"):
        LpvDs(**arrays()).velocity(states)


def test_a_model_keeps_copies_that_nobody_can_change():
    """Else the certificate would be of another system than the one that moves the arm."""
    given = arrays()
    ds = LpvDs(**given)
    given["matrices"][:] = 0.0
    assert ds.certificate().holds
    for name in ("weights", "means", "covariances", "matrices", "lyapunov"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(ds, name)[0] = 0.0


def test_a_system_comes_back_from_its_arrays_and_is_checked_again():
    ds = LpvDs(**arrays())
    kept = ds.arrays("arm.")
    assert set(kept) == {f"arm.{name}" for name in arrays()}
    again = LpvDs.from_arrays(kept, "arm.")
    np.testing.assert_array_equal(again.velocity([0.3, 0.1]), ds.velocity([0.3, 0.1]))
    assert again.certificate() == ds.certificate()
    with pytest.raises(StateError, match="not certified"):
        LpvDs.from_arrays({**kept, "arm.matrices": -ds.matrices}, "arm.")
    with pytest.raises(ArgumentError, match=r"arrays: no 'hand\.weights'"):
        LpvDs.from_arrays(kept, "hand.")


def coupling(**changes):
    values = {
        "weights": np.array([0.4, 0.6]),
        "means": np.array([[0.1, 0.3], [0.4, 0.9]]),
        "covariances": np.array([[[0.01, 0.02], [0.02, 0.09]], [[0.02, -0.01], [-0.01, 0.04]]]),
    }
    return Coupling(**{**values, **changes})


def test_the_expected_slave_is_the_mean_over_the_joint_density():
    """Against the integral of y p(psi, y) over y, on a fine grid."""
    link = coupling()
    y = np.linspace(-6.0, 7.0, 20001)
    for psi in (0.03, 0.1, 0.25, 0.5):
        joint = np.zeros_like(y)
        for weight, mean, cov in zip(link.weights, link.means, link.covariances, strict=True):
            gap = np.stack([np.full_like(y, psi), y], axis=1) - mean
            exponent = -0.5 * np.einsum("ni,ij,nj->n", gap, np.linalg.inv(cov), gap)
            joint += weight * np.exp(exponent) / np.sqrt(np.linalg.det(cov))
        assert link.expected(psi) == pytest.approx((y * joint).sum() / joint.sum(), rel=1e-9)


def test_the_slave_is_at_its_goal_when_the_master_is_and_gets_there_without_a_jump():
    link = coupling()
    assert link.expected(0.0) == 0.0
    psi = np.linspace(0.0, 0.05, 501)
    values = link.expected(psi)
    assert np.abs(np.diff(values)).max() < 0.01 * np.abs(values).max()
    raw = coupling(near=1e-12)
    assert link.expected(0.005) == pytest.approx(0.25 * raw.expected(0.005))
    assert link.expected(0.02) == pytest.approx(raw.expected(0.02))


def test_expected_answers_in_the_shape_it_was_asked():
    link = coupling()
    assert isinstance(link.expected(0.1), float)
    np.testing.assert_array_equal(link.expected([0.1, 0.2]), [link.expected(0.1), link.expected(0.2)])
    assert np.isfinite(link.expected(1e6))


@pytest.mark.parametrize("psi", [-0.1, np.nan, np.inf, [[0.1]], [0.1, -1e-9]])
def test_a_distance_that_is_none_is_refused(psi):
    with pytest.raises(ArgumentError, match="psi: expected"):
        coupling().expected(psi)


@pytest.mark.parametrize("near", [0.0, -1.0, np.nan])
def test_near_is_a_distance(near):
    with pytest.raises(ArgumentError, match="near"):
        coupling(near=near)


def test_a_coupling_is_of_two_scalars():
    with pytest.raises(ArgumentError, match=r"means: expected shape \(1, 2\)"):
        Coupling(np.ones(1), np.zeros((1, 3)), np.eye(3)[None])


def test_a_coupling_comes_back_from_its_arrays():
    link = coupling(near=0.03)
    again = Coupling.from_arrays(link.arrays("eye_arm."), "eye_arm.")
    assert again.expected(0.01) == link.expected(0.01) and again.near == 0.03
    with pytest.raises(ArgumentError, match="arrays: no 'weights'"):
        Coupling.from_arrays(link.arrays("eye_arm."))


def test_posteriors_are_shares_that_sum_to_one(rng):
    mixture = Mixture(*(arrays()[name] for name in ("weights", "means", "covariances")))
    shares = mixture.posterior(rng.normal(size=(50, 2)) * 100.0)
    assert (shares >= 0.0).all()
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
