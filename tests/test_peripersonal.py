"""The reachable space and its Gaussian in the image (Eq. 2, 3)."""

from __future__ import annotations

import numpy as np
import pytest

from motorprime import KinematicProjection, PinholeProjection, ReachCloud, fit_gaussian, fit_peripersonal
from motorprime.errors import ArgumentError, ArgumentTypeError, NotInViewError, StateError
from motorprime.peripersonal import moments
from small_robot import PALM_FRAME, reference_pose, small_robot

sim = pytest.mark.sim
SHAPE = (240, 320)


def blob(count=2000, mean=(150.0, 130.0), cov=((900.0, -420.0), (-420.0, 500.0)), seed=0):
    """Pixels whose sample mean and covariance are exactly these: whitened and coloured again."""
    white = np.random.default_rng(seed).normal(size=(count, 2))
    white -= white.mean(axis=0)
    white = white @ np.linalg.inv(np.linalg.cholesky(white.T @ white / (count - 1))).T
    return white @ np.linalg.cholesky(np.array(cov)).T + mean


@pytest.mark.parametrize("slope", [-1.0, 1.0])
def test_the_fit_is_the_sample_mean_and_the_lower_cholesky_factor(slope):
    """L = [[L1, 0], [L2, L3]] with L L^T the covariance: L2 has the sign of the slope, v down."""
    cov = np.array([[900.0, 420.0 * slope], [420.0 * slope, 500.0]])
    fit = fit_gaussian(blob(cov=cov), np.full(2000, 0.4), SHAPE)
    l1, l2, l3 = fit.chol
    np.testing.assert_allclose(fit.mean, (150.0, 130.0), atol=1e-9)
    # By hand: L1 = sqrt(900), L2 = cov / L1, L3 = sqrt(500 - L2^2).
    np.testing.assert_allclose((l1, l2, l3), (30.0, 14.0 * slope, np.sqrt(500 - 14.0**2)), rtol=1e-5)
    factor = np.array([[l1, 0], [l2, l3]])
    np.testing.assert_allclose(factor @ factor.T, cov, atol=1e-3)


def test_points_nearer_than_5_cm_are_left_out():
    near = np.array([[10.0, 10.0]] * 300)
    pixels = np.vstack([blob(), near])
    for depth in (0.05, 0.01, -0.4, np.nan):
        fit = fit_gaussian(pixels, np.r_[np.full(2000, 0.06), np.full(300, depth)], SHAPE)
        np.testing.assert_allclose(fit.mean, (150.0, 130.0), atol=1e-9)
    fit = fit_gaussian(pixels, np.full(2300, 0.0501), SHAPE)
    assert fit.mean[0] < 140


def test_points_within_three_image_sizes_count_and_those_beyond_do_not():
    """Around the centre (159.5, 119.5): u from -320.5 to 639.5, v from -240.5 to 479.5."""
    base = blob(mean=(159.5, 119.5), cov=((4.0, 0.0), (0.0, 4.0)))
    depths = np.full(2001, 0.4)
    for inside, outside in (
        ((639.4, 119.5), (639.6, 119.5)),
        ((-320.4, 119.5), (-320.6, 119.5)),
        ((159.5, 479.4), (159.5, 479.6)),
        ((159.5, -240.4), (159.5, -240.6)),
    ):
        moved = fit_gaussian(np.vstack([base, [inside]]), depths, SHAPE).mean
        assert np.abs(moved - (159.5, 119.5)).max() > 0.1
        still = fit_gaussian(np.vstack([base, [outside]]), depths, SHAPE)
        np.testing.assert_allclose(still.mean, (159.5, 119.5), atol=1e-9)
        assert still.inside == 2000


@pytest.mark.parametrize(("u", "v"), [(-0.5, 0.0), (319.5, 239.5), (100.0, -0.49), (0.0, 239.5)])
def test_the_image_reaches_half_a_pixel_beyond_its_outer_centres(u, v):
    """Pixel centres are integers, so the image covers -0.5 .. W - 0.5."""
    rng = np.random.default_rng(1)
    corner = np.array([u, v])
    outward = np.sign(corner - (159.5, 119.5))
    pixels = corner - rng.uniform(0.0, 0.4, (49, 2)) * outward
    depths = np.full(50, 0.4)
    assert fit_gaussian(np.vstack([pixels, [corner]]), depths, SHAPE).inside == 50
    beyond = np.where(
        np.abs(corner - (159.5, 119.5)) * 2 >= (320, 240), corner + 0.02 * outward, (159.5, -0.6)
    )
    with pytest.raises(NotInViewError, match="49 of 50"):
        fit_gaussian(np.vstack([pixels, [beyond]]), depths, SHAPE)


def test_fewer_than_50_points_inside_is_not_in_view_and_the_message_says_so():
    pixels = np.vstack([blob(49, cov=((9.0, 0.0), (0.0, 9.0))), np.full((500, 2), 400.0)])
    with pytest.raises(NotInViewError) as caught:
        fit_gaussian(pixels, np.full(549, 0.4), SHAPE, camera="left")
    for words in ("not in view", "camera 'left'", "49 of 549", "50"):
        assert words in str(caught.value)


def test_nan_and_infinite_rows_are_dropped_and_nothing_is_changed():
    pixels = blob(200)
    holes = np.vstack([pixels, [[np.nan, np.nan], [np.inf, 3.0], [4.0, -np.inf]]])
    kept = holes.copy()
    fit = fit_gaussian(holes, np.full(203, 0.4), SHAPE)
    np.testing.assert_allclose(fit.mean, (150.0, 130.0), atol=1e-9)
    np.testing.assert_array_equal(holes, kept)


def test_a_cloud_on_one_pixel_still_gives_a_factor_that_a_landscape_takes():
    fit = fit_gaussian(np.full((80, 2), 33.0), np.full(80, 0.4), SHAPE)
    assert fit.chol[0] > 0 and fit.chol[2] > 0


@pytest.mark.parametrize(
    ("pixels", "depths", "shape", "name", "error"),
    [
        (np.zeros((2, 60)), np.ones(60), SHAPE, "pixels", ArgumentError),
        (np.zeros((60, 3)), np.ones(60), SHAPE, "pixels", ArgumentError),
        (np.zeros(60), np.ones(60), SHAPE, "pixels", ArgumentError),
        (np.zeros((60, 2)), np.ones(59), SHAPE, "depths", ArgumentError),
        (np.zeros((60, 2)), np.ones((60, 1)), SHAPE, "depths", ArgumentError),
        (np.zeros((60, 2)), "deep", SHAPE, "depths", ArgumentTypeError),
        (np.zeros((60, 2)), np.ones(60), (0, 320), "shape", ArgumentError),
        (np.zeros((60, 2)), np.ones(60), (240, 320, 3), "shape", ArgumentError),
        (np.zeros((60, 2)), np.ones(60), (240.0, 320.0), "shape", ArgumentTypeError),
    ],
)
def test_arrays_that_do_not_belong_together_are_named(pixels, depths, shape, name, error):
    with pytest.raises(error, match=name):
        fit_gaussian(pixels, depths, shape)


# The cloud.


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    return small_robot(tmp_path_factory.mktemp("robot"))


def test_the_cloud_holds_the_palm_s_places_of_postures_uniform_within_the_limits(robot):
    """Against the same draw through the second kinematics, in the chest's frame."""
    cloud = ReachCloud(robot, size=60, seed=4)
    draws = np.random.default_rng(4).uniform((-2.0, 0.2), (0.5, 2.0), (60, 2))
    for point, (shoulder, elbow) in zip(cloud.points, draws, strict=True):
        pose = reference_pose("chest", "hand", {"shoulder": shoulder, "elbow": elbow}) @ PALM_FRAME
        np.testing.assert_allclose(point, pose[:3, 3], atol=1e-9)


def test_the_torso_carries_the_cloud_and_the_neck_does_not(robot):
    cloud = ReachCloud(robot, size=50)
    chest = reference_pose("base", "chest", {"waist": 0.7})
    expected = cloud.points @ chest[:3, :3].T + chest[:3, 3]
    np.testing.assert_allclose(cloud.in_root([0.0, 0.7, 0.0, 0.0]), expected, atol=1e-9)
    np.testing.assert_allclose(cloud.in_root([0.5, 0.7, 0.3, 0.2]), expected, atol=1e-9)


def test_the_same_seed_gives_the_same_cloud_and_a_generator_advances(robot):
    one, two = ReachCloud(robot, size=50, seed=3), ReachCloud(robot, size=50, seed=3)
    np.testing.assert_array_equal(one.points, two.points)
    generator = np.random.default_rng(3)
    np.testing.assert_array_equal(ReachCloud(robot, size=50, seed=generator).points, one.points)
    assert not np.array_equal(ReachCloud(robot, size=50, seed=generator).points, one.points)


@pytest.mark.parametrize(
    ("arguments", "name", "error"),
    [
        ({"size": 49}, "size", ArgumentError),
        ({"size": 60.0}, "size", ArgumentTypeError),
        ({"size": "60"}, "size", ArgumentTypeError),
        ({"seed": -1}, "seed", ArgumentError),
        ({"seed": "one"}, "seed", ArgumentTypeError),
    ],
)
def test_a_cloud_of_wrong_size_or_seed_names_it(robot, arguments, name, error):
    with pytest.raises(error, match=name):
        ReachCloud(robot, **arguments)


def test_a_cloud_needs_a_urdf_and_a_whole_posture(robot):
    with pytest.raises(StateError, match="with_urdf"):
        ReachCloud(small_robot())
    with pytest.raises(ArgumentError, match="joints"):
        ReachCloud(robot, size=50).in_root(np.zeros(3))


class Standing(ReachCloud):
    """A cloud of given points, whatever the posture."""

    def __init__(self, points) -> None:
        self.points = points

    def in_root(self, joints):
        return self.points


def looking(*, away=False, shift=0.0):
    """(3, 4) matrix of a camera at (shift, 0, 0) that looks along z, or the other way."""
    k = np.array([[250.0, 0, 160], [0, 250.0, 120], [0, 0, 1]])
    rotation = np.diag([-1.0, 1.0, -1.0]) if away else np.eye(3)
    return k @ np.column_stack([rotation, -rotation @ (shift, 0, 0)])


def test_only_the_camera_that_has_the_space_in_view_gets_a_gaussian():
    points = np.random.default_rng(2).normal((0.02, -0.01, 0.5), (0.04, 0.02, 0.02), (400, 3))
    projection = PinholeProjection({"front": looking(), "back": looking(away=True)}, SHAPE)
    fits = fit_peripersonal(Standing(points), projection, None)
    assert list(fits) == ["front"]
    expected = 250.0 * points[:, :2] / points[:, 2:] + (160, 120)
    np.testing.assert_allclose(fits["front"].mean, expected.mean(axis=0), atol=1e-9)
    assert fits["front"].inside == 400


def test_in_no_camera_s_view_the_message_gives_every_camera_s_reason():
    points = np.full((100, 3), (0.0, 0.0, -0.5))
    projection = PinholeProjection({"one": looking(), "two": looking(shift=0.1)}, SHAPE)
    with pytest.raises(NotInViewError, match=r"camera 'one'.*; .*camera 'two'"):
        fit_peripersonal(Standing(points), projection, None)


@sim
def test_the_icub_s_torso_moves_its_reach_cloud(icub, cloud):
    """A turn about the torso's yaw axis, which is upright at zero, keeps heights and turns by that angle."""
    turned = np.zeros(9)
    turned[icub.gaze.index("torso_yaw")] = 0.3
    before, after = cloud.in_root(np.zeros(9)), cloud.in_root(turned)
    np.testing.assert_allclose(after[:, 2], before[:, 2], atol=1e-3)
    centred = [cloud - cloud.mean(axis=0) for cloud in (before, after)]
    angles = [np.arctan2(points[:, 1], points[:, 0]) for points in centred]
    change = np.angle(np.exp(1j * (angles[1] - angles[0])))
    np.testing.assert_allclose(np.abs(np.median(change)), 0.3, atol=2e-3)
    looked = np.zeros(9)
    looked[[icub.gaze.index("neck_yaw"), icub.gaze.index("eyes_tilt")]] = 0.3
    np.testing.assert_allclose(cloud.in_root(looked), before, atol=1e-12)


@sim
def test_the_icub_that_looks_down_has_its_reach_in_view_and_looking_up_has_not(icub, cloud):
    projection = KinematicProjection(icub)
    down, up = np.zeros(9), np.zeros(9)
    down[[3, 6, 8]] = np.deg2rad((-35.0, -15.0, 10.0))
    up[[3, 6]] = np.deg2rad((22.0, 30.0))
    fits = fit_peripersonal(cloud, projection, down)
    assert set(fits) == {"left", "right"}
    for fit in fits.values():
        assert fit.inside > 400 and np.hypot(fit.chol[1], fit.chol[2]) < 240 and fit.chol[0] < 320
    # Near things appear further left in the right eye.
    assert fits["right"].mean[0] < fits["left"].mean[0] - 10
    with pytest.raises(NotInViewError, match="look elsewhere"):
        fit_peripersonal(cloud, projection, up)


# A tool in the hand, and babbling that was stored.

STICK = np.eye(4)
STICK[:3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
STICK[0, 3] = 0.2


def test_a_stick_s_cloud_is_the_palm_s_moved_along_each_posture_s_fingers(robot):
    """Its tip is 20 cm along the palm's x axis, whichever way the palm points, so it reaches farther."""
    palm, tip = (ReachCloud(robot, size=60, seed=4, tool=tool).points for tool in (None, STICK))
    draws = np.random.default_rng(4).uniform((-2.0, 0.2), (0.5, 2.0), (60, 2))
    for before, after, (shoulder, elbow) in zip(palm, tip, draws, strict=True):
        pose = reference_pose("chest", "hand", {"shoulder": shoulder, "elbow": elbow}) @ PALM_FRAME
        np.testing.assert_allclose(after, before + 0.2 * pose[:3, 0], atol=1e-9)
    shoulder = reference_pose("chest", "upper", {})[:3, 3]
    assert np.linalg.norm(tip - shoulder, axis=1).max() > np.linalg.norm(palm - shoulder, axis=1).max() + 0.15


def test_no_tool_is_a_tool_of_no_length(robot):
    np.testing.assert_allclose(
        ReachCloud(robot, size=60, tool=np.eye(4)).points, ReachCloud(robot, size=60).points, atol=1e-15
    )


@pytest.mark.parametrize(
    ("tool", "error"),
    [
        (np.eye(3), ArgumentError),
        (np.full((4, 4), np.nan), ArgumentError),
        (2.0 * np.eye(4), ArgumentError),
        (np.diag([1.0, 1.0, -1.0, 1.0]), ArgumentError),
        (np.eye(4) + np.eye(4)[[3, 0, 1, 2]] * 0.2, ArgumentError),
        (STICK.T, ArgumentError),
        ("stick", ArgumentTypeError),
    ],
)
def test_a_tool_that_is_no_rigid_motion_is_named(robot, tool, error):
    with pytest.raises(error, match="tool"):
        ReachCloud(robot, size=60, tool=tool)


def test_a_cloud_of_stored_babbling_holds_its_own_copy_and_moves_with_the_torso(robot):
    points = ReachCloud(robot, size=60, seed=9).points
    cloud = ReachCloud.from_points(robot, points)
    posture = [0.1, 0.7, 0.0, 0.2]
    expected = ReachCloud(robot, size=60, seed=9).in_root(posture)
    points[:] = 0.0
    np.testing.assert_array_equal(cloud.in_root(posture), expected)


@pytest.mark.parametrize(
    ("points", "error"),
    [
        (np.zeros((49, 3)), ArgumentError),
        (np.zeros((3, 60)), ArgumentError),
        (np.full((60, 3), np.inf), ArgumentError),
        (np.full((60, 3), np.nan), ArgumentError),
        ([["a", "b", "c"]] * 60, ArgumentTypeError),
    ],
)
def test_stored_babbling_that_is_no_cloud_is_named(robot, points, error):
    with pytest.raises(error, match="points"):
        ReachCloud.from_points(robot, points)


# Projections that know of no depths, and many clouds at once.


class Depthless(PinholeProjection):
    """Pixels without depths, as a learned projection gives them: NaN where it sees nothing."""

    def depths(self, points, joints=None):
        raise StateError("no depths here")


def test_without_depths_the_points_that_have_pixels_are_fitted():
    points = np.random.default_rng(2).normal((0.02, -0.01, 0.5), (0.04, 0.02, 0.02), (400, 3))
    points[:100, 2] = -0.5
    cameras = {"front": looking(), "back": looking(away=True, shift=9.0)}
    without = fit_peripersonal(Standing(points), Depthless(cameras, SHAPE), None)
    assert list(without) == ["front"]
    known = fit_peripersonal(Standing(points), PinholeProjection(cameras, SHAPE), None)
    np.testing.assert_array_equal(without["front"].mean, known["front"].mean)
    np.testing.assert_array_equal(without["front"].chol, known["front"].chol)
    assert without["front"].inside == 300


def test_many_clouds_at_once_are_fitted_as_one_by_one():
    rng = np.random.default_rng(6)
    pixels = rng.normal((150.0, 100.0), (200.0, 150.0), (3, 5, 200, 2))
    pixels[0, 0, :90] = np.nan
    depths = rng.uniform(0.0, 0.4, (3, 5, 200))
    means, chols, inside = moments(pixels, depths, SHAPE)
    assert means.shape == (3, 5, 2) and chols.shape == (3, 5, 3) and inside.shape == (3, 5)
    for at in np.ndindex(3, 5):
        one = fit_gaussian(pixels[at], depths[at], SHAPE) if inside[at] >= 50 else None
        offset = np.abs(pixels[at] - (159.5, 119.5)) <= (480.0, 360.0)
        kept = pixels[at][offset.all(axis=1) & (depths[at] > 0.05)]
        factor = np.linalg.cholesky(np.cov(kept.T))
        np.testing.assert_allclose(means[at], kept.mean(axis=0), atol=1e-9)
        np.testing.assert_allclose(chols[at], factor[[0, 1, 1], [0, 0, 1]], rtol=1e-6)
        if one is not None:
            np.testing.assert_allclose(one.mean, means[at], atol=1e-9)
            assert one.inside == inside[at]


def test_a_cloud_on_one_pixel_far_from_a_huge_image_s_centre_still_gives_a_factor():
    """Rounding must not make a variance of nothing negative, neither across nor along."""
    for place in np.random.default_rng(0).uniform(1000.0, 5000.0, (50, 2)):
        pixels = np.tile(place, (4000, 1))
        fit = fit_gaussian(pixels, None, (30000, 30000))
        assert np.isfinite(fit.chol).all() and fit.chol[0] > 0 and fit.chol[2] > 0


def test_points_too_near_do_not_count_as_inside_either():
    fit = fit_gaussian(blob(300), np.r_[np.full(100, 0.04), np.full(200, 0.4)], (2000, 2000))
    assert fit.inside == 200


def test_no_point_that_counts_gives_nan_and_none_inside():
    means, chols, inside = moments(np.full((2, 60, 2), np.nan), None, SHAPE)
    assert np.isnan(means).all() and np.isnan(chols).all() and not inside.any()
