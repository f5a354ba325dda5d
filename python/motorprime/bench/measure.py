"""The measurement itself, in this process: call it where NumPy was loaded with one thread."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from .. import _core
from . import suite
from .cases import Case
from .copying import Copy
from .scene import LARGE, SMALL, Scene
from .timing import FULL, QUICK, Call, Effort, Times, interleave
from .timing import LARGE as LARGE_EFFORT

Report = Callable[[int, int, str], None]
"""Told what is done, of how many, and what comes next."""

COPY, OURS = "memcpy", "motorprime"
DISTURBED = 1.15


def measure(names: Sequence[str], seed: int, quick: bool, report: Report) -> dict[str, Any]:
    """Measure kernels at 320 x 240 and, where that makes a difference, at 1920 x 1080.

    Args:
        names: Kernels, all of them if empty.
        seed: Draws everything that is random.
        quick: A few repetitions only, for a look at the table.
        report: Progress.

    Returns:
        As described in the documentation of the kernels.

    Raises:
        ArgumentError: there is no kernel of that name.
        InexactPeerError: a peer, or a kernel, gives something else than the others.
    """
    cv2.setNumThreads(1)
    names = suite.chosen(names)
    sized = [name for name in names if name in suite.SIZED]
    steps = len(names) + len(sized)
    small, large = Scene(SMALL, seed), Scene(LARGE, seed)
    copy = Copy(small.landscape)
    flops = _flops(QUICK if quick else FULL)
    timed = {}
    for number, name in enumerate(names):
        report(number, steps, name)
        timed[name] = [
            _timed(case, copy, QUICK if quick else FULL, peers=True) for case in suite.SUITE[name](small)
        ]
    timed_large = {}
    copy = Copy(large.landscape) if sized else copy
    for number, name in enumerate(sized, len(names)):
        report(number, steps, f"{name} at {_label(LARGE)}")
        timed_large[name] = [
            _timed(case, copy, QUICK if quick else LARGE_EFFORT, peers=False)
            for case in suite.SUITE[name](large)
        ]
    report(steps, steps, "")
    unit, unit_large = _copy_us(timed), _copy_us(timed_large) if timed_large else None
    kernels = {
        name: judged(name, [(case, entry(case, small, times, unit, flops)) for case, times in cases])
        for name, cases in timed.items()
    }
    grown = {
        name: _growth([figures(times, unit_large or unit) for _, times in cases], kernels[name])
        for name, cases in timed_large.items()
    }
    return {
        "machine": machine(flops),
        "seed": seed,
        "quick": quick,
        "memcpy_us": unit,
        "kernels": kernels,
        "sizes": {_label(LARGE): {"memcpy_us": unit_large, "kernels": grown}},
    }


def _timed(case: Case, copy: Call, effort: Effort, *, peers: bool) -> tuple[Case, dict[str, Times]]:
    """Check, then time. Without peers only the first is checked."""
    case.check(peers=None if peers else list(case.peers)[:1])
    return case, interleave(calls(case, copy, peers=peers), effort)


def _copy_us(timed: Mapping[str, Sequence[tuple[Case, dict[str, Times]]]]) -> float:
    """The unit of a run [us]: every kernel's rounds have a median copy, the least of these.

    What else uses the machine slows a copy more than a kernel, and so would flatter the kernels.
    """
    return min(times[COPY].median for cases in timed.values() for _, times in cases)


def calls(case: Case, copy: Call, *, peers: bool = True) -> dict[str, Call]:
    """All that is timed in turn: the copy of a landscape, the kernel, what stands beside it, its peers."""
    timed: dict[str, Call] = {COPY: copy}
    if case.ours is not None:
        timed[OURS] = case.ours.run
    if peers:
        timed |= {f"beside {name}": call for name, call in case.beside.items()}
        timed |= {f"peer {name}": peer.run for name, peer in case.peers.items()}
    return timed


def figures(times: Mapping[str, Times], unit: float) -> dict[str, Any]:
    """Our time and its ratio to the run's copy; None where there is no such kernel.

    ``copy_us`` is the copy in the same rounds. Where it is much slower than the unit, something else used the
    machine.
    """
    ours, copy = times.get(OURS), times[COPY].median
    return {
        "ours_us": ours.median if ours else None,
        "spread": _spread(ours) if ours else None,
        "memcpy_ratio": ours.median / unit if ours else None,
        "copy_us": copy,
        "disturbed": copy > DISTURBED * unit,
    }


def entry(case: Case, scene: Scene, times: Mapping[str, Times], unit: float, flops: float) -> dict[str, Any]:
    """What the JSON says of one case."""
    ours = times.get(OURS)
    peers: dict[str, dict[str, Any]] = {
        name: {
            "us": times[f"peer {name}"].median,
            "spread": _spread(times[f"peer {name}"]),
            "speedup": times[f"peer {name}"].over(ours) if ours else None,
        }
        for name in case.peers
    }
    best = min(case.peers, key=lambda name: times[f"peer {name}"].median)
    memory = unit * case.moved / (2 * 4 * scene.pixels)
    compute = case.operations / flops / 1e3
    return {
        "what": case.what,
        **figures(times, unit),
        "best_peer": best,
        "best_peer_us": peers[best]["us"],
        "speedup": peers[best]["speedup"],
        "beside": {name: times[f"beside {name}"].median for name in case.beside},
        **{f"times_{name}": ours.over(times[f"beside {name}"]) for name in case.beside if ours},
        "peers": peers,
        "absent_peers": dict(case.absent),
        "bound": {
            "us": max(memory, compute),
            "memory_us": memory,
            "compute_us": compute if case.operations else None,
            "bytes": case.moved,
            "operations": case.operations or None,
        },
    }


def judged(name: str, entries: Sequence[tuple[Case, dict[str, Any]]]) -> dict[str, Any]:
    """A kernel's entry with its targets: its input with the least speedup, and the worst ratio."""
    worst = min((seen for _, seen in entries), key=lambda seen: seen["speedup"] or 0.0)
    result = dict(worst)
    if len(entries) > 1:
        result["memcpy_ratio"] = _worst(seen for _, seen in entries)
        result["details"] = {case.variant: seen for case, seen in entries}
    result["may_lose"] = name in suite.MAY_LOSE
    result["targets"] = [target.judge(result.get(target.figure)) for target in suite.TARGETS[name]]
    return result


def _growth(seen: Sequence[dict[str, Any]], small: Mapping[str, Any]) -> dict[str, Any]:
    result = dict(max(seen, key=lambda one: one["memcpy_ratio"] or 0.0))
    ratio, base = result["memcpy_ratio"], small["memcpy_ratio"]
    result["growth"] = ratio / base if ratio and base else None
    result["targets"] = [suite.GROWTH.judge(result["growth"])]
    return result


def _worst(entries: Any) -> float | None:
    ratios = [seen["memcpy_ratio"] for seen in entries]
    return None if None in ratios else max(ratios)


def _spread(times: Times) -> dict[str, float]:
    q1, q3 = times.quartiles
    return {"q1": q1, "q3": q3}


def _flops(effort: Effort) -> float:
    """Additions and multiplications per nanosecond of a product of matrices: what this core can do."""
    side = 384
    a, b, out = (np.ones((side, side), np.float32) for _ in range(3))
    times = interleave({"product": lambda: np.matmul(a, b, out=out)}, effort)["product"]
    return 2 * side**3 / float(np.percentile(times.us, 10)) / 1e3


def machine(flops: float) -> dict[str, Any]:
    """On what was measured."""
    blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
    return {
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "threads": 1,
        "simd": _core.instruction_set(),
        "gflops": flops,
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "blas": f"{blas['name']} {blas['version']}",
        "opencv": cv2.__version__,
        "onnxruntime": _version("onnxruntime"),
        "motorprime": _version("motorprime"),
    }


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor() or platform.machine()


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _label(shape: tuple[int, int]) -> str:
    return f"{shape[1]}x{shape[0]}"
