"""The report: says what must be said, and opens in a browser without network, error or broken picture."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from html.parser import HTMLParser

import numpy as np
import pytest

import synthetic_run
from motorprime import MissingExtraError
from motorprime.recording import Recording
from motorprime.report import EMBED_LIMIT, Shot, movement_shots, page, plot_shots, plots
from motorprime.report.text import factor, headline, milliseconds, note, numbers
from motorprime.report.way import _seen

pytestmark = pytest.mark.viz

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
PROBE = """<script>
const errors = [];
window.addEventListener('error', e => errors.push(String(e.message || e.target.tagName)), true);
document.addEventListener('securitypolicyviolation', e => errors.push('policy: ' + e.blockedURI));
window.addEventListener('load', () => {
  const images = [...document.images], video = document.querySelector('video');
  const result = {
    errors: errors,
    images: images.length,
    broken: images.filter(i => !(i.complete && i.naturalWidth > 0)).length,
    nameless: images.filter(i => !i.alt).length,
    video: video && {
      error: video.error && video.error.message, width: video.videoWidth, seconds: video.duration,
    },
    requests: performance.getEntriesByType('resource').map(r => r.name).filter(n => !n.startsWith('data:')),
    overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
    title: document.title,
  };
  const place = document.createElement('pre');
  place.id = 'probe';
  place.textContent = JSON.stringify(result);
  document.body.append(place);
});
</script>"""


class Reader(HTMLParser):
    """Collects the tags and the addresses of a page, and checks that tags close in order."""

    VOID = ("meta", "link", "img", "br", "hr", "source")

    def __init__(self):
        super().__init__()
        self.open, self.tags, self.addresses, self.said = [], [], [], ""

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self.addresses += [
            value for name, value in attrs if name in ("src", "href", "poster", "srcset", "action")
        ]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not self.open or self.open[-1] != "style":
            self.said += data


def read(text):
    reader = Reader()
    reader.feed(text)
    assert not reader.open
    return reader


def record(
    folder, cycles, *, video=True, outcome="reached", reason="", title="Reach for the red glass", **judged
):
    view = np.full((48, 64, 3), 120, np.uint8)
    meta, certificates = {"seed": 3}, synthetic_run.CERTIFICATES
    with Recording(
        folder, title=title, meta=meta, video=video, bystander=lambda: view, certificates=certificates
    ) as recording:
        for cycle in cycles:
            recording.add(cycle, truth=np.array([-0.3, 0.1, 0.051]))
        recording.finish(outcome, reason, judged)
    return folder / "report.html"


def data_of(path):
    return json.loads(path.with_name("result.json").read_text())


def test_the_report_needs_no_other_file_and_no_network(tmp_path):
    text = record(tmp_path / "demo", synthetic_run.run()).read_text()
    reader = read(text)
    assert reader.addresses and all(address.startswith("data:") for address in reader.addresses)
    assert not re.search(r"url\(|@import|https?://", text)
    assert not [tag for tag, _ in reader.tags if tag in ("script", "iframe", "object")]
    assert "icon" in [attributes.get("rel") for tag, attributes in reader.tags if tag == "link"]
    assert all(attributes["alt"] for tag, attributes in reader.tags if tag == "img")
    policies = [attributes.get("content", "") for tag, attributes in reader.tags if tag == "meta"]
    assert any(policy.startswith("default-src 'none'") for policy in policies)


def test_the_report_says_what_was_saved_and_what_is_fair(tmp_path):
    said = read(record(tmp_path / "demo", synthetic_run.run(), palm_error_mm=1.25).read_text()).said
    for words in (
        "Reach for the red glass",
        "The hand reached its place before the target.",
        "20% of the pixels",
        "6.0 ms",
        "60 ms",
        "10 times faster",
        "8 of 9",
        "would beat both for this very cheap detector",
        "attentional landscape",
        "palm error [mm]",
        "1.25",
        "seed",
    ):
        assert words in said
    for stage in ("projection", "landscape", "sampling", "detection", "triangulation"):
        assert stage in said
    assert "not completed" not in said


def test_everything_is_escaped(tmp_path):
    evil = "<script>alert('x')</script>\"&"
    path = record(
        tmp_path / "demo",
        synthetic_run.run()[:2],
        video=False,
        title=evil,
        reason=evil,
        outcome=evil,
        **{evil: evil},
    )
    reader = read(path.read_text())
    assert "script" not in [tag for tag, _ in reader.tags]
    assert reader.said.count(evil) >= 5


def test_a_large_video_is_linked(tmp_path):
    data = data_of(record(tmp_path / "demo", synthetic_run.run()[:1], video=False))
    film = tmp_path / "demo" / "video.webm"
    film.write_bytes(bytes(EMBED_LIMIT))
    text = page(data, video=film)
    assert len(text) < 100_000
    assert 'src="video.webm"' in text and "too large for this page" in text


def test_a_run_without_a_full_scan_claims_no_speed_up(tmp_path):
    cycles = [synthetic_run.cycle(k=k, full=False) for k in range(3)]
    said = read(record(tmp_path / "demo", cycles, video=False).read_text()).said
    assert "faster" not in said and "nothing to compare with" in said


def test_a_run_that_never_saw_the_target(tmp_path):
    cycles = [synthetic_run.cycle("search", k, found=False, path=False) for k in range(4)]
    said = read(record(tmp_path / "demo", cycles, outcome="not found", reason="no glass").read_text()).said
    assert "The target was not found." in said and "no glass" in said
    assert "0 of 4" in said and "Still searching" in said


def test_cycles_without_a_landscape_are_reported(tmp_path):
    cycles = [synthetic_run.cycle(k=k, looks=False, found=False) for k in range(3)]
    assert "<h1>" in record(tmp_path / "demo", cycles).read_text()


def test_the_outside_judge_has_the_last_word(tmp_path):
    text = record(tmp_path / "demo", synthetic_run.run()[:4], video=False, reached=False).read_text()
    assert "judged from outside it is not" in text
    assert 'class="outcome bad"' in text and "The hand reached" not in text


def picked(folder, **judged):
    judged = synthetic_run.LIFTED | judged
    return record(folder, synthetic_run.pick(), outcome="lifted", **judged)


def test_a_lift_is_said_first_with_its_figures(tmp_path):
    path = picked(tmp_path / "demo")
    said = read(path.read_text()).said
    assert "The robot lifted the target." in said
    assert (
        "The hand lifted a glass of 153 g by 6.0 cm, past an obstacle that it did not touch. The robot"
        in said
    )
    text = path.read_text()
    assert 'class="outcome good"' in text
    assert all(f"<b>{figure}" in text for figure in ("153 g", "6.0 cm", "20% of the pixels", "10 times"))
    cards = dict(numbers(data_of(path)))
    assert cards["6.0 cm"].startswith("over the table")
    assert cards["153 g"] == "weighs the glass, 66 mm wide; friction alone holds it"
    assert cards["0.8 s"] == "from the first look to the end"
    assert cards["1.0 mm"].startswith("error of the glass's place")  # 5 cm against 5.1 cm


def test_an_obstacle_that_was_touched_is_not_passed_over(tmp_path):
    said = read(picked(tmp_path / "demo", touched_obstacle=True).read_text()).said
    assert "by 6.0 cm, and touched the obstacle." in said and "did not touch" not in said


def test_a_glass_that_was_not_lifted_is_no_success(tmp_path):
    text = picked(tmp_path / "demo", lifted=False, height_m=0.0).read_text()
    assert "The robot takes the target to be lifted; judged from outside it is not." in text
    assert 'class="outcome bad"' in text
    assert "The hand lifted" not in text and "over the table" not in text


def test_the_story_of_a_pick_is_told_from_within_and_from_outside(tmp_path):
    said = read(picked(tmp_path / "demo").read_text()).said
    assert "The glass jumps 10 cm. What the robot knew" in said
    words = ("follows the planned path", "hit the target", "turned to the target", "mental simulation")
    words += ("plan leads past", "plans anew", "beside the target", "closed around", "target by friction")
    within = [said.index(word) for word in words]  # the largest picture first, then in their order
    assert within == sorted(within)
    outside = [said.index(words) for words in ("The robot looks for the glass.", "The hand has lifted")]
    assert outside == sorted(outside) and outside[1] < within[0]


def test_the_report_says_why_the_movement_must_converge(tmp_path):
    text = picked(tmp_path / "demo").read_text()
    said = read(text).said
    part = said[said.index("Why it must converge") :]
    assert "eye1.250.98000015" in part.replace("\n", "") and "arm0.50.99000020" in part.replace("\n", "")
    data = data_of(tmp_path / "demo" / "report.html")
    assert data["certificates"] == synthetic_run.CERTIFICATES
    assert "Why it must converge" not in page(data | {"certificates": {}})


def test_the_movement_is_plotted_with_what_happened_on_it(tmp_path):
    data = data_of(picked(tmp_path / "demo"))
    time, way = movement_shots(data)
    assert time.lead and way.lead
    for words in (
        "hand open",
        "error of the estimate",
        "grasp",
        "via-point",
        "The glass jumps 10 cm",
    ):
        assert words in comments(time)
    for words in ("obstacle, as seen", "glass", "via-point", "straight way", "ahead", "height"):
        assert words in comments(way)


def test_a_plain_reach_is_plotted_without_hand_and_obstacle(tmp_path):
    data = data_of(record(tmp_path / "demo", synthetic_run.run(), video=False))
    time, way = movement_shots(data)
    assert "hand open" not in comments(time) and "via-point" not in comments(time)
    assert "obstacle" not in comments(way) + way.alt


def comments(shot):
    """The words of a plot: its letters are drawn, and what they say is beside them."""
    return " ".join(re.findall(r"<!-- (.*?) -->", shot.data.decode()))


def test_numbers_are_said_as_they_are():
    assert [factor(x) for x in (15.4, 2.04, 1.0, 0.5)] == [
        "15 times faster",
        "2.0 times faster",
        "no faster",
        "2.0 times slower",
    ]
    assert [milliseconds(x) for x in (0.04, 6.34, 98.2)] == ["0.0 ms", "6.3 ms", "98 ms"]


def test_the_note_does_not_praise_a_slow_short_cut(tmp_path):
    data = data_of(record(tmp_path / "demo", synthetic_run.run(), video=False))
    data["back_projection_ms"]["median"] = 50.0
    assert not any("beat both" in line for line in note(data))
    data["full_frame_ms"] = None
    assert len(note(data)) == 1


def test_the_headline_of_nothing():
    nothing = {"attended_ms": None, "full_frame_ms": None, "attended_fraction": None, "speed_up": None}
    assert headline(nothing) == ["No vision cycle was recorded."]


def test_plots_of_a_run_are_the_same_each_time(tmp_path):
    data = data_of(record(tmp_path / "demo", synthetic_run.run(), video=False))
    first, second = ([*plot_shots(data), *movement_shots(data)] for _ in range(2))
    assert [shot.title for shot in first] == [
        "Time of every vision cycle",
        "How much was looked at",
        "The movement",
        "The way of the hand",
    ]
    assert [shot.data for shot in first] == [shot.data for shot in second]
    assert plot_shots(data | {"history": []}) == [] == movement_shots(data | {"history": []})


def test_plots_need_the_extra(monkeypatch):
    monkeypatch.setattr(plots.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"motorprime\[viz\]"):
        plot_shots({"history": []})
    with pytest.raises(MissingExtraError, match=r"motorprime\[viz\]"):
        movement_shots({"history": []})


def open_in_browser(path, folder):
    """What a browser without a network finds in a page: the probe's results, and the console's lines."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        pytest.skip("no Chromium to open the report with: apt-get install chromium")
    text = path.read_text()
    # The page allows no script, not even the probe's: for the probe alone that is lifted.
    probed = text.replace(
        "default-src &#x27;none&#x27;", "default-src &#x27;none&#x27;; script-src &#x27;unsafe-inline&#x27;"
    )
    assert probed != text
    copy = path.with_name("probed.html")
    copy.write_text(probed.replace("<title>", PROBE + "<title>", 1))
    flags = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        "--no-first-run",
        "--disable-background-networking",
        "--host-resolver-rules=MAP * ~NOTFOUND",
        "--enable-logging=stderr",
        "--v=0",
        "--window-size=1200,900",
    ]
    outputs = []
    for k, (url, name) in enumerate(((copy, "probed"), (path, "plain"))):
        done = subprocess.run(
            [
                browser,
                *flags,
                f"--user-data-dir={folder / f'profile-{k}'}",
                "--dump-dom",
                url.resolve().as_uri(),
            ],
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.returncode == 0, f"{name}: {done.stderr[-2000:]}"
        outputs.append(done)
    found = re.search(r'<pre id="probe">(.*?)</pre>', outputs[0].stdout, re.DOTALL)
    assert found, outputs[0].stderr[-2000:]
    console = [line for done in outputs for line in done.stderr.splitlines() if "CONSOLE" in line]
    return json.loads(found[1].replace("&amp;", "&").replace("&lt;", "<").replace("&gt;", ">")), console


def test_a_browser_opens_the_report_without_a_complaint(tmp_path):
    path = record(tmp_path / "demo", synthetic_run.run())
    found, console = open_in_browser(path, tmp_path)
    assert console == []
    assert found["errors"] == []
    assert found["requests"] == []
    assert found["images"] == 6 + 4 + 4 and found["broken"] == 0 and found["nameless"] == 0
    assert found["video"]["error"] is None and found["video"]["width"] > 0 and found["video"]["seconds"] > 1.5
    assert found["overflow"] <= 0
    assert found["title"] == "Reach for the red glass: reached"


def test_the_browser_check_notices_what_is_broken(tmp_path):
    data = data_of(record(tmp_path / "demo", synthetic_run.run()[:1], video=False))
    broken = tmp_path / "demo" / "broken.html"
    film = tmp_path / "demo" / "video.webm"
    film.write_bytes(b"no film")
    shot = Shot("A picture", "It is none.", "nothing", b"no picture", "image/png")
    text = page(data, pictures=[shot], video=film)
    broken.write_text(text.replace("</body>", '<img src="http://example.invalid/x.png" alt="far"></body>'))
    found, console = open_in_browser(broken, tmp_path)
    assert found["broken"] == 2
    assert found["video"]["error"] or found["video"]["width"] == 0
    assert found["errors"]
    assert console


def test_the_way_is_seen_to_the_robot_s_right_and_ahead_or_upwards():
    """In the robot's root frame x points backwards and y to the right."""
    place = np.array([[-0.3, 0.1, 0.05]])
    np.testing.assert_allclose(_seen(place, False), [[10.0], [30.0]])
    np.testing.assert_allclose(_seen(place, True), [[10.0], [5.0]])
