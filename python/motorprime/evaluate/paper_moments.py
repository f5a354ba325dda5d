"""Scenes for the paper's experiments: a glass for the histograms, and in its place a printed card for SURF.

The robot is stopped in a posture or in the middle of a reach, and is shown the glass; then the card instead,
in the bare room and with pictures on the walls and sheets of print on the table, as there are in rooms; then
both once more, with things about that look like them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .._arrays import Floats
from ..robot import Robot
from ..sim.cameras import Eyes
from ..sim.cards import stand_card
from ..sim.glass import Glass, draw_glass
from ..sim.scene import CANISTER, TABLE_HEIGHT, TABLE_X, TABLE_Y, draw_layout
from ..tasks.staging import Stage, strike_seeing_posture
from .textures import draw_texture
from .trials import reach_of

Kind = Literal["peripersonal", "motorplan"]
DETECTORS = ("histogram", "surf")

CARD = (0.09, 0.12)
"""Width and height of the printed card [m]."""
LEAN = np.deg2rad(35.0)  # of cards on the table: the eyes look down at them
PRINT = (120, 90)
"""Height and width of its picture [px]: about as large as it is seen."""
OF_A_REACH = 5  # moments of it, at most
AWAY = (400.0, 0.0, 0.0)  # out of sight [m]
PRINT_SEED = 8  # a print that the full frame finds at nearly every look; 7 is one that it does not
NOISE = 2.0  # of the sensors [grey levels]
VISIBLE = 0.5  # of the glass's outline, in both eyes, when an obstacle has been stood about
BESIDE = (0.11, 0.25)  # of the obstacle's axis from the glass's [m]
ON_WALL, ON_TABLE = 6, 2  # things of each kind that look like the target
PICTURES, SHEETS = 6, 3  # of print that does not
SHEET = (0.21, 0.297)
"""Width and height of a sheet on the table [m]."""
ASIDE = 0.2  # of its middle from the target [m]
WALL = -1.68  # x of the wall behind the table [m]

Image = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Sight:
    """What the eyes see of one target.

    Attributes:
        images: of each camera, (H, W, 3) uint8 RGB, without noise.
        boxes: (u0, v0, u1, v1) of the target in each camera that has some of it in view, half-open.
    """

    images: Mapping[str, Image]
    boxes: Mapping[str, tuple[int, int, int, int]]

    def noisy(self, generator: np.random.Generator) -> dict[str, Image]:
        """The images as the sensors give them."""
        return {
            camera: np.clip(np.rint(image + generator.normal(0.0, NOISE, image.shape)), 0, 255).astype(
                np.uint8
            )
            for camera, image in self.images.items()
        }


@dataclass(frozen=True, eq=False)
class PaperMoment:
    """One scene of an experiment.

    Attributes:
        joints: gaze posture [rad].
        path: (N, 3) [m] where the hand is to go; None in search.
        glass: what the histogram is of.
        plain: for each of :data:`DETECTORS` what there is to see.
        cluttered: the same with things that look like the target.
        bare: what there is to see for SURF in a room without any other print.
    """

    joints: Floats
    path: Floats | None
    glass: Glass
    plain: Mapping[str, Sight]
    cluttered: Mapping[str, Sight]
    bare: Sight


def printed() -> Image:
    """The card's picture (h, w, 3) RGB."""
    return np.repeat(draw_texture(PRINT_SEED, *PRINT)[..., None], 3, axis=2)


def paper_moments(robot: Robot, kind: Kind, seed: int, number: int, *, obstacle: bool) -> list[PaperMoment]:
    """Stage one scene.

    Args:
        robot: with its URDF.
        kind: 'peripersonal': neck and eyes anywhere, the glass anywhere in reach and in view of both eyes.
            'motorplan': a reach for it, at :data:`OF_A_REACH` random moments.
        seed: of the series.
        number: of the scene.
        obstacle: whether something stands beside the glass, or on the way of the hand.

    Returns:
        The moments; none where the robot did not set out.
    """
    generator = np.random.default_rng([seed, number])
    if kind == "motorplan":
        return _reach(robot, seed, number, obstacle, generator)
    layout = draw_layout(generator, glass=draw_glass(generator))
    with Stage(robot, layout, noise=0.0) as stage:
        strike_seeing_posture(stage, generator)
        if obstacle:
            _stand_beside(stage, generator)
        return [_show(stage, stage.world.gaze(), None, generator)]


def _reach(
    robot: Robot, seed: int, number: int, obstacle: bool, generator: np.random.Generator
) -> list[PaperMoment]:
    with reach_of(robot, seed, number, obstacle=obstacle) as trial:
        world, glass, stopped = trial.stage.world, trial.stage.scene.glass, []
        assert glass is not None
        for cycle in trial.run():
            if cycle.phase == "grasp":
                break
            if cycle.phase == "reach" and cycle.path is not None:
                angles = {name: world.angle(name) for name in world.joint_index}
                stopped.append((angles, trial.stage.scene.glass_pose()[0], cycle.joints, cycle.path))
        chosen = np.sort(generator.permutation(len(stopped))[:OF_A_REACH])
        moments = []
        # What stands about does not move during a reach, but for a glass that is pushed.
        for angles, place, joints, path in (stopped[k] for k in chosen):
            world.place(angles)
            world.put(glass, place)
            moments.append(_show(trial.stage, joints, path, generator))
        return moments


def _stand_beside(stage: Stage, generator: np.random.Generator) -> None:
    """Let an obstacle stand near the glass and hide at most a part of it."""
    glass = stage.scene.glass_pose()[0][:2]
    while True:
        turn, away = generator.uniform(0.0, 2.0 * np.pi), generator.uniform(*BESIDE)
        spot = glass + away * np.array([np.cos(turn), np.sin(turn)])
        if not stage.scene.on_table(spot, CANISTER.radius):
            continue
        stage.scene.stand_obstacle(CANISTER, (float(spot[0]), float(spot[1])))
        if stage.visible(stage.eyes.capture()) >= VISIBLE:
            return
        stage.scene.remove_obstacle()


def _show(stage: Stage, joints: Floats, path: Floats | None, generator: np.random.Generator) -> PaperMoment:
    """Take the pictures of one posture: with the glass, with the card, without and with things alike."""
    scene, world = stage.scene, stage.world
    eyes = Eyes(world, light=stage.eyes.light)
    assert scene.glass is not None
    place = scene.glass_pose()[0]
    red = np.full((8, 8, 3), np.rint(np.multiply(stage.layout.glass.rgb, 255.0)), np.uint8)
    plain, cluttered = {"histogram": _sight(eyes, scene.glass)}, {}
    alike = _stand_alike(stage, place, red, "red", generator)
    cluttered["histogram"] = _sight(eyes, scene.glass)
    for body in alike:
        world.remove(body)
    world.put(scene.glass, AWAY)
    head = np.mean([view.pose[:3, 3] for view in stage.eyes.views().values()], axis=0)
    middle = np.array([place[0], place[1], TABLE_HEIGHT + CARD[1] / 2 + 0.001])
    turn = float(np.arctan2(head[1] - place[1], head[0] - place[0]))
    card = stand_card(world, scene.folder / "card", printed(), middle, CARD, turn=turn, lean=LEAN)
    bare = _sight(eyes, card)
    print_about = _furnish(stage, place, generator)
    plain["surf"] = _sight(eyes, card)
    alike = _stand_alike(stage, place, printed(), "print", generator)
    cluttered["surf"] = _sight(eyes, card)
    for body in (card, *alike, *print_about):
        world.remove(body)
    world.put(scene.glass, place)
    return PaperMoment(joints, path, stage.layout.glass, plain, cluttered, bare)


def _sight(eyes: Eyes, body: int) -> Sight:
    """What the eyes see, and where they see a body."""
    frames, boxes = eyes.capture(), {}
    for camera, frame in frames.items():
        v, u = np.nonzero(frame.body == body)
        if len(u):
            boxes[camera] = (int(u.min()), int(v.min()), int(u.max()) + 1, int(v.max()) + 1)
    return Sight({camera: frame.rgb for camera, frame in frames.items()}, boxes)


def _stand_alike(
    stage: Stage, target: Floats, picture: Image, name: str, generator: np.random.Generator
) -> list[int]:
    """Hang large copies on the wall, of about the size in the image, and stand small ones on the table."""
    folder = stage.scene.folder
    # In front of the pictures that hang there already.
    bodies = [_hang(stage, picture, f"{name}-wall-{k}", PICTURES + k, generator) for k in range(ON_WALL)]
    for k in range(ON_TABLE):
        while True:
            x, y = generator.uniform(*TABLE_X), generator.uniform(*TABLE_Y)
            # Behind the glass: in front of it the card would hide it.
            if x < target[0] - 0.05 and np.hypot(x - target[0], y - target[1]) > 0.15:
                break
        place = (x, y, TABLE_HEIGHT + CARD[1] / 2 + 0.001)
        bodies.append(stand_card(stage.world, folder / f"{name}-{k}", picture, place, CARD, lean=LEAN))
    return bodies


def _hang(stage: Stage, picture: Image, name: str, order: int, generator: np.random.Generator) -> int:
    """Hang a picture on the wall, five times as large as a card, before those of lower order."""
    place = (WALL + 0.005 * order, generator.uniform(-1.2, 1.2), generator.uniform(-0.6, 0.9))
    large = 5.0 * CARD[0], 5.0 * CARD[1]
    return stand_card(stage.world, stage.scene.folder / name, picture, place, large)


def _furnish(stage: Stage, target: Floats, generator: np.random.Generator) -> list[int]:
    """Hang pictures on the wall and lay sheets of print on the table, none like the card."""

    def other(height: int, width: int) -> Image:
        drawn = draw_texture(int(generator.integers(PRINT_SEED + 1, 2**31)), height, width)
        return np.repeat(drawn[..., None], 3, axis=2)

    bodies = [_hang(stage, other(*PRINT), f"picture-{k}", k, generator) for k in range(PICTURES)]
    for k in range(SHEETS):
        while True:
            x, y = generator.uniform(*TABLE_X), generator.uniform(*TABLE_Y)
            if np.hypot(x - target[0], y - target[1]) > ASIDE:
                break
        # Each a little above the one before: they may lie on each other.
        place = (x, y, TABLE_HEIGHT + 0.001 * (k + 1))
        turn = float(generator.uniform(0.0, 2.0 * np.pi))
        path, lying = stage.scene.folder / f"sheet-{k}", np.pi / 2.0
        bodies.append(stand_card(stage.world, path, other(297, 210), place, SHEET, turn=turn, lean=lying))
    return bodies
