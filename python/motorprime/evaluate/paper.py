"""``motorprime evaluate paper``: the experiments of section V, with the same detector on both sides."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, get_args

import numpy as np

from .. import shipped
from .._arrays import integer
from ..attention import Look
from ..detectors import HistogramDetector, Mask
from ..looking import Memory, choose_piece
from ..robot import Robot
from ..sim.glass import Glass
from ..step import Attended
from ..tasks.staging import target_of
from ..tasks.timing import Stages
from .common import Progress, one_thread
from .paper_moments import DETECTORS, Kind, PaperMoment, Sight, paper_moments
from .paper_sides import FRACTION, BackProjection, Found, Gaze, Histogram, Keypoints, Side
from .trials import each

CYCLES = 10
"""Found means: within so many."""
MARGIN = 40  # at the border of a region the card is not seen as a whole [px]
KEEP = 0.98  # of the memory, from cycle to cycle
REPEATS = 21  # of a measurement, of which the median counts
PAPER = {
    "histogram_peripersonal": 2.4,
    "histogram_motorplan": 3.1,
    "surf_peripersonal": 1.6,
    "surf_motorplan": 1.7,
}
"""The paper's speed-ups."""
CONDITIONS = {"no_obstacle": False, "obstacle": True}
ROUNDS = 12  # of replacing reaches that did not take place

Seen = dict[str, Any]


@dataclass(frozen=True)
class _Asked:
    robot: Robot
    kind: Kind
    seed: int
    number: int
    obstacle: bool


@dataclass
class _Measured:
    """Of one row, over all moments of a condition."""

    full: list[float] = field(default_factory=list)
    attended: list[float] = field(default_factory=list)
    bare: list[list[float]] = field(default_factory=list)
    stages: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    eyes: int = 0
    found: int = 0
    found_full: int = 0
    frames: int = 0
    false: int = 0
    false_full: int = 0

    def take(self, seen: Seen) -> None:
        """One moment."""
        self.full.append(seen["full"])
        self.attended.append(seen["attended"])
        if seen["bare"]:
            self.bare.append(seen["bare"])
        for name, seconds in seen["stages"].items():
            self.stages[name].append(seconds)
        for name in ("eyes", "found", "found_full", "false", "false_full"):
            setattr(self, name, getattr(self, name) + seen[name])
        self.frames += 1

    def figures(self) -> dict[str, Any]:
        """Medians and shares."""
        full, attended = float(np.median(self.full)) * 1e3, float(np.median(self.attended)) * 1e3
        in_bare_room = np.median(self.bare, axis=0).tolist() if self.bare else None
        return {
            "measurements": self.frames,
            "speedup": full / attended if attended else None,
            "full_ms": full,
            "attended_ms": attended or None,
            **({"speedup_in_bare_room": in_bare_room[0] / in_bare_room[1]} if in_bare_room else {}),
            "found": self.found / max(self.eyes, 1),
            "found_full": self.found_full / max(self.eyes, 1),
            "false_positives": self.false / self.frames,
            "false_positives_full": self.false_full / self.frames,
            "stages_ms": {name: float(np.median(times)) * 1e3 for name, times in self.stages.items()},
        }


def evaluate_paper(
    robot: Robot,
    *,
    measurements: int = 200,
    seed: int = 0,
    workers: int = 1,
    clock: Callable[[], float] = time.thread_time,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Two detectors, two kinds of attention, with and without an obstacle.

    The histogram detector scores windows of 20 x 20 px by the intersection of histograms: all of them, one
    pixel apart, on the one side; 50 for each eye, sampled from the landscape, on the other. SURF with a
    Hessian threshold of 300 looks at all pixels, or at the 30 % that are most relevant, and in the next
    cycles at rectangles with as many that hold most of what is left of the landscape. Both sides work on both
    eyes' images on one thread, in turn. Time is the processor's, and the attended side's begins with the
    posture or the plan. What the detectors look for is learned beforehand.

    Args:
        robot: with its URDF.
        measurements: scenes, or moments of reaches, of each kind with and without an obstacle.
        seed: of everything.
        workers: processes; times are best taken with one.
        clock: the time [s].
        progress: shows how far it is.

    Returns:
        For each of :data:`PAPER`: speedup and paper_speedup; full_ms and attended_ms (medians for a stereo
        pair); found and found_full (share of the eyes that have the target in view in which it is found
        within ten cycles, each with new noise and new windows); false_positives and false_positives_full (for
        a stereo pair, in the same scenes with things about that look like the target: detections whose centre
        is outside the target's box); stages_ms; for SURF, which is slower where there is print about,
        speedup_in_bare_room; the same for each condition, under its name. Under
        ``back_projection`` the short cut for the full frame, which is no part of any ratio.
    """
    progress = progress or Progress()
    measurements = integer("measurements", measurements, at_least=1)
    rows: dict[str, dict[str, _Measured]] = defaultdict(lambda: defaultdict(_Measured))
    refused = 0
    for kind in get_args(Kind):
        for name, obstacle in CONDITIONS.items():
            seen, without = _series(robot, kind, measurements, seed, obstacle, workers, clock, progress, name)
            refused += without
            for moment in seen:
                for row, figures in moment.items():
                    for part in (name, "all"):
                        rows[row][part].take(figures)
    result: dict[str, Any] = {"seed": seed, "measurements": measurements, "refused": refused}
    for row, paper in PAPER.items():
        figures = rows[row].pop("all").figures()
        parts = {name: part.figures() for name, part in rows[row].items()}
        result[row] = {"paper_speedup": paper, **figures, **parts}
    result["back_projection"] = {
        kind: {
            name: value
            for name, value in rows[f"back_projection_{kind}"]["all"].figures().items()
            if name in ("full_ms", "found_full", "false_positives_full")
        }
        for kind in get_args(Kind)
    }
    return result


def _series(
    robot: Robot,
    kind: Kind,
    measurements: int,
    seed: int,
    obstacle: bool,
    workers: int,
    clock: Callable[[], float],
    progress: Progress,
    name: str,
) -> tuple[list[dict[str, Seen]], int]:
    """So many moments, in the order of their scenes, and how many scenes had none."""
    done: dict[int, list[dict[str, Seen]]] = {}
    for _ in range(ROUNDS):
        held = [len(moments) for moments in done.values() if moments]
        missing = measurements - sum(held)
        if missing <= 0:
            break
        of_one = np.mean(held) if held else 1.0 if kind == "peripersonal" else 5.0
        first = len(done)
        asked = [
            _Asked(robot, kind, seed, first + k, obstacle) for k in range(int(np.ceil(missing / of_one)))
        ]
        what = f"{kind}, {name.replace('_', ' ')}"
        for one, moments in each(_Run(clock), asked, what, progress, workers=workers):
            done[one.number] = moments
    moments = [moment for _, scene in sorted(done.items()) for moment in scene]
    return moments[:measurements], sum(not scene for scene in done.values())


@dataclass(frozen=True)
class _Run:
    """Measures one scene, in a process of its own."""

    clock: Callable[[], float]

    def __call__(self, asked: _Asked) -> list[dict[str, Seen]]:
        with one_thread():
            return self._measured(asked)

    def _measured(self, asked: _Asked) -> list[dict[str, Seen]]:
        gaze = Gaze(shipped.neural_projection(asked.robot), shipped.peripersonal_model(asked.robot))
        moments = paper_moments(asked.robot, asked.kind, asked.seed, asked.number, obstacle=asked.obstacle)
        generator = np.random.default_rng([asked.seed, asked.number, 3])
        measured: list[dict[str, Seen]] = []
        for moment in moments:
            seen: dict[str, Seen] = {}
            sides: dict[str, Side] = {"histogram": Histogram(_detector(moment.glass)), "surf": Keypoints()}
            for name in DETECTORS:
                seen[f"{name}_{asked.kind}"] = measure(
                    sides[name], gaze, moment, name, generator, clock=self.clock
                )
            short = BackProjection(_detector(moment.glass, "back-projection"))
            seen[f"back_projection_{asked.kind}"] = _short_cut(short, moment, generator, self.clock)
            measured.append(seen)
        return measured


def measure(
    side: Side,
    gaze: Gaze,
    moment: PaperMoment,
    name: str,
    generator: np.random.Generator,
    *,
    clock: Callable[[], float],
) -> Seen:
    """One moment: times, what each side finds within the cycles, and what it takes for the target."""
    plain, cluttered = moment.plain[name], moment.cluttered[name]
    kept: dict[str, Attended] = {}

    def attend(images: Mapping[str, Any], stages: Stages) -> Found:
        draw = int(generator.integers(2**62))
        where = gaze.where(moment, stages, masks=name == "surf", seed=draw, kept=kept)
        return side.attended(images, where, stages)

    images = plain.noisy(generator)
    looks = {"full": side.everywhere, "attended": attend}
    times, stages = _times(looks, images, clock)
    bare = name == "surf" and _times(looks, moment.bare.noisy(generator), clock)[0]
    in_full: set[str] = set()
    in_part: set[str] = set()
    unused = Stages(clock)
    memories: dict[str, Memory] = {}
    for cycle in range(CYCLES):
        images = images if cycle == 0 else plain.noisy(generator)
        draw = int(generator.integers(2**62))
        where = gaze.where(moment, unused, masks=name == "surf", seed=draw, kept=kept)
        where = elsewhere(where, memories)
        in_full |= hit(plain, side.everywhere(images, unused))
        in_part |= hit(plain, side.attended(images, where, unused))
        if len(in_full) == len(in_part) == len(plain.boxes):
            break
    images = cluttered.noisy(generator)
    return {
        **times,
        "bare": bare and list(bare.values()),
        "stages": stages,
        "eyes": len(plain.boxes),
        "found": len(in_part),
        "found_full": len(in_full),
        "false": beside(cluttered, attend(images, unused)),
        "false_full": beside(cluttered, side.everywhere(images, unused)),
    }


def _times(
    looks: Mapping[str, Callable[[Mapping[str, Any], Stages], Found]],
    images: Mapping[str, Any],
    clock: Callable[[], float],
) -> tuple[dict[str, float], dict[str, float]]:
    """Medians [s] of each look, in turn, and of their stages."""
    times: dict[str, list[float]] = defaultdict(list)
    stages: dict[str, list[float]] = defaultdict(list)
    for _ in range(REPEATS):
        for side, look in looks.items():
            own = Stages(clock)
            before = clock()
            look(images, own)
            times[side].append(clock() - before)
            for stage, seconds in own.seconds.items():
                stages[f"{side}: {stage}"].append(sum(seconds))
    medians = [{name: float(np.median(taken)) for name, taken in part.items()} for part in (times, stages)]
    return medians[0], medians[1]


def elsewhere(where: Mapping[str, Attended], memories: dict[str, Memory]) -> Mapping[str, Attended]:
    """Where to look when earlier cycles looked in vain: masks move on, windows are drawn anew anyway."""
    moved = {}
    for camera, look in where.items():
        if look.mask is None:
            return where
        mask = Mask(look.mask)
        if camera in memories:
            mask = choose_piece(Look(look.landscape), FRACTION, margin=MARGIN, memory=memories[camera])
        else:
            height, width = look.landscape.shape
            memories[camera] = Memory((height, width), keep=KEEP)
        memories[camera].note(mask, margin=MARGIN)
        moved[camera] = Attended(look.landscape, mask=mask.mask)
    return moved


def hit(sight: Sight, found: Found) -> set[str]:
    """The cameras in which some detection has its centre in the target's box."""
    return {camera for camera, inside in _inside(sight, found).items() if inside.any()}


def beside(sight: Sight, found: Found) -> int:
    """How many detections have it elsewhere."""
    return sum(int(np.count_nonzero(~inside)) for inside in _inside(sight, found).values())


def _inside(sight: Sight, found: Found) -> dict[str, Any]:
    inside = {}
    for camera, centres in found.items():
        u0, v0, u1, v1 = sight.boxes.get(camera, (0, 0, 0, 0))
        # Half-open, and pixels are centred on whole numbers.
        low, high = np.array([u0, v0]) - 0.5, np.array([u1, v1]) - 0.5
        inside[camera] = ((centres >= low) & (centres < high)).all(axis=1)
    return inside


def _short_cut(
    short: BackProjection,
    moment: PaperMoment,
    generator: np.random.Generator,
    clock: Callable[[], float],
) -> Seen:
    plain, cluttered = moment.plain["histogram"], moment.cluttered["histogram"]
    images, unused, times = plain.noisy(generator), Stages(clock), []
    for _ in range(REPEATS):
        before = clock()
        found = short.everywhere(images, unused)
        times.append(clock() - before)
    return {
        "full": float(np.median(times)),
        "attended": 0.0,
        "bare": False,
        "stages": {},
        "eyes": len(plain.boxes),
        "found": 0,
        "found_full": len(hit(plain, found)),
        "false": 0,
        "false_full": beside(cluttered, short.everywhere(cluttered.noisy(generator), unused)),
    }


def _detector(glass: Glass, way: Any = "scan") -> HistogramDetector:
    key = (glass.radius, glass.height, way)
    if key not in _DETECTORS:
        _DETECTORS[key] = HistogramDetector(target_of(glass).detector.target, way=way)
    return _DETECTORS[key]


_DETECTORS: dict[Sequence[Any], HistogramDetector] = {}
