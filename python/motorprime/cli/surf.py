"""``motorprime evaluate surf``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .measuring import show, writable
from .options import JsonFile, Seed, err


def register(evaluate: typer.Typer) -> None:
    """Add the command to ``motorprime evaluate``."""
    evaluate.command("surf", short_help="SURF where it matters: what it saves, and is it right?")(_surf)


def _surf(
    images: Annotated[int, typer.Option(min=1, help="Textures that are drawn.")] = 4,
    width: Annotated[int, typer.Option(min=32, help="Their width.")] = 640,
    height: Annotated[int, typer.Option(min=32, help="Their height.")] = 480,
    threshold: Annotated[float, typer.Option(min=0.0, help="Of the Hessian's determinant.")] = 300.0,
    opencv342: Annotated[
        Path | None,
        typer.Option(help="A Python that has OpenCV 3.4.2 with SURF, to be timed in turn.", dir_okay=False),
    ] = None,
    graf: Annotated[
        Path | None,
        typer.Option(
            help="Folder with graf1.png, graf3.png and H1to3p.xml (Debian's opencv-doc).", file_okay=False
        ),
    ] = None,
    seed: Seed = 0,
    json_file: JsonFile = None,
) -> None:
    """SURF on drawn textures: time with and without masks on one thread, and whether the results are right.

    mask30, mask10 and scattered30 are times relative to full_ms: with a rectangle of 30 and of 10 % of the
    pixels at a random place, and with blobs that cover 30 %. two_threads is how many times as fast two
    threads are by the clock, two_threads_caller by the calling thread's processor time, which a busy machine
    does not spoil. identical says whether every keypoint inside of a mask, also of single pixels, lines and
    noise, had the same bits as in the whole image; compared counts them.

    golden holds what is found against keypoints of OpenCV 3.4.2 that are stored with the tests: found is the
    share within 1 px and 10 % in size, cosine_share those of them whose descriptors have a cosine of 0.98 or
    more. opencv342_ratio is how many times as fast it is as that OpenCV on one thread, in turns. For graf see
    the help of evaluate_pair: repeatability and matching at 3 px in the part that both views show.
    """
    from ..evaluate.common import Progress
    from ..evaluate.surf import check_folder, evaluate_surf, golden_files

    writable(json=json_file)
    if graf is not None:
        check_folder(graf)
    result = evaluate_surf(
        images=images,
        shape=(height, width),
        threshold=threshold,
        seed=seed,
        golden=golden_files(),
        opencv342=opencv342,
        graf=graf,
        progress=Progress(err),
    )
    show("surf", result, json_file)
