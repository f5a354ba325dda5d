"""``motorprime evaluate regions``."""

from __future__ import annotations

from typing import Annotated

import typer

from .measuring import show, writable
from .options import JsonFile, Seed, TextModel, err


def register(evaluate: typer.Typer) -> None:
    """Add the command to ``motorprime evaluate``."""
    evaluate.command("regions", short_help="Real detectors on 30 % of the pixels: what is saved and found.")(
        _regions
    )


def _regions(
    images: Annotated[int, typer.Option(min=1, help="Textures; four times as many of labels and faces.")] = 5,
    rounds: Annotated[int, typer.Option(min=1, help="Timed runs on each image.")] = 3,
    text_model: TextModel = None,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """Detectors on one compact tile of 30 % of the pixels, beside the same on the whole image.

    Keypoints with descriptors of SIFT, AKAZE, KAZE, ORB and BRISK on textures of 1280 x 720, and a neural
    text detector on printed labels at 640 x 480; tiles are aligned as each detector wants it. "ratio" is the
    median time over that of the full frame, both on one thread, in turn, in processor time. "recovered" is
    the share of what the full run found inside the tile: keypoints within 0.1 px, 2 % in size and 2 degrees;
    boxes that lie wholly inside, with a score of 0.6 or more, by an intersection over union of 0.7.
    "pixels_read" counts the halo too.

    "orb_2" is ORB with the scale factor 2 and three levels, "brisk_48" is BRISK on images whose sides are
    multiples of 48, "cascade" finds drawn faces at 640 x 480, whatever their score. "cover" compares tilings
    with the optimum on small random masks: "optimal" is the share that no other cover beats, "worst" the
    largest ratio to the best.
    """
    from ..evaluate.common import Progress
    from ..evaluate.regions import evaluate_regions

    writable(json=json_file)
    result = evaluate_regions(
        images=images, rounds=rounds, seed=seed, text_model=text_model, progress=Progress(err)
    )
    show("regions", result, json_file)
