"""Calibrating a robot: derivatives, recovery, outliers, priors, going on, and bad samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from motorprime import Camera, KinematicProjection
from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.learning.synthetic import draw_samples
from motorprime.perturbed import build, draw_errors, perturb
from motorprime.projection import Calibration, Priors, calibrate, parameter_names
from motorprime.projection.estimation import _minimise, _Prior, _Problem, _State
from motorprime.projection.observations import Observations
from motorprime.projection.parameters import Parameters
from motorprime.samples import Samples
from small_robot import CAMERA
from watching_robot import watching_robot

sim = pytest.mark.sim


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return watching_robot(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def real(robot, tmp_path_factory):
    """Its arm is exact."""
    return perturb(robot, 0, tmp_path_factory.mktemp("real"), mounting=0.01)


@pytest.fixture(scope="module")
def wrong_arm(robot, tmp_path_factory):
    return perturb(robot, 1, tmp_path_factory.mktemp("wrong_arm"), arm=True)


def errors(robot, calibration, samples) -> np.ndarray:
    """Lengths [px] of the residuals of all cameras, through the projection and not through the solver."""
    projection = KinematicProjection(robot, calibration)
    found = []
    for k, joints in enumerate(samples.joints):
        if samples.points is None:
            pixels = projection.hand_pixels(joints)
        else:
            pixels = projection.project(samples.points[[k]], joints)
        found += [pixels[c][0] - samples.pixels[c][k] for c in samples.cameras if samples.seen(c)[k]]
    return np.linalg.norm(found, axis=1)


def median(robot, calibration, samples) -> float:
    lengths = errors(robot, calibration, samples)
    assert not np.isnan(lengths).any()
    return float(np.median(lengths))


@pytest.mark.parametrize("arm", [False, True])
@pytest.mark.parametrize("lens", [(), (-0.2, 0.05, 1e-3, -2e-3, 0.01, 0.05, -0.02, 0.01)])
def test_every_derivative_is_the_difference_quotient(robot, arm, lens):
    camera = replace(CAMERA, distortion=lens)
    seeing = replace(robot, cameras={n: replace(m, camera=camera) for n, m in robot.cameras.items()})
    parameters = Parameters(seeing)
    observations = Observations(parameters, draw_samples(seeing, seeing, 40, 0, arm=arm))
    middle = 0.5 * parameters.sigmas(Priors()) * np.random.default_rng(0).normal(size=parameters.size)
    none, step = Calibration(seeing.name), 1e-6
    at = {name: part.slopes for name, part in observations.predict(parameters.unpack(middle, none)).items()}
    for k, what in enumerate(parameters.names):
        ahead, behind = (
            observations.predict(parameters.unpack(middle + d * np.eye(parameters.size)[k], none))
            for d in (step, -step)
        )
        for camera_name, slopes in at.items():
            quotient = (ahead[camera_name].pixels - behind[camera_name].pixels) / (2 * step)
            assert len(quotient) > 10 and np.isfinite(quotient).all()
            scale = 1.0 + np.abs(quotient)
            np.testing.assert_allclose(slopes[:, :, k] / scale, quotient / scale, atol=1e-6, err_msg=what)


def test_what_a_lens_folds_back_has_no_pixel_and_no_derivative(robot):
    folding = Camera(320, 240, 257.34, 257.34, 160.0, 120.0, (-2.0, 0.0, 0.0, 0.0))
    observations = Observations(Parameters(robot), draw_samples(robot, robot, 60, 0))
    calibration = Calibration(robot.name, cameras={"left": folding})
    found = observations.predict(calibration)["left"]
    lost = np.isnan(found.pixels[:, 0])
    assert 5 < lost.sum() < len(lost) - 5
    assert not found.slopes[lost].any() and np.isfinite(found.slopes).all()


def test_a_hundred_noisy_samples_recover_what_unseen_ones_show(robot, real):
    unseen = draw_samples(real, robot, 300, 11)
    result = calibrate(robot, draw_samples(real, robot, 100, 10, 0.3))
    assert median(robot, Calibration(robot.name), unseen) > 5.0
    assert median(robot, result.calibration, unseen) < 0.3
    assert result.converged and result.spread == pytest.approx(0.3, abs=0.05) and result.constant == ()


def test_without_noise_the_pixels_come_back_closely(robot, real):
    """The prior holds back what little the samples do not show."""
    result = calibrate(robot, draw_samples(real, robot, 400, 10), noise=0.01)
    assert median(robot, result.calibration, draw_samples(real, robot, 300, 11)) < 0.01


def test_degrees_and_millimetres_are_refused(robot, real):
    samples = draw_samples(real, robot, 40, 3)
    degrees = Samples(samples.names, np.rad2deg(samples.joints), samples.pixels, samples.points)
    with pytest.raises(ArgumentError, match="radians expected"):
        calibrate(robot, degrees)
    millimetres = Samples(samples.names, samples.joints, samples.pixels, 1e3 * samples.points)
    with pytest.raises(ArgumentError, match="metres expected"):
        calibrate(robot, millimetres)


def test_the_hand_alone_calibrates_eyes_and_arm(robot, wrong_arm):
    """Hand-eye: no points, the arm's encoders are off, and the marker is not where the model has the palm."""
    frame = wrong_arm.palm.frame.copy()
    frame[:3, 3] += (0.02, -0.015, 0.01)
    marked = replace(wrong_arm, palm=replace(wrong_arm.palm, frame=frame))
    unseen = draw_samples(marked, robot, 300, 13, arm=True)
    result = calibrate(robot, draw_samples(marked, robot, 100, 12, 0.3, arm=True))
    assert median(robot, Calibration(robot.name), unseen) > 5.0
    assert median(robot, result.calibration, unseen) < 0.4
    assert np.linalg.norm(result.calibration.hand) > 0.005


def test_the_torso_shows_nothing_when_it_carries_hand_and_eyes_alike(robot, wrong_arm):
    covariance = calibrate(robot, draw_samples(wrong_arm, robot, 50, 12, arm=True)).calibration.covariance
    spread = dict(zip(parameter_names(robot), np.sqrt(np.diag(covariance)), strict=True))
    assert spread["waist offset"] == pytest.approx(Priors().offsets, rel=1e-3)
    assert spread["neck offset"] < 0.7 * Priors().offsets


def test_exact_points_say_nothing_of_the_arm(robot, real):
    result = calibrate(robot, draw_samples(real, robot, 50, 10, 0.3)).calibration
    assert result.offsets["elbow"] == 0.0 and not result.hand.any() and not result.links["elbow"].any()
    spread = dict(zip(parameter_names(robot), np.sqrt(np.diag(result.covariance)), strict=True))
    assert spread["elbow offset"] == pytest.approx(Priors().arm_offsets)
    assert spread["hand z"] == pytest.approx(Priors().hand)


@pytest.mark.parametrize("distance", [5.0, 50.0])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_labels_that_are_far_off_do_not_spoil_it_and_are_named(robot, real, seed, distance):
    samples, rng = draw_samples(real, robot, 100, 20 + seed, 0.3), np.random.default_rng(seed)
    bad = rng.random(100) < 0.05
    bad[0] = True
    angle = rng.uniform(0, 2 * np.pi, 100)
    astray = distance * np.column_stack([np.cos(angle), np.sin(angle)])
    pixels = {c: np.where(bad[:, None], uv + astray, uv) for c, uv in samples.pixels.items()}
    result = calibrate(robot, Samples(samples.names, samples.joints, pixels, samples.points))
    assert median(robot, result.calibration, draw_samples(real, robot, 300, 11)) < 0.35
    for camera, outliers in result.outliers.items():
        np.testing.assert_array_equal(outliers, bad & samples.seen(camera))
        assert result.rms[camera] < 1.0 and result.median[camera] < 0.6


def test_labels_of_what_is_behind_the_camera_are_outliers(robot, real):
    samples = draw_samples(real, robot, 100, 10, 0.3)
    projection, points = KinematicProjection(real), samples.points.copy()
    behind = np.flatnonzero(samples.seen("left"))[:4]
    for k in behind:
        eye = projection.posed(samples.joints[k])["left"]
        points[k] = eye.origin - 0.3 * eye.pose[:3, 2]
    only = {"left": samples.pixels["left"]}
    result = calibrate(robot, Samples(samples.names, samples.joints, only, points))
    assert set(behind) <= set(np.flatnonzero(result.outliers["left"]))
    good = np.delete(np.arange(100), behind)
    rest = Samples(samples.names, samples.joints[good], {"left": only["left"][good]}, points[good])
    assert median(robot, result.calibration, rest) < 0.5


def test_labels_believed_half_as_much_leave_twice_the_deviation(robot, real):
    samples, prior = draw_samples(real, robot, 1000, 10, 0.01), Parameters(robot).sigmas(Priors())
    fine, coarse = (
        np.sqrt(np.diag(calibrate(robot, samples, noise=noise).calibration.covariance))
        for noise in (0.1, 0.2)
    )
    well_known = fine < 0.05 * prior
    assert well_known.sum() > 5
    assert np.median(coarse[well_known] / fine[well_known]) == pytest.approx(2.0, abs=0.1)


def test_a_step_that_overshoots_is_taken_back():
    """Newton's steps towards the root of an arc tangent run away from where it is nearly flat."""

    class Flat:
        def at(self, x):
            residual, slope = 1000.0 * np.arctan(x[0]), 1000.0 / (1.0 + x[0] ** 2)
            residuals, slopes = np.tile([residual, 0.0], (10000, 1)), np.tile([[slope], [0.0]], (10000, 1, 1))
            return _State(x, Calibration("flat"), residuals, slopes)

    fit = _minimise(Flat(), np.array([3.0]), 1.0, 60)
    assert fit.converged and abs(fit.state.x[0]) < 1e-3


def test_the_gradient_is_the_slope_of_the_cost_and_the_hessian_near_its_curvature(robot, real):
    """A factor missing in one of them would slow the steps down, and nothing else would show it."""
    parameters = Parameters(robot)
    samples = draw_samples(real, robot, 60, 10, 0.3)
    prior = _Prior(np.zeros(parameters.size), np.diag(parameters.sigmas(Priors())))
    problem = _Problem(parameters, Observations(parameters, samples), Calibration(robot.name), prior)
    rng = np.random.default_rng(0)
    x = prior.whitened(parameters.pack(calibrate(robot, samples).calibration))
    state, direction = problem.at(x + 0.01 * rng.normal(size=x.size)), rng.normal(size=x.size)
    gradient, hessian = state.system(3.0)
    step = 1e-5
    ahead, here, behind = (problem.at(state.x + d * direction).cost(3.0) for d in (step, 0.0, -step))
    assert gradient @ direction == pytest.approx((ahead - behind) / (2 * step), rel=1e-4)
    wide = 1e-3
    ahead, behind = (problem.at(state.x + d * direction).cost(3.0) for d in (wide, -wide))
    assert direction @ hessian @ direction == pytest.approx((ahead - 2 * here + behind) / wide**2, rel=0.1)


def test_fifty_samples_and_then_fifty_come_close_to_a_hundred(robot, real):
    samples, unseen = draw_samples(real, robot, 100, 10, 0.3), draw_samples(real, robot, 300, 11)
    first = calibrate(robot, samples.take(slice(0, 50)))
    second = calibrate(robot, samples.take(slice(50, None)), start=first.calibration)
    together = calibrate(robot, samples)
    half, split, whole = (median(robot, r.calibration, unseen) for r in (first, second, together))
    assert split < 0.9 * half and split == pytest.approx(whole, rel=0.15)
    ratio = np.diag(second.calibration.covariance) / np.diag(together.calibration.covariance)
    assert 0.7 < np.median(ratio) < 1.4


def test_going_on_needs_only_one_sample_and_moves_little(robot, real):
    samples, unseen = draw_samples(real, robot, 101, 10, 0.3), draw_samples(real, robot, 300, 11)
    first = calibrate(robot, samples.take(slice(0, 100))).calibration
    second = calibrate(robot, samples.take(slice(100, None)), start=first).calibration
    assert median(robot, second, unseen) == pytest.approx(median(robot, first, unseen), rel=0.2)


def test_given_priors_begin_anew_around_the_model(robot, real):
    samples = draw_samples(real, robot, 60, 10, 0.3)
    start = calibrate(robot, draw_samples(real, robot, 60, 12, 0.3)).calibration
    anew = calibrate(robot, samples, start=start, priors=Priors()).calibration
    fresh = calibrate(robot, samples).calibration
    for name in robot.gaze:
        assert anew.offsets[name] == pytest.approx(fresh.offsets[name], abs=1e-3)


def test_a_prior_of_zero_holds_a_group_where_it_is(robot, real):
    samples = draw_samples(real, robot, 60, 10, 0.3)
    held = Priors(links=0.0, focal=0.0, centre=0.0, radial=0.0, tangential=0.0)
    result = calibrate(robot, samples, priors=held).calibration
    assert result.cameras["left"] == CAMERA and not any(v.any() for v in result.links.values())
    assert result.offsets["neck"] != 0.0
    known = Calibration(robot.name, cameras={name: real.cameras[name].camera for name in robot.cameras})
    kept = calibrate(robot, samples, priors=held, start=known).calibration
    for name, camera in known.cameras.items():
        assert kept.cameras[name].fx == pytest.approx(camera.fx, rel=1e-12)
        np.testing.assert_allclose(kept.cameras[name].distortion, camera.distortion, atol=1e-12)
    later = calibrate(robot, samples, start=kept).calibration
    assert later.cameras["left"].fx == pytest.approx(known.cameras["left"].fx, rel=1e-12)


def test_a_tighter_prior_gives_smaller_corrections(robot, real):
    samples = draw_samples(real, robot, 40, 10, 0.3)

    def size(sigma):
        links = calibrate(robot, samples, priors=Priors(links=sigma)).calibration.links
        return np.linalg.norm(np.ravel(list(links.values())))

    assert 0.0 < size(0.0005) < 0.5 * size(0.005)


def test_the_covariance_says_how_far_the_truth_is(robot, tmp_path_factory):
    """Errors drawn from the prior, in units of the standard deviations found: about standard normal."""
    parameters, rng, deviations = Parameters(robot), np.random.default_rng(7), []
    for k in range(12):
        truth = parameters.sigmas(Priors()) * rng.normal(size=parameters.size) * 0.6
        errors_ = replace(parameters.unpack(truth, Calibration(robot.name)), hand=np.zeros((1, 3)))
        real = build(robot, errors_, tmp_path_factory.mktemp("drawn"))
        priors = Priors(**{name: 0.6 * getattr(Priors(), name) for name in Priors.__dataclass_fields__})
        found = calibrate(robot, draw_samples(real, robot, 60, k, 0.3), priors=priors).calibration
        sigma = np.sqrt(np.diag(found.covariance))
        gaze = [
            i for i, name in enumerate(parameters.names) if name in ("neck offset", "left fx", "left_pan x")
        ]
        deviations.append(((parameters.pack(found) - truth) / sigma)[gaze])
    assert 0.6 < np.sqrt(np.mean(np.square(deviations))) < 1.5


def test_joints_that_never_moved_are_named_and_do_not_harm(robot, real):
    samples = draw_samples(real, robot, 4000, 10, 0.3)
    joints = samples.joints.copy()
    joints[:, 1] = 0.4  # the waist
    place = draw_samples(real, robot, 4000, 10).points
    projection = KinematicProjection(real)
    rows, labels = [], {"left": [], "right": []}
    for k, (q, point) in enumerate(zip(joints[:600], place, strict=False)):
        pixels, seen = projection.project(point[None], q), projection.visible(point[None], q)
        if seen["left"][0] or seen["right"][0]:
            rows.append(k)
            for name, uv in pixels.items():
                labels[name].append(uv[0] if seen[name][0] else [np.nan, np.nan])
    still = Samples(robot.gaze, joints[rows], {n: np.array(v) for n, v in labels.items()}, place[rows])
    assert len(still) > 100
    result = calibrate(robot, still.take(slice(0, 80)))
    assert result.constant == ("waist",)
    assert abs(result.calibration.offsets["waist"]) < 3 * Priors().offsets
    assert median(robot, result.calibration, still.take(slice(80, None))) < 0.3


def test_one_camera_s_samples_calibrate_that_camera(robot, real):
    samples = draw_samples(real, robot, 200, 10, 0.3)
    left = Samples(robot.gaze, samples.joints, {"left": samples.pixels["left"]}, samples.points)
    result = calibrate(robot, left)
    assert list(result.used) == ["left"] and result.used["left"] == samples.seen("left").sum()
    unseen = draw_samples(real, robot, 300, 11)
    only = Samples(robot.gaze, unseen.joints, {"left": unseen.pixels["left"]}, unseen.points)
    assert median(robot, result.calibration, only) < 0.3
    assert result.calibration.cameras["right"] == CAMERA


def test_joints_may_come_in_any_order_with_others_among_them(robot, real):
    samples = draw_samples(real, robot, 60, 10, 0.3)
    shuffled = Samples(
        ("tail", *reversed(robot.gaze)),
        np.column_stack([np.arange(60.0), samples.joints[:, ::-1]]),
        samples.pixels,
        samples.points,
    )
    one, other = calibrate(robot, samples).calibration, calibrate(robot, shuffled).calibration
    assert one.offsets == other.offsets


def test_the_user_s_samples_stay_as_they_are(robot, real):
    samples = draw_samples(real, robot, 30, 10, 0.3)
    before = samples.joints.copy(), samples.pixels["left"].copy(), samples.points.copy()
    calibrate(robot, samples)
    for old, new in zip(before, (samples.joints, samples.pixels["left"], samples.points), strict=True):
        np.testing.assert_array_equal(old, new)


def test_adapt_gives_a_new_projection_that_remembers_through_a_file(robot, real, tmp_path):
    samples, unseen = draw_samples(real, robot, 100, 10, 0.3), draw_samples(real, robot, 300, 11)
    plain = KinematicProjection(robot)
    first = plain.adapt(samples.take(slice(0, 50)))
    assert plain.calibration.offsets == {}
    first.save(tmp_path / "first.model")
    loaded = KinematicProjection.load(tmp_path / "first.model", robot)
    again, direct = (p.adapt(samples.take(slice(50, None))) for p in (loaded, first))
    assert again.calibration.offsets == direct.calibration.offsets
    assert median(robot, again.calibration, unseen) < 0.9 * median(robot, first.calibration, unseen)
    other = first.adapt(samples.take(slice(50, None)), priors=Priors(links=0.0))
    for name, shift in other.calibration.links.items():
        np.testing.assert_allclose(shift, first.calibration.links[name], atol=1e-15)


def test_too_few_samples_are_refused_with_the_number_that_is_needed(robot, real):
    samples = draw_samples(real, robot, 9, 10)
    with pytest.raises(ArgumentError, match="samples: at least 10 in view are needed, got 9"):
        calibrate(robot, samples)
    with pytest.raises(ArgumentError, match="at least 10 in view are needed, got 0"):
        calibrate(robot, samples.take(slice(0, 0)))


def test_samples_that_no_camera_saw_are_refused(robot, real):
    samples = draw_samples(real, robot, 30, 10)
    blind = {name: np.full_like(uv, np.nan) for name, uv in samples.pixels.items()}
    with pytest.raises(ArgumentError, match="samples: no camera saw the point in any of 30 samples"):
        calibrate(robot, Samples(samples.names, samples.joints, blind, samples.points))


def test_samples_of_another_robot_are_refused(robot, real):
    samples = draw_samples(real, robot, 30, 10)
    with pytest.raises(ArgumentError, match="samples: no joint 'neck'"):
        calibrate(robot, Samples(("a", "b", "c", "d"), samples.joints, samples.pixels, samples.points))
    with pytest.raises(ArgumentError, match="samples: no joint 'shoulder'"):
        calibrate(robot, Samples(samples.names, samples.joints, samples.pixels))
    top = {"top": samples.pixels["left"]}
    with pytest.raises(ArgumentError, match="samples: no camera 'top'; there are left, right"):
        calibrate(robot, Samples(samples.names, samples.joints, top, samples.points))
    with pytest.raises(ArgumentTypeError, match="samples: expected Samples, got dict"):
        calibrate(robot, {})


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"noise": 0.0}, ArgumentError, "noise"),
        ({"noise": np.nan}, ArgumentError, "noise"),
        ({"iterations": 0}, ArgumentError, "iterations"),
        ({"start": Calibration("iCub")}, ArgumentError, "robot 'small', got one of 'iCub'"),
        ({"start": Calibration("small", hand=np.zeros((2, 3)))}, ArgumentError, "start: .*has 2"),
        ({"start": Calibration("small", links={"plate": np.ones(3)})}, ArgumentError, "start: joint 'plate'"),
        ({"start": Calibration("small", covariance=np.eye(3))}, ArgumentError, "start: .*covariance of"),
    ],
)
def test_wrong_arguments_are_errors_that_name_them(robot, real, change, error, words):
    with pytest.raises(error, match=words):
        calibrate(robot, draw_samples(real, robot, 20, 10), **change)


def test_a_tilted_sensor_is_refused(robot, real):
    tilted = replace(CAMERA, distortion=(0.0,) * 12 + (0.01, 0.0))
    seeing = replace(robot, cameras={n: replace(m, camera=tilted) for n, m in robot.cameras.items()})
    with pytest.raises(ArgumentError, match="camera 'left' has a tilted sensor"):
        calibrate(seeing, draw_samples(real, robot, 20, 10))


def test_a_few_iterations_are_reported_as_not_converged(robot, real):
    result = calibrate(robot, draw_samples(real, robot, 60, 10, 0.3), iterations=2)
    assert result.iterations == 2 and not result.converged


def test_a_start_far_off_comes_back(robot, real):
    """Twice the errors, in the wrong direction: many points start behind the cameras' images."""
    errors_ = draw_errors(robot, 0)
    start = Calibration(robot.name, {name: -2.0 * value for name, value in errors_.offsets.items()})
    result = calibrate(robot, draw_samples(real, robot, 100, 10, 0.3), start=start)
    assert result.converged
    assert median(robot, result.calibration, draw_samples(real, robot, 300, 11)) < 0.3


@sim
@pytest.mark.parametrize("arm", [False, True])
def test_the_icub_is_calibrated_by_a_hundred_samples(icub, tmp_path, arm):
    real = perturb(icub, 3, tmp_path, arm=arm)
    result = calibrate(icub, draw_samples(real, icub, 100, 10, 0.3, arm=arm))
    unseen = draw_samples(real, icub, 300, 11, arm=arm)
    assert median(icub, Calibration(icub.name), unseen) > 5.0
    assert median(icub, result.calibration, unseen) < 0.3
