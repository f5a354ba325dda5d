"""An upright cylinder from its silhouettes, drawn by ray casting: nothing is shared with the library."""

from __future__ import annotations

import numpy as np
import pytest

from motorprime import Camera, PinholeProjection, PosedCamera
from motorprime.cylinder import Cylinder, convex_spans, locate_cylinder, outline, outlines
from motorprime.detectors import Silhouette
from motorprime.errors import ArgumentError, ArgumentTypeError
from motorprime.kinematics import transform
from motorprime.views import Views
from poseless import Poseless, Shifted

CAMERA = Camera(320, 240, 257.34, 257.34, 160.0, 120.0)
GLASS = Cylinder(radius=0.0325, height=0.11)
PLACES = np.random.default_rng(0).uniform((-0.50, -0.10, -0.03), (-0.28, 0.20, 0.03), (10, 3))


def looking(origin, at) -> PosedCamera:
    """A camera at ``origin`` whose axis meets ``at``, its u axis level; z is up."""
    forward = np.subtract(at, origin) / np.linalg.norm(np.subtract(at, origin))
    right = np.cross(forward, (0, 0, 1))
    right /= np.linalg.norm(right)
    return PosedCamera(CAMERA, transform(np.column_stack([right, np.cross(forward, right), forward]), origin))


def eyes(at):
    """Two eyes 68 mm apart, 34 cm above the root, that look at a point, the head rolled by 3 degrees.

    Exactly upright sides would fall on whole columns: half a pixel of luck that no head has.
    """
    roll = np.eye(4)
    roll[:2, :2] = [[np.cos(0.05), -np.sin(0.05)], [np.sin(0.05), np.cos(0.05)]]
    views = {"left": looking((-0.05, -0.034, 0.34), at), "right": looking((-0.05, 0.034, 0.34), at)}
    return {name: PosedCamera(CAMERA, view.pose @ roll) for name, view in views.items()}


def cast(view, centre, cylinder=GLASS):
    """The solid's pixels (H, W): rays through pixel centres that hit its side or one of its ends."""
    height, width = view.camera.shape
    v, u = np.mgrid[:height, :width]
    origin, ray = view.rays(np.column_stack([u.ravel(), v.ravel()]).astype(float))
    origin = origin - centre
    a = ray[:, 0] ** 2 + ray[:, 1] ** 2
    b = ray[:, :2] @ origin[:2]
    root = b * b - a * (origin[0] ** 2 + origin[1] ** 2 - cylinder.radius**2)
    hit = np.zeros(len(ray), bool)
    for sign in (-1, 1):
        t = (-b + sign * np.sqrt(np.maximum(root, 0.0))) / a
        hit |= (root > 0) & (t > 0) & (np.abs(origin[2] + t * ray[:, 2]) <= cylinder.height / 2)
        t = (sign * cylinder.height / 2 - origin[2]) / ray[:, 2]
        hit |= (t > 0) & (np.hypot(origin[0] + t * ray[:, 0], origin[1] + t * ray[:, 1]) <= cylinder.radius)
    return hit.reshape(height, width)


def silhouette(mask) -> Silhouette:
    v, u = np.nonzero(mask)
    box = mask[v.min() : v.max() + 1, u.min() : u.max() + 1]
    return Silhouette(box, (int(u.min()), int(v.min())), np.array([u.mean(), v.mean()]), 0.5)


def seen(views, centre, cylinder=GLASS, hide=lambda mask, name: None):
    result = {}
    for name, view in views.items():
        mask = cast(view, centre, cylinder)
        hide(mask, name)
        result[name] = silhouette(mask)
    return result


def locate(views, silhouettes, cylinder=GLASS, through=lambda projection: projection, **options):
    return locate_cylinder(Views(through(PinholeProjection(views))), silhouettes, cylinder, **options)


def off(located, centre) -> float:
    return float(np.linalg.norm(located.centre - centre))


@pytest.fixture(scope="module")
def whole():
    """Offsets [m] of the located and of the plainly triangulated centres, over the places."""
    offsets = []
    for centre in PLACES:
        views = eyes(centre)
        silhouettes = seen(views, centre)
        located = locate(views, silhouettes, GLASS)
        assert min(located.overlap, located.explained, located.visible) > 0.985
        plain = PinholeProjection(views).triangulate({k: s.centroid[None] for k, s in silhouettes.items()})
        offsets.append((off(located, centre), np.linalg.norm(plain[0] - centre)))
    return np.array(offsets).T


def test_a_whole_cylinder_is_located_within_a_millimetre(whole):
    """One pixel of disparity is 7 to 12 mm here, so this is a tenth of a pixel; at worst a third."""
    located, _ = whole
    assert np.median(located) < 0.001 and located.max() < 0.004


def test_plain_triangulation_of_the_centroids_would_be_several_millimetres_off(whole):
    """The eye looks down on the top, and the near side looks larger: the correction matters."""
    located, plain = whole
    assert np.median(plain) > 0.003 and np.median(plain) > 4 * np.median(located)


def level_bar(mask, name):
    rows = np.nonzero(mask)[0]
    mask[int(rows.mean()) - 4 : int(rows.mean()) + 4] = False


def half_in_the_left_eye(mask, name):
    if name == "left":
        mask[:, : int(np.nonzero(mask)[1].mean())] = False


def lower_third(mask, name):
    mask[int(np.quantile(np.nonzero(mask)[0], 0.67)) :] = False


def foot(mask, name):
    mask[int(np.quantile(np.nonzero(mask)[0], 0.96)) + 1 :] = False


@pytest.mark.parametrize(
    ("hide", "typical", "worst", "visible"),
    [
        (level_bar, 0.003, 0.005, (0.80, 0.90)),
        (half_in_the_left_eye, 0.003, 0.006, (0.45, 0.60)),
        (lower_third, 0.004, 0.014, (0.60, 0.72)),
        (foot, 0.0025, 0.004, (0.93, 0.97)),
    ],
)
def test_a_partly_hidden_cylinder_is_fitted_by_its_outline(hide, typical, worst, visible):
    """A bar splits it, a hand hides a half of it in one eye, something before it hides its foot."""
    errors = []
    for centre in PLACES[:6]:
        views = eyes(centre)
        located = locate(views, seen(views, centre, hide=hide), GLASS)
        errors.append(off(located, centre))
        assert located.explained > 0.97 and visible[0] < located.visible < visible[1]
        assert located.overlap <= min(located.explained, located.visible) + 1e-9
    assert np.median(errors) < typical and max(errors) < worst


@pytest.mark.parametrize("shift", [(0.0, 0.25, 0.0), (0.0, -0.25, 0.0), (0.2, 0.0, 0.0), (-0.4, 0.0, 0.0)])
def test_what_the_image_s_border_cuts_off_is_not_missed(shift):
    """Outside the image nothing is predicted either."""
    centre = np.array([-0.33, 0.03, 0.0])
    views = eyes(centre + shift)
    silhouettes = seen(views, centre)
    assert any(
        s.box[0] == 0 or s.box[1] == 0 or s.box[2] == 320 or s.box[3] == 240 for s in silhouettes.values()
    )
    located = locate(views, silhouettes, GLASS)
    assert off(located, centre) < 0.003 and located.overlap > 0.97 and located.visible > 0.97


def test_a_small_one_is_located_too_and_the_size_matters():
    centre, small = np.array([-0.36, 0.05, 0.0]), Cylinder(0.014, 0.056)
    views = eyes(centre)
    silhouettes = seen(views, centre, small)
    assert off(locate(views, silhouettes, small), centre) < 0.002
    taken_for_large = locate(views, silhouettes, GLASS)
    assert taken_for_large.overlap < 0.6


def test_silhouettes_of_different_objects_are_not_explained():
    centre = np.array([-0.36, 0.05, 0.0])
    views = eyes(centre)
    for left, right in (((0, 0, 0), (0, 0, 0.12)), ((0, 0.08, 0), (0, -0.08, 0))):
        silhouettes = {
            "left": silhouette(cast(views["left"], centre + left)),
            "right": silhouette(cast(views["right"], centre + right)),
        }
        located = locate(views, silhouettes, GLASS)
        assert located is None or located.overlap < 0.5


def test_rays_that_meet_behind_the_cameras_locate_nothing():
    centre = np.array([-0.36, 0.05, 0.0])
    views = eyes(centre)
    silhouettes = {
        "left": silhouette(cast(views["left"], np.add(centre, (0, -0.08, 0)))),
        "right": silhouette(cast(views["right"], np.add(centre, (0, 0.08, 0)))),
    }
    assert locate(views, silhouettes, GLASS) is None


def test_three_cameras_serve_and_one_without_a_silhouette_does_not_count():
    centre = PLACES[0]
    views = {**eyes(centre), "side": looking((-0.3, -0.4, 0.3), centre)}
    silhouettes = seen(views, centre)
    assert off(locate(views, silhouettes, GLASS), centre) < 0.001
    del silhouettes["left"]
    assert off(locate(views, silhouettes, GLASS), centre) < 0.001


def test_fewer_than_two_silhouettes_is_an_error():
    views = eyes(PLACES[0])
    silhouettes = seen(views, PLACES[0])
    for few in (
        {},
        {"left": silhouettes["left"]},
        {"left": silhouettes["left"], "tail": silhouettes["right"]},
    ):
        with pytest.raises(ArgumentError, match="silhouettes: at least two"):
            locate(views, few, GLASS)


@pytest.mark.parametrize("corner", [(318, 100), (-2, 100), (100, 236), (100, -1)])
def test_a_silhouette_that_is_empty_or_sticks_out_of_its_image_is_named(corner):
    views = eyes(PLACES[0])
    silhouettes = seen(views, PLACES[0])
    centroid = np.array([100.0, 100.0])
    for wrong in (
        Silhouette(np.ones((5, 5), bool), corner, centroid, 0.5),
        Silhouette(np.zeros((5, 5), bool), (100, 100), centroid, 0.5),
    ):
        with pytest.raises(ArgumentError, match=r"silhouettes\['right'\]"):
            locate(views, {**silhouettes, "right": wrong}, GLASS)


@pytest.mark.parametrize(
    ("radius", "height", "name", "error"),
    [
        (0.0, 0.1, "radius", ArgumentError),
        (-0.1, 0.1, "radius", ArgumentError),
        (0.1, 0.0, "height", ArgumentError),
        (np.nan, 0.1, "radius", ArgumentError),
        (0.1, np.inf, "height", ArgumentError),
        ("wide", 0.1, "radius", ArgumentTypeError),
    ],
)
def test_a_cylinder_without_size_is_refused(radius, height, name, error):
    with pytest.raises(error, match=name):
        Cylinder(radius, height)


# Projections that know pixels only, and may err.


def test_pixels_are_all_that_locating_needs():
    """The starts differ, and so may the last step of 0.1 mm."""
    for centre in PLACES[:5]:
        views = eyes(centre)
        for hide in (lambda mask, name: None, lower_third):
            silhouettes = seen(views, centre, hide=hide)
            located, posed = (
                locate(views, silhouettes, through=through) for through in (Poseless, lambda known: known)
            )
            np.testing.assert_allclose(located.centre, posed.centre, atol=2e-4)
            assert located.overlap == pytest.approx(posed.overlap, abs=0.01)


class HalfBlind(Poseless):
    """Has no pixels for points beyond a plane."""

    def __init__(self, projection, beyond):
        super().__init__(projection)
        self._beyond = beyond

    def project(self, points, joints=None):
        lost = np.asarray(points)[:, 1] > self._beyond
        return {name: np.where(lost[:, None], np.nan, p) for name, p in super().project(points).items()}


def test_no_cylinder_is_located_where_a_part_of_it_has_no_pixels():
    """A hull of the remaining points would be an outline, of something else."""
    centre = PLACES[0]
    views = eyes(centre)
    silhouettes = seen(views, centre)
    for beyond in (centre[1] + 0.03, centre[1], centre[1] - 0.03):
        located = locate(views, silhouettes, through=lambda known, b=beyond: HalfBlind(known, b))
        if located is not None and located.explained > 0.0:
            assert located.centre[1] + GLASS.radius <= beyond
            assert located.overlap < 0.9


@pytest.mark.parametrize("k1", [-0.3, 0.25])
def test_a_lens_bends_sides_by_less_than_it_matters(k1):
    """Of sides that a lens bends the hull of the rims loses a sliver, half a pixel wide at most."""
    camera = Camera(320, 240, 257.34, 257.34, 160.0, 120.0, (k1, 0.08 if k1 < 0 else 0.0, 0.0, 0.0))
    errors = []
    for centre in PLACES[:6]:
        views = {n: PosedCamera(camera, v.pose) for n, v in eyes(np.add(centre, (0.0, 0.16, 0.0))).items()}
        silhouettes = seen(views, centre)
        for name, view in views.items():
            truth = silhouettes[name].paint((240, 320))
            drawn = filled(outline(view, centre, GLASS), (240, 320))
            assert np.count_nonzero(drawn != truth) < 0.01 * truth.sum()
        errors.append(off(locate(views, silhouettes), centre))
    assert np.median(errors) < 0.001 and max(errors) < 0.003


def test_a_known_level_turns_centimetres_into_millimetres():
    """4 pixels to and fro are 5 cm of depth by disparity; across the table they are a few millimetres."""
    free, level = [], []
    for centre in PLACES[:6]:
        views = eyes(centre)
        silhouettes = seen(views, centre)
        options = {"through": lambda known: Shifted(known, left=(2.0, 1.0), right=(-2.0, -1.0)), "slack": 3.0}
        free.append(off(locate(views, silhouettes, **options), centre))
        known = locate(views, silhouettes, level=centre[2], **options)
        assert known.centre[2] == centre[2]
        assert known.explained > 0.97
        level.append(off(known, centre))
    assert np.median(free) > 0.02
    assert np.median(level) < 0.006 and max(level) < 0.008


def test_with_a_right_projection_a_level_changes_little_and_a_wrong_one_is_noticed():
    centre = PLACES[1]
    views = eyes(centre)
    silhouettes = seen(views, centre)
    assert off(locate(views, silhouettes, level=centre[2]), centre) < 0.001
    wrong = locate(views, silhouettes, level=centre[2] - 0.06)
    assert wrong.centre[2] == centre[2] - 0.06
    assert wrong.overlap < 0.9


def test_a_partly_hidden_one_stays_at_its_level():
    errors = []
    for centre in PLACES[:6]:
        views = eyes(centre)
        located = locate(views, seen(views, centre, hide=lower_third), level=centre[2])
        assert located.centre[2] == centre[2]
        errors.append(off(located, centre))
    assert np.median(errors) < 0.004 and max(errors) < 0.008


def test_slack_forgives_as_many_pixels_as_it_says_and_no_more():
    """Eyes that disagree by 2 x 3 pixels in height cannot both be right."""
    centre = PLACES[2]
    views = eyes(centre)
    silhouettes = seen(views, centre)

    def judged(slack):
        through = lambda known: Shifted(known, left=(0.0, 3.0), right=(0.0, -3.0))  # noqa: E731
        return locate(views, silhouettes, through=through, slack=slack)

    strict, half, full = judged(0.0), judged(1.5), judged(3.0)
    assert strict.overlap < half.overlap < 0.95
    assert full.explained == 1.0 and full.visible == full.overlap > 0.975


def test_slack_does_not_explain_other_things():
    """A glass is not taken for a smaller one, nearer, nor two glasses for one: see the limits of a report."""
    centre = np.array([-0.36, 0.05, 0.0])
    views = eyes(centre)
    large = seen(views, centre)
    assert locate(views, large, Cylinder(0.014, 0.056), slack=3.0).explained < 0.6
    apart = {"left": large["left"], "right": silhouette(cast(views["right"], np.add(centre, (0, 0, 0.12))))}
    located = locate(views, apart, slack=3.0)
    assert located is None or located.overlap < 0.5


def test_without_slack_the_judgement_is_that_of_the_pixels():
    """Intersection over union and both fractions, counted with masks; it is a lower and wider one."""
    centre = PLACES[3]
    views = eyes(centre)
    silhouettes = seen(views, centre, Cylinder(0.038, 0.09))
    located = locate(views, silhouettes)
    overlap, explained, visible = [], [], []
    for name, view in views.items():
        drawn = filled(outline(view, located.centre, GLASS), (240, 320))
        there = silhouettes[name].paint((240, 320))
        common = np.count_nonzero(drawn & there)
        overlap.append(common / np.count_nonzero(drawn | there))
        explained.append(common / there.sum())
        visible.append(common / drawn.sum())
    for ours, theirs in (
        (located.overlap, overlap),
        (located.explained, explained),
        (located.visible, visible),
    ):
        assert ours == pytest.approx(min(theirs), abs=0.005)
    assert located.overlap < min(located.explained, located.visible) - 0.03


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"slack": -1.0}, ArgumentError),
        ({"slack": np.nan}, ArgumentError),
        ({"slack": np.inf}, ArgumentError),
        ({"slack": "much"}, ArgumentTypeError),
        ({"level": np.nan}, ArgumentError),
        ({"level": [0.0, 0.1]}, ArgumentError),
        ({"level": "table"}, ArgumentTypeError),
    ],
    ids=str,
)
def test_a_level_or_slack_that_is_none_is_named(options, error):
    views = eyes(PLACES[0])
    with pytest.raises(error, match=next(iter(options))):
        locate(views, seen(views, PLACES[0]), **options)


def filled(polygon, shape):
    first, stop = convex_spans(polygon, shape)
    columns = np.arange(shape[1])
    assert (first <= stop).all() and first.min() >= 0 and stop.max() <= shape[1]
    return (columns >= first[:, None]) & (columns < stop[:, None])


def test_the_outline_encloses_the_solid_s_pixels_tightly_and_is_none_behind_a_camera():
    """The polygon has 48 corners a rim, so it may lose a sliver of a pixel at the rims."""
    for centre in PLACES:
        view = eyes(centre)["left"]
        truth = cast(view, centre)
        drawn = filled(outline(view, centre, GLASS), (240, 320))
        assert np.count_nonzero(drawn != truth) < 0.005 * truth.sum()
    assert outline(view, view.origin - 0.3 * view.pose[:3, 2], GLASS) is None
    assert outline(view, view.origin, GLASS) is None


@pytest.mark.parametrize("seed", range(5))
def test_spans_hold_the_pixels_whose_centres_lie_inside(seed):
    """Against the half-planes of a triangle, either way round, also where it leaves the array."""
    corners = np.random.default_rng(seed).uniform(-8, 30, (3, 2))
    v, u = np.mgrid[:18, :25]
    sides = [
        (bu - au) * (v - av) - (bv - av) * (u - au) > 0
        for (au, av), (bu, bv) in zip(corners, np.roll(corners, -1, axis=0), strict=True)
    ]
    inside = np.all(sides, axis=0) | ~np.any(sides, axis=0)
    for turned in (corners, corners[::-1], np.roll(corners, 1, axis=0)):
        np.testing.assert_array_equal(filled(turned, (18, 25)), inside)


def test_spans_take_level_edges_and_rows_without_any():
    for square in (
        [[1.5, 1.5], [3.5, 1.5], [3.5, 2.5], [1.5, 2.5]],
        [[3.5, 1.5], [3.5, 2.5], [1.5, 2.5], [1.5, 1.5]],
    ):
        expected = np.zeros((5, 6), bool)
        expected[2, 2:4] = True
        np.testing.assert_array_equal(filled(np.array(square, np.float32), (5, 6)), expected)
        assert not filled(np.array(square) + 100, (5, 6)).any()
        assert not filled(np.array(square) - 100, (5, 6)).any()


def test_silhouettes_that_a_lens_reaches_from_nowhere_give_no_position():
    camera = Camera(640, 480, 300.0, 300.0, 319.5, 239.5, (-0.4, 0.0, 0.0, 0.0))
    corner = Silhouette(np.ones((20, 20), np.bool_), (2, 2), np.array([11.5, 11.5]), 0.5)
    assert np.isnan(camera.rays(corner.centroid[None])).all()
    views = {
        name: PosedCamera(camera, transform(np.eye(3), (x, 0.0, 0.0)))
        for name, x in {"left": 0.0, "right": 0.068}.items()
    }
    assert locate(views, dict.fromkeys(views, corner), GLASS) is None


def test_outlines_are_those_of_each_camera_without_the_ones_that_are_behind():
    views = eyes(PLACES[0])
    views["behind"] = looking((-0.05, 0.0, 0.34), (1.0, 0.0, 0.34))
    drawn = outlines(Views(PinholeProjection(views)), PLACES[0], GLASS)
    assert set(drawn) == {"left", "right"}
    for name, polygon in drawn.items():
        np.testing.assert_allclose(polygon, outline(views[name], PLACES[0], GLASS), atol=1e-3)


def test_its_axis_is_inside_it_from_end_to_end():
    axis = Cylinder(0.03, 0.2).axis
    assert axis.shape == (4, 3)
    assert not axis[:, :2].any()
    assert 0.08 < axis[-1, 2] == -axis[0, 2] < 0.1
