"""The figures of a run, from the plain records of its cycles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

History: TypeAlias = list[dict[str, Any]]

STAGES = ("projection", "landscape", "sampling", "landscape and sampling", "detection", "triangulation")
"""The stages of a vision cycle with attention, in their order.

While the hand moves, landscape and sampling are one call and one stage."""


def summarise(history: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Medians and quartiles over all cycles.

    Args:
        history: records as in result.json: phase, seconds by stage, attended, located, full_frame or None.

    Returns:
        Times in milliseconds. ``attended_ms`` counts every stage, ``full_frame_ms`` the scan alone, so that
        ``speed_up`` (the ratio of the medians) is on the safe side. What was not measured is None.
    """
    phases = [str(record["phase"]) for record in history]
    full = [record["full_frame"] for record in history if record["full_frame"] is not None]
    attended = spread([total_ms(record) for record in history])
    scan = spread([1e3 * each["seconds"] for each in full])
    return {
        "cycles": {"total": len(phases)} | {phase: phases.count(phase) for phase in dict.fromkeys(phases)},
        "stages_ms": {
            stage: spread([1e3 * r["seconds"][stage] for r in history if stage in r["seconds"]])
            for stage in stages_of(history)
        },
        "attended_ms": attended,
        "full_frame_ms": scan,
        "back_projection_ms": spread([1e3 * each["back_projection"] for each in full]),
        "speed_up": scan["median"] / attended["median"]
        if scan and attended and attended["median"] > 0.0
        else None,
        "attended_fraction": spread([record["attended"] for record in history]),
        "located": {
            "attended": sum(bool(record["located"]) for record in history),
            "full_frame": sum(bool(each["located"]) for each in full) if full else None,
        },
    }


def stages_of(history: Sequence[Mapping[str, Any]]) -> list[str]:
    """The stages that occur, the known ones first and in order."""
    seen = dict.fromkeys(stage for record in history for stage in record["seconds"])
    return [stage for stage in STAGES if stage in seen] + [stage for stage in seen if stage not in STAGES]


def total_ms(record: Mapping[str, Any]) -> float:
    """A cycle's time with attention, all stages [ms]."""
    return 1e3 * float(sum(record["seconds"].values()))


def spread(values: Sequence[float]) -> dict[str, float] | None:
    """Median and quartiles; None of nothing."""
    if not len(values):
        return None
    lower, median, upper = (float(x) for x in np.percentile(values, (25, 50, 75)))
    return {"median": median, "lower_quartile": lower, "upper_quartile": upper}
