"""Reading folders of yarpdatadumper and pairing images with the postures that they show."""

import numpy as np
import pytest

from motorprime.errors import ArgumentError
from motorprime.recordings import (
    ICUB_RIGHT_ARM,
    Layout,
    estimate_lag,
    find_holds,
    read_encoders,
    read_images,
    read_recording,
)
from motorprime.recordings.synchronise import Holds, merge
from yarp_folder import START, write_encoders, write_images, write_log

LAYOUT = Layout(
    names=("still", "shoulder", "elbow"),
    encoders={"arm": ("shoulder", "elbow", "finger")},
    images={"eye": "images/eye"},
)
RNG = np.random.default_rng(3)
POSTURES = np.column_stack([RNG.uniform(-30, 30, (12, 2)), np.full(12, 5.0)])
PIXELS = np.column_stack([80.0 + POSTURES[:, 0], 50.0 + POSTURES[:, 1]])


@pytest.fixture
def folder(tmp_path):
    write_encoders(tmp_path / "arm", POSTURES)
    write_images(tmp_path / "images" / "eye", PIXELS)
    return tmp_path


def rewrite(folder, change):
    """Change the lines of a stream's log."""
    lines = (folder / "data.log").read_text().splitlines()
    change(lines)
    write_log(folder, lines)


def test_every_held_posture_becomes_one_sample_with_the_pixel_that_it_was_shown_at(folder):
    recording = read_recording(folder, LAYOUT)
    samples = recording.samples
    assert len(samples) == recording.postures == 12
    assert samples.names == ("still", "shoulder", "elbow")
    assert samples.points is None
    np.testing.assert_allclose(samples.joints[:, 1:], np.deg2rad(POSTURES[:, :2]), atol=1e-7)
    np.testing.assert_allclose(samples.pixels["eye"], PIXELS, atol=0.35)
    np.testing.assert_allclose(recording.times, 0.5 * np.arange(12), atol=1e-6)
    assert recording.outliers == 0
    assert recording.skipped == {"arm": 0, "images/eye": 0}


def test_joints_that_were_not_recorded_are_zero_and_named(folder):
    recording = read_recording(folder, LAYOUT)
    assert recording.absent == ("still",)
    assert not recording.samples.joints[:, 0].any()


def test_the_lag_of_the_images_is_found_from_themselves(folder):
    assert read_recording(folder, LAYOUT).lag == pytest.approx(0.03, abs=0.012)


def test_without_the_lag_images_after_a_change_would_show_the_wrong_posture(folder):
    right, wrong = (read_recording(folder, LAYOUT, lag=lag, guard=0.0) for lag in (0.03, -0.2))
    errors = [np.linalg.norm(r.samples.pixels["eye"] - PIXELS, axis=1) for r in (right, wrong)]
    assert errors[0].max() < 0.5 < errors[1].max()
    late = read_recording(folder, LAYOUT, lag=0.03, guard=0.1)
    assert late.paired["eye"] < right.paired["eye"]


def test_every_sample_names_an_image_that_shows_it(folder):
    recording = read_recording(folder, LAYOUT)
    times = dict(zip(*(reversed(_stamps(folder / "images" / "eye"))), strict=True))
    for k, path in enumerate(recording.images["eye"]):
        shown = times[path.name] - START - 0.03
        assert 0.5 * k <= shown <= 0.5 * (k + 1)


def _stamps(stream):
    words = [line.split() for line in (stream / "data.log").read_text().splitlines()]
    return [float(w[1]) for w in words], [w[2] for w in words]


def test_a_posture_that_no_image_shows_is_no_sample(folder):
    def blind(images):
        hidden = np.abs(images.times - START - 0.03 - 5.25 * 0.5) < 0.5
        return np.where(hidden[:, None], np.nan, np.linspace(0.0, 99.0, len(images))[:, None].repeat(2, 1))

    recording = read_recording(folder, LAYOUT, labels=blind, lag=0.03)
    assert recording.postures == 12
    assert 0 < 12 - len(recording.samples) <= 2
    assert recording.samples.seen("eye").all()
    assert len(recording.times) == len(recording.images["eye"]) == len(recording.samples)
    assert 2.5 not in recording.times.round(6)


def test_a_posture_that_lasts_too_briefly_is_an_outlier(folder):
    def spoil(lines):
        for k in (60, 160):  # one line each, in the middle of a posture
            time = lines[k].split()[1]
            lines[k] = f"-1 {time} 70.0 70.0 5.0"

    rewrite(folder / "arm", spoil)
    recording = read_recording(folder, LAYOUT)
    assert recording.outliers == 2
    assert np.abs(recording.samples.joints).max() < np.deg2rad(45)
    assert read_recording(folder, LAYOUT, min_hold=0.0).postures == recording.postures + 2


def test_noise_of_the_encoders_is_no_motion_and_a_drift_is_one():
    times = np.arange(0.0, 2.0, 0.02)
    noisy = 10.0 + 0.02 * np.sin(np.arange(100.0))[:, None]
    assert len(find_holds([(times, noisy)], still=0.05, gap=0.25)) == 1
    drifting = 10.0 + 0.01 * np.arange(100.0)[:, None]
    assert len(find_holds([(times, drifting)], still=0.05, gap=0.25)) > 5


def test_a_posture_ends_where_the_encoders_fall_silent():
    times = np.r_[np.arange(0.0, 1.0, 0.02), np.arange(2.0, 3.0, 0.02)]
    holds = find_holds([(times, np.ones((100, 1)))], still=0.1, gap=0.25)
    np.testing.assert_allclose(holds.start, [0.0, 2.0])
    np.testing.assert_allclose(holds.stop, [0.98, 2.98])
    np.testing.assert_array_equal(holds.at(np.array([0.5, 1.5, 2.5])), [0, -1, 1])


def test_a_silent_stream_is_not_believed_while_another_goes_on():
    steady = np.arange(0.0, 3.0, 0.02)
    silent = np.r_[np.arange(0.0, 1.0, 0.02), np.arange(2.0, 3.0, 0.02)]
    streams = [(steady, np.ones((150, 1))), (silent, np.ones((100, 1)))]
    holds = find_holds(streams, still=0.1, gap=0.25)
    assert holds.at(np.array([1.5]))[0] == -1
    assert holds.stop[0] == pytest.approx(0.98)
    assert len(find_holds(streams, still=0.1, gap=1.5)) == 1


def test_streams_of_different_rates_are_put_together():
    fast, slow = np.arange(0.0, 2.0, 0.01), np.arange(0.005, 2.0, 0.05)
    a = np.where(fast < 1.0, 0.0, 1.0)[:, None]
    b = np.where(slow < 0.5, 5.0, 6.0)[:, None]
    holds = find_holds([(fast, a), (slow, b)], still=0.1, gap=0.25)
    np.testing.assert_array_equal(holds.values, [[0, 5], [0, 6], [1, 6]])


def test_streams_without_common_time_are_an_error():
    with pytest.raises(ArgumentError, match="no time in common"):
        find_holds([(np.array([0.0, 1.0]), np.ones((2, 1))), (np.array([5.0, 6.0]), np.ones((2, 1)))],
                   still=0.1, gap=0.25)  # fmt: skip


def test_a_time_next_to_a_change_shows_no_posture_for_sure():
    holds = Holds(np.array([0.0, 1.0]), np.array([0.98, 2.0]), np.zeros((2, 1)))
    times = np.array([-0.1, 0.0, 0.02, 0.97, 0.99, 1.005, 1.5, 2.1])
    np.testing.assert_array_equal(holds.at(times, 0.015), [-1, -1, 0, -1, -1, -1, 1, -1])
    np.testing.assert_array_equal(holds.at(times), [-1, 0, 0, 0, -1, 1, 1, -1])


def test_images_of_one_posture_are_merged_by_their_median():
    index = np.array([0, 0, 0, -1, 2])
    pixels = np.array([[1.0, 1.0], [2.0, 2.0], [90.0, 90.0], [5.0, 5.0], [np.nan, np.nan]])
    merged = merge(index, pixels, 3)
    np.testing.assert_array_equal(merged, [[2, 2], [np.nan, np.nan], [np.nan, np.nan]])


def test_a_lag_that_the_images_do_not_tell_is_asked_for():
    holds = Holds(np.array([0.0]), np.array([10.0]), np.zeros((1, 1)))
    times = {"eye": np.arange(1.0, 9.0)}
    with pytest.raises(ArgumentError, match="give lag"):
        estimate_lag(holds, times, {"eye": np.ones((8, 2))})


@pytest.mark.parametrize("lag", [0.01, 0.04, 0.08])
def test_the_lag_is_found_whatever_it_is(lag):
    rng = np.random.default_rng(5)
    start = np.cumsum(rng.uniform(0.3, 0.6, 80))
    holds = Holds(start[:-1], start[1:] - 0.001, np.arange(79.0)[:, None])
    shown = rng.uniform(start[0], start[-1], 800)
    index = np.searchsorted(start, shown, side="right") - 1
    pixels = rng.uniform(0, 200, (80, 2))[index]
    assert estimate_lag(holds, {"eye": shown + lag}, {"eye": pixels}) == pytest.approx(lag, abs=0.004)


def test_a_cut_off_last_line_is_left_out_and_counted(folder):
    def cut(lines):
        lines[-1] = " ".join(lines[-1].split()[:3])

    rewrite(folder / "arm", cut)
    recording = read_recording(folder, LAYOUT)
    assert recording.skipped == {"arm": 1, "images/eye": 0}
    assert len(recording.samples) == 12


def test_duplicated_lines_change_nothing(folder):
    before = read_recording(folder, LAYOUT)
    rewrite(folder / "arm", lambda lines: lines.insert(50, lines[50]))
    after = read_recording(folder, LAYOUT)
    np.testing.assert_array_equal(after.samples.joints, before.samples.joints)
    np.testing.assert_array_equal(after.samples.pixels["eye"], before.samples.pixels["eye"])


def test_lines_out_of_order_are_left_out_and_counted(folder):
    def swap(lines):
        lines[30], lines[31] = lines[31], lines[30]

    rewrite(folder / "arm", swap)
    assert read_recording(folder, LAYOUT).skipped["arm"] == 1


BAD = {
    "no number": ("-1 1500.1 1.0 abc 5.0", r"line 1: a finite number expected, got 'abc'"),
    "nan": ("-1 1500.1 1.0 nan 5.0", r"line 1: a finite number expected, got 'nan'"),
    "a column more": ("-1 1500.1 1.0 2.0 5.0 6.0", r"line 1: 3 values expected .* got 4"),
    "a column less": ("-1 1500.1 1.0 2.0", r"line 1: 3 values expected .* got 2"),
    "no time stamp": ("-1 soon 1.0 2.0 5.0", r"line 1: a counter and a time stamp .*"),
    "infinite time": ("-1 inf 1.0 2.0 5.0", r"line 1: a counter and a time stamp .*"),
    "one word": ("-1", r"line 1: a counter and a time stamp .*"),
}


@pytest.mark.parametrize(("line", "message"), BAD.values(), ids=BAD)
def test_a_log_of_bad_lines_is_an_error_that_names_file_and_line(folder, line, message):
    write_log(folder / "arm", [line] * 10)
    with pytest.raises(ArgumentError, match=rf"arm/data.log, {message} \(10 bad lines of 10\)"):
        read_recording(folder, LAYOUT)


@pytest.mark.parametrize("line", [line for line, _ in BAD.values()], ids=BAD)
def test_one_bad_line_is_left_out_and_counted(folder, line):
    rewrite(folder / "arm", lambda lines: lines.insert(20, line))
    recording = read_recording(folder, LAYOUT)
    assert recording.skipped["arm"] == 1
    np.testing.assert_allclose(recording.samples.joints[:, 1:], np.deg2rad(POSTURES[:, :2]), atol=1e-7)


def test_more_than_a_few_bad_lines_are_an_error(folder):
    rewrite(folder / "arm", lambda lines: lines.__setitem__(slice(10, 14), ["-1 1500.3 x x x"] * 4))
    with pytest.raises(ArgumentError, match=r"line 11: .* \(4 bad lines of 300\)"):
        read_encoders(folder / "arm", 3)


def test_times_that_run_backwards_are_an_error(folder):
    rewrite(folder / "arm", lambda lines: lines.reverse())
    with pytest.raises(ArgumentError, match="line 2: the time goes back from 1505"):
        read_encoders(folder / "arm", 3)


def test_an_empty_log_is_an_error(folder):
    write_log(folder / "arm", [])
    with pytest.raises(ArgumentError, match=r"arm/data.log is empty"):
        read_recording(folder, LAYOUT)


def test_a_log_that_is_no_text_is_an_error(folder):
    (folder / "arm" / "data.log").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ArgumentError, match=r"cannot read .*arm/data.log"):
        read_recording(folder, LAYOUT)


def test_a_missing_image_is_left_out_and_many_are_an_error(folder):
    stream = folder / "images" / "eye"
    (stream / "00000003.ppm").unlink()
    assert read_recording(folder, LAYOUT).skipped["images/eye"] == 1
    for path in sorted(stream.glob("*.ppm"))[10:20]:
        path.unlink()
    with pytest.raises(ArgumentError, match=r"eye/data.log, line 4: there is no image '00000003.ppm'"):
        read_recording(folder, LAYOUT)


def test_an_image_that_cannot_be_read_counts_as_a_bad_line(folder):
    stream = folder / "images" / "eye"
    (stream / "00000002.ppm").write_bytes(b"P6 nothing")
    assert read_images(stream).skipped == 1
    write_log(stream, ["-1 1500.0 00000002.ppm"])
    with pytest.raises(ArgumentError, match=r"line 1: '00000002.ppm' is no image that can be read"):
        read_images(stream)


def test_an_image_of_another_size_counts_as_a_bad_line(folder):
    import cv2

    stream = folder / "images" / "eye"
    cv2.imwrite(str(stream / "00000002.ppm"), np.zeros((10, 10, 3), np.uint8))
    images = read_images(stream)
    assert images.skipped == 1
    assert {image.shape for image in (images[k] for k in range(len(images)))} == {(120, 160, 3)}


def test_images_are_read_as_rgb_from_their_files(tmp_path):
    import cv2

    write_log(tmp_path / "eye", ["-1 1.0 a.ppm"])
    cv2.imwrite(str(tmp_path / "eye" / "a.ppm"), np.full((4, 4, 3), (10, 20, 30), np.uint8))
    images = read_images(tmp_path / "eye")
    np.testing.assert_array_equal(images[0][0, 0], [30, 20, 10])
    (tmp_path / "eye" / "a.ppm").unlink()
    with pytest.raises(ArgumentError, match="cannot read the image"):
        images[0]


def test_a_missing_stream_is_named_with_those_that_are_there(folder):
    with pytest.raises(ArgumentError, match="no stream 'head'; there are arm, images/eye"):
        read_recording(folder, ICUB_RIGHT_ARM)


def test_a_folder_that_is_no_recording_says_so(tmp_path):
    with pytest.raises(ArgumentError, match="is no recording"):
        read_recording(tmp_path, LAYOUT)
    with pytest.raises(ArgumentError, match="no such folder"):
        read_recording(tmp_path / "nowhere", LAYOUT)


def test_a_recording_without_a_hand_or_a_held_posture_is_an_error(folder):
    def blind(images):
        return np.full((len(images), 2), np.nan)

    with pytest.raises(ArgumentError, match=r"no image of .* shows the hand"):
        read_recording(folder, LAYOUT, labels=blind, lag=0.0)
    with pytest.raises(ArgumentError, match=r"none of 12 postures in .* was held 3"):
        read_recording(folder, LAYOUT, min_hold=3.0)


@pytest.mark.parametrize("name", ["guard", "min_hold", "still", "gap"])
def test_settings_below_zero_or_nan_are_errors(folder, name):
    for value in (-1.0, np.nan):
        with pytest.raises(ArgumentError, match=name):
            read_recording(folder, LAYOUT, **{name: value})


def test_a_lag_that_is_no_number_is_an_error(folder):
    with pytest.raises(ArgumentError, match="lag"):
        read_recording(folder, LAYOUT, lag=np.inf)


def test_the_icub_s_streams_have_their_joints_in_the_order_of_its_motors():
    assert ICUB_RIGHT_ARM.encoders["head"] == (
        "neck_pitch", "neck_roll", "neck_yaw", "eyes_tilt", "eyes_version", "eyes_vergence",
    )  # fmt: skip
    assert ICUB_RIGHT_ARM.encoders["rightArm"][:7] == ICUB_RIGHT_ARM.names[9:]
    assert len(ICUB_RIGHT_ARM.encoders["rightArm"]) == 16
