"""The fused cycle: bit for bit what the public functions give one after the other."""

import itertools
import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import motorprime as mp
import reference
from motorprime import Attended, Mlp, attention_step
from motorprime.errors import ArgumentError, ArgumentTypeError, NotInViewError
from motorprime.landscape import gaussian_landscape, gibbs_sample, kernel_landscape, threshold
from step_rig import BLIND, JOINTS, MAPS, MATRIX, PIXELS, POINTS, POSTURE, PROJECTOR, SHAPES, moved, network

examples = settings(deadline=None, derandomize=True, max_examples=250)


def projected(matrix, points):
    """A matrix's pixels with the sums in the order of the kernel; `reference.project` is the plain way."""
    x, y, z = points.T
    a, b, c = matrix[2, :3]
    matrix = matrix * (np.sign(np.linalg.det(matrix[:, :3])) / math.sqrt(a * a + b * b + c * c))
    across, down, depth = (row[0] * x + row[1] * y + row[2] * z + row[3] for row in matrix)
    ahead = depth >= 0.01
    return np.stack([across[ahead] / depth[ahead], down[ahead] / depth[ahead]], axis=1)


def landscape_of(source, shape, points, joints, width, kernel, cutoff, mixing):
    """Landscape of one camera by the public functions, None where all of the path lies behind."""
    if isinstance(source, Mlp) and points is None:
        u, v, l1, l2, l3 = source(np.asarray(joints)[None])[0].astype(float).tolist()
        chol = (math.exp(min(max(l1, -12.0), 12.0)), l2, math.exp(min(max(l3, -12.0), 12.0)))
        return gaussian_landscape((u, v), chol, shape, cutoff=cutoff, mixing=mixing)
    if isinstance(source, Mlp):
        inputs = np.hstack([points, np.broadcast_to(np.asarray(joints, float), (len(points), len(joints)))])
        places = source(inputs)
    elif source.shape == (3, 4):
        places = projected(source.astype(float), points)
    else:
        places = source[~np.isnan(source).any(axis=1)]
    if not len(places):
        return None
    return kernel_landscape(places, shape, width=width or 40 * shape[1] / 320, kernel=kernel)


def composed(sources, shapes, points=None, joints=None, *, seed=0, windows=None, **options):
    """The step as calls of the public functions."""
    wanted = {name: options.pop(name) for name in ("fraction", "count") if name in options}
    options = {"width": None, "kernel": "triangular", "cutoff": 3.0, "mixing": 1.0} | options
    seen = {}
    for k, (camera, source) in enumerate(sources.items()):
        landscape = landscape_of(source, shapes[camera], points, joints, **options)
        if landscape is None or not landscape.any():
            continue
        if windows is not None:
            centres = gibbs_sample(landscape, windows, seed=(seed + k) % 2**64)
            seen[camera] = Attended(landscape, centres=centres)
            continue
        level = threshold(landscape, **wanted)
        seen[camera] = Attended(landscape, mask=(landscape >= level) & (landscape > 0), level=level)
    return seen


def assert_same(attended, right):
    assert list(attended) == list(right)
    for camera, one in attended.items():
        other = right[camera]
        assert one.landscape.dtype == np.float32
        assert one.landscape.tobytes() == other.landscape.tobytes()
        assert one.level == other.level
        for look, wanted, dtype in ((one.centres, other.centres, np.int32), (one.mask, other.mask, np.bool_)):
            assert (look is None) == (wanted is None)
            if look is not None:
                assert look.dtype == dtype
                np.testing.assert_array_equal(look, wanted)


LOOKS = [
    {"windows": 12},
    {"windows": 0},
    {"fraction": 0.1},
    {"fraction": 1.0},
    {"count": 1},
    {"count": 10**7},
]
looks = st.sampled_from(LOOKS) | st.builds(lambda f: {"fraction": f}, st.floats(1e-6, 1.0))
shapes = st.tuples(st.integers(1, 70), st.integers(1, 70))
seeds = st.integers(0, 2**64 - 1)
kernels = st.sampled_from(["triangular", "gaussian"])
widths = st.none() | st.floats(0.3, 60.0)
reals = st.floats(-40.0, 110.0) | st.integers(-10, 80).map(float)
paths = st.lists(st.tuples(reals, reals) | st.just((math.nan, 3.0)), min_size=1, max_size=30).map(np.array)


@examples
@given(
    st.lists(st.tuples(shapes, paths), min_size=1, max_size=3), widths, kernels, looks, seeds, st.booleans()
)
def test_pixels_give_what_the_functions_give_one_by_one(cameras, width, kernel, look, seed, threads):
    sizes = {str(k): shape for k, (shape, _) in enumerate(cameras)}
    pixels = {str(k): path for k, (_, path) in enumerate(cameras)}
    options = {"width": width, "kernel": kernel, "seed": seed} | look
    if all(np.isnan(path).any(axis=1).all() for path in pixels.values()):
        with pytest.raises(NotInViewError, match="pixels"):
            attention_step(None, sizes, pixels=pixels, threads=threads, **options)
        return
    right = composed(pixels, sizes, **options)
    assert_same(attention_step(None, sizes, pixels=pixels, threads=threads, **options), right)


@examples
@given(seeds, st.integers(1, 40), widths, kernels, looks, st.booleans())
def test_matrices_and_networks_give_what_the_functions_give_one_by_one(
    seed, rows, width, kernel, look, threads
):
    rng = np.random.default_rng(seed)
    maps = {
        "left": MATRIX + rng.normal(0, 1, (3, 4)) * [[9], [9], [0.5]],
        "right": network((3 + 4, 9, 2), seed, [30.0, 20.0], [30.0, 30.0]),
        "hand": (MATRIX + rng.normal(0, 1, (3, 4))).astype(np.float32),
    }
    points, joints = rng.normal(0, 1, (rows, 3)), rng.normal(0, 1, 4)
    options = {"width": width, "kernel": kernel, "seed": seed} | look
    right = composed(maps, SHAPES, points, joints, **options)
    assert_same(attention_step(maps, SHAPES, points, joints, threads=threads, **options), right)


@examples
@given(seeds, shapes, st.floats(0.1, 6.0), st.sampled_from([0.0, 0.2, 1.0]), looks, st.booleans())
def test_postures_give_what_the_functions_give_one_by_one(seed, shape, cutoff, mixing, look, threads):
    mean = [shape[1] / 2, shape[0] / 2, 2.0, 0.0, 2.0]
    maps = {str(k): network((3, 7, 5), seed + k, mean, [20.0, 20.0, 1.0, 5.0, 1.0]) for k in range(3)}
    sizes = dict.fromkeys(maps, shape)
    joints = np.random.default_rng(seed).normal(0, 1, 3)
    options = {"cutoff": cutoff, "mixing": mixing, "seed": seed} | look
    right = composed(maps, sizes, None, joints, **options)
    assert_same(attention_step(maps, sizes, joints=joints, threads=threads, **options), right)


@pytest.mark.parametrize("look", LOOKS, ids=str)
@pytest.mark.parametrize("kernel", ["triangular", "gaussian"])
@pytest.mark.parametrize("width", [0.4, 1.0, 3.7, 20.0, 300.0])
def test_one_rig_at_many_widths(width, kernel, look):
    options = {"width": width, "kernel": kernel, "seed": 4} | look
    right = composed(MAPS, SHAPES, POINTS, JOINTS, **options)
    for threads in (False, True):
        assert_same(attention_step(MAPS, SHAPES, POINTS, JOINTS, threads=threads, **options), right)


def test_agrees_with_the_twin():
    points = np.concatenate([POINTS, -POINTS])
    pixels = {"left": reference.project(MATRIX, points), "hand": reference.project(MAPS["hand"], points)}
    pixels["right"] = np.full((3, 2), 1e6)
    order = {name: pixels[name] for name in ("left", "right", "hand")}
    for look in ({"windows": 9}, {"fraction": 0.07}, {"count": 200}):
        right = reference.attention_step(order, SHAPES, 9.0, seed=3, **look)
        seen = attention_step(None, SHAPES, pixels=order, width=9.0, seed=3, **look)
        assert list(seen) == list(right) == ["left", "hand"]
        for camera, (landscape, looked) in right.items():
            peak = reference.kernel_peak(points, 9.0)
            np.testing.assert_allclose(seen[camera].landscape, landscape, atol=1e-5 * peak)
            if "windows" in look:
                np.testing.assert_array_equal(seen[camera].centres, looked)
            else:
                assert (seen[camera].mask != looked).mean() < 1e-3


def test_matrices_see_what_the_projection_sees():
    """Bit for bit only up to the rounding of two ways to project."""
    matrices = {"left": MATRIX, "hand": MAPS["hand"]}
    points = np.concatenate([POINTS, -POINTS])
    attention = mp.Attention(mp.PinholeProjection(matrices, shape={name: SHAPES[name] for name in matrices}))
    found = attention.motor_plan(points)
    seen = attention_step(matrices, SHAPES, points, fraction=0.2)
    assert list(seen) == list(found)
    for camera, look in found.items():
        peak = look.landscape.max()
        np.testing.assert_allclose(seen[camera].landscape, look.landscape, atol=1e-5 * peak)


def test_a_default_width_is_40_in_an_image_320_wide():
    for columns, width in ((320, 40.0), (160, 20.0), (640, 80.0), (50, 6.25)):
        sizes = {"left": (24, columns)}
        pixels = {"left": np.array([[20.0, 10.0], [40.0, 12.0]])}
        default = attention_step(None, sizes, pixels=pixels, windows=5, seed=1)
        assert_same(default, attention_step(None, sizes, pixels=pixels, windows=5, seed=1, width=width))


def test_the_kth_camera_draws_with_seed_plus_k_whether_or_not_others_see():
    three = attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=20, seed=7)
    assert list(three) == list(MAPS)
    for k, camera in enumerate(MAPS):
        alone = attention_step({camera: MAPS[camera]}, SHAPES, POINTS, JOINTS, windows=20, seed=7 + k)
        assert_same({camera: three[camera]}, alone)
    blind = MAPS | {"left": BLIND}
    two = attention_step(blind, SHAPES, POINTS, JOINTS, windows=20, seed=7)
    assert_same(two, {camera: three[camera] for camera in ("right", "hand")})
    wrapped = attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=20, seed=2**64 - 1)
    start = attention_step({"right": PROJECTOR}, SHAPES, POINTS, JOINTS, windows=20, seed=0)
    assert_same({"right": wrapped["right"]}, start)


def test_cameras_that_see_nothing_are_left_out():
    beside = moved(1e4, 0.0)
    maps = {"left": BLIND, "right": MATRIX, "hand": beside}
    for look in LOOKS:
        seen = attention_step(maps, SHAPES, POINTS, **look)
        assert list(seen) == ["right"]
        assert attention_step({"left": BLIND, "hand": beside}, SHAPES, POINTS, **look) == {}
        assert attention_step({"hand": beside}, SHAPES, POINTS, **look) == {}


@pytest.mark.parametrize("look", LOOKS, ids=str)
def test_a_path_behind_every_camera_is_an_error(look):
    with pytest.raises(NotInViewError, match="points: none of them is in front"):
        attention_step({"left": BLIND, "right": BLIND}, SHAPES, POINTS, **look)
    blind = dict.fromkeys(SHAPES, np.full((4, 2), np.nan))
    with pytest.raises(NotInViewError, match="pixels: none of them is in front"):
        attention_step(None, SHAPES, pixels=blind, **look)
    with pytest.raises(NotInViewError, match="pixels: none of them is in front"):
        attention_step(None, SHAPES, pixels={"left": np.zeros((0, 2))}, **look)


def test_a_point_counts_from_a_centimetre_in_front():
    behind = np.array([[0.0, 0.0, 0.0099999]])
    with pytest.raises(NotInViewError):
        attention_step({"left": MATRIX}, SHAPES, behind, windows=1)
    assert attention_step({"left": MATRIX}, SHAPES, [[0.0, 0.0, 0.01]], windows=1)
    both = attention_step({"left": MATRIX}, SHAPES, np.concatenate([POINTS, behind]), windows=9, seed=1)
    assert_same(both, attention_step({"left": MATRIX}, SHAPES, POINTS, windows=9, seed=1))


@pytest.mark.parametrize("scale", [-1.0, 1e-3, -250.0])
def test_a_matrix_of_another_scale_or_sign_is_the_same_camera(scale):
    given = attention_step({"left": MATRIX}, SHAPES, POINTS, windows=9, seed=1)["left"]
    scaled = attention_step({"left": scale * MATRIX}, SHAPES, POINTS, windows=9, seed=1)["left"]
    np.testing.assert_allclose(scaled.landscape, given.landscape, rtol=1e-5, atol=1e-10)
    assert scaled.landscape.any()


def test_a_matrix_without_a_centre_is_an_error_that_names_it():
    for flat in (np.zeros((3, 4)), np.ones((3, 4))):
        with pytest.raises(ArgumentError, match=r"maps\['left'\] must be a projection matrix"):
            attention_step({"left": flat}, SHAPES, POINTS, windows=9)


def test_rows_of_nan_are_points_that_a_camera_does_not_see():
    dotted = PIXELS["left"].copy()
    dotted[::3] = np.nan
    dotted[1, 0] = dotted[4, 1] = np.nan
    left = dotted[~np.isnan(dotted).any(axis=1)]
    for dtype in (np.float32, np.float64):
        seen = attention_step(None, SHAPES, pixels={"left": dotted.astype(dtype)}, windows=9, seed=1)
        right = attention_step(None, SHAPES, pixels={"left": left.astype(dtype)}, windows=9, seed=1)
        assert_same(seen, right)


def test_shapes_may_be_of_more_cameras_and_inputs_of_any_layout():
    right = attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=9, seed=1)
    more = SHAPES | {"back": (3, 4)}
    layouts = {name: m if isinstance(m, Mlp) else np.asfortranarray(m) for name, m in MAPS.items()}
    path = np.asfortranarray(POINTS)
    assert_same(attention_step(layouts, more, path, JOINTS[::-1][::-1], windows=9, seed=1), right)
    lists = {name: list(shape) for name, shape in SHAPES.items()}
    assert_same(attention_step(MAPS, lists, POINTS.tolist(), JOINTS.tolist(), windows=9, seed=1), right)
    plain = {name: path.tolist() for name, path in PIXELS.items()}
    given = attention_step(None, SHAPES, pixels=PIXELS, windows=9, seed=1)
    assert_same(attention_step(None, SHAPES, pixels=plain, windows=9, seed=1), given)
    numbers = {name: (np.int32(h), np.int64(w)) for name, (h, w) in SHAPES.items()}
    assert_same(attention_step(MAPS, numbers, POINTS, JOINTS, windows=np.uint8(9), seed=1), right)


def test_arguments_are_not_changed():
    maps, points, joints = {"left": MATRIX.copy(), "right": PROJECTOR}, POINTS.copy(), JOINTS.copy()
    attention_step(maps, SHAPES, points, joints, windows=9)
    pixels = {name: path.copy() for name, path in PIXELS.items()}
    attention_step(None, SHAPES, pixels=pixels, fraction=0.2)
    np.testing.assert_array_equal(maps["left"], MATRIX)
    np.testing.assert_array_equal(points, POINTS)
    np.testing.assert_array_equal(joints, JOINTS)
    for name, path in PIXELS.items():
        np.testing.assert_array_equal(pixels[name], path)


def arrays(attended):
    """All arrays of a result."""
    parts = [(one.landscape, one.centres, one.mask) for one in attended.values()]
    return [array for part in parts for array in part if array is not None]


@pytest.mark.parametrize("look", LOOKS, ids=str)
def test_out_is_written_again(look):
    first = attention_step(MAPS, SHAPES, POINTS, JOINTS, seed=1, **look)
    held = arrays(first)
    for array in held:
        array.view(np.uint8)[...] = 1  # whatever was there must not shine through
    again = attention_step(MAPS, SHAPES, POINTS + 0.1, JOINTS, seed=2, out=first, **look)
    assert all(a is b for a, b in zip(arrays(again), held, strict=True))
    assert_same(again, attention_step(MAPS, SHAPES, POINTS + 0.1, JOINTS, seed=2, **look))


def test_arrays_that_do_not_fit_are_made_anew():
    first = attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=9, seed=1)
    before = [array.copy() for array in arrays(first)]
    taller = {name: (h + 1, w) for name, (h, w) in SHAPES.items()}
    for sizes, look in ((SHAPES, {"windows": 8}), (SHAPES, {"fraction": 0.1}), (taller, {"windows": 9})):
        fresh = attention_step(MAPS, sizes, POINTS, JOINTS, seed=5, out=first, **look)
        assert_same(fresh, attention_step(MAPS, sizes, POINTS, JOINTS, seed=5, **look))
        assert not any(a is b for a in arrays(fresh) for b in arrays(first))
    for array, copy in zip(arrays(first), before, strict=True):
        np.testing.assert_array_equal(array, copy)
    masks = attention_step(MAPS, SHAPES, POINTS, JOINTS, count=50)
    other = attention_step(MAPS, SHAPES, POINTS, JOINTS, fraction=0.3, out=masks)
    assert all(other[camera].mask is masks[camera].mask for camera in masks)


def test_an_out_of_some_cameras_serves_those():
    first = attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=9, seed=1)
    again = attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=9, seed=2, out={"right": first["right"]})
    assert again["right"].landscape is first["right"].landscape
    assert again["left"].landscape is not first["left"].landscape
    fresh = attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=9, seed=2)
    assert_same(again, fresh)
    assert_same(attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=9, seed=2, out={}), fresh)


def test_seeds():
    known = attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=9, seed=3)
    assert_same(attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=9, seed=np.uint64(3)), known)
    drawn = [attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=9) for _ in range(2)]
    assert not np.array_equal(drawn[0]["left"].centres, drawn[1]["left"].centres)
    masks = [attention_step(MAPS, SHAPES, POINTS, JOINTS, count=50, seed=seed) for seed in (0, 1)]
    assert_same(*masks)


def test_a_numpy_generator_gives_one_draw_and_advances():
    generator = np.random.default_rng(7)
    stream = np.random.default_rng(7).bit_generator
    for _ in range(2):
        seen = attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=9, seed=generator)
        seed = int(stream.random_raw())
        assert_same(seen, attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=9, seed=seed))


def test_threads_of_python_do_not_disturb_each_other():
    cases = [(POINTS + 0.02 * k, k) for k in range(12)]
    right = [attention_step(MAPS, SHAPES, p, JOINTS, windows=9, seed=k) for p, k in cases]

    def work(case):
        points, seed = case
        out = None
        for threads in (False, True, False):
            out = attention_step(MAPS, SHAPES, points, JOINTS, windows=9, seed=seed, threads=threads, out=out)
        return out

    with ThreadPoolExecutor(4) as pool:
        for seen, wanted in zip(pool.map(work, cases), right, strict=True):
            assert_same(seen, wanted)


def linear(weights, biases):
    """A network of one layer from one joint to an ellipse."""
    five = np.ones(5)
    return Mlp([np.reshape(weights, (5, 1))], [biases], [0.0], [1.0], 0 * five, five)


@pytest.mark.parametrize("look", [{"windows": 5}, {"fraction": 0.2}], ids=str)
@pytest.mark.parametrize("mixing", [1.0, 0.2])
def test_every_output_of_a_network_is_an_ellipse(look, mixing):
    extremes = (-1e30, -13.0, -12.0, 0.0, 3.0, 12.0, 1e30)
    for l1, l2, l3 in itertools.product(extremes, (-1e30, -7.0, 0.0, 1e30), extremes):
        maps = {"left": linear([0, 0, l1, l2, l3], [30.0, 20.0, 0, 0, 0])}
        right = composed(maps, SHAPES, None, [1.0], mixing=mixing, seed=1, **look)
        seen = attention_step(maps, SHAPES, joints=[1.0], mixing=mixing, seed=1, **look)
        assert_same(seen, right)
        mean, chol = reference.ellipse(np.array([30.0, 20.0, l1, l2, l3]))
        assert (chol[[0, 2]] > 0).all() and mean.tolist() == [30.0, 20.0]
        for one in seen.values():
            assert one.landscape.min() >= 0 and 0 < one.landscape.max() <= 1


def test_weights_beyond_measure_give_an_ellipse_or_nothing():
    for signs in itertools.product((-1e30, 0.0, 1e30), repeat=5):
        maps = {"left": linear(signs, np.zeros(5))}
        for joint in (1.0, -1.0, 1e-29):
            seen = attention_step(maps, SHAPES, joints=[joint], windows=3, seed=0)
            assert_same(seen, composed(maps, SHAPES, None, [joint], windows=3, seed=0))


def test_an_output_beyond_float32_is_an_error_that_names_the_map():
    maps = {"left": linear([1e30] * 5, np.zeros(5))}
    with pytest.raises(ArgumentError, match=r"maps\['left'\].* overflows float32"):
        attention_step(maps, SHAPES, joints=[1e30], windows=3)


@pytest.mark.parametrize("field", ["landscape", "centres", "mask", "level"])
def test_a_result_is_frozen(field):
    one = attention_step(MAPS, SHAPES, POINTS, JOINTS, windows=9)["left"]
    with pytest.raises(AttributeError):
        setattr(one, field, None)


@examples
@given(shapes, paths, st.integers(1, 90), st.floats(1.0, 20.0), kernels, looks, seeds)
def test_a_stride_gives_the_landscape_of_a_smaller_image(shape, path, stride, wide, kernel, look, seed):
    width, options = wide * stride, {"kernel": kernel, "seed": seed} | look
    small = tuple(-(-side // stride) for side in shape)
    centred = (path - (stride - 1) / 2) / stride if stride > 1 else path
    if np.isnan(path).any(axis=1).all():
        return
    if "count" in look:
        look = {"count": -(-look["count"] // stride**2)}
    right = composed({"a": centred}, {"a": small}, width=width / stride, **(options | look))
    found = attention_step(None, {"a": shape}, pixels={"a": path}, width=width, stride=stride, **options)
    assert list(found) == list(right)
    for camera, one in found.items():
        assert one.landscape.tobytes() == right[camera].landscape.tobytes()
        if one.mask is not None:
            whole = right[camera].mask.repeat(stride, axis=0).repeat(stride, axis=1)
            np.testing.assert_array_equal(one.mask, whole[: shape[0], : shape[1]])
        else:
            np.testing.assert_array_equal(one.centres // stride, right[camera].centres)
            assert (one.centres >= 0).all()
            assert (one.centres < shape[::-1]).all()


def test_ellipses_have_strides_too():
    found = attention_step({"a": POSTURE}, {"a": (48, 64)}, joints=JOINTS, fraction=0.2, stride=3)["a"]
    u, v, l1, l2, l3 = POSTURE(np.asarray(JOINTS)[None])[0].astype(float).tolist()
    chol = (math.exp(l1) / 3, l2 / 3, math.exp(l3) / 3)
    right = gaussian_landscape(((u - 1) / 3, (v - 1) / 3), chol, (16, 22))
    np.testing.assert_allclose(found.landscape, right, atol=1e-6)
    every = attention_step({"a": POSTURE}, {"a": (48, 64)}, joints=JOINTS, fraction=0.2)["a"]
    np.testing.assert_allclose(found.landscape[:, :-1], every.landscape[1::3, 1::3], atol=1e-6)


def test_windows_fall_on_every_pixel_of_a_cell_alike():
    # A single cell, cut off by the border of the image: 3 x 5 of 8 x 8 pixels.
    options = {"windows": 30_000, "stride": 8, "width": 40, "seed": 0}
    centres = attention_step(None, {"a": (3, 5)}, pixels={"a": [[2.0, 1.0]]}, **options)["a"].centres
    counts = np.bincount(centres[:, 1] * 5 + centres[:, 0], minlength=15)
    assert len(counts) == 15
    assert (abs(counts - 2000) < 5 * math.sqrt(2000)).all()


@pytest.mark.parametrize("stride", [0, -1, 2**31, 1.5, "2", 6])
def test_a_stride_is_a_number_of_pixels_and_smaller_than_the_kernel(stride):
    with pytest.raises((ArgumentError, ArgumentTypeError), match="stride"):
        attention_step(None, {"a": (9, 9)}, pixels={"a": [[4.0, 4.0]]}, windows=1, stride=stride, width=5)


def test_arrays_of_another_stride_are_not_written_again():
    given_ = {"shapes": {"a": (30, 40)}, "pixels": {"a": [[20.0, 15.0]]}, "fraction": 0.1}
    coarse = attention_step(None, **given_, stride=2)
    fine = attention_step(None, **given_, out=coarse)
    assert fine["a"].landscape.shape == (30, 40)
    assert attention_step(None, **given_, stride=2, out=coarse)["a"].landscape is coarse["a"].landscape


def test_a_pair_of_networks_leaves_out_what_the_second_one_does_not_see():
    inputs = np.hstack([POINTS, np.broadcast_to(JOINTS, (len(POINTS), 3))])
    middle = float(np.median(network((6, 5, 1), 9, [0.0], [1.0])(inputs)))
    sight = network((6, 5, 1), 9, [-middle], [1.0])
    seen = sight(inputs)[:, 0] >= 0.0
    assert 0 < seen.sum() < len(POINTS)
    shapes = {"right": SHAPES["right"]}
    both = attention_step({"right": (PROJECTOR, sight)}, shapes, POINTS, JOINTS, fraction=0.2)
    assert_same(both, attention_step({"right": PROJECTOR}, shapes, POINTS[seen], JOINTS, fraction=0.2))
    with pytest.raises(ArgumentError, match=r"points: maps\['right'\] is a pair of networks"):
        attention_step({"right": (PROJECTOR, sight)}, shapes, joints=JOINTS, fraction=0.2)
    with pytest.raises(ArgumentError, match=r"maps\['right'\] must be a network of 6 inputs and 1 outputs"):
        attention_step({"right": (PROJECTOR, PROJECTOR)}, shapes, POINTS, JOINTS, fraction=0.2)
    blind = network((6, 5, 1), 9, [-9.0], [1.0])
    with pytest.raises(NotInViewError):
        attention_step({"right": (PROJECTOR, blind)}, shapes, POINTS, JOINTS, fraction=0.2)
    for odd in ((PROJECTOR,), (PROJECTOR, MATRIX), [PROJECTOR, sight]):
        with pytest.raises((ArgumentError, ArgumentTypeError), match="maps"):
            attention_step({"right": odd}, shapes, POINTS, JOINTS, fraction=0.2)
