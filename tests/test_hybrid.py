"""Kinematics with small networks on top: never worse, better where no model fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from motorprime import KinematicProjection
from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.learning.network import Network
from motorprime.learning.synthetic import draw_samples
from motorprime.perturbed import perturb
from motorprime.projection.hybrid import MEMORY, HybridProjection
from motorprime.projection.residual import Form, better, fit_residual, folds
from motorprime.samples import Samples
from watching_robot import watching_robot

Q = np.array([0.9, -0.2, -0.4, 0.4])


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return watching_robot(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def real(robot, tmp_path_factory):
    return perturb(robot, 0, tmp_path_factory.mktemp("real"))


@pytest.fixture(scope="module")
def odd(real):
    """Lenses with a prism, which the calibration does not know."""
    mounts = {
        name: replace(mount, camera=replace(
            mount.camera, distortion=(*mount.camera.distortion, 0, 0, 0, 0, 0.05, 0.03, -0.06, 0.05)
        ))
        for name, mount in real.cameras.items()
    }  # fmt: skip
    return replace(real, cameras=mounts)


@pytest.fixture(scope="module")
def adapted(robot, odd):
    return HybridProjection(KinematicProjection(robot)).adapt(draw_samples(odd, robot, 300, 1, 0.3))


def errors(projection, samples) -> np.ndarray:
    found = []
    for k, joints in enumerate(samples.joints):
        if samples.points is None:
            pixels = projection.hand_pixels(joints)
        else:
            pixels = projection.project(samples.points[[k]], joints)
        found += [pixels[c][0] - samples.pixels[c][k] for c in samples.cameras if samples.seen(c)[k]]
    return np.linalg.norm(found, axis=1)


def network_of(seed=0, inputs=7) -> Network:
    rng = np.random.default_rng(seed)
    x = np.column_stack(
        [rng.uniform(0, 300, (50, 2)), rng.uniform(2, 10, 50), rng.normal(size=(50, inputs - 3))]
    )
    return Network.random((inputs, 8, 2), seed, x, rng.normal(size=(50, 2)))


def in_view(robot, count=20):
    """Points that the left eye has before it at Q."""
    rng = np.random.default_rng(3)
    local = rng.uniform((-0.1, -0.1, 0.2), (0.1, 0.1, 0.6), (count, 3))
    pose = KinematicProjection(robot).posed(Q)["left"].pose
    return local @ pose[:3, :3].T + pose[:3, 3]


def test_without_networks_it_is_the_kinematic_projection(robot):
    kinematic, points = KinematicProjection(robot), in_view(robot)
    hybrid = HybridProjection(kinematic)
    assert hybrid.cameras == kinematic.cameras and hybrid.shapes == kinematic.shapes
    for name in hybrid.cameras:
        np.testing.assert_array_equal(hybrid.project(points, Q)[name], kinematic.project(points, Q)[name])
        np.testing.assert_allclose(hybrid.jacobian(points, Q)[name], kinematic.jacobian(points, Q)[name])
        np.testing.assert_array_equal(hybrid.depths(points, Q)[name], kinematic.depths(points, Q)[name])


def test_a_network_adds_its_outputs_to_the_pixels_of_its_camera(robot):
    kinematic, points, network = KinematicProjection(robot), in_view(robot), network_of()
    hybrid = HybridProjection(kinematic, {"left": network})
    plain, depth = kinematic.project(points, Q)["left"], kinematic.depths(points, Q)["left"]
    x = np.column_stack([plain, 1.0 / depth, np.tile(Q, (len(points), 1))])
    np.testing.assert_allclose(hybrid.project(points, Q)["left"], plain + network.forward(x), atol=1e-3)
    np.testing.assert_array_equal(hybrid.project(points, Q)["right"], kinematic.project(points, Q)["right"])


def test_the_jacobian_is_the_difference_quotient_of_the_pixels(robot):
    """What the network adds to both; it is in single precision, hence the wide step."""
    kinematic, points = KinematicProjection(robot), in_view(robot)
    hybrid = HybridProjection(kinematic, {"left": replace(network_of(), output_std=np.full(2, 1000.0))})
    slopes = hybrid.jacobian(points, Q)["left"] - kinematic.jacobian(points, Q)["left"]
    assert np.median(np.abs(slopes), axis=(0, 1)).min() > 5.0
    for k in range(3):
        step = 1e-3 * np.eye(3)[k]
        ahead, behind = (
            hybrid.project(points + d, Q)["left"] - kinematic.project(points + d, Q)["left"]
            for d in (step, -step)
        )
        np.testing.assert_allclose(slopes[:, :, k], (ahead - behind) / 2e-3, rtol=0.01, atol=3.0)


def test_a_point_behind_a_camera_stays_nan(robot):
    hybrid = HybridProjection(KinematicProjection(robot), {"left": network_of()})
    pose = KinematicProjection(robot).posed(Q)["left"].pose
    points = np.array([pose[:3, 3] + 0.3 * pose[:3, 2], pose[:3, 3] - 0.3 * pose[:3, 2]])
    np.testing.assert_array_equal(np.isnan(hybrid.project(points, Q)["left"][:, 0]), [False, True])
    np.testing.assert_array_equal(np.isnan(hybrid.jacobian(points, Q)["left"][:, 0, 0]), [False, True])
    assert hybrid.visible(points, Q)["left"].tolist() == [True, False]
    assert hybrid.project(np.zeros((0, 3)), Q)["left"].shape == (0, 2)


def test_triangulation_inverts_what_it_projects(adapted, robot):
    points = in_view(robot, 40)
    pixels = adapted.project(points, Q)
    both = ~np.isnan(pixels["left"][:, 0]) & ~np.isnan(pixels["right"][:, 0])
    # Where each eye has it in its image, and so within reach of what its network was taught.
    both &= np.all(list(adapted.visible(points, Q).values()), axis=0)
    assert both.sum() >= 5
    found = adapted.triangulate({name: uv[both] for name, uv in pixels.items()}, Q)
    np.testing.assert_allclose(found, points[both], atol=1e-4)


@pytest.mark.parametrize("count", [20, 50, 100])
@pytest.mark.parametrize("seed", [0, 1])
def test_where_kinematics_explain_everything_it_is_no_worse(robot, real, count, seed):
    hybrid = HybridProjection(KinematicProjection(robot)).adapt(draw_samples(real, robot, count, seed, 0.3))
    unseen = draw_samples(real, robot, 400, 99)
    assert np.median(errors(hybrid, unseen)) <= 1.02 * np.median(errors(hybrid.kinematic, unseen))


def test_where_no_model_fits_the_lens_it_helps(adapted, robot, odd):
    unseen = draw_samples(odd, robot, 400, 99)
    assert set(adapted.residuals) == {"left", "right"}
    hybrid, kinematic = (np.median(errors(p, unseen)) for p in (adapted, adapted.kinematic))
    assert hybrid < 0.75 * kinematic


def test_adapting_leaves_the_old_one_and_is_repeatable(robot, odd):
    samples = draw_samples(odd, robot, 100, 1, 0.3)
    hybrid = HybridProjection(KinematicProjection(robot))
    one, other = hybrid.adapt(samples), hybrid.adapt(samples)
    assert hybrid.residuals == {} and hybrid.memory is None
    assert hybrid.kinematic.calibration.offsets == {}
    for name, network in one.residuals.items():
        np.testing.assert_array_equal(network.parameters, other.residuals[name].parameters)


def test_adapting_again_goes_on_from_all_samples(robot, odd):
    samples, unseen = draw_samples(odd, robot, 300, 1, 0.3), draw_samples(odd, robot, 300, 99)
    first = HybridProjection(KinematicProjection(robot)).adapt(samples.take(slice(0, 100)))
    second = first.adapt(samples.take(slice(100, 300)))
    assert len(first.memory) == 100 and len(second.memory) == 300
    assert np.median(errors(second, unseen)) < np.median(errors(first, unseen))


@pytest.mark.parametrize("count", [1, 12])
def test_a_few_samples_more_do_not_make_it_forget(adapted, robot, odd, count):
    again, unseen = adapted.adapt(draw_samples(odd, robot, count, 5, 0.3)), draw_samples(odd, robot, 400, 99)
    assert set(again.residuals) == {"left", "right"}
    assert np.median(errors(again, unseen)) < 1.1 * np.median(errors(adapted, unseen))


def test_ten_samples_are_enough_for_the_kinematics_alone(robot, odd):
    hybrid = HybridProjection(KinematicProjection(robot)).adapt(draw_samples(odd, robot, 10, 1, 0.3))
    assert hybrid.residuals == {} and hybrid.kinematic.calibration.covariance is not None


def test_the_memory_keeps_the_latest_thousand(robot, real):
    samples = draw_samples(real, robot, MEMORY + 30, 1, 0.3)
    kept = HybridProjection(KinematicProjection(robot)).adapt(samples).memory
    np.testing.assert_array_equal(kept.points, samples.points[30:])


def test_the_hand_s_encoders_alone_teach_it_too(robot, odd):
    samples, unseen = (
        draw_samples(odd, robot, n, s, e, arm=True) for n, s, e in [(300, 1, 0.3), (300, 99, 0.0)]
    )
    hybrid = HybridProjection(KinematicProjection(robot)).adapt(samples)
    assert hybrid.memory.names == (*robot.gaze, *robot.arm) and hybrid.memory.points is None
    assert np.median(errors(hybrid, unseen)) < 0.85 * np.median(errors(hybrid.kinematic, unseen))
    with_points = hybrid.adapt(draw_samples(odd, robot, 40, 2, 0.3))
    assert len(with_points.memory) == 40


def test_the_hand_in_many_postures_is_the_hand_in_each(adapted, robot):
    joints = np.random.default_rng(0).uniform(-0.5, 0.5, (5, 6))
    for name, many in adapted.hand_pixels(joints).items():
        assert many.shape == (5, 1, 2)
        for row, q in zip(many, joints, strict=True):
            np.testing.assert_allclose(row, adapted.hand_pixels(q)[name], atol=1e-4)
            np.testing.assert_allclose(
                row, adapted.project(adapted.kinematic.hand_points(q), q[:4])[name], atol=1e-4
            )


def test_a_camera_that_the_samples_lack_gets_no_network(robot, odd):
    samples = draw_samples(odd, robot, 300, 1, 0.3)
    left = Samples(samples.names, samples.joints, {"left": samples.pixels["left"]}, samples.points)
    hybrid = HybridProjection(KinematicProjection(robot)).adapt(left)
    assert set(hybrid.residuals) == {"left"}
    assert np.isnan(hybrid.memory.pixels["right"]).all()
    assert len(hybrid.adapt(samples).memory) == 600


def test_a_file_brings_it_back(adapted, robot, odd, tmp_path):
    adapted.save(tmp_path / "hybrid.model")
    loaded = HybridProjection.load(tmp_path / "hybrid.model", robot)
    points = in_view(robot)
    for name, uv in adapted.project(points, Q).items():
        np.testing.assert_array_equal(loaded.project(points, Q)[name], uv)
    more = draw_samples(odd, robot, 50, 5, 0.3)
    again, direct = loaded.adapt(more), adapted.adapt(more)
    for name, uv in direct.project(points, Q).items():
        np.testing.assert_array_equal(again.project(points, Q)[name], uv)
    HybridProjection(KinematicProjection(robot)).save(tmp_path / "empty.model")
    assert HybridProjection.load(tmp_path / "empty.model", robot).memory is None


def test_a_file_of_another_robot_or_kind_is_refused(adapted, robot, tmp_path):
    path = tmp_path / "hybrid.model"
    adapted.save(path)
    with pytest.raises(ArgumentError, match="robot 'tall', got one of 'small'"):
        HybridProjection.load(path, replace(robot, name="tall"))
    with pytest.raises(ArgumentError, match="is a hybrid projection, a kinematic projection expected"):
        KinematicProjection.load(path, robot)
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(ArgumentError, match="cut off"):
        HybridProjection.load(path, robot)


@pytest.mark.parametrize(
    ("residuals", "words"),
    [
        ({"top": network_of()}, "residuals: no camera 'top'; there are left, right"),
        ({"left": network_of(inputs=8)}, r"residuals\['left'\]: a network from 7 inputs"),
    ],
)
def test_networks_that_do_not_fit_are_refused(robot, residuals, words):
    with pytest.raises(ArgumentError, match=words):
        HybridProjection(KinematicProjection(robot), residuals)


def test_wrong_arguments_are_errors_that_name_them(adapted, robot, real):
    with pytest.raises(ArgumentTypeError, match="kinematic: expected a KinematicProjection, got str"):
        HybridProjection("small")
    with pytest.raises(ArgumentTypeError, match="samples: expected Samples, got dict"):
        adapted.adapt({})
    with pytest.raises(ArgumentError, match="samples: at least 10 in view are needed, got 5"):
        HybridProjection(KinematicProjection(robot)).adapt(draw_samples(real, robot, 5, 0))
    with pytest.raises(ArgumentError, match="joints: a posture"):
        adapted.project(in_view(robot))
    with pytest.raises(ArgumentError, match="joints"):
        adapted.project(in_view(robot), np.zeros(5))
    with pytest.raises(ArgumentError, match="points"):
        adapted.jacobian(np.full((1, 3), np.nan), Q)


# The networks themselves.


def test_a_residual_network_learns_a_smooth_error_and_ignores_outliers():
    rng = np.random.default_rng(0)
    x = np.column_stack([rng.uniform((0, 0), (320, 240), (200, 2)), rng.normal(size=(200, 3))])

    def truth(x):
        return np.column_stack([2.0 * np.sin(x[:, 0] / 90.0), (x[:, 1] / 120.0 - 1.0) ** 2])

    y = truth(x) + rng.normal(0, 0.1, (200, 2))
    y[:10] += 60.0
    network = fit_residual(x, y, Form(2, 0.3))
    unseen = np.column_stack([rng.uniform((20, 20), (300, 220), (200, 2)), rng.normal(size=(200, 3))])
    left = np.linalg.norm(network.forward(unseen) - truth(unseen), axis=1)
    assert np.median(left) < 0.15 < 1.0 < np.median(np.linalg.norm(truth(unseen), axis=1))
    np.testing.assert_allclose(network.mlp()(unseen), network.forward(unseen), atol=1e-3)


def test_a_network_looks_only_at_its_first_columns():
    rng = np.random.default_rng(1)
    x, y = rng.normal(size=(80, 5)), rng.normal(size=(80, 2))
    network = fit_residual(x, y, Form(3, 3.0))
    np.testing.assert_array_equal(
        network.forward(x), network.forward(np.column_stack([x[:, :3], 9.0 * x[:, 3:]]))
    )
    assert not np.array_equal(network.forward(x), network.forward(x[:, [1, 0, 2, 3, 4]]))


def test_a_stronger_ridge_gives_a_smaller_correction_around_the_same_mean():
    rng = np.random.default_rng(2)
    x, y = rng.normal(size=(80, 2)), rng.normal((3.0, -1.0), 1.0, (80, 2))
    weak, strong = (fit_residual(x, y, Form(2, ridge)).forward(x) for ridge in (0.3, 1e6))
    assert strong.std(axis=0).max() < 0.05 < weak.std(axis=0).min()
    np.testing.assert_allclose(strong.mean(axis=0), (3.0, -1.0), atol=0.3)


def test_folds_hold_every_sample_out_once():
    masks = list(folds(23))
    assert len(masks) == 5 and np.sum(masks, axis=0).tolist() == [1] * 23
    assert len(list(folds(3))) == 3


def test_better_counts_standard_errors_and_chance_is_not_enough():
    rng = np.random.default_rng(3)
    errors_ = rng.uniform(0, 1, 400)
    assert better(errors_, 0.5 * errors_) > 20.0 > -20.0 > better(0.5 * errors_, errors_)
    assert abs(better(errors_, rng.permutation(errors_))) < 3.0
    assert better(errors_[:4], np.zeros(4)) == -np.inf
    spoiled = np.where(np.arange(400) == 0, 1e6, 0.5 * errors_)
    assert better(errors_, spoiled) > 3.0
    gain = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    expected = 0.3 / (np.std(gain, ddof=1) / np.sqrt(5))
    assert better(np.full(5, 1.0), 1.0 - gain) == pytest.approx(expected)
