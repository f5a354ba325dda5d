"""The measurement in a process of its own, whose libraries are loaded with one thread."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from typing import Any

from ..errors import StateError

ONE_THREAD = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "RAYON_NUM_THREADS",
)


def measure_in_child(
    names: Sequence[str], seed: int, quick: bool, report: Callable[[int, int, str], None]
) -> dict[str, Any]:
    """:func:`motorprime.bench.measure.measure` in a fresh process; ends with this one.

    Raises:
        StateError: the measurement ended with an error.
    """
    options = json.dumps({"names": list(names), "seed": seed, "quick": quick})
    command = [sys.executable, "-m", "motorprime.bench", options]
    environment = {**os.environ, **dict.fromkeys(ONE_THREAD, "1")}
    with tempfile.TemporaryFile("w+") as complaints:
        child = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=complaints,
            text=True,
            env=environment,
            start_new_session=True,  # an interrupt is for this process, which then ends the child
        )
        assert child.stdout is not None
        try:
            for line in child.stdout:
                said = json.loads(line)
                if "progress" in said:
                    report(*said["progress"])
                elif "error" in said:
                    raise StateError(said["error"])
                else:
                    return dict(said["result"])
        finally:
            child.kill()
            child.wait()
            child.stdout.close()
        complaints.seek(0)
        last = (complaints.read().strip().splitlines() or ["it said nothing"])[-1]
    raise StateError(f"bench: the measuring process ended early: {last}")
