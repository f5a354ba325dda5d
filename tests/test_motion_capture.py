"""Motion capture, and the reaches in it."""

import numpy as np
import pytest

from motorprime.errors import ArgumentError, StateError
from motorprime.recordings.motion_capture import MotionCapture, fill_gaps, read_motion_capture
from motorprime.recordings.reaches import DEPTH, apertures, find_reaches, palm_poses, smooth
from synthetic_reaches import GRASP, OPEN, SHUT, WAY, capture, markers, text


def written(tmp_path, content):
    path = tmp_path / "recording.tsv"
    path.write_text(content)
    return path


def without(recording, **hidden):
    """The recording with markers hidden in slices."""
    found = {name: places.copy() for name, places in recording.markers.items()}
    for name, part in hidden.items():
        found[name][part] = np.nan
    return MotionCapture(recording.times, found)


def test_a_recording_comes_back_from_its_file_in_metres_and_seconds(tmp_path):
    recording = capture(2)
    read = read_motion_capture(written(tmp_path, text(recording)))
    np.testing.assert_allclose(read.times, recording.times)
    assert list(read.markers) == list(recording.markers)
    for name, places in recording.markers.items():
        np.testing.assert_allclose(read.marker(name), places, atol=1e-6)
    assert read.period == pytest.approx(0.01)


def test_an_empty_cell_and_three_zeros_mean_hidden(tmp_path):
    content = text(without(capture(1), thumb_tip=slice(3, 5)))
    lines = content.splitlines()
    cells = lines[4].split("\t")
    cells[2:5] = ["0.000"] * 3
    lines[4] = "\t".join(cells)
    read = read_motion_capture(written(tmp_path, "\n".join(lines)))
    assert np.isnan(read.marker("hand_top")[0]).all() and not np.isnan(read.marker("hand_top")[1]).any()
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(read.marker("thumb_tip")).any(axis=1)), [3, 4])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: s.replace("MARKER_NAMES", "NAMES"), "MARKER_NAMES"),
        (lambda s: s.replace("Frame\t", "Row\t"), "Frame"),
        (lambda s: s.replace("FREQUENCY\t100", "FREQUENCY\tfast"), "FREQUENCY > 0, got 'fast'"),
        (lambda s: s.replace("FREQUENCY\t100", "FREQUENCY\t0"), "FREQUENCY > 0"),
        (lambda s: s.replace("FREQUENCY\t100", "FREQUENCY\t50"), "not 0.02 s apart"),
        (lambda s: s + "7\t0.1\t2.0\n", "values expected, got 3"),
        (lambda s: s.replace("\n1\t0.00000\t", "\n1\t0.00000\thigh"), "line 5: could not convert"),
        (lambda s: "\n".join(s.splitlines()[:5]), "1 samples; at least 2"),
        (lambda s: "\n".join(s.splitlines()[:4]), "0 samples; at least 2"),
    ],
)
def test_what_is_no_such_table_is_named(tmp_path, change, message):
    with pytest.raises(ArgumentError, match=message):
        read_motion_capture(written(tmp_path, change(text(capture(1)))))


def test_files_that_are_missing_or_no_text_are_named(tmp_path):
    with pytest.raises(ArgumentError, match="cannot read"):
        read_motion_capture(tmp_path / "none.tsv")
    (tmp_path / "image.tsv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(ArgumentError, match="no text"):
        read_motion_capture(tmp_path / "image.tsv")


def test_another_unit_is_found_out(tmp_path):
    """A reach of a quarter of a kilometre, when metres are read as if each were a thousand."""
    with pytest.raises(ArgumentError, match=r"moves over .* m, at most 20"):
        read_motion_capture(written(tmp_path, text(capture(1))), unit=1.0)
    wide = {name: 20.0 * places for name, places in capture(2).markers.items()}
    with pytest.raises(ArgumentError, match=r"states: a movement of .*millimetres"):
        find_reaches(MotionCapture(capture(2).times, wide))


def test_a_marker_that_is_not_there_is_named():
    with pytest.raises(ArgumentError, match="no 'nose' among hand_top"):
        capture(1).marker("nose")
    left = {name: places for name, places in capture(1).markers.items() if name != "thumb_middle"}
    with pytest.raises(ArgumentError, match="no 'thumb_middle'"):
        find_reaches(MotionCapture(capture(1).times, left))


def test_short_gaps_are_bridged_by_a_line_and_long_ones_and_the_ends_stay():
    times = np.arange(30) / 100
    line = np.column_stack([times, 2.0 - times])
    holed = line.copy()
    holed[[0, 5, 6, 29]] = np.nan
    holed[12:24] = np.nan
    filled = fill_gaps(times, holed, longest=0.1)
    np.testing.assert_allclose(filled[5:7], line[5:7])
    assert np.isnan(filled[[0, 29]]).all() and np.isnan(filled[12:24]).all()
    assert np.isnan(holed[5]).all()  # the caller's are not changed
    np.testing.assert_allclose(fill_gaps(times, holed, longest=0.13)[12:24], line[12:24])


def test_smoothing_keeps_a_parabola_and_takes_jitter_away(rng):
    recording = capture(1)
    t = recording.times
    curve = np.column_stack([3.0 * t**2 - t, 1.0 - 2.0 * t**2])
    kept = smooth(recording, curve)
    np.testing.assert_allclose(kept[6:-6], curve[6:-6], atol=1e-9)
    noise = rng.normal(size=curve.shape)
    assert smooth(recording, noise).std() < 0.5 * noise.std()


def test_the_palm_looks_along_its_fingers_and_out_of_its_inside():
    """The hand is a right one with its palm down: x ahead, z down, and so y to the little finger."""
    recording = markers(np.tile(GRASP, (50, 1)), np.full(50, OPEN))
    pose = palm_poses(recording)[20]
    np.testing.assert_allclose(pose[:3, :3], np.column_stack([[1, 0, 0], [0, -1, 0], [0, 0, -1]]), atol=1e-9)
    np.testing.assert_allclose(pose[:3, 3], GRASP - [0.0, 0.0, DEPTH], atol=1e-9)


def test_hand_markers_on_one_line_are_no_frame():
    flat = dict(markers(np.tile(GRASP, (50, 1)), np.full(50, OPEN)).markers)
    flat["hand_left"] = flat["hand_right"]
    with pytest.raises(ArgumentError, match="one line"):
        palm_poses(MotionCapture(np.arange(50) / 100, flat))


def test_the_aperture_is_from_the_thumb_to_the_two_fingers():
    recording = capture(2)
    seen = apertures(recording)
    assert seen.max() == pytest.approx(OPEN, abs=1e-3) and seen.min() == pytest.approx(SHUT, abs=1e-3)


def test_a_hidden_thumb_is_followed_by_its_middle():
    recording = capture(2)
    whole = apertures(recording)
    closed = np.flatnonzero(whole < (OPEN + SHUT) / 2)
    hidden = without(recording, thumb_tip=slice(closed[0] - 5, closed[0] + 40))
    np.testing.assert_allclose(apertures(hidden), whole, atol=1e-4)


def test_a_hidden_thumb_does_not_make_the_opening_jump_where_its_middle_errs():
    recording = capture(2)
    bent = dict(recording.markers)
    bent["thumb_middle"] = bent["thumb_middle"] + [0.0, 0.0, 0.004] * np.sin(recording.times)[:, None]
    hidden = without(MotionCapture(recording.times, bent), thumb_tip=slice(160, 200))
    seen = apertures(hidden)
    assert np.abs(np.diff(seen)).max() < 1.5 * np.abs(np.diff(apertures(recording))).max()
    np.testing.assert_allclose(seen, apertures(recording), atol=2e-3)


def test_where_a_finger_is_hidden_too_the_index_alone_is_followed():
    recording = capture(3)
    part = slice(140, 190)
    hidden = without(recording, thumb_tip=part, middle_tip=part)
    np.testing.assert_allclose(apertures(hidden), apertures(recording), atol=2e-3)


def test_a_thumb_that_is_never_seen_is_an_error():
    with pytest.raises(StateError, match="never seen together"):
        apertures(without(capture(1), thumb_tip=slice(None)))


def test_each_reach_goes_from_setting_off_to_the_closed_hand():
    found = find_reaches(capture(4))
    assert len(found) == 4 and sum(found.dropped.values()) == 0
    np.testing.assert_allclose(found.aperture, (SHUT, OPEN), atol=2e-3)
    for reach in found.reaches:
        way = np.linalg.norm(reach.palms[:, :3, 3] - reach.palms[-1, :3, 3], axis=1)
        assert way[0] == pytest.approx(WAY, rel=0.02)  # it had hardly moved when it began
        assert (np.diff(way) < 1e-4).all()  # and never went away again
        np.testing.assert_allclose(reach.palms[-1, :3, 3], GRASP - [0.0, 0.0, DEPTH], atol=1e-3)
        assert reach.openings[-1] == 0.0 and reach.openings[0] == pytest.approx(1.0, abs=0.03)
        assert 1.1 < reach.times[-1] - reach.times[0] < 1.45  # 1.0 s and most of the closing's 0.4 s


def test_a_reach_with_a_marker_hidden_for_long_is_dropped_and_counted():
    recording = capture(4)
    second = find_reaches(recording).reaches[1]
    middle = round(float(second.times.mean()) * 100)
    found = find_reaches(without(recording, hand_left=slice(middle, middle + 30)))
    assert len(found) == 3 and found.dropped["marker hidden too long"] == 1
    assert len(find_reaches(without(recording, hand_left=slice(middle, middle + 8)))) == 4


def test_closing_without_coming_is_no_reach():
    still = markers(np.tile(GRASP, (400, 1)), OPEN - 0.06 * (np.arange(400) % 200 > 100))
    with pytest.raises(StateError, match=r"no reach found; left out: .*'no movement': 2"):
        find_reaches(still)
