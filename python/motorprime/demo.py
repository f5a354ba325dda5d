"""``motorprime reach``: stage a trial, show it live, record it, and say what attention saved."""

from __future__ import annotations

import contextlib
import json
import signal
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from . import shipped
from .errors import ArgumentError
from .projection import KinematicProjection, NeuralProjection, Projection
from .recording import Recording, fresh_folder
from .robot import Robot
from .sim.bystander import Bystander
from .sim.icub import load_icub
from .tasks.cycle import Cycle, Settings
from .tasks.trial import Trial, Verdict
from .viz import PHASES

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


def run_reach(options: ReachOptions, console: Console) -> dict[str, Any]:
    """Run one reach and write its folder; returns what result.json holds."""
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
    with Trial(
        robot,
        options.seed,
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
            title="Motor-primed attention: an iCub reaches for a glass",
            meta={**asdict(options), "runs": str(options.runs), "robot": robot.name},
            video=options.video,
            bystander=bystander,
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


def _drive_to_the_end(trial: Trial, recording: Recording, console: Console) -> bool:
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


def _drive(trial: Trial, recording: Recording, console: Console) -> None:
    scene = trial.stage.scene
    with Live(console=console, refresh_per_second=8, transient=True) as live:
        for cycle in trial.task.run():
            truth = None if scene.glass is None else scene.glass_pose()[0]
            recording.add(cycle, truth=truth)
            live.update(_status(cycle, len(recording.history)))
        live.update(Text("Writing the report ..."))
        verdict = trial.judge()
        recording.finish(verdict.outcome, verdict.reason, _judged(verdict))


def _judged(verdict: Verdict) -> dict[str, Any]:
    return {
        "reached": verdict.reached,
        "palm_error_m": verdict.palm_error_m,
        "glass_error_m": verdict.glass_error_m,
        "touched": list(verdict.touched),
    }


def _status(cycle: Cycle, count: int) -> Group:
    """The live display: what the robot does, and what the last cycle cost."""
    attended = 1e3 * sum(cycle.seconds.values())
    found = "seen" if cycle.sight.located is not None else "not seen"
    lines = [
        f"cycle {count:3d}   {cycle.time:5.1f} s   {PHASES[cycle.phase]}",
        f"looked at {cycle.sight.attended:4.0%} of the pixels in {attended:5.1f} ms; glass {found}",
    ]
    if cycle.full is not None:
        lines.append(f"the full scan beside it took {1e3 * cycle.full.seconds:5.1f} ms")
    if cycle.goal is not None:
        lines.append(
            f"palm {100 * float(((cycle.palm - cycle.goal) ** 2).sum()) ** 0.5:4.1f} cm from its goal"
        )
    return Group(*(Text(line) for line in lines))


def _conclude(result: dict[str, Any], console: Console) -> None:
    """The closing words and the table of times."""
    judged = result["judged"]
    if judged.get("reached"):
        console.print(
            f"Reached: the palm is {1e3 * judged['palm_error_m']:.1f} mm from the true pre-grasp point, "
            f"the glass was located to {1e3 * judged['glass_error_m']:.1f} mm.",
            style="green",
            highlight=False,
        )
    else:
        console.print(f"{result['outcome'].capitalize()}: {result['reason']}", style="yellow", markup=False)
    if judged.get("touched"):
        console.print(f"On its way the robot touched: {', '.join(judged['touched'])}.", style="yellow")
    console.print(_times(result))


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
