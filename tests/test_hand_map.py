"""The hand's pixels from the joints alone, by a network."""

import numpy as np
import pytest

import motorprime as mp
from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.hand_map import HandMap, learn_hand_map
from motorprime.samples import Samples

NAMES = ("shoulder", "stiff", "elbow")


def planar(joints, offset=0.0):
    """Pixels of a two-link arm before two fixed cameras; the joint between them does nothing."""
    q = joints[:, [0, 2]] + offset
    x = 0.3 * np.cos(q[:, 0]) + 0.25 * np.cos(q.sum(axis=1))
    y = 0.3 * np.sin(q[:, 0]) + 0.25 * np.sin(q.sum(axis=1))
    return {
        "left": np.column_stack([300 * x, 300 * y]) / (1 + 0.2 * x)[:, None],
        "right": np.column_stack([300 * x - 40, 290 * y]),
    }


def samples(count, seed, *, stiff=0.2, offset=0.0, noise=0.0):
    rng = np.random.default_rng(seed)
    joints = np.column_stack(
        [rng.uniform(-0.5, 0.9, count), np.full(count, stiff), rng.uniform(-1.2, 0.8, count)]
    )
    pixels = planar(joints, offset)
    return Samples(NAMES, joints, {c: p + rng.normal(0.0, noise, p.shape) for c, p in pixels.items()})


def error(hand_map, test):
    predicted = hand_map.hand_pixels(test.joints)
    return {c: np.median(np.linalg.norm(predicted[c] - test.pixels[c], axis=1)) for c in test.cameras}


@pytest.fixture(scope="module")
def learned():
    return learn_hand_map(samples(300, 1), seed=4)


def test_it_predicts_pixels_of_postures_that_it_has_not_seen(learned):
    assert max(error(learned, samples(200, 2)).values()) < 0.5
    assert learned.cameras == ("left", "right")
    assert all(0.0 < value < 0.5 for value in learned.errors.values())


def test_one_posture_or_many_give_the_same(learned):
    joints = samples(5, 3).joints
    many = learned.hand_pixels(joints)
    assert many["left"].shape == (5, 2)
    for k in range(5):
        np.testing.assert_allclose(learned.hand_pixels(joints[k])["right"], many["right"][k : k + 1])


def test_a_trajectory_of_joints_becomes_a_landscape_where_the_hand_will_be(learned):
    path = np.linspace([-0.2, 0.2, -0.4], [0.5, 0.2, 0.3], 40)
    pixels = learned.hand_pixels(path)
    look = mp.attention_step(None, {"left": (240, 320)}, pixels={"left": pixels["left"]}, fraction=0.1)
    places = pixels["left"][(pixels["left"] >= 0).all(axis=1)].round().astype(int)
    assert look["left"].mask[places[:, 1], places[:, 0]].mean() > 0.9
    landscape = mp.kernel_landscape(pixels["left"], (240, 320), width=40.0)
    np.testing.assert_allclose(look["left"].landscape, landscape, rtol=1e-5)


def test_the_same_seed_gives_the_same_map():
    one, two = (learn_hand_map(samples(60, 1), seed=7) for _ in range(2))
    np.testing.assert_array_equal(one.networks["left"].parameters, two.networks["left"].parameters)
    other = learn_hand_map(samples(60, 1), seed=8)
    assert (one.networks["left"].parameters != other.networks["left"].parameters).any()


def test_joints_that_never_moved_are_named_and_not_looked_at(learned):
    assert learned.constant == {"stiff": pytest.approx(0.2)}
    joints = samples(5, 3).joints
    turned = joints + np.array([0.0, 0.7, 0.0])
    np.testing.assert_array_equal(learned.hand_pixels(joints)["left"], learned.hand_pixels(turned)["left"])


def test_a_joint_that_one_camera_never_saw_move_is_not_known():
    both = samples(200, 1)
    joints = both.joints.copy()
    joints[:100, 1], joints[100:, 1] = 0.2, np.random.default_rng(2).uniform(-1.0, 1.0, 100)
    right = both.pixels["right"].copy()
    right[100:] = np.nan  # it saw the hand while the middle joint stood still
    hand_map = learn_hand_map(Samples(NAMES, joints, {"left": both.pixels["left"], "right": right}), seed=4)
    assert list(hand_map.constant) == ["stiff"]
    assert hand_map.inside([[0.0, 0.2, 0.0], [0.0, 0.9, 0.0]]).tolist() == [True, False]


def test_inside_is_the_range_of_training(learned):
    middle = np.array([0.2, 0.2, -0.2])
    assert learned.inside(middle).tolist() == [True]
    outside = middle + np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 0.05, 0], [0, -0.05, 0], [0, 0, 2.0]])
    assert not learned.inside(outside).any()
    assert learned.inside(middle + np.array([[0, 0.009, 0]])).all()
    assert learned.inside(samples(300, 1).joints).all()


def test_few_samples_set_random_units_and_many_train_two_layers():
    few, many = (learn_hand_map(samples(n, 1), seed=0, iterations=2).networks["left"] for n in (30, 1200))
    assert few.sizes == (2, 200, 2)
    assert many.sizes == (2, 25, 25, 2)
    asked = learn_hand_map(samples(60, 1), seed=0, hidden=(6,), iterations=2)
    assert asked.networks["left"].sizes == (2, 6, 2)


def test_twenty_samples_are_a_start():
    assert max(error(learn_hand_map(samples(20, 1), seed=0), samples(200, 2)).values()) < 10.0


def test_too_few_samples_are_an_error_that_says_how_many_are_needed():
    with pytest.raises(ArgumentError, match=r"6 that camera 'left' saw .* 2 joints .* at least 7 are needed"):
        learn_hand_map(samples(6, 1), seed=0)
    learn_hand_map(samples(7, 1), seed=0)
    rng = np.random.default_rng(0)
    wide = Samples(tuple("abcdefg"), rng.normal(size=(15, 7)), {"left": rng.normal(size=(15, 2))})
    with pytest.raises(ArgumentError, match=r"15 .* 7 joints that move; at least 16 are needed"):
        learn_hand_map(wide)


def test_the_error_that_a_map_tells_is_about_the_one_that_it_makes():
    for count in (40, 1200):
        hand_map = learn_hand_map(samples(count, 1, noise=1.0), seed=0, iterations=30)
        for camera, off in error(hand_map, samples(300, 2, noise=1.0)).items():
            assert 0.6 < hand_map.errors[camera] / off < 1.7


def test_only_samples_that_a_camera_saw_count_for_it():
    given = samples(80, 1)
    pixels = {camera: value.copy() for camera, value in given.pixels.items()}
    pixels["right"][5:] = np.nan
    with pytest.raises(ArgumentError, match="5 that camera 'right' saw are too few"):
        learn_hand_map(Samples(NAMES, given.joints, pixels), seed=0)
    pixels["right"] = np.where(np.arange(80)[:, None] % 5 == 0, np.nan, given.pixels["right"])
    hand_map = learn_hand_map(Samples(NAMES, given.joints, pixels), seed=0)
    assert np.isfinite(hand_map.hand_pixels(given.joints)["right"]).all()


def test_a_robot_that_never_moved_is_an_error():
    still = Samples(NAMES, np.ones((50, 3)), {"left": np.zeros((50, 2))})
    with pytest.raises(ArgumentError, match="none of the joints shoulder, stiff, elbow moves"):
        learn_hand_map(still)


def test_no_samples_and_something_else_are_errors():
    with pytest.raises(ArgumentError, match="at least one, got none"):
        learn_hand_map(samples(5, 1).take(slice(0, 0)))
    with pytest.raises(ArgumentTypeError, match="expected Samples, got dict"):
        learn_hand_map({})


@pytest.mark.parametrize("name", ["restarts", "iterations"])
def test_settings_must_be_at_least_one(name):
    with pytest.raises(ArgumentError, match=name):
        learn_hand_map(samples(60, 1), **{name: 0})


@pytest.mark.parametrize("joints", [np.zeros(2), np.zeros((4, 2)), np.zeros((2, 2, 3)), np.array(0.0)])
def test_joints_of_another_shape_are_an_error(learned, joints):
    for method in (learned.hand_pixels, learned.inside):
        with pytest.raises(ArgumentError, match=r"joints: expected shape \(3,\) or \(N, 3\)"):
            method(joints)


def test_joints_that_are_no_numbers_are_an_error(learned):
    for method in (learned.hand_pixels, learned.inside):
        with pytest.raises(ArgumentError, match="joints: expected finite"):
            method([0.0, np.nan, 0.0])


def test_adapting_to_joint_offsets_lowers_the_error_and_leaves_the_first_map_alone(learned):
    offset = 0.04
    changed, test = samples(60, 5, offset=offset, noise=0.3), samples(200, 6, offset=offset)
    before = learned.hand_pixels(test.joints)["left"]
    adapted = learned.adapt(changed)
    old, new = error(learned, test), error(adapted, test)
    for camera in test.cameras:
        assert new[camera] < 0.15 * old[camera]
    np.testing.assert_array_equal(learned.hand_pixels(test.joints)["left"], before)


def test_adapting_finds_joint_offsets_and_shifts_of_the_image(learned):
    turned = learned.adapt(samples(200, 5, offset=0.04))
    assert 0.01 < turned.correction.offset[0] < 0.06
    some, test = samples(15, 5), samples(200, 6)
    moved = Samples(NAMES, some.joints, {"left": some.pixels["left"] + (9.0, -6.0)})
    shifted = learned.adapt(moved)
    off = shifted.hand_pixels(test.joints)["left"] - learned.hand_pixels(test.joints)["left"]
    np.testing.assert_allclose(np.median(off, axis=0), (9.0, -6.0), atol=1.0)
    np.testing.assert_allclose(shifted.correction.output("left")[1], (9.0, -6.0), atol=3.0)


def test_adapting_again_goes_on_from_what_is_known(learned):
    test = samples(200, 6, offset=0.04)
    once = learned.adapt(samples(15, 5, offset=0.04, noise=1.0))
    twice = once.adapt(samples(150, 8, offset=0.04, noise=1.0))
    assert sum(error(twice, test).values()) < sum(error(once, test).values())
    assert twice.correction.samples == 2 * 15 + 2 * 150
    few = samples(10, 9, offset=0.04, noise=1.0)
    assert sum(error(twice.adapt(few), test).values()) < sum(error(learned.adapt(few), test).values())


def test_adapting_needs_the_joints_one_camera_and_labels(learned):
    some = samples(20, 5)
    with pytest.raises(ArgumentError, match="no joint 'elbow'"):
        learned.adapt(Samples(NAMES[:2], some.joints[:, :2], some.pixels))
    with pytest.raises(ArgumentError, match="some of the cameras left, right, got chest"):
        learned.adapt(Samples(NAMES, some.joints, {"chest": some.pixels["left"]}))
    with pytest.raises(ArgumentError, match="too few to adapt by"):
        learned.adapt(some.take(slice(0, 2)))
    only_left = learned.adapt(Samples(NAMES, some.joints, {"left": some.pixels["left"]}))
    assert only_left.cameras == learned.cameras


def test_a_map_comes_back_from_its_file_as_it_was(learned, tmp_path):
    adapted = learned.adapt(samples(20, 5, offset=0.03))
    adapted.save(tmp_path / "hand.safetensors")
    loaded = HandMap.load(tmp_path / "hand.safetensors")
    joints = samples(20, 7).joints
    for camera in adapted.cameras:
        np.testing.assert_array_equal(loaded.hand_pixels(joints)[camera], adapted.hand_pixels(joints)[camera])
    assert (loaded.names, loaded.constant, loaded.errors) == (
        adapted.names, dict(adapted.constant), dict(adapted.errors),
    )  # fmt: skip
    np.testing.assert_array_equal(loaded.inside(joints), adapted.inside(joints))
    more = samples(20, 8, offset=0.03)
    np.testing.assert_array_equal(loaded.adapt(more).correction.vector, adapted.adapt(more).correction.vector)


def test_files_that_are_no_hand_maps_say_so(learned, tmp_path):
    path = tmp_path / "hand.safetensors"
    with pytest.raises(ArgumentError, match="cannot read"):
        HandMap.load(path)
    learned.save(path)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(ArgumentError, match="cut off"):
        HandMap.load(path)
    from motorprime.model_files import write_model

    write_model(path, "neural projection", {"a": np.ones(2)}, {})
    with pytest.raises(ArgumentError, match="is a neural projection, a hand map expected"):
        HandMap.load(path)
    write_model(path, "hand map", {"a": np.ones(2)}, {"joints": ["a"]})
    with pytest.raises(ArgumentError, match="does not hold a whole hand map"):
        HandMap.load(path)


def test_a_file_whose_joints_do_not_fit_its_networks_says_so(learned, tmp_path):
    from motorprime.model_files import read_model, write_model

    path = tmp_path / "hand.safetensors"
    learned.save(path)
    arrays, about = read_model(path, "hand map")
    write_model(path, "hand map", arrays, about | {"constant": {}})
    with pytest.raises(ArgumentError, match="3 moving joints do not fit the networks"):
        HandMap.load(path)
