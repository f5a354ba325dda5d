"""Functions that worker processes run; in a module of their own, so that those processes can import them."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path

import cv2

from motorprime.errors import ArgumentError


def square(x):
    return x * x


def process_of(x):
    return os.getpid()


def opencv_threads(x):
    return cv2.getNumThreads()


def blas_threads(x):
    return os.environ.get("OPENBLAS_NUM_THREADS")


@dataclass(frozen=True)
class Touch:
    """Leaves a file for every item."""

    folder: Path
    slowly: bool = False

    def __call__(self, x):
        (self.folder / str(x)).touch()
        time.sleep(0.02 if self.slowly else 0.001)


class Stubborn(Exception):
    """Cannot be unpickled: its constructor wants two arguments."""

    def __init__(self, what, why):
        super().__init__(f"{what} because of {why}")


def fail(x):
    if x == 2:
        raise ArgumentError(f"x: {x} is not to my liking")
    return x


def fail_stubbornly(x):
    raise Stubborn("no", "reasons")


def die(x):
    if x == 2:
        os.kill(os.getpid(), 9)
    return x


@dataclass(frozen=True)
class SquareOnce:
    """Squares; but who first meets ``held`` says so in a file and waits there to be killed."""

    folder: Path
    held: int

    def __call__(self, x):
        trap = self.folder / "trap"
        if x == self.held and not trap.exists():
            aside = self.folder / "aside"
            aside.write_text(str(os.getpid()))
            aside.rename(trap)
            while True:
                time.sleep(0.01)
        return x * x
