"""Projections that networks learned: errors, view, inverse, adaptation, files."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from motorprime import attention_step
from motorprime.errors import ArgumentError, ArgumentTypeError, StateError
from motorprime.learning.projections import learn_projection, spread
from motorprime.model_files import read_model, write_model
from motorprime.projection import NeuralProjection
from motorprime.projection.adaptation import linearise
from motorprime.samples import Samples
from toy_head import CAMERA, JOINTS, SHAPES, Head, babble, learn, median_error, truncated


@pytest.fixture(scope="module")
def lesson():
    return learn(babble(Head(), 3000, 1))


@pytest.fixture(scope="module")
def learned(lesson):
    return lesson[0]


@pytest.fixture(scope="module")
def unseen():
    return babble(Head(), 500, 2, noise=0.0)


def test_it_puts_points_where_the_cameras_see_them(learned, lesson, unseen):
    error = median_error(learned, unseen)
    assert error < 1.5  # of an image 160 px wide
    told = np.median(np.concatenate([part.errors for part in lesson[1].values()]))
    assert error == pytest.approx(told, rel=0.4)


def test_points_far_out_of_view_have_no_pixel_and_those_in_view_have_one(learned):
    head, behind = Head(), np.array([[0.0, 0.0, 0.5]])
    far = learned.project(np.array([[0.25, 0.2, 0.4]]), [-0.35, 0.35])
    assert all(np.isnan(pixels).all() for pixels in far.values())
    assert not any(
        seen.any() for seen in learned.visible(np.array([[0.25, 0.2, 0.4]]), [-0.35, 0.35]).values()
    )
    samples = babble(head, 400, 3)
    right = []
    for k in range(400):
        told = learned.visible(samples.points[k : k + 1], samples.joints[k])
        right += [told[camera][0] == samples.seen(camera)[k] for camera in SHAPES]
    assert np.mean(right) > 0.93
    assert all(seen.all() for seen in learned.visible(behind, [0.0, 0.0]).values())


def test_a_point_has_no_pixel_where_it_is_judged_clearly_out_of_view(learned):
    points = np.random.default_rng(6).uniform([-0.25, -0.2, 0.3], [0.25, 0.2, 0.8], (500, 3))
    joints = np.array([-0.2, 0.2])
    inputs = np.hstack([points, np.broadcast_to(joints, (500, 2))])
    pixels = learned.project(points, joints)
    for camera, part in learned.learned.items():
        judged = part.sight.mlp()(inputs)[:, 0]
        # -1 is out of view and 1 in view; what is hardly out of it has a pixel near the border.
        assert ((judged > -0.65) & (judged < 0.0)).any() and (judged < -0.75).any()
        assert np.isnan(pixels[camera][judged < -0.701]).all()
        assert not np.isnan(pixels[camera][judged > -0.699]).any()


def test_its_maps_project_in_the_fused_cycle_as_it_does(learned):
    rng = np.random.default_rng(5)
    points = rng.uniform([-0.25, -0.2, 0.3], [0.25, 0.2, 0.8], (60, 3))
    for joints in ([0.05, -0.1], [-0.35, 0.35]):
        pixels = learned.project(points, joints)
        assert any(np.isnan(there).any() for there in pixels.values())
        options = {"fraction": 0.2, "width": 12.0}
        right = attention_step(None, learned.shapes, pixels=pixels, **options)
        found = attention_step(learned.maps, learned.shapes, points, joints, **options)
        assert list(found) == list(right)
        for camera, attended in found.items():
            np.testing.assert_array_equal(attended.landscape, right[camera].landscape)


def test_the_jacobian_is_that_of_differences(learned):
    points, joints = np.array([[0.02, -0.03, 0.5], [-0.05, 0.04, 0.6]]), [0.05, -0.1]
    step = 1e-3
    for camera, slopes in learned.jacobian(points, joints).items():
        for axis in range(3):
            moved = step * np.eye(3)[axis]
            high, low = (learned.project(points + s * moved, joints)[camera] for s in (1, -1))
            np.testing.assert_allclose(slopes[:, :, axis], (high - low) / (2 * step), rtol=0.02, atol=2.0)


def test_triangulating_what_it_projects_gives_the_points_back(learned):
    rng = np.random.default_rng(4)
    points, joints = rng.uniform((-0.05, -0.05, 0.4), (0.05, 0.05, 0.65), (25, 3)), [0.03, -0.02]
    back = learned.triangulate(learned.project(points, joints), joints)
    assert np.linalg.norm(back - points, axis=1).max() < 2e-3


def test_triangulation_leaves_out_what_one_camera_alone_sees(learned):
    points, joints = np.array([[0.0, 0.0, 0.5], [0.02, 0.0, 0.5]]), [0.0, 0.0]
    pixels = learned.project(points, joints)
    pixels["right"][1] = np.nan
    back = learned.triangulate(pixels, joints)
    assert not np.isnan(back[0]).any() and np.isnan(back[1]).all()
    with pytest.raises(ArgumentError, match="at least two"):
        learned.triangulate({"left": pixels["left"]}, joints)


def test_it_knows_no_depths_and_says_so(learned):
    with pytest.raises(StateError, match="no depths"):
        learned.depths(np.zeros((1, 3)), [0.0, 0.0])


def other_head():
    return Head(offset=(0.05, -0.04), aside=(0.006, -0.004, 0.005), focal=1.03)


def test_a_hundred_samples_of_another_head_bring_the_error_back(learned, unseen):
    other = other_head()
    test = babble(other, 500, 5, noise=0.0)
    before, own = median_error(learned, test), median_error(learned, unseen)
    adapted = learned.adapt(babble(other, 100, 6, noise=0.3))
    after = median_error(adapted, test)
    assert before > 4.0 > 1.5 * own + 0.4 > after
    assert median_error(learned, test) == before  # the old one stays as it was


def test_adapting_twice_is_nearly_adapting_at_once(learned):
    other, test = other_head(), babble(other_head(), 500, 5, noise=0.0)
    samples = babble(other, 120, 7, noise=0.3)
    at_once = learned.adapt(samples)
    twice = learned.adapt(samples.take(slice(60))).adapt(samples.take(slice(60, None)))
    assert twice.correction.samples == at_once.correction.samples
    assert median_error(twice, test) == pytest.approx(median_error(at_once, test), rel=0.15)
    first_half = learned.adapt(samples.take(slice(60)))
    assert np.abs(twice.correction.vector - first_half.correction.vector).max() > 1e-3


def test_what_it_knew_elsewhere_is_not_forgotten(learned):
    """Samples from one corner of the workspace do not spoil the others."""
    other = other_head()
    samples = babble(other, 900, 8, noise=0.3)
    corner = (samples.points[:, 0] > 0.1) & (samples.joints[:, 0] > 0.0)
    test = babble(other, 500, 5, noise=0.0)
    elsewhere = test.take(test.points[:, 0] < 0.0)
    adapted = learned.adapt(samples.take(np.flatnonzero(corner)[:100]))
    assert median_error(adapted, elsewhere) < 0.7 * median_error(learned, elsewhere)


def test_joint_offsets_are_found_with_their_sign(learned):
    other = Head(offset=(0.04, -0.03))
    adapted = learned.adapt(babble(other, 200, 9, noise=0.1))
    # A part of the pan looks like a shift of the point to the side, and of the image.
    pan, tilt = adapted.correction.offset[3:]
    assert 0.01 < pan < 0.05
    assert tilt == pytest.approx(-0.03, abs=0.012)


def test_a_correction_folds_into_the_networks_as_its_formula_says(learned):
    rng = np.random.default_rng(3)
    size = learned.correction.vector.size
    correction = replace(learned.correction, vector=rng.normal(0.0, 0.02, size))
    x = rng.normal(learned.correction.centre, learned.correction.scale, (20, 5))
    n, network = 5, learned.learned["right"].place
    mixing = correction.vector[n : n + n * n].reshape(n, n)
    moved = x + correction.vector[:n] + ((x - correction.centre) / correction.scale) @ mixing.T
    scaling, shift = correction.vector[-6:-2].reshape(2, 2), correction.vector[-2:]
    mean = network.output_mean
    expected = mean + (network.forward(moved) - mean) @ (np.eye(2) + scaling).T + shift
    folded = correction.apply_to_pixels("right", network)
    np.testing.assert_allclose(folded.forward(x), expected, rtol=1e-10)
    np.testing.assert_allclose(correction.apply(network).forward(x), network.forward(moved), rtol=1e-10)


def test_the_correction_s_derivatives_are_those_of_differences(learned):
    rng = np.random.default_rng(3)
    correction = replace(learned.correction, vector=rng.normal(0.0, 0.02, learned.correction.vector.size))
    x = rng.normal(learned.correction.centre, learned.correction.scale, (4, 5))
    network, step = learned.learned["left"].place, 1e-6
    pixels, slopes = linearise(network, correction, "left", x)
    np.testing.assert_allclose(pixels, correction.apply_to_pixels("left", network).forward(x), rtol=1e-10)
    for k in range(correction.vector.size):
        high, low = (
            linearise(
                network,
                replace(correction, vector=correction.vector + s * np.eye(len(correction.vector))[k]),
                "left",
                x,
            )[0]
            for s in (step, -step)
        )
        np.testing.assert_allclose(slopes[:, :, k], (high - low) / (2 * step), rtol=1e-4, atol=1e-4)


def test_a_few_wild_labels_do_not_spoil_it(learned):
    other, test = other_head(), babble(other_head(), 500, 5, noise=0.0)
    samples = babble(other, 100, 6, noise=0.3)
    wild = {camera: uv.copy() for camera, uv in samples.pixels.items()}
    for uv in wild.values():
        uv[::20] += 50.0
    spoilt = learned.adapt(Samples(samples.names, samples.joints, wild, samples.points))
    assert median_error(spoilt, test) < 1.25 * median_error(learned.adapt(samples), test) + 0.1


def test_too_few_samples_say_how_many_are_needed(learned):
    samples = babble(Head(), 3, 1)
    with pytest.raises(ArgumentError, match="at least 10 are needed"):
        learned.adapt(samples)
    nothing = Samples(
        samples.names, samples.joints, {c: np.full((3, 2), np.nan) for c in SHAPES}, samples.points
    )
    with pytest.raises(ArgumentError, match="0 labels"):
        learned.adapt(nothing)


def test_samples_of_another_robot_or_without_points_are_refused(learned):
    samples = babble(Head(), 40, 1)
    with pytest.raises(ArgumentError, match="no joint 'tilt'"):
        learned.adapt(Samples(("pan", "roll"), samples.joints, samples.pixels, samples.points))
    with pytest.raises(ArgumentError, match="points"):
        learned.adapt(Samples(samples.names, samples.joints, samples.pixels))


def test_it_survives_its_file_adapted_or_not(learned, tmp_path, unseen):
    adapted = learned.adapt(babble(other_head(), 100, 6))
    for name, projection in (("plain", learned), ("adapted", adapted)):
        path = tmp_path / f"{name}.safetensors"
        projection.save(path)
        again = NeuralProjection.load(path, robot="head")
        for k in range(20):
            point, joints = unseen.points[k : k + 1], unseen.joints[k]
            for camera, pixels in projection.project(point, joints).items():
                np.testing.assert_array_equal(again.project(point, joints)[camera], pixels)
    more = babble(other_head(), 60, 12)
    again = NeuralProjection.load(tmp_path / "adapted.safetensors").adapt(more)
    np.testing.assert_array_equal(again.correction.vector, adapted.adapt(more).correction.vector)


def test_resized_images_have_the_same_points_at_the_resized_pixels(learned, unseen):
    points = unseen.points[np.abs(unseen.points[:, :2]).max(axis=1) < 0.08]
    larger = learned.resized(dict.fromkeys(SHAPES, (240, 320)))
    assert larger.shapes == dict.fromkeys(SHAPES, (240, 320))
    centred = points - (-0.03, 0.0, 0.0)  # in the left camera's frame, at joints zero
    errors = [
        np.median(projection.project(points, [0.0, 0.0])["left"] - camera.project(centred), axis=0)
        for projection, camera in ((learned, CAMERA), (larger, CAMERA.scale(2.0)))
    ]
    np.testing.assert_allclose(errors[1], 2.0 * errors[0], atol=0.01)
    with pytest.raises(ArgumentError, match="no camera 'right'"):
        learned.resized({"left": (240, 320)})
    with pytest.raises(ArgumentError, match="resize first"):
        learned.adapt(babble(Head(), 40, 1)).resized(SHAPES)


def test_files_that_are_cut_off_damaged_or_of_another_robot_are_refused(learned, tmp_path):
    path = tmp_path / "weights.safetensors"
    learned.save(path)
    with pytest.raises(ArgumentError, match="belongs to robot 'head', not to 'iCub'"):
        NeuralProjection.load(path, robot="iCub")
    for keep in (0.0, 0.001, 0.01, 0.5, 0.99):
        with pytest.raises(ArgumentError, match="cut off"):
            NeuralProjection.load(truncated(path, keep))
    with pytest.raises(ArgumentError, match="cannot read"):
        NeuralProjection.load(tmp_path / "missing.safetensors")
    arrays, about = read_model(path, "neural projection")
    write_model(path, "something else", arrays, {})
    with pytest.raises(ArgumentError, match="something else"):
        NeuralProjection.load(path)
    for damage in ("left.place.weight0", "points", "correction.vector", "right.sight.bias0"):
        fewer = {name: array for name, array in arrays.items() if name != damage}
        write_model(path, "neural projection", fewer, about)
        with pytest.raises(ArgumentError, match="whole neural projection"):
            NeuralProjection.load(path)
    write_model(path, "neural projection", arrays, {**about, "joints": ["pan"]})
    with pytest.raises(ArgumentError):
        NeuralProjection.load(path)
    with pytest.raises(ArgumentError, match="cannot write"):
        learned.save(tmp_path / "no" / "folder.safetensors")


def test_bad_postures_and_points_are_refused(learned):
    point = np.array([[0.0, 0.0, 0.5]])
    with pytest.raises(ArgumentError, match=r"joints: a posture of \('pan', 'tilt'\)"):
        learned.project(point)
    with pytest.raises(ArgumentError, match=r"joints: expected shape \(2,\)"):
        learned.project(point, [0.0, 0.0, 0.0])
    with pytest.raises(ArgumentError, match="joints: expected finite"):
        learned.project(point, [0.0, np.nan])
    with pytest.raises(ArgumentError, match=r"points: expected shape \(N, 3\)"):
        learned.project(point[:, :2], [0.0, 0.0])
    with pytest.raises(ArgumentError, match="points: expected finite"):
        learned.project(np.full((1, 3), np.inf), [0.0, 0.0])
    with pytest.raises(ArgumentTypeError, match="learned"):
        NeuralProjection([], JOINTS, robot="head", points=point)
    with pytest.raises(ArgumentError, match="at least one camera"):
        NeuralProjection({}, JOINTS, robot="head", points=point)
    with pytest.raises(ArgumentError, match="3 coordinates and 3 joints"):
        NeuralProjection(learned.learned, ("a", "b", "c"), robot="head", points=point)


def test_points_far_from_all_that_was_babbled_have_no_pixel(learned):
    rng = np.random.default_rng(2)
    around = rng.normal(size=(300, 3))
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    for radius in (3.0, 10.0, 1e3, 1e30):
        for camera, pixels in learned.project(radius * around, [0.0, 0.0]).items():
            assert np.isnan(pixels).all()
            assert not learned.visible(radius * around, [0.0, 0.0])[camera].any()
    far = {camera: np.full((1, 2), 1e9) for camera in SHAPES}
    assert np.isnan(learned.triangulate(far, [0.0, 0.0])).all()


def test_samples_in_other_units_or_of_other_cameras_are_refused(learned):
    samples = babble(Head(), 60, 1)
    degrees = Samples(samples.names, np.rad2deg(samples.joints), samples.pixels, samples.points)
    with pytest.raises(ArgumentError, match=r"(pan|tilt) = .* metres and radians expected"):
        learned.adapt(degrees)
    millimetres = Samples(samples.names, samples.joints, samples.pixels, 1e3 * samples.points)
    with pytest.raises(ArgumentError, match=r"[xyz] = .* metres and radians expected"):
        learned.adapt(millimetres)
    other = Samples(samples.names, samples.joints, {"top": samples.pixels["left"]}, samples.points)
    with pytest.raises(ArgumentError, match="no camera 'top'; there are left, right"):
        learned.adapt(other)
    for nothing in (None, {}):
        with pytest.raises(ArgumentTypeError, match="samples: expected Samples"):
            learned.adapt(nothing)


def test_one_more_sample_is_enough_to_go_on(learned):
    adapted = learned.adapt(babble(other_head(), 60, 6))
    one = babble(other_head(), 400, 7)
    seen = np.flatnonzero(one.seen("left"))[:1]
    again = adapted.adapt(one.take(seen))
    assert again.correction.samples > adapted.correction.samples


@pytest.mark.parametrize("error", [-1.0, 0.0, "x", None])
def test_a_file_whose_error_is_no_positive_number_is_refused(learned, tmp_path, error):
    path = tmp_path / "weights.safetensors"
    learned.save(path)
    arrays, about = read_model(path, "neural projection")
    about["cameras"]["left"]["error"] = error
    write_model(path, "neural projection", arrays, about)
    with pytest.raises(ArgumentError):
        NeuralProjection.load(path)


def test_no_points_give_no_pixels(learned):
    assert all(pixels.shape == (0, 2) for pixels in learned.project(np.zeros((0, 3)), [0.0, 0.0]).values())


def test_samples_that_cannot_teach_a_view_are_refused():
    samples = babble(Head(), 300, 1)
    seen = np.all([samples.seen(camera) for camera in SHAPES], axis=0)
    with pytest.raises(ArgumentError, match="saw the point in"):
        learn(samples.take(seen))
    nothing = {camera: np.full((len(samples), 2), np.nan) for camera in SHAPES}
    with pytest.raises(ArgumentError, match="in 0 of 300"):
        learn(Samples(samples.names, samples.joints, nothing, samples.points))
    with pytest.raises(ArgumentError, match="no camera 'top'"):
        learn_projection(samples, {"top": (10, 10)}, JOINTS, robot="head")
    with pytest.raises(ArgumentError, match="too few"):
        learn(samples.take(slice(40)))


def test_the_same_seed_learns_the_same(lesson):
    one, two = (learn(babble(Head(), 700, 3), iterations=5)[0] for _ in range(2))
    for camera in SHAPES:
        np.testing.assert_array_equal(
            one.learned[camera].place.parameters, two.learned[camera].place.parameters
        )


def test_starting_places_lie_apart():
    points = np.random.default_rng(1).uniform(0.0, 1.0, (400, 3))
    chosen = spread(points, 8)
    apart = [np.linalg.norm(a - b) for k, a in enumerate(chosen) for b in chosen[:k]]
    assert len(chosen) == 8 and min(apart) > 0.5
    assert len(spread(points[:3], 8)) == 3
