"""SURF of OpenCV 3.4.2 in an interpreter of its own, timed in turn with ours."""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from ..bench.timing import Call
from ..errors import ArgumentError

SCRIPT = Path(__file__).with_name("opencv342.py")
VERSION = "3.4.2"


@dataclass(eq=False)
class Rival:
    """A child process that detects and describes on one thread, once for every line it is sent."""

    threshold: float
    requests: IO[str]
    answers: IO[str]
    folder: Path
    images: int = 0

    def over(self, ours: Call, image: NDArray[np.uint8], rounds: int) -> float:
        """How many times longer it takes than ours: the median over the rounds of processor time."""
        self.images += 1
        path = self.folder / f"{self.images}.npy"
        np.save(path, image)
        self._time(path)
        ratios = []
        for _ in range(rounds):
            ours()
            start = time.thread_time_ns()
            ours()
            taken = time.thread_time_ns() - start
            ratios.append(self._time(path) / max(taken, 1))
        return float(np.median(ratios))

    def _time(self, path: Path) -> int:
        try:
            self.requests.write(f"{self.threshold} {path}\n")
            self.requests.flush()
            return int(self.answers.readline().split()[0])
        except (OSError, IndexError, ValueError):
            raise ArgumentError("opencv342: a Python whose OpenCV has SURF expected, it failed") from None


@contextmanager
def rival(python: Path, threshold: float) -> Iterator[Rival]:
    """Start an interpreter that has that OpenCV, and end it.

    Raises:
        ArgumentError: there is no such interpreter, or it has another OpenCV or none.
    """
    with tempfile.TemporaryDirectory() as folder:
        command = [str(python), str(SCRIPT)]
        pipe = subprocess.PIPE
        try:
            child = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, text=True)
        except OSError as error:
            raise ArgumentError(f"opencv342: cannot run {python}: {error.strerror}") from None
        with child:
            if child.stdin is None or child.stdout is None:
                raise ArgumentError(f"opencv342: cannot talk to {python}")
            version = child.stdout.readline().strip()
            if version != VERSION:
                raise ArgumentError(
                    f"opencv342: a Python with OpenCV {VERSION} expected, {python} has {version or 'none'}"
                )
            yield Rival(threshold, child.stdin, child.stdout, Path(folder))
