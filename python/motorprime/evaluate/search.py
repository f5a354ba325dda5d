"""``motorprime evaluate search``: how many cycles it takes to find the glass, with and without attention.

With strategies, the same scenes are also searched by windows that are drawn in other ways than the paper's,
each without and with a memory of where the search has been in vain.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np

from ..attention import Attention, Look
from ..detectors import Where
from ..errors import ArgumentError, NotInViewError
from ..looking import Strategy
from ..peripersonal import ReachCloud
from ..robot import Robot
from ..sim.glass import Glass
from ..sim.scene import SMALL_GLASS, draw_layout
from ..tasks.explore import Finder, Images, Target, everywhere, windows_anywhere, windows_from
from ..tasks.staging import Stage, strike_seeing_posture, target_of
from ..views import Views
from .common import Progress
from .search_strategies import Chooser

WINDOWS, SIZE, MIXING = 50, 20, 0.2
TOLERANCE = 0.02
LIMITS = {"normal": 4, "small": 10}


@dataclass(frozen=True)
class Outcome:
    """One search: whether the first report was right, after how many cycles, how far off."""

    found: bool
    reported: bool
    cycles: int
    error: float


def evaluate_search(
    robot: Robot,
    *,
    scenes: int = 100,
    seed: int = 0,
    strategies: Sequence[Strategy] = (),
    few: int = 10,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Search ``scenes`` scenes with a glass of 6.5 x 10 cm, and as many with one of 2.8 x 5.6 cm.

    Returns:
        scenes, found_attended, cycles_median, found_uniform, cycles_median_uniform, found_full,
        false_reports, median_error_m (over the reports of the attended search), covered_median (fraction
        of the image where the landscape is positive), and cycles_limit, beyond which a search is a miss; the
        same for the small glass under ``small``. Windows anywhere and the full scan are judged alike. With
        ``strategies`` also strategies: under the name of each, and with ``_memory`` behind it, found and
        cycles_mean (a miss counts as a cycle more than the limit) of searches with ``few`` windows for each
        eye and cycle, in up to five times as many cycles.

    Raises:
        ArgumentError: an unknown strategy.
    """
    progress = progress or Progress()
    for strategy in strategies:
        if strategy not in get_args(Strategy):
            raise ArgumentError(
                f"strategy: one of {', '.join(get_args(Strategy))} expected, got {strategy!r}"
            )
    cloud = ReachCloud(robot)
    results = {}
    for k, (name, glass) in enumerate({"normal": Glass(), "small": SMALL_GLASS}.items()):
        trials = []
        target = target_of(glass)
        for i in progress.over(range(scenes), f"searching, {name} glass"):
            draws = np.random.default_rng([seed, k, i])
            trials.append(_scene(robot, cloud, glass, target, draws, LIMITS[name], strategies, few))
        results[name] = _summary(trials, LIMITS[name])
    return {"seed": seed, **results["normal"], "small": results["small"]}


def _scene(
    robot: Robot,
    cloud: ReachCloud,
    glass: Glass,
    target: Target,
    generator: np.random.Generator,
    limit: int,
    strategies: Sequence[Strategy],
    few: int,
) -> dict[str, Any]:
    layout = draw_layout(generator, glass=glass)
    with Stage(robot, layout, seed=int(generator.integers(2**31))) as stage:
        frames = strike_seeing_posture(stage, generator)
        joints = stage.world.gaze()
        truth, centre = stage.truth(frames), stage.scene.glass_pose()[0]
    images: Images = {camera: frame.rgb for camera, frame in frames.items()}
    attention = Attention(stage.projection, cloud=cloud)
    views, shapes = Views(stage.projection, joints), stage.projection.shapes

    def judge(finder: Finder, where: Callable[[], Mapping[str, Where]], cycles: int) -> Outcome:
        return _search(finder, images, views, where, cycles, truth, centre)

    finder = Finder(target)
    try:
        looks = attention.peripersonal(joints, mixing=MIXING)
    except NotInViewError:
        looks = {}

    def looks_of(finder: Finder) -> dict[str, Look]:
        return finder.complete(looks, views, lambda: cloud.in_root(joints))

    def by(strategy: Strategy, remember: bool) -> Outcome:
        finder = Finder(target)
        draws = np.random.default_rng(chosen_seed)
        chooser = Chooser(finder, lambda: looks_of(finder), strategy, remember, few, SIZE, draws)
        return judge(finder, chooser, 5 * limit)

    trial = {
        "attended": judge(finder, lambda: windows_from(looks_of(finder), WINDOWS, SIZE, generator), limit),
        "uniform": judge(Finder(target), lambda: windows_anywhere(shapes, WINDOWS, SIZE, generator), limit),
        "full": judge(Finder(target), lambda: everywhere(shapes), 1),
        "covered": float(np.mean([looks[c].covered if c in looks else 0.0 for c in shapes])),
    }
    chosen_seed = int(generator.integers(2**31)) if strategies else 0
    trial["strategies"] = {
        strategy + "_memory" * remember: by(strategy, remember)
        for strategy in strategies
        for remember in (False, True)
    }
    return trial


def _search(
    finder: Finder,
    images: Images,
    views: Views,
    where: Callable[[], Mapping[str, Where]],
    limit: int,
    truth: Mapping[str, np.ndarray],
    centre: np.ndarray,
) -> Outcome:
    """Look until the program reports a position or ``limit`` cycles are over, then judge the report.

    Right means: the position is within 2 cm of the truth, and in every eye the reported window, which is the
    hit's window moved onto its silhouette, has its centre pixel on the glass.
    """
    for cycle in range(1, limit + 1):
        sight = finder.look(images, views, where())
        if sight.located is None:
            continue
        error = float(np.linalg.norm(sight.located.centre - centre))
        over = all(
            truth[camera][tuple(np.rint(silhouette.centroid[::-1]).astype(int))]
            for camera, silhouette in finder.reported.items()
        )
        return Outcome(over and error < TOLERANCE, True, cycle, error)
    return Outcome(False, False, limit + 1, float("nan"))


def _summary(trials: list[dict[str, Any]], limit: int) -> dict[str, Any]:
    def cycles(kind: str) -> float:
        return float(np.median([t[kind].cycles if t[kind].found else limit + 1 for t in trials]))

    errors = [t["attended"].error for t in trials if t["attended"].reported]
    figures = {
        "scenes": len(trials),
        "cycles_limit": limit,
        "found_attended": sum(t["attended"].found for t in trials),
        "cycles_median": cycles("attended"),
        "found_uniform": sum(t["uniform"].found for t in trials),
        "cycles_median_uniform": cycles("uniform"),
        "found_full": sum(t["full"].found for t in trials),
        "false_reports": sum(t["attended"].reported and not t["attended"].found for t in trials),
        "median_error_m": float(np.median(errors)) if errors else None,
        "covered_median": float(np.median([t["covered"] for t in trials])),
    }
    if names := trials[0].get("strategies"):
        figures["strategies"] = {
            name: _strategy([trial["strategies"][name] for trial in trials], 5 * limit) for name in names
        }
    return figures


def _strategy(outcomes: list[Outcome], limit: int) -> dict[str, float]:
    cycles = [outcome.cycles if outcome.found else limit + 1 for outcome in outcomes]
    return {
        "found": sum(outcome.found for outcome in outcomes),
        "cycles_mean": float(np.mean(cycles)),
    }
