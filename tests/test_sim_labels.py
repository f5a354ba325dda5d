"""A bottle and boxes with printed labels in the simulator, and the robot that finds the bottle by reading."""

from __future__ import annotations

import numpy as np
import pytest

import motorprime as mp
from motorprime.evaluate import text_model
from motorprime.sim.cameras import Eyes
from motorprime.sim.glass import Glass
from motorprime.sim.labels import BOTTLE, BOXES, print_word, stand_labelled
from motorprime.sim.meshes import write_wrapped
from motorprime.sim.scene import TABLE_HEIGHT, Layout, Scene
from motorprime.sim.world import World
from motorprime.tasks.label import find_label
from motorprime.views import Views

pytestmark = pytest.mark.sim

SPOTS = ((-0.45, 0.2), (-0.4, -0.15), (-0.5, 0.0))


def read_obj(path):
    vertices, textures, normals, faces = [], [], [], []
    for line in path.read_text().splitlines():
        kind, *numbers = line.split()
        if kind == "f":
            corners = [tuple(map(int, corner.split("/"))) for corner in numbers]
            assert all(len(set(corner)) == 1 for corner in corners)
            faces.append([corner[0] - 1 for corner in corners])
        else:
            {"v": vertices, "vt": textures, "vn": normals}[kind].append(list(map(float, numbers)))
    return np.array(vertices), np.array(textures), np.array(normals), np.array(faces)


@pytest.mark.parametrize("sides", [4, 48])
def test_a_wrapped_mesh_is_closed_faces_outwards_and_has_the_picture_s_middle_in_front(tmp_path, sides):
    path = write_wrapped(tmp_path / "m.obj", ((0.03, 0.0), (0.03, 0.1), (0.01, 0.15)), sides=sides)
    vertices, textures, normals, faces = read_obj(path)
    corners = vertices[faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", outward, normals[faces].mean(axis=1)) > 0).all()
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    area = sides / 2 * np.sin(2 * np.pi / sides)  # of a polygon in a circle of radius 1
    shape = 0.1 * 0.03**2 + 0.05 / 3 * (0.03**2 + 0.03 * 0.01 + 0.01**2)
    assert volume == pytest.approx(area * shape, rel=1e-4)
    assert textures.min() >= 0 and textures.max() <= 1
    sides_only = np.abs(normals[:, 2]) < 0.5
    front = sides_only & (vertices[:, 0] > 0) & (np.abs(vertices[:, 1]) < 0.9 * vertices[:, 0] + 1e-6)
    np.testing.assert_allclose(
        textures[front, 0], 0.5 + np.arctan2(vertices[front, 1], vertices[front, 0]) / (2 * np.pi), atol=1e-5
    )
    np.testing.assert_allclose(textures[sides_only, 1], vertices[sides_only, 2] / 0.15, atol=1e-5)


@pytest.mark.parametrize("thing", [BOTTLE, *BOXES], ids=lambda thing: thing.word)
def test_a_label_fits_on_the_front_and_is_not_stretched(thing):
    picture = thing.picture()
    paper = (picture == (245, 244, 238)).all(axis=2)
    rows, columns = np.flatnonzero(paper.any(axis=1)), np.flatnonzero(paper.any(axis=0))
    wide, tall = columns[-1] - columns[0] + 1, rows[-1] - rows[0] + 1
    assert wide < picture.shape[1] / 4  # a side of a box
    assert (columns[0] + columns[-1]) / 2 == pytest.approx(picture.shape[1] / 2, abs=2)
    side = 4 * np.sqrt(2) * thing.radius
    label = print_word(thing.word)
    metres = (tall / picture.shape[0] * thing.height) / (wide / picture.shape[1] * side)
    assert metres == pytest.approx(label.shape[0] / label.shape[1], rel=0.05)


@pytest.fixture(scope="module")
def reader():
    if not (text_model.PLACE.is_file() and text_model.READER.is_file()):
        pytest.skip(f"text detector and reader were not fetched: {text_model.HINT}")
    pytest.importorskip("onnxruntime")
    from motorprime.detectors.reading import ReadText

    return ReadText(text_model.text_detector(), text_model.text_reader())


def test_the_robot_finds_the_bottle_by_its_label_where_it_attends(icub, reader, tmp_path):
    robot = icub.with_image_size(640, 480)
    attention = mp.Attention(mp.KinematicProjection(robot), cloud=mp.ReachCloud(robot))
    found = 0
    for seed in range(3):
        rng = np.random.default_rng(seed)
        at = (rng.uniform(-0.34, -0.28), rng.uniform(0.02, 0.12))
        with World(robot) as world:
            scene = Scene(world, Layout(Glass(), (-0.3, 0.3), textures=seed))
            scene.remove_glass()
            for thing, spot in zip((BOTTLE, *BOXES), (at, *SPOTS), strict=True):
                stand_labelled(world, tmp_path, thing, spot)
            world.step(60)
            world.place({"neck_pitch": -0.5, "eyes_tilt": -0.3, "neck_yaw": 0.1})
            frames, joints = Eyes(world, noise=2.0, seed=seed).capture(), world.gaze()
            scene.close()
        images = {camera: frame.rgb for camera, frame in frames.items()}
        looks = attention.peripersonal(joints)
        where = {camera: looks[camera].mask(fraction=0.5) for camera in images}
        views = Views(attention.projection, joints)
        front = np.array(
            [at[0] + BOTTLE.radius / np.sqrt(2), at[1], TABLE_HEIGHT + BOTTLE.level * BOTTLE.height]
        )
        label = find_label(BOTTLE.word, images, where, reader, views)
        assert find_label("COLA", images, where, reader, views) is None
        if label is not None:
            assert np.linalg.norm(label.place - front) < 0.02
            found += 1
    assert found >= 2
