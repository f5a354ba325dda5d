"""Pictures of attention: what is drawn where, and that nothing else is touched."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

import synthetic_run
from motorprime import ArgumentError, ArgumentTypeError, Windows
from motorprime.video import NoVideo, VideoWriter, figures, video_frame
from motorprime.viz import (
    BLUE,
    GREEN,
    MAGENTA,
    RED,
    WHITE,
    YELLOW,
    draw_attention,
    legend_strip,
    side_by_side,
    stereo_panel,
    story,
    write,
)

SHAPE = (60, 80)


@pytest.fixture
def grey():
    return np.full((*SHAPE, 3), 90, np.uint8)


def like(picture, colour, tolerance=30):
    """Where a picture (H, W, 3) has about a colour."""
    return (np.abs(picture.astype(int) - colour) <= tolerance).all(axis=2)


def test_nothing_to_draw_is_the_image_enlarged(grey):
    drawn = draw_attention(grey)
    assert drawn.shape == (120, 160, 3) and drawn.dtype == np.uint8
    assert np.abs(drawn.astype(int) - 90).max() <= 1
    assert draw_attention(grey, scale=3).shape == (180, 240, 3)


def test_inputs_stay_as_they_were(grey):
    landscape = np.zeros(SHAPE, np.float32)
    landscape[10:30, 10:30] = 3.0
    silhouette = landscape > 0
    path = np.array([[1.0, 1.0], [50.0, 40.0]])
    windows, hits = np.array([[20, 20]]), np.array([[5, 5]])
    given = (grey, landscape, silhouette, path, windows, hits)
    before = [array.copy() for array in given]
    for array in given:
        array.setflags(write=False)
    draw_attention(
        grey,
        landscape=landscape,
        silhouette=silhouette,
        path=path,
        windows=windows,
        hits=hits,
        label="left eye",
    )
    for array, old in zip(given, before, strict=True):
        assert np.array_equal(array, old)


def test_a_window_is_drawn_on_its_border_and_nowhere_else(grey):
    drawn = draw_attention(grey, windows=Windows(np.array([[40, 30]], np.int32), 10))
    blue = like(drawn, BLUE)
    # Columns 35..44, rows 25..34: twice that in the picture.
    expected = np.zeros_like(blue)
    expected[50:70, 70:90] = True
    expected[51:69, 71:89] = False
    assert np.array_equal(blue, expected)
    same = draw_attention(grey, windows=[[40, 30]], window_size=10)
    assert np.array_equal(drawn, same)


def test_a_window_at_the_border_is_shifted_into_the_image(grey):
    blue = like(draw_attention(grey, windows=[[0, 0]], window_size=10), BLUE)
    rows, columns = np.nonzero(blue)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (0, 19, 0, 19)


def test_windows_that_hit_are_yellow(grey):
    drawn = draw_attention(grey, windows=[[40, 30], [20, 20]], window_size=10, hits=[[35, 25]])
    assert like(drawn, YELLOW)[50, 75] and not like(drawn, BLUE)[50, 75]
    assert like(drawn, BLUE)[30, 35]


def test_no_windows_and_no_hits_draw_nothing(grey):
    drawn = draw_attention(grey, windows=np.zeros((0, 2), np.int32), hits=np.zeros((0, 2)))
    assert np.array_equal(drawn, draw_attention(grey))


def test_the_landscape_reddens_where_it_is_positive(grey):
    landscape = np.zeros(SHAPE, np.float32)
    landscape[10:30, 10:30] = 1e-6
    landscape[15:25, 15:25] = 2e-6
    drawn = draw_attention(grey, landscape=landscape).astype(int)
    redness = drawn[..., 0] - drawn[..., 1]
    assert redness[40, 40] > redness[24, 24] > 5
    assert redness[100, 140] == 0
    assert RED[0] > RED[1]


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_an_empty_landscape_changes_nothing(grey, value):
    drawn = draw_attention(grey, landscape=np.full(SHAPE, value, np.float32))
    assert np.array_equal(drawn, draw_attention(grey))


def test_the_path_is_a_white_line_with_its_end_marked(grey):
    drawn = draw_attention(grey, path=[[10.0, 30.0], [60.0, 30.0]])
    white = like(drawn, WHITE, 5)
    assert white[60:62, 25:100].any(axis=0).all()
    assert not white[:50].any() and not white[72:].any()
    assert white[:, 121 + 6 - 1 : 121 + 9].any()  # the ring around (60, 30)


def test_a_nan_row_interrupts_the_path(grey):
    drawn = draw_attention(
        grey, path=[[10.0, 30.0], [30.0, 30.0], [np.nan, np.nan], [50.0, 30.0], [70.0, 30.0]]
    )
    white = like(drawn, WHITE, 5)
    assert white[60, 40] and white[60, 120]
    assert not white[:, 70:95].any()


@pytest.mark.parametrize(
    "path",
    [
        np.zeros((0, 2)),
        np.full((4, 2), np.nan),
        [[5.0, 5.0]],
        [[-1e12, 30.0], [1e12, 30.0]],
        [[1e300, 1e300], [1e300, 1e301]],
        [[np.inf, 3.0], [3.0, 3.0]],
    ],
)
def test_strange_paths_are_drawn_as_far_as_they_are_visible(grey, path):
    assert draw_attention(grey, path=path).shape == (120, 160, 3)


def test_a_line_through_the_image_from_far_outside_keeps_its_direction(grey):
    white = like(draw_attention(grey, path=[[-1e7, 30.0], [1e7, 30.0]]), WHITE, 5)
    assert white[60:62].any(axis=0).all()
    assert not draw_attention(grey, path=[[-1e7, -50.0], [1e7, -50.0]])[8:].max() > 100


def test_the_silhouette_is_outlined_in_green(grey):
    silhouette = np.zeros(SHAPE, np.bool_)
    silhouette[20:40, 30:50] = True
    green = like(draw_attention(grey, silhouette=silhouette), GREEN, 60)
    assert green[40:80, 58:63].any(axis=1).all()
    assert not green[50:70, 70:90].any()


def test_an_obstacle_is_outlined_in_magenta_and_its_inside_left(grey):
    outline = np.array([[20.0, 10.0], [60.0, 10.0], [60.0, 40.0], [20.0, 40.0]])
    drawn = like(draw_attention(grey, obstacles=[outline]), MAGENTA, 40)
    assert drawn[20:22, 50:110].any(axis=0).all() and drawn[80:82, 50:110].any(axis=0).all()
    assert drawn[30:70, 40:42].any(axis=1).all() and drawn[30:70, 120:122].any(axis=1).all()  # closed
    assert not drawn[28:72, 50:110].any()


def test_an_obstacle_out_of_view_draws_nothing(grey):
    far = np.array([[200.0, 10.0], [260.0, 10.0], [260.0, 40.0]])
    assert np.array_equal(draw_attention(grey, obstacles=[far]), draw_attention(grey))


def test_known_obstacles_are_drawn_in_every_eye_that_has_them_in_view():
    pick = synthetic_run.pick()[2]
    without = stereo_panel(replace(pick, outlines={}))
    changed = (stereo_panel(replace(pick, outlines={"right": pick.outlines["right"]})) != without).any(axis=2)
    assert changed[:, -160:].any() and not changed[:, :160].any()
    assert (stereo_panel(pick) != without)[:, :160].any()


def test_strangers_are_told_on_which_part_of_the_way_the_hand_is():
    told = [story(cycle) for cycle in synthetic_run.pick()]
    assert "via-point" in told[3] and "before the target" in told[5] and "last way" in told[6]
    assert len(set(told)) == 8
    assert story(synthetic_run.cycle("reach")) == "Reach: look along the planned path of the hand"
    assert story(synthetic_run.cycle("dance")) == "dance"


def test_wrong_arguments_are_named(grey):
    with pytest.raises(ArgumentError, match=r"obstacles: shape \(N, 2\)"):
        draw_attention(grey, obstacles=[np.zeros(4)])
    with pytest.raises(ArgumentError, match="landscape: shape"):
        draw_attention(grey, landscape=np.ones((80, 60), np.float32))
    with pytest.raises(ArgumentError, match="silhouette: shape"):
        draw_attention(grey, silhouette=np.ones((2, 2), np.bool_))
    with pytest.raises(ArgumentError, match=r"path: shape \(N, 2\)"):
        draw_attention(grey, path=np.zeros((4, 3)))
    with pytest.raises(ArgumentError, match="hits"):
        draw_attention(grey, hits=[1, 2])
    with pytest.raises(ArgumentError, match="scale"):
        draw_attention(grey, scale=0)
    with pytest.raises(ArgumentTypeError, match="uint8"):
        draw_attention(grey.astype(np.float32))
    with pytest.raises(ArgumentError, match="pictures"):
        side_by_side([])


def test_text_that_the_font_lacks_is_still_written(grey):
    canvas = grey.copy()
    write(canvas, "10 µm – 2 €", (2, 2))
    assert not np.array_equal(canvas, grey)


def test_the_legend_explains_every_colour_at_any_width():
    for width in (200, 400, 1200):
        strip = legend_strip(width)
        assert strip.shape[1] == width
        for colour in (RED, WHITE, BLUE, YELLOW, GREEN, MAGENTA):
            assert like(strip, colour, 2).sum() > 100


def test_a_stereo_panel_shows_both_eyes():
    panel = stereo_panel(synthetic_run.cycle())
    assert panel.shape == (120, 2 * 160 + 8, 3)
    for half in (panel[:, :160], panel[:, -160:]):
        for colour in (WHITE, YELLOW, GREEN):
            assert like(half, colour, 60).any()


def test_large_images_are_not_enlarged_and_make_no_huge_video():
    cycle = synthetic_run.cycle(looks=False, path=False)
    large = replace(cycle, images={c: np.zeros((480, 640, 3), np.uint8) for c in cycle.images})
    assert stereo_panel(large).shape == (480, 1288, 3)
    huge = replace(cycle, images={c: np.zeros((960, 1280, 3), np.uint8) for c in cycle.images})
    assert video_frame(huge).shape[1] == 1288


def test_a_cycle_without_a_landscape_or_a_path_is_drawn():
    panel = stereo_panel(synthetic_run.cycle(looks=False, path=False, full=False), captions=False)
    assert panel.shape == (120, 328, 3)


@pytest.mark.parametrize("full", [True, False])
@pytest.mark.parametrize("bystander", [True, False])
def test_frames_of_a_pick_say_what_happens_and_have_one_size_too(bystander, full):
    view = np.zeros((48, 64, 3), np.uint8) if bystander else None
    cycles = [replace(cycle, full=cycle.full if full else None) for cycle in synthetic_run.pick()]
    assert len({video_frame(cycle, view).shape for cycle in cycles}) == 1


def test_the_board_says_what_the_hand_does_and_what_happened():
    cycle = synthetic_run.pick()[6]
    board = figures(cycle, 640, 480)
    for field, nothing in (("opening", None), ("event", ""), ("goal", None), ("legs", ())):
        assert not np.array_equal(figures(replace(cycle, **{field: nothing}), 640, 480), board)
    assert like(board[50:90], MAGENTA, 40).any()  # the event


@pytest.mark.parametrize("full", [True, False])
@pytest.mark.parametrize("bystander", [True, False])
def test_video_frames_have_one_even_size(bystander, full):
    view = np.zeros((48, 64, 3), np.uint8) if bystander else None
    sizes = {video_frame(synthetic_run.cycle(k=k, full=full), view).shape for k in range(3)}
    assert len(sizes) == 1
    height, width, _ = sizes.pop()
    assert height % 2 == 0 and width % 2 == 0


def test_the_video_plays_every_frame_and_holds_the_last(tmp_path, capfd):
    frames = [np.full((64, 96, 3), level, np.uint8) for level in (40, 120, 200)]
    with VideoWriter(tmp_path / "a.webm", hold=0.5) as video:
        for frame in frames:
            video.add(frame)
    assert capfd.readouterr().err == ""
    film = cv2.VideoCapture(str(tmp_path / "a.webm"))
    levels = []
    while True:
        more, frame = film.read()
        if not more:
            break
        levels.append(float(frame.mean()))
    film.release()
    assert levels == pytest.approx([40, 120, 200, 200, 200, 200, 200, 200], abs=6)


def test_a_video_says_what_it_cannot_do(tmp_path):
    with pytest.raises(ArgumentError, match=r"\.webm"):
        VideoWriter(tmp_path / "a.mp4")
    with VideoWriter(tmp_path / "a.webm") as video:
        video.add(np.zeros((64, 96, 3), np.uint8))
        with pytest.raises(ArgumentError, match="96 x 64"):
            video.add(np.zeros((32, 96, 3), np.uint8))


def test_without_a_frame_no_file_is_written(tmp_path):
    with VideoWriter(tmp_path / "a.webm"), NoVideo() as none:
        none.add(np.zeros((2, 2, 3), np.uint8))
    assert list(tmp_path.iterdir()) == []
