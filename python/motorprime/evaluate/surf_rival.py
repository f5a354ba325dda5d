"""SURF of OpenCV 3.4.2 in an interpreter of its own, timed in turn with ours."""

from __future__ import annotations

import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..bench.timing import Call
from ..errors import ArgumentError

SCRIPT = Path(__file__).with_name("opencv342.py")


class Rival:
    """A child process that detects and describes on one thread, once for every line it is sent."""

    def __init__(self, python: Path, threshold: float) -> None:
        """Start it.

        Raises:
            ArgumentError: there is no such interpreter, or it has no OpenCV with SURF.
        """
        self._threshold = threshold
        self._folder = tempfile.TemporaryDirectory()
        try:
            self._child = subprocess.Popen(
                [str(python), str(SCRIPT)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            )
        except OSError as error:
            raise ArgumentError(f"opencv342: cannot run {python}: {error.strerror}") from None
        self.version = self._read()

    def over(self, ours: Call, image: NDArray[np.uint8], rounds: int) -> float:
        """How many times longer it takes than ours: the median over the rounds of processor time."""
        path = Path(self._folder.name) / "image.npy"
        np.save(path, image)
        # A path that it has not seen yet: it keeps what it has read.
        path = path.rename(path.with_name(f"{time.monotonic_ns()}.npy"))
        self._time(path)
        ratios = []
        for _ in range(rounds):
            ours()
            start = time.thread_time_ns()
            ours()
            taken = time.thread_time_ns() - start
            ratios.append(self._time(path) / max(taken, 1))
        return float(np.median(ratios))

    def close(self) -> None:
        """End the child."""
        if self._child.stdin is not None:
            self._child.stdin.close()
        self._child.wait()
        self._folder.cleanup()

    def _time(self, path: Path) -> int:
        if self._child.stdin is not None:
            self._child.stdin.write(f"{self._threshold} {path}\n")
            self._child.stdin.flush()
        return int(self._read().split()[0])

    def _read(self) -> str:
        line = self._child.stdout.readline() if self._child.stdout is not None else ""
        if not line:
            raise ArgumentError(
                "opencv342: an interpreter with OpenCV 3.4.2 and its SURF expected, it failed"
            )
        return line.strip()
