"""The renderer's pixels are the Camera's pixels: places, depth, names, noise."""

import numpy as np
import pytest

from motorprime import ArgumentError, Camera, PosedCamera
from motorprime.camera import sphere_outline_centre
from motorprime.kinematics import rotation_from_rpy, transform
from motorprime.sim import cameras
from motorprime.sim.bystander import Bystander, looking_at
from motorprime.sim.cameras import FAR, Eyes, Light, render
from motorprime.sim.meshes import write_plane, write_sphere
from motorprime.sim.world import World, connect, pybullet

pytestmark = pytest.mark.sim

EYE = Camera(width=320, height=240, fx=257.34, fy=257.34, cx=160.0, cy=120.0)
RADIUS = 0.006


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """An empty world with one small bright ball: (client, ball)."""
    bullet = connect()
    mesh = write_sphere(tmp_path_factory.mktemp("ball") / "ball.obj", RADIUS)
    shape = bullet.createVisualShape(pybullet.GEOM_MESH, fileName=str(mesh), rgbaColor=[1, 1, 1, 1])
    yield bullet, int(bullet.createMultiBody(baseVisualShapeIndex=shape))
    bullet.disconnect()


@pytest.fixture(scope="module")
def world(icub):
    with World(icub) as world:
        yield world


def offset(bench, view, pixel, depth):
    """Where the ball is seen less where it should be: (2,) [px]."""
    bullet, ball = bench
    local = depth * view.camera.rays(np.array([pixel], dtype=float))[0]
    place = view.pose[:3, :3] @ local + view.pose[:3, 3]
    bullet.resetBasePositionAndOrientation(ball, list(place), (0, 0, 0, 1))
    rows, columns = np.nonzero(render(bullet, view).body == ball)
    assert len(rows) > 12
    return [columns.mean(), rows.mean()] - sphere_outline_centre(view.camera, local, RADIUS)


def offsets(bench, camera, pose):
    view = PosedCamera(camera, pose)
    width, height = camera.width, camera.height
    return np.array(
        [
            offset(bench, view, (u, v), depth)
            for u in (0.1 * width, 0.5 * width + 0.3, 0.9 * width)
            for v in (0.1 * height, 0.5 * height - 0.4, 0.9 * height)
            for depth in (0.15, 0.35)
        ]
    )


POSES = {
    "at the origin": np.eye(4),
    "anywhere": transform(rotation_from_rpy((0.4, -1.1, 2.0)), (0.3, -0.2, 0.5)),
}
CAMERAS = {
    "the iCub's": EYE,
    "off-centre": Camera(width=200, height=160, fx=240.0, fy=180.0, cx=80.2, cy=95.7),
    "odd": Camera(width=161, height=121, fx=150.0, fy=150.0, cx=80.0, cy=60.0),
}


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())
@pytest.mark.parametrize("pose", POSES.values(), ids=POSES.keys())
def test_a_ball_is_seen_where_the_camera_says(bench, camera, pose):
    errors = offsets(bench, camera, pose)
    assert np.abs(errors).max() < 0.3
    assert np.abs(errors.mean(axis=0)).max() < 0.06  # no bias in either axis


def test_the_textbook_matrix_would_fail_that(bench, monkeypatch):
    def textbook(camera):
        matrix = right(camera)
        matrix[9] = 2.0 * camera.cy / camera.height - 1.0
        return matrix

    right = cameras.projection_matrix
    monkeypatch.setattr(cameras, "projection_matrix", textbook)
    np.testing.assert_allclose(offsets(bench, EYE, np.eye(4)).mean(axis=0), [0, -1], atol=0.06)


@pytest.mark.parametrize("depth", [0.1, 0.4, 1.5])
def test_depth_is_planar_and_right_to_a_millimetre(bench, tmp_path, depth):
    bullet, _ = bench
    # A wall across the whole view, its far edge slanted away: z = depth + slope x.
    slope, half = 0.3, 1.2 * depth
    path = write_plane(
        tmp_path / "wall.obj",
        (-half, -half, depth - half * slope),
        (0, 2 * half, 0),
        (2 * half, 0, 2 * half * slope),
    )
    shape = bullet.createVisualShape(pybullet.GEOM_MESH, fileName=str(path))
    wall = bullet.createMultiBody(baseVisualShapeIndex=shape)
    try:
        frame = render(bullet, PosedCamera(EYE, np.eye(4)))
    finally:
        bullet.removeBody(wall)
    seen = frame.body == wall
    assert seen.mean() > 0.9
    rows, columns = np.nonzero(seen)
    x_over_z = (columns - EYE.cx) / EYE.fx
    expected = depth / (1.0 - slope * x_over_z)
    np.testing.assert_allclose(frame.depth[rows, columns], expected, atol=1e-3)


def test_nothing_is_far_away_and_has_no_name(bench):
    bullet, ball = bench
    bullet.resetBasePositionAndOrientation(ball, (0, 0, -5), (0, 0, 0, 1))
    frame = render(bullet, PosedCamera(EYE, np.eye(4)))
    assert (frame.body == -1).all()
    assert (frame.link == -1).all()
    np.testing.assert_allclose(frame.depth, FAR, rtol=1e-4)


@pytest.mark.parametrize("size", [(1, 1), (7, 5), (33, 64), (640, 480)])
def test_any_image_size(bench, size):
    bullet, ball = bench
    bullet.resetBasePositionAndOrientation(ball, (0, 0, 0.1), (0, 0, 0, 1))
    camera = Camera(
        width=size[0],
        height=size[1],
        fx=8.0 * size[0],
        fy=8.0 * size[0],
        cx=(size[0] - 1) / 2,
        cy=(size[1] - 1) / 2,
    )
    frame = render(bullet, PosedCamera(camera, np.eye(4)))
    assert frame.rgb.shape == (*camera.shape, 3)
    assert frame.rgb.flags.c_contiguous
    assert (frame.rgb.dtype, frame.depth.dtype) == (np.uint8, np.float32)
    assert (frame.body.dtype, frame.link.dtype) == (np.int32, np.int32)
    assert frame.depth.shape == frame.body.shape == frame.link.shape == camera.shape
    if size != (1, 1):  # the renderer leaves a single pixel empty
        assert frame.body[size[1] // 2, size[0] // 2] == ball


def test_a_distorted_camera_is_refused(bench):
    camera = Camera(
        width=320, height=240, fx=257.0, fy=257.0, cx=160.0, cy=120.0, distortion=(0.1, 0, 0, 0, 0)
    )
    with pytest.raises(ArgumentError, match="camera: the renderer has no lens distortion"):
        render(bench[0], PosedCamera(camera, np.eye(4)))


def test_colours_are_red_green_blue(bench):
    bullet, ball = bench
    bullet.resetBasePositionAndOrientation(ball, (0, 0, 0.05), (0, 0, 0, 1))
    bullet.changeVisualShape(ball, -1, rgbaColor=[0.9, 0.4, 0.1, 1])
    try:
        r, g, b = render(bullet, PosedCamera(EYE, np.eye(4))).rgb[120, 160].astype(int)
    finally:
        bullet.changeVisualShape(ball, -1, rgbaColor=[1, 1, 1, 1])
    assert r > 1.8 * g > 1.8 * 2 * b


def test_the_light_comes_from_where_it_is_said_to(bench):
    bullet, ball = bench
    bullet.resetBasePositionAndOrientation(ball, (0, 0, 0.05), (0, 0, 0, 1))
    rows = []
    for direction in ((0.0, -1.0, -0.2), (0.0, 1.0, -0.2)):  # from above and from below: v points down
        frame = render(
            bullet,
            PosedCamera(EYE, np.eye(4)),
            light=Light(direction, ambient=0.2, diffuse=0.8, specular=0.0),
        )
        weights = frame.rgb.sum(axis=2) * (frame.body == ball)
        rows.append((weights.sum(axis=1) * np.arange(240)).sum() / weights.sum())
    assert rows[0] < 120 - 1 < 120 + 1 < rows[1]


def test_looking_at_puts_the_target_in_the_middle_with_a_level_horizon():
    pose = looking_at((-0.9, 0.8, 0.5), (-0.2, 0.1, 0.1))
    view = PosedCamera(EYE, pose)
    np.testing.assert_allclose(view.project(np.array([[-0.2, 0.1, 0.1]]))[0], [160, 120], atol=1e-9)
    assert pose[2, 0] == pytest.approx(0.0)
    assert pose[2, 1] < 0.0  # the image's down is down
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)


# The robot's eyes.


def test_the_links_of_the_robot_have_their_names(world, icub):
    view = PosedCamera(
        EYE, looking_at(tuple(world.palm_pose()[:3, 3] + [-0.3, 0.1, 0.2]), tuple(palm(world)))
    )
    frame = render(world.bullet, view)
    u, v = np.rint(view.project(palm(world)[None])[0]).astype(int)
    assert frame.body[v, u] == world.body
    names = {index: name for name, index in world.link_index.items()}
    assert names[int(frame.link[v, u])].startswith("r_")
    robot = frame.body == world.body
    assert {int(k) for k in np.unique(frame.link[robot])} <= set(names)


def palm(world):
    return world.palm_pose()[:3, 3]


def test_the_views_are_the_eyes_links(world, icub):
    views = Eyes(world).views()
    assert list(views) == list(icub.cameras) == ["left", "right"]
    for name, view in views.items():
        np.testing.assert_array_equal(view.pose, world.link_pose(icub.cameras[name].link))
        assert view.camera == icub.cameras[name].camera


def test_the_eyes_never_see_the_head_around_them(world, icub, rng):
    limits = icub.limits(icub.gaze)
    eyes, head = Eyes(world), world.link_index["head"]
    for _ in range(12):
        world.place(dict(zip(icub.gaze, rng.uniform(limits[:, 0], limits[:, 1]), strict=True)))
        for frame in eyes.capture().values():
            assert not ((frame.body == world.body) & (frame.link == head)).any()
            assert frame.depth.min() > 0.04  # no splinters at the near plane


def test_a_bystander_sees_the_head_and_the_eyeballs_and_leaves_no_trace(world, icub):
    world.place(dict.fromkeys(icub.gaze, 0.0))
    eyes = Eyes(world)
    before = eyes.capture()
    bystander = Bystander(world, size=(160, 120))
    picture = bystander.capture()
    assert picture.shape == (120, 160, 3)
    frame = render(world.bullet, bystander.view)
    assert ((frame.body == world.body) & (frame.link == world.link_index["head"])).any()
    for name, frame in eyes.capture().items():
        np.testing.assert_array_equal(frame.rgb, before[name].rgb)


@pytest.fixture
def before_a_wall(world, icub, tmp_path):
    """The robot looks at a grey wall."""
    world.place(dict.fromkeys((*icub.gaze, *icub.arm), 0.0))
    mesh = write_plane(tmp_path / "wall.obj", (-0.6, -2.0, -2.0), (0, 4.0, 0), (0, 0, 4.0))
    shape = world.bullet.createVisualShape(
        pybullet.GEOM_MESH, fileName=str(mesh), rgbaColor=[0.5, 0.5, 0.5, 1]
    )
    wall = world.bullet.createMultiBody(baseVisualShapeIndex=shape)
    yield world
    world.bullet.removeBody(wall)


def frames(world, **options):
    eyes = Eyes(world, **options)
    return [eyes.capture()["left"] for _ in range(2)]


def test_noise_is_seeded_and_leaves_the_truth_alone(before_a_wall):
    world = before_a_wall
    clean = frames(world)
    first, again, other = (frames(world, noise=4.0, seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(clean[0].rgb, clean[1].rgb)
    for k in range(2):
        np.testing.assert_array_equal(first[k].rgb, again[k].rgb)
        for name in ("depth", "body", "link"):
            np.testing.assert_array_equal(getattr(first[k], name), getattr(clean[k], name))
    assert (first[0].rgb != first[1].rgb).any()
    assert (first[0].rgb != other[0].rgb).any()


def test_noise_has_the_strength_that_was_asked_for(before_a_wall):
    clean, noisy = (frames(before_a_wall, noise=noise, seed=1)[0].rgb for noise in (0.0, 4.0))
    middle = (clean > 30) & (clean < 225)
    assert middle.mean() > 0.5
    difference = noisy[middle].astype(float) - clean[middle]
    assert difference.std() == pytest.approx(4.0, rel=0.05)
    assert abs(difference.mean()) < 0.1


@pytest.mark.parametrize("noise", [-1.0, np.nan, np.inf])
def test_noise_that_makes_no_sense_is_refused(world, noise):
    with pytest.raises(ArgumentError, match="noise"):
        Eyes(world, noise=noise)
