"""Babbling with the simulated robot: a sample depends on its seed and number, and its labels are right."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import cv2
import numpy as np
import pytest

from motorprime import ArgumentError, KinematicProjection
from motorprime.camera import PosedCamera, sphere_outline_centre
from motorprime.detectors.marker import find_ball
from motorprime.learning.babbling import ArmBabble, babble
from motorprime.learning.manifest import robot_fingerprint
from motorprime.learning.postures import Postures
from motorprime.learning.store import Store
from motorprime.robot import CameraMount
from motorprime.sim.ball import LIGHTS, BallStudio
from motorprime.sim.cameras import render
from motorprime.tasks.babble import GazeBabble, MarkerBabble
from motorprime.tasks.studio import close_studio, studio

pytestmark = pytest.mark.sim

BARREL = (-0.25, 0.08, 0.001, -0.002)


@pytest.fixture(autouse=True, scope="module")
def _closed_in_the_end():
    yield
    close_studio()


@pytest.fixture(scope="module")
def other(icub, tmp_path_factory):
    """The iCub as it might really be: another head and elbow, other optics, a bent lens in the left eye."""
    tree = ET.parse(icub.urdf)
    for mesh in tree.iter("mesh"):
        mesh.set("filename", str(icub.urdf.parent / mesh.get("filename")))
    for joint in tree.iter("joint"):
        if joint.get("name") in ("eyes_tilt", "r_elbow"):
            origin = joint.find("origin")
            x, y, z = map(float, origin.get("xyz").split())
            origin.set("xyz", f"{x + 0.006} {y - 0.009} {z + 0.005}")
    path = tmp_path_factory.mktemp("other") / "other.urdf"
    tree.write(path)
    left, right = icub.cameras["left"], icub.cameras["right"]
    cameras = {
        "left": CameraMount(left.link, replace(left.camera, fx=275.0, cx=172.0, distortion=BARREL)),
        "right": CameraMount(right.link, replace(right.camera, fy=245.0, cy=108.0)),
    }
    return replace(icub.with_urdf(path), cameras=cameras)


def labels(row, camera):
    return np.array([row[f"{camera}_u"], row[f"{camera}_v"]])


# What a sample is.


def test_a_sample_depends_on_its_seed_and_number_only(icub, other):
    """Not on what was rendered before, on another robot that was open meanwhile, or on a copy's age."""
    gaze, marker = GazeBabble(icub, noise=2.0), MarkerBabble(other, icub)
    for source in (gaze, marker):
        first = [source(3, i) for i in range(4)]
        gaze(9, 1), marker(9, 2)
        again = [replace(source)(3, i) for i in reversed(range(4))][::-1]
        for a, b in zip(first, again, strict=True):
            assert list(a) == list(b)
            assert all(np.array_equal(a[k], b[k]) or (a[k] != a[k] and b[k] != b[k]) for k in a)
        assert first[0] != source(4, 0) and first[0]["torso_yaw"] != first[1]["torso_yaw"]


def test_encoders_points_and_predictions_belong_together(icub):
    source, projection = GazeBabble(icub), KinematicProjection(icub)
    seen = 0
    for i in range(12):
        row, views = source.look(1, i)
        joints = np.array([row[name] for name in icub.gaze])
        limits = icub.limits(icub.gaze)
        assert (joints >= limits[:, 0] - 1e-9).all() and (joints <= limits[:, 1] + 1e-9).all()
        point = np.array([[row[axis] for axis in "xyz"]])
        for camera, view in projection.posed(joints).items():
            predicted = np.array([row[f"{camera}_predicted_u"], row[f"{camera}_predicted_v"]])
            if view.depth(point)[0] > 0.05:
                expected = sphere_outline_centre(view.camera, view.to_camera(point)[0], 0.015)
                assert np.allclose(predicted, expected, atol=1e-9)
            if row[f"{camera}_outcome"] == "seen":
                seen += 1
                assert np.abs(labels(row, camera) - predicted).max() < 0.3
                assert row[f"{camera}_pixels"] >= 30
            else:
                assert np.isnan(labels(row, camera)).all()
            assert (views[camera].picture is None) == (row[f"{camera}_outcome"] == "outside")
    assert seen > 12


def test_the_colour_finds_what_the_simulator_s_segmentation_knows(icub):
    source, checked = GazeBabble(icub), 0
    for i in range(10):
        _, views = source.look(2, i)
        with studio(source.fingerprint, icub, source.radius) as here:
            for camera, view in views.items():
                if view.sighting.outcome != "seen":
                    continue
                mount = icub.cameras[camera]
                frame = render(here.world.bullet, PosedCamera(mount.camera, here.world.link_pose(mount.link)))
                v, u = np.nonzero(frame.body == here.ball)
                assert len(u) == view.sighting.pixels
                assert np.allclose(view.sighting.centre, (u.mean(), v.mean()))
                checked += 1
    assert checked > 8


def test_near_has_the_ball_in_view_and_uniform_seldom(icub):
    found = {}
    for mode in ("near", "uniform"):
        rows = [GazeBabble(icub, mode=mode)(4, i) for i in range(40)]
        found[mode] = sum(row["left_outcome"] == "seen" or row["right_outcome"] == "seen" for row in rows)
    assert found["near"] > 30
    assert found["uniform"] < 15


def test_nothing_is_rendered_where_the_ball_is_well_outside(icub, monkeypatch):
    """And nothing is lost by it: a ball outside cannot be wholly in the picture."""
    asked = []
    usual = BallStudio.pictures
    monkeypatch.setattr(
        BallStudio,
        "pictures",
        lambda self, cameras, light: asked.extend(cameras) or usual(self, cameras, light),
    )
    rows = [GazeBabble(icub, mode="uniform")(6, i) for i in range(30)]
    rendered = [c for row in rows for c in ("left", "right") if row[f"{c}_outcome"] != "outside"]
    assert asked == rendered and len(asked) < 25


def test_the_noise_is_that_of_the_sensor(icub):
    clean, noisy = (GazeBabble(icub, noise=noise).look(7, 1)[1] for noise in (0.0, 5.0))
    cameras = [camera for camera, view in clean.items() if view.picture is not None]
    assert cameras
    for camera in cameras:
        a, b = (views[camera].picture.astype(float) for views in (clean, noisy))
        ball = (a[..., 1] - a[..., 0] > 40) & (a < 240).all(axis=2) & (a > 15).all(axis=2)
        assert 4.0 < (b - a)[ball].std() < 6.0
        assert np.abs(clean[camera].sighting.centre - noisy[camera].sighting.centre).max() < 0.2


# The marker on the hand of a robot that is not quite what is believed of it.


def test_the_marker_of_the_robot_itself_is_where_its_kinematics_say(icub):
    source, off = MarkerBabble(icub, icub), []
    for i in range(40):
        row = source(1, i)
        off += [
            np.abs(labels(row, c) - (row[f"{c}_predicted_u"], row[f"{c}_predicted_v"])).max()
            for c in icub.cameras
            if row[f"{c}_outcome"] == "seen"
        ]
    assert len(off) > 8
    assert np.median(off) < 0.1 and max(off) < 0.6


def test_the_marker_s_place_is_the_nominal_robot_s_and_its_pixels_the_moving_one_s(icub, other):
    source = MarkerBabble(other, icub)
    apart, exact = [], []
    for i in range(40):
        row = source(1, i)
        gaze, arm = (np.array([row[name] for name in names]) for names in (icub.gaze, icub.arm))
        torso_arm = [row[name] for name in icub.reach_chain.names]
        palm = icub.reach_chain.forward(torso_arm) @ icub.palm.frame
        assert np.allclose([row[axis] for axis in "xyz"], (palm @ (*source.offset, 1.0))[:3], atol=1e-9)
        hand = other.chest_chain.forward(gaze[:3][[icub.gaze.index(n) for n in other.chest_chain.names]])
        true = (hand @ other.arm_chain.forward(arm) @ other.palm.frame @ (*source.offset, 1.0))[None, :3]
        assert 0.005 < np.linalg.norm(true[0] - [row[axis] for axis in "xyz"]) < 0.02
        in_view = Postures(other, radius=source.radius).in_view(gaze, true[0])
        for camera, view in KinematicProjection(other).posed(gaze).items():
            assert (row[f"{camera}_outcome"] == "outside") == (not in_view[camera])
            if row[f"{camera}_outcome"] != "seen":
                continue
            exact.append(np.abs(labels(row, camera) - view.project(true)[0]).max())
            predicted = (row[f"{camera}_predicted_u"], row[f"{camera}_predicted_v"])
            apart.append(np.linalg.norm(labels(row, camera) - predicted))
    assert len(exact) > 8
    assert max(exact) < 1.2  # the outline's middle is up to a pixel off the centre's projection
    assert np.median(apart) > 5.0


def middle(outline):
    """Centre of gravity (2,) of the area within a closed polygon (N, 2)."""
    moments = cv2.moments(outline.astype(np.float32)[:, None])
    return np.array([moments["m10"], moments["m01"]]) / moments["m00"]


def test_the_bent_lens_bends_the_picture_as_the_camera_projects(other):
    """The ball in 30 places of the image: its centroid against the projection of points of its rim."""
    camera, link = other.cameras["left"].camera, other.cameras["left"].link
    plain = replace(camera, distortion=())
    generator, bent, off = np.random.default_rng(0), [], []
    with BallStudio(other, 0.015) as here:
        pose = here.world.link_pose(link)
        turn = np.linspace(0.0, 2.0 * np.pi, 200)[:, None]
        for _ in range(40):
            pixel = generator.uniform((25, 25), (295, 215))
            centre = 0.35 * camera.rays(pixel[None])[0]
            here.put((pose @ (*centre, 1.0))[:3])
            image = here.pictures(["left"], LIGHTS[0])["left"]
            found = find_ball(image, camera)
            if found.outcome != "seen":  # the bending leaves small balls a little ragged
                continue
            distance = np.linalg.norm(centre)
            axis, angle = centre / distance, np.arcsin(0.015 / distance)
            across = np.linalg.svd(axis[None])[2][1:]
            rim = np.cos(angle) * axis + np.sin(angle) * (np.cos(turn) * across[0] + np.sin(turn) * across[1])
            off.append(np.abs(found.centre - middle(camera.project(rim))).max())
            bent.append(np.linalg.norm(middle(camera.project(rim)) - middle(plain.project(rim))))
    assert len(off) > 30
    assert max(bent) > 10.0  # there is something to bend
    assert np.median(off) < 0.12 and max(off) < 0.4


def test_two_robots_of_different_form_are_an_error(icub):
    small = icub.with_image_size(160, 120)
    with pytest.raises(ArgumentError, match=r"nominal: images .* expected, got .*120, 160"):
        MarkerBabble(icub, small)
    with pytest.raises(ArgumentError, match=r"nominal: arm .* of the moving robot expected"):
        MarkerBabble(icub, replace(icub, arm=icub.arm[::-1]))


# Sources and stores.


def test_the_fingerprint_is_of_everything_that_makes_the_robot(icub, other, tmp_path):
    same = tmp_path / "same.urdf"
    same.write_bytes(icub.urdf.read_bytes())
    assert robot_fingerprint(icub.with_urdf(same)) == robot_fingerprint(icub)
    palm = replace(icub.palm, frame=icub.palm.frame + 1e-9)
    others = [
        other,
        replace(icub, cameras=other.cameras),
        icub.with_urdf(other.urdf),
        replace(icub, palm=palm),
        replace(icub, ranges={**icub.ranges, "eyes_tilt": (0.0, 0.1)}),
    ]
    prints = {robot_fingerprint(robot) for robot in (icub, *others)}
    assert len(prints) == 6
    with pytest.raises(ArgumentError, match="robot: cannot read its URDF"):
        robot_fingerprint(icub.with_urdf(tmp_path / "none.urdf"))


@pytest.mark.parametrize("kind", ["gaze", "marker", "arm"])
def test_every_kind_fits_its_manifest_and_comes_back_from_the_store(icub, kind, tmp_path):
    pytest.importorskip("duckdb")
    source = {"gaze": GazeBabble(icub), "marker": MarkerBabble(icub, icub), "arm": ArmBabble(icub)}[kind]
    store = Store.create(tmp_path, replace(source.manifest(8), chunk=5))
    babble(store, source, 12)
    assert (store.manifest.kind, len(store)) == (kind, 12)
    found = store.read()
    for i in range(12):
        for name, value in source(8, i).items():
            assert found[name][i] == value or np.isnan(value)
    if kind != "arm":
        samples = store.samples()
        assert samples.names == (icub.gaze if kind == "gaze" else icub.gaze + icub.arm)
        assert samples.cameras == ("left", "right") and samples.points.shape == (len(samples), 3)


def test_the_arm_s_samples_are_the_reach_cloud(icub):
    from motorprime import ReachCloud

    source = ArmBabble(icub)
    row = source(1, 5)
    palm = icub.arm_chain.forward([row[name] for name in icub.arm]) @ icub.palm.frame
    assert np.allclose([row[axis] for axis in "xyz"], palm[:3, 3], atol=1e-12)
    points = np.array([[source(1, i)[axis] for axis in "xyz"] for i in range(600)])
    cloud = ReachCloud(icub).points
    assert np.abs(points.mean(axis=0) - cloud.mean(axis=0)).max() < 0.02
    assert np.abs(points.std(axis=0) - cloud.std(axis=0)).max() < 0.02


def test_another_noise_mode_or_moving_robot_is_another_store(icub, other, tmp_path):
    pytest.importorskip("duckdb")
    Store.create(tmp_path / "gaze", GazeBabble(icub).manifest(1))
    for source, words in (
        (GazeBabble(icub, noise=1.0), r"settings\.noise"),
        (GazeBabble(icub, mode="uniform"), "mode 'near', asked for 'uniform'"),
        (GazeBabble(icub, radius=0.02), r"settings\.radius"),
        (GazeBabble(other), "another robot 'iCub'"),
    ):
        with pytest.raises(ArgumentError, match=words):
            Store.create(tmp_path / "gaze", source.manifest(1))
    Store.create(tmp_path / "marker", MarkerBabble(other, icub).manifest(1))
    with pytest.raises(ArgumentError, match=r"settings\.moving_robot"):
        Store.create(tmp_path / "marker", MarkerBabble(icub, icub).manifest(1))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"mode": "far"}, "mode: one of near, uniform expected, got 'far'"),
        ({"noise": -1.0}, "noise: a finite number of grey levels"),
        ({"noise": np.nan}, "noise: a finite number of grey levels"),
        ({"radius": 0.0}, "radius: expected a number > 0"),
    ],
)
def test_options_that_make_no_sense_are_errors(icub, options, words):
    with pytest.raises(ArgumentError, match=words):
        GazeBabble(icub, **options)
    with pytest.raises(ArgumentError, match=words):
        MarkerBabble(icub, icub, **options)
