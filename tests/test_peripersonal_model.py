"""The learned peripersonal model: from a posture to Gaussians, whatever the posture."""

from __future__ import annotations

import math

import numpy as np
import pytest

from motorprime import Attention, PeripersonalModel, PinholeProjection, ReachCloud, attention_step
from motorprime.errors import ArgumentError, ArgumentTypeError, NotInViewError, StateError
from motorprime.learning.network import Network
from motorprime.model_files import write_model
from motorprime.projection.neural import LearnedCamera, NeuralProjection

JOINTS = ("neck", "waist", "version", "squint")
INPUTS = ("neck", "version", "squint")
SHAPES = {"left": (240, 320), "right": (120, 160)}
POSTURE = np.array([0.3, -0.8, 0.2, -0.1])
MATRIX = np.array([[250.0, 0, 160, 0], [0, 250.0, 120, 0], [0, 0, 1, 0]])
PROJECTION = PinholeProjection({"left": MATRIX, "right": MATRIX}, SHAPES)


def linear(weights, biases):
    """The network W x + b, so that every output can be told by hand."""
    weights = np.array(weights, float)
    inputs, outputs = weights.shape[1], len(weights)
    unit = np.ones(inputs), np.zeros(outputs), np.ones(outputs)
    return Network((weights,), (np.array(biases, float),), np.zeros(inputs), *unit)


LEFT = linear(
    [[100.0, 0, 0], [0, 50.0, 0], [0, 0, 1.0], [-30.0, 10.0, 0], [0.5, 0, 0]],
    [150.0, 110.0, math.log(40.0), 5.0, math.log(25.0)],
)
RIGHT = linear(np.zeros((5, 3)), [80.0, 60.0, math.log(20.0), -8.0, math.log(12.0)])
VIEW = linear([[0.0, 0, 0], [4.0, 0, 0]], [math.log(900.0), math.log(60.0)])
"""The left camera always sees 900 points of the cloud, the right 60, and more with the neck turned."""


def deeper(outputs):
    x = np.random.default_rng(0).normal(size=(9, 3))
    return Network.random((3, 4, outputs), 0, x, np.zeros((9, outputs)))


def model(**changes):
    parts = {
        "ellipses": {"left": LEFT, "right": RIGHT},
        "view": VIEW,
        "shapes": SHAPES,
        "joints": JOINTS,
        "inputs": INPUTS,
        "robot": "small",
    } | changes
    ellipses, view, shapes, joints, inputs = (
        parts.pop(name) for name in ("ellipses", "view", "shapes", "joints", "inputs")
    )
    return PeripersonalModel(ellipses, view, shapes, joints, inputs, **parts)


def random_model(seed=0):
    """Random networks with hidden layers, whose ellipses lie about in the images."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1.0, 1.0, (200, 3))

    def network(outputs, mean, spread):
        return Network.random((3, 9, 9, outputs), rng, x, rng.normal(mean, spread, (200, outputs)))

    sizes = (math.log(40.0), 0.0, math.log(30.0))
    ellipses = {
        camera: network(5, (width / 2, height / 2, *sizes), (20.0, 15.0, 0.2, 8.0, 0.2))
        for camera, (height, width) in SHAPES.items()
    }
    return model(ellipses=ellipses, view=network(2, math.log(500.0), 0.1))


def test_a_posture_gives_mean_and_factor_by_hand():
    """u = 150 + 100 neck, v = 110 + 50 version, L1 = 40 exp(squint), L2 = 5 - 30 neck + 10 version."""
    fits = model().ellipses(POSTURE)
    np.testing.assert_allclose(fits["left"].mean, (180.0, 120.0), rtol=1e-6)
    l1, l3 = 40.0 * math.exp(-0.1), 25.0 * math.exp(0.15)
    np.testing.assert_allclose(fits["left"].chol, (l1, -2.0, l3), rtol=1e-5)
    np.testing.assert_allclose(fits["right"].chol, (20.0, -8.0, 12.0), rtol=1e-5)
    assert fits["left"].inside == 900 and fits["right"].inside == round(60.0 * math.exp(1.2))
    assert fits["left"].mean.dtype == fits["left"].chol.dtype == np.float64


def test_the_torso_is_not_looked_at_and_lists_and_integers_are_taken():
    turned = np.add(POSTURE, (0.0, 2.0, 0.0, 0.0))
    np.testing.assert_array_equal(model().inputs_of(turned), POSTURE[[0, 2, 3]])
    one, two = model().ellipses(POSTURE), model().ellipses(list(turned))
    np.testing.assert_array_equal(one["left"].mean, two["left"].mean)
    np.testing.assert_allclose(model().ellipses(np.array([1, 0, 0, 0]))["left"].mean, (250.0, 110.0))


def test_nothing_that_the_user_passes_is_changed_and_results_are_apart():
    posture, trained = POSTURE.copy(), model()
    first = trained.ellipses(posture)
    first["left"].mean[:] = -1.0
    np.testing.assert_array_equal(posture, POSTURE)
    np.testing.assert_allclose(trained.ellipses(posture)["left"].mean, (180.0, 120.0), rtol=1e-6)
    trained.inputs_of(posture)[:] = 9.0
    trained.maps.clear(), trained.shapes.clear()
    np.testing.assert_array_equal(posture, POSTURE)
    assert trained.cameras == tuple(trained.maps) == tuple(trained.shapes) == ("left", "right")


@pytest.mark.parametrize("size", [3.0, 40.0, 1e3, 1e6, 1e30])
def test_factors_are_positive_and_finite_for_absurd_postures_too(size):
    """The logarithms are clipped to +-12: from far below a pixel to far beyond any image."""
    for seed in range(5):
        trained = random_model(seed)
        for signs in np.random.default_rng(seed).choice([-1.0, 1.0], (20, 4)):
            try:
                fits = trained.ellipses(size * signs)
            except NotInViewError:
                continue
            for fit in fits.values():
                assert np.isfinite(fit.mean).all() and np.isfinite(fit.chol).all()
                assert fit.chol[0] >= math.exp(-12.0) and fit.chol[2] >= math.exp(-12.0)
                assert fit.chol[0] <= math.exp(12.0) and fit.chol[2] <= math.exp(12.0)


def test_a_factor_beyond_the_clip_is_the_clip():
    """1 m of squint is ln L1 = ln 40 + 1000, and the other way round."""
    for squint, log in ((1000.0, 12.0), (-1000.0, -12.0)):
        fit = model().ellipses([0.0, 0.0, 0.0, squint])["left"]
        np.testing.assert_allclose(fit.chol[0], math.exp(log), rtol=1e-12)


def test_a_posture_that_overflows_single_precision_is_an_error_and_no_infinity():
    with pytest.raises(ArgumentError, match="overflows"):
        random_model().ellipses([1e300, 0.0, -1e300, 0.0])


# What is in view.


@pytest.mark.parametrize(
    ("neck", "count", "seen"), [(-0.05, 49.12, False), (-0.047, 49.72, True), (0.0, 60.0, True)]
)
def test_a_camera_without_50_points_in_its_image_is_left_out(neck, count, seen):
    """60 exp(4 neck) points; 49.5 and more round to 50."""
    trained = model()
    posture = np.array([neck, 0.0, 0.0, 0.0])
    assert trained.visible(posture) == {"left": True, "right": seen}
    fits = trained.ellipses(posture)
    assert list(fits) == (["left", "right"] if seen else ["left"])
    if seen:
        assert fits["right"].inside == round(count) >= 50


def test_in_no_camera_s_view_the_model_says_so_as_the_direct_fit_does():
    blind = model(view=linear(np.zeros((2, 3)), [math.log(20.0), -700.0]))
    assert blind.visible(POSTURE) == {"left": False, "right": False}
    with pytest.raises(NotInViewError, match="cameras left, right; look elsewhere"):
        blind.ellipses(POSTURE)


def test_more_points_than_any_cloud_has_do_not_overflow():
    crowded = model(view=linear(np.zeros((2, 3)), [5000.0, 5000.0]))
    assert crowded.ellipses(POSTURE)["left"].inside == round(math.exp(12.0))


@pytest.mark.parametrize(
    ("joints", "error"),
    [
        (np.zeros(3), ArgumentError),
        (np.zeros((1, 4)), ArgumentError),
        (np.array([0.0, np.nan, 0.0, 0.0]), ArgumentError),
        (np.array([np.inf, 0.0, 0.0, 0.0]), ArgumentError),
        ([0.0, 0.0, 0.0, np.nan], ArgumentError),
        ([[0.0], [1.0, 2.0]], ArgumentError),
        ("looking left", ArgumentTypeError),
        (None, ArgumentTypeError),
        (np.zeros(4, complex), ArgumentTypeError),
    ],
)
def test_a_posture_that_is_none_is_named_also_in_joints_that_do_not_matter(joints, error):
    for ask in (model().ellipses, model().visible, model().inputs_of):
        with pytest.raises(error, match="joints"):
            ask(joints)


def test_large_finite_joints_are_no_error():
    """Their squares overflow, they do not."""
    assert model().inputs_of(np.array([1e200, 1e200, 0.0, 0.0]))[0] == 1e200


@pytest.mark.parametrize(
    ("changes", "name", "error"),
    [
        ({"ellipses": [LEFT, RIGHT]}, "ellipses", ArgumentTypeError),
        ({"shapes": [(1, 2)]}, "shapes", ArgumentTypeError),
        ({"ellipses": {}, "shapes": {}}, "ellipses", ArgumentError),
        ({"ellipses": {"left": LEFT}}, "same cameras", ArgumentError),
        ({"ellipses": {"right": RIGHT, "left": LEFT}}, "same cameras", ArgumentError),
        ({"ellipses": {"left": LEFT, "right": VIEW}}, r"ellipses\['right'\]", ArgumentError),
        ({"view": LEFT}, "view", ArgumentError),
        ({"inputs": ("neck", "version")}, "from 2 joints", ArgumentError),
        ({"view": deeper(2)}, "same inputs and depth", ArgumentError),
        ({"inputs": ("neck", "version", "tail")}, "inputs", ArgumentError),
        ({"inputs": ("neck", "version", "neck")}, "inputs", ArgumentError),
        ({"shapes": {"left": (0, 320), "right": (120, 160)}}, r"shapes\['left'\]", ArgumentError),
        ({"shapes": {"left": 320, "right": (120, 160)}}, r"shapes\['left'\]", ArgumentError),
    ],
)
def test_parts_that_do_not_belong_together_are_named(changes, name, error):
    with pytest.raises(error, match=name):
        model(**changes)


# In the cycle.


@pytest.mark.parametrize("mixing", [1.0, 0.2])
def test_the_fused_cycle_and_the_steps_one_by_one_agree_to_the_last_bit(mixing):
    rng = np.random.default_rng(4)
    for seed in range(8):
        trained = random_model(seed)
        joints = rng.uniform(-1.0, 1.0, 4)
        looks = Attention(PROJECTION, peripersonal=trained).peripersonal(joints, mixing=mixing)
        together = attention_step(
            trained.maps, trained.shapes, joints=trained.inputs_of(joints), windows=30, mixing=mixing, seed=7
        )
        assert list(together) == list(looks) == ["left", "right"]
        for k, (camera, look) in enumerate(looks.items()):
            np.testing.assert_array_equal(together[camera].landscape, look.landscape)
            np.testing.assert_array_equal(together[camera].centres, look.windows(30, seed=7 + k).centres)


def test_the_fused_cycle_takes_the_cameras_that_see_the_space():
    """As the model's own example has it."""
    trained, posture = model(), np.array([-0.3, 0.0, 0.1, 0.0])
    seen = trained.visible(posture)
    maps = {camera: network for camera, network in trained.maps.items() if seen[camera]}
    step = attention_step(maps, trained.shapes, joints=trained.inputs_of(posture), fraction=0.1)
    looks = Attention(PROJECTION, peripersonal=trained).peripersonal(posture)
    assert list(step) == list(looks) == ["left"]
    np.testing.assert_array_equal(step["left"].landscape, looks["left"].landscape)


class Blurred(PinholeProjection):
    """A projection that knows pixels and no depths, as a learned one."""

    def depths(self, points, joints=None):
        raise StateError("no depths here")

    def project(self, points, joints=None):
        raise AssertionError("the model needs no projecting")


def test_attention_with_a_model_needs_neither_cloud_nor_depths():
    attention = Attention(Blurred({"left": MATRIX, "right": MATRIX}, SHAPES), peripersonal=model())
    fits = attention.gaussians(POSTURE)
    assert list(attention.peripersonal(POSTURE)) == list(fits) == ["left", "right"]
    np.testing.assert_array_equal(fits["left"].chol, model().ellipses(POSTURE)["left"].chol)


def test_attention_through_a_learned_projection_takes_a_learned_model():
    x = np.random.default_rng(0).normal(size=(50, 7))
    place, sight = (Network.random((7, 5, n), 0, x, np.ones((50, n))) for n in (2, 1))
    learned = {camera: LearnedCamera(shape, place, sight, 1.0) for camera, shape in SHAPES.items()}
    projection = NeuralProjection(learned, JOINTS, robot="small", points=np.zeros((1, 3)))
    looks = Attention(projection, peripersonal=model()).peripersonal(POSTURE)
    expected = Attention(PROJECTION, peripersonal=model()).peripersonal(POSTURE)
    np.testing.assert_array_equal(looks["left"].landscape, expected["left"].landscape)


def test_the_model_goes_before_the_cloud():
    class Untouched(ReachCloud):
        def __init__(self):
            pass

        def in_root(self, joints):
            raise AssertionError("the cloud is not needed")

    attention = Attention(PROJECTION, cloud=Untouched(), peripersonal=model())
    np.testing.assert_allclose(attention.gaussians(POSTURE)["left"].mean, (180.0, 120.0), rtol=1e-6)


def test_an_ellipse_learned_beside_the_image_gives_no_look():
    aside = linear(np.zeros((5, 3)), [-900.0, 60.0, 2.0, 0.0, 2.0])
    attention = Attention(PROJECTION, peripersonal=model(ellipses={"left": LEFT, "right": aside}))
    assert list(attention.gaussians(POSTURE)) == ["left", "right"]
    assert list(attention.peripersonal(POSTURE)) == ["left"]


def test_a_model_of_other_cameras_or_images_is_refused():
    larger = PinholeProjection({"left": MATRIX, "right": MATRIX}, (240, 320))
    with pytest.raises(ArgumentError, match=r"camera 'right' with images \(120, 160\)"):
        Attention(larger, peripersonal=model())
    with pytest.raises(ArgumentError, match="camera 'left'"):
        Attention(PinholeProjection({"right": MATRIX}, (120, 160)), peripersonal=model())
    with pytest.raises(ArgumentTypeError, match="PeripersonalModel"):
        Attention(PROJECTION, peripersonal="model.safetensors")


def test_an_attention_with_neither_names_both():
    with pytest.raises(StateError, match="ReachCloud or a PeripersonalModel"):
        Attention(PROJECTION).gaussians(POSTURE)


# Files.


def test_what_was_saved_is_what_is_loaded_to_the_last_bit(tmp_path):
    saved = random_model(3)
    saved.save(tmp_path / "model.safetensors")
    loaded = PeripersonalModel.load(tmp_path / "model.safetensors", robot="small")
    assert (loaded.joints, loaded.inputs, loaded.robot) == (JOINTS, INPUTS, "small")
    assert loaded.shapes == SHAPES and loaded.cameras == ("left", "right")
    for posture in np.random.default_rng(0).uniform(-1, 1, (20, 4)):
        one, two = saved.ellipses(posture), loaded.ellipses(posture)
        for camera in one:
            np.testing.assert_array_equal(one[camera].mean, two[camera].mean)
            np.testing.assert_array_equal(one[camera].chol, two[camera].chol)
            assert one[camera].inside == two[camera].inside


def test_files_that_are_no_whole_model_are_refused(tmp_path):
    path = tmp_path / "model.safetensors"
    with pytest.raises(ArgumentError, match="cannot read"):
        PeripersonalModel.load(path)
    model().save(path)
    whole = path.read_bytes()
    for cut in (0, 5, 200, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:cut])
        with pytest.raises(ArgumentError, match="cut off"):
            PeripersonalModel.load(path)
    path.write_bytes(whole)
    with pytest.raises(ArgumentError, match="belongs to robot 'small', not to 'iCub'"):
        PeripersonalModel.load(path, robot="iCub")
    write_model(path, "neural projection", {"a": np.zeros(1)}, {})
    with pytest.raises(ArgumentError, match="a peripersonal model expected"):
        PeripersonalModel.load(path)
    with pytest.raises(ArgumentError, match="cannot write"):
        model().save(tmp_path / "nowhere" / "model.safetensors")


@pytest.mark.parametrize(
    "change",
    [
        lambda arrays, about: arrays.pop("view.weight0"),
        lambda arrays, about: arrays.pop("right.ellipse.output_std"),
        lambda arrays, about: arrays.update({"left.ellipse.bias0": np.full(5, np.nan)}),
        lambda arrays, about: arrays.update({"left.ellipse.weight0": np.zeros((5, 4))}),
        lambda arrays, about: about.pop("inputs"),
        lambda arrays, about: about.pop("cameras"),
        lambda arrays, about: about.update(cameras={"left": [240, 320]}),
        lambda arrays, about: about.update(cameras=["left", "right"]),
        lambda arrays, about: about.update(cameras={"left": [240, 320], "right": [0, 160]}),
        lambda arrays, about: about.update(inputs=["neck", "version", "tail"]),
        lambda arrays, about: about.update(joints=3),
    ],
)
def test_a_file_with_parts_missing_or_changed_is_refused(tmp_path, change):
    from motorprime.model_files import read_model

    path = tmp_path / "model.safetensors"
    model().save(path)
    arrays, about = read_model(path, "peripersonal model")
    kind = about.pop("kind")
    change(arrays, about)
    write_model(path, kind, arrays, about)
    with pytest.raises(ArgumentError, match="does not hold a whole peripersonal model"):
        PeripersonalModel.load(path)


def test_resized_images_have_resized_ellipses():
    small = model()
    joints = next(
        q
        for q in np.random.default_rng(1).uniform(-1.0, 1.0, (200, len(small.joints)))
        if all(small.visible(q).values())
    )
    shapes = {camera: (3 * height, 2 * width) for camera, (height, width) in small.shapes.items()}
    large = small.resized(shapes)
    assert large.shapes == shapes and large.visible(joints) == small.visible(joints)
    stretch = np.diag([2.0, 3.0])
    for camera, fit in small.ellipses(joints).items():
        resized = large.ellipses(joints)[camera]
        np.testing.assert_allclose(resized.mean, (fit.mean + 0.5) @ stretch - 0.5, rtol=1e-4, atol=1e-3)
        factors = []
        for l1, l2, l3 in (fit.chol, resized.chol):
            lower = np.array([[l1, 0.0], [l2, l3]])
            factors.append(lower @ lower.T)
        np.testing.assert_allclose(factors[1], stretch @ factors[0] @ stretch, rtol=1e-4)
    with pytest.raises(ArgumentError, match="expected cameras"):
        small.resized({"top": (10, 10)})
