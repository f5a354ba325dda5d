"""``motorprime reach``: stage a trial, show it live, record it, and say what attention saved."""

from __future__ import annotations

import contextlib
import json
import signal
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from . import shipped
from .control.cds import CoupledDynamics
from .cylinder import Polygon, outlines
from .errors import ArgumentError
from .projection import KinematicProjection, NeuralProjection, Projection
from .recording import Recording, fresh_folder
from .robot import Robot
from .sim.bystander import Bystander
from .sim.icub import load_icub
from .tasks.cycle import Cycle, Settings
from .tasks.pick_trial import PickTrial, PickVerdict
from .views import Views
from .viz import story

WINDOW = 20  # side of a window [px]


@dataclass(frozen=True)
class ReachOptions:
    """What ``motorprime reach`` was asked for; see its ``--help``."""

    seed: int
    name: str
    runs: Path
    windows: int
    width: float | None
    size: tuple[int, int]
    noise: float
    clutter: int
    glass: bool
    glass_at: tuple[float, float] | None
    video: bool
    gui: bool
    projection: str = "kinematic"
    obstacle: bool = False
    perturb: bool = False


def run_reach(options: ReachOptions, console: Console) -> dict[str, Any]:
    """Let the robot pick up the glass once and write the run's folder; returns what result.json holds."""
    if min(options.size) < WINDOW:
        width, height = options.size
        raise ArgumentError(f"size: {width}x{height} is smaller than a window of {WINDOW} px")
    folder = fresh_folder(options.runs, options.name)
    try:
        return _run_into(folder, options, console)
    except BaseException:
        with contextlib.suppress(OSError):
            folder.rmdir()  # only where nothing has been recorded yet
        raise


def _run_into(folder: Path, options: ReachOptions, console: Console) -> dict[str, Any]:
    console.print(f"Building the scene from seed {options.seed} ...", highlight=False)
    robot = load_icub().with_image_size(*options.size)
    projection = projection_of(robot, options.projection)
    settings = Settings(windows=options.windows, size=WINDOW, width=options.width, slack=slack_of(projection))
    dynamics = shipped.coupled_dynamics()
    with PickTrial(
        robot,
        options.seed,
        dynamics,
        obstacle=options.obstacle,
        perturb=options.perturb,
        settings=settings,
        projection=projection,
        peripersonal=None if options.projection == "kinematic" else shipped.peripersonal_model(robot),
        glass=options.glass,
        glass_at=options.glass_at,
        clutter=options.clutter,
        noise=options.noise,
        gui=options.gui,
    ) as trial:
        bystander = Bystander(trial.stage.world).capture if options.video else None
        recording = Recording(
            folder,
            title=title_of(options),
            meta={**asdict(options), "runs": str(options.runs), "robot": robot.name},
            video=options.video,
            bystander=bystander,
            certificates=certificates_of(dynamics),
        )
        completed = _drive_to_the_end(trial, recording, console)
    result: dict[str, Any] = json.loads((folder / "result.json").read_text())
    if completed:
        _conclude(result, console)
    else:
        console.print("Interrupted; the run's folder says so.", style="yellow")
    console.print(f"Report: {recording.report}", markup=False, highlight=False, soft_wrap=True)
    return result


def projection_of(robot: Robot, kind: str) -> Projection:
    """The projection by which the robot is to see: 'kinematic', or 'neural' or 'hybrid' as shipped.

    Raises:
        ArgumentError: another kind.
        StateError: this installation lacks the weights.
    """
    if kind == "kinematic":
        return KinematicProjection(robot)
    if kind not in ("neural", "hybrid"):
        raise ArgumentError(f"projection: 'kinematic', 'neural' or 'hybrid' expected, got {kind!r}")
    return shipped.neural_projection(robot) if kind == "neural" else shipped.hybrid_projection(robot)


def slack_of(projection: Projection) -> float:
    """How far [px] a projection may be off: the networks' own median errors, the largest; else 0."""
    if isinstance(projection, NeuralProjection):
        return max(part.error for part in projection.learned.values())
    return 0.0


def title_of(options: ReachOptions) -> str:
    """What is to be done, whether or not it will be."""
    if options.obstacle and options.perturb:
        return "An iCub lifts a glass, and an obstacle appears on the way"
    if options.obstacle:
        return "An iCub lifts a glass that stands behind an obstacle"
    if options.perturb:
        return "An iCub lifts a glass that jumps away from its hand"
    return "An iCub finds a glass and lifts it"


def certificates_of(dynamics: CoupledDynamics) -> dict[str, dict[str, float]]:
    """Why eye, arm and hand must come to rest: rates [1/s], factors of a step, and that step [s]."""
    return {name: asdict(system.certificate()) for name, system in dynamics.systems.items()}


def _drive_to_the_end(trial: PickTrial, recording: Recording, console: Console) -> bool:
    """Whether it got there; after a Ctrl-C the report is still written, and a second one cannot spoil it."""
    usual = signal.getsignal(signal.SIGINT)
    try:
        with recording:
            try:
                _drive(trial, recording, console)
            except KeyboardInterrupt:
                signal.signal(signal.SIGINT, signal.SIG_IGN)
                raise
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, usual)
        return False
    return True


def _drive(trial: PickTrial, recording: Recording, console: Console) -> None:
    scene, disturbed = trial.stage.scene, False
    with Live(console=console, refresh_per_second=8, transient=True) as live:
        for bare in trial.run():
            happened = trial.disturbance is not None and trial.disturbance.happened
            cycle = _told(bare, trial, event=_event(trial) if happened and not disturbed else "")
            disturbed = happened
            truth = None if scene.glass is None else scene.glass_pose()[0]
            recording.add(cycle, truth=truth)
            live.update(_status(cycle, len(recording.history)))
        live.update(Text("Writing the report ..."))
        verdict = trial.judge()
        recording.finish(verdict.outcome, verdict.reason, _judged(verdict))


def _told(cycle: Cycle, trial: PickTrial, event: str) -> Cycle:
    """A cycle with what the controller knew at that moment, and where the eyes have the obstacles."""
    controller, motion = trial.task.controller, trial.task.motion
    views = Views(trial.attention.projection, cycle.joints)
    seen: dict[str, tuple[Polygon, ...]] = {}
    for centre, shape in cycle.obstacles:
        for camera, outline in outlines(views, centre, shape).items():
            seen[camera] = (*seen.get(camera, ()), outline)
    opening = None
    if motion is not None and controller.state is not None:
        opening = controller.state.opening
        if cycle.phase == "reach":  # before the palm is there the hand stays wider than the dynamics say
            away = float(np.linalg.norm(controller.palm[:3, 3] - motion.goal.palm[:3, 3]))
            opening = controller.grasp.opening(opening, away)
    legs = () if motion is None else tuple(leg.goal.palm[:3, 3] for leg in motion.legs)
    return replace(cycle, outlines=seen, legs=legs, opening=opening, event=event)


def _event(trial: PickTrial) -> str:
    assert trial.disturbance is not None
    return "The glass jumps 10 cm" if trial.disturbance.obstacle is None else "An obstacle appears"


def _judged(verdict: PickVerdict) -> dict[str, Any]:
    judged = asdict(verdict)
    del judged["outcome"], judged["reason"]  # the robot's own word, which stands beside the judge's
    # Touching the glass is what the robot is there for.
    return judged | {"touched": [name for name in verdict.touched if name != "glass"]}


def _status(cycle: Cycle, count: int) -> Group:
    """The live display: what the robot does, and what the last cycle cost."""
    attended = 1e3 * sum(cycle.seconds.values())
    found = "seen" if cycle.sight.located is not None else "not seen"
    lines = [
        f"cycle {count:3d}   {cycle.time:5.1f} s   {story(cycle)}",
        f"looked at {cycle.sight.attended:4.0%} of the pixels in {attended:5.1f} ms; glass {found}",
    ]
    if cycle.full is not None:
        lines.append(f"the full scan beside it took {1e3 * cycle.full.seconds:5.1f} ms")
    if cycle.goal is not None:
        lines.append(
            f"palm {100 * float(np.linalg.norm(cycle.palm - cycle.goal)):4.1f} cm from the grasp"
            + ("" if cycle.opening is None else f", hand {_opening(cycle.opening)}")
        )
    if cycle.obstacles:
        lines.append(f"{len(cycle.obstacles)} obstacle seen")
    return Group(*(Text(line) for line in lines))


def _opening(opening: float) -> str:
    return "squeezes" if opening < 0.0 else f"{opening:.0%} open"


def _conclude(result: dict[str, Any], console: Console) -> None:
    """The closing words and the table of times."""
    for line, good in closing(result):
        console.print(line, style="green" if good else "yellow", markup=False, highlight=False)
    console.print(_times(result))


def closing(result: dict[str, Any]) -> list[tuple[str, bool]]:
    """What came of a run, line by line, and whether that is good.

    Args:
        result: as in result.json, judged by a :class:`PickVerdict`.
    """
    judged, meta = result["judged"], result["meta"]
    lines = []
    if judged["lifted"]:
        glass = f"{1e3 * judged['mass_kg']:.0f} g and {1e3 * judged['width_m']:.0f} mm width"
        height = f"{100 * judged['height_m']:.1f} cm"
        lines.append(
            (f"Lifted: a glass of {glass}, for a second {height} over the table, by friction alone.", True)
        )
    elif result["outcome"] == "lifted":
        lines.append(("The robot takes the glass to be lifted; judged from outside it is not.", False))
    else:
        lines.append((f"{result['outcome'].capitalize()}: {result['reason']}", False))
    if meta["perturb"]:
        what = "the obstacle to appear" if meta["obstacle"] else "the glass to jump"
        if not judged["disturbed"]:
            lines.append((f"There was no time or room for {what}.", False))
        elif not meta["obstacle"]:
            lines.append(("On the way the glass jumped 10 cm, and the hand followed.", judged["lifted"]))
        else:
            lines.append(("The obstacle appeared when the hand was on its way.", judged["lifted"]))
    if meta["obstacle"] and not judged["touched_obstacle"] and judged["lifted"]:
        lines.append(("Nothing of the robot touched the obstacle.", True))
    if judged["touched"]:
        lines.append((f"The robot also touched: {', '.join(judged['touched'])}.", False))
    return lines


def _times(summary: dict[str, Any]) -> Table:
    table = Table(title="Time per vision cycle, both eyes, in ms", title_justify="left")
    table.add_column("stage")
    table.add_column("attended", justify="right")
    table.add_column("full frame", justify="right")
    full = summary["full_frame_ms"]
    for stage, times in summary["stages_ms"].items():
        beside = _ms(full) if stage == "detection" else ""
        table.add_row(stage, _ms(times), beside)
    table.add_section()
    table.add_row("whole cycle", _ms(summary["attended_ms"]), _ms(full))
    fraction = summary["attended_fraction"]
    table.add_row(
        "pixels looked at", "-" if fraction is None else f"{fraction['median']:.0%}", "100%" if full else "-"
    )
    located = summary["located"]
    cycles = summary["cycles"]["total"]
    table.add_row(
        "cycles with the glass located",
        f"{located['attended']} of {cycles}",
        "-" if located["full_frame"] is None else f"{located['full_frame']} of {cycles}",
    )
    if summary["speed_up"] is not None:
        table.add_row("speed-up", f"{summary['speed_up']:.1f}x", "")
    table.caption = (
        "Medians. A back-projection of the full images with its largest region, good for plain colours "
        f"only, takes {_ms(summary['back_projection_ms'])} ms: attention pays for detectors that cost more."
    )
    return table


def _ms(times: dict[str, float] | None) -> str:
    return "-" if times is None else f"{times['median']:.2f}"
