"""The figures as a table, for the terminal and for the documentation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.table import Table

STAR = "* something else used the machine meanwhile: a copy took longer than beside other kernels."
COLUMNS = ("kernel", "ours, us", "copies", "best peer", "peer, us", "speedup", "target", "met")
SIZE_COLUMNS = ("kernel", "size", "ours, us", "copies", "of the ratio at 320 x 240", "target", "met")
WIDE = 110  # characters
WORDS = {
    "memcpy_ratio": "<= {:g} copies",
    "speedup": ">= {:g}x",
    "times_triangular": "<= {:g}x triangular",
    "growth": "<= {:g}x",
}


def table(result: Mapping[str, Any], width: int) -> Table:
    """What was seen at 320 x 240, beside what is asked; without the peers where the terminal is narrow."""
    size = "320 x 240, float32, one thread; a copy takes {:.2f} us".format(result["memcpy_us"])
    shown = Table(title=f"bench: {size}", title_justify="left")
    kept = [k for k, name in enumerate(COLUMNS) if width >= WIDE or name not in ("best peer", "peer, us")]
    for name in (COLUMNS[k] for k in kept):
        numeric = name in ("ours, us", "copies", "peer, us", "speedup")
        shown.add_column(name, justify="right" if numeric else "left", no_wrap=numeric or name == "kernel")
    for cells in _rows(result):
        shown.add_row(*(cells[k] for k in kept))
    return shown


def sizes_table(result: Mapping[str, Any]) -> Table | None:
    """What was seen in larger images; None if nothing was."""
    rows = list(_size_rows(result))
    if not rows:
        return None
    shown = Table(title="the same in larger images", title_justify="left")
    for name in SIZE_COLUMNS:
        shown.add_column(name, justify="left" if name in ("kernel", "size", "target", "met") else "right")
    for cells in rows:
        shown.add_row(*cells)
    return shown


def markdown(result: Mapping[str, Any]) -> str:
    """The tables and the machine in Markdown, to be included in the documentation."""
    machine = result["machine"]
    lines = [
        f"Measured on {machine['cpu']} ({machine['system']}, instruction set: {machine['simd']}), "
        f"one thread, Python {machine['python']}, NumPy {machine['numpy']} ({machine['blas']}), "
        f"OpenCV {machine['opencv']}, ONNX Runtime {machine['onnxruntime'] or 'not installed'}. "
        f"Copying a landscape of 320 x 240 took {result['memcpy_us']:.2f} us.",
        "",
        *_markdown(COLUMNS, _rows(result)),
    ]
    if words := two_threads(result):
        lines += ["", words]
    sized = list(_size_rows(result))
    if sized:
        lines += ["", "The same in larger images, lengths stretched with the image:", ""]
        lines += _markdown(SIZE_COLUMNS, iter(sized))
    if disturbed(result):
        lines += ["", "\\" + STAR]
    lines += [
        "",
        "Every peer, median of single calls [us]:",
        "",
        *_markdown(("kernel", "peers"), _peers(result)),
    ]
    return "\n".join(lines) + "\n"


def two_threads(result: Mapping[str, Any]) -> str:
    """What a second thread makes of the whole step; empty where it was not measured."""
    seen = result["kernels"].get("attention_step")
    if seen is None or seen["ours_us"] is None:
        return ""
    us = seen["beside"]["two_threads"]
    return f"attention_step with both eyes side by side on two threads: {us:.1f} us."


def disturbed(result: Mapping[str, Any]) -> bool:
    """Whether a row carries the star."""
    parts = [result, *result["sizes"].values()]
    return any(seen["disturbed"] for part in parts for seen in part["kernels"].values())


def missed(result: Mapping[str, Any]) -> list[str]:
    """Kernels that miss a target, with the size where it is not 320 x 240."""
    names = [name for name, seen in result["kernels"].items() if _verdict(seen["targets"]) == "no"]
    for size, part in result["sizes"].items():
        names += [
            f"{n} at {size}" for n, seen in part["kernels"].items() if _verdict(seen["targets"]) == "no"
        ]
    return names


def _rows(result: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    for name, seen in result["kernels"].items():
        yield (
            name,
            _ours(seen, "{:.1f}"),
            _number(seen["memcpy_ratio"], "{:.2f}"),
            seen["best_peer"],
            _number(seen["best_peer_us"], "{:.1f}"),
            _number(seen["speedup"], "{:.2f}x"),
            _asked(seen["targets"]),
            _verdict(seen["targets"]) or ("may lose" if seen["may_lose"] else "-"),
        )


def _size_rows(result: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    for size, part in result["sizes"].items():
        for name, seen in part["kernels"].items():
            yield (
                name,
                size.replace("x", " x "),
                _ours(seen, "{:.0f}"),
                _number(seen["memcpy_ratio"], "{:.2f}"),
                _number(seen["growth"], "{:.2f}x"),
                _asked(seen["targets"]),
                _verdict(seen["targets"]) or "-",
            )


def _peers(result: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    for name, seen in result["kernels"].items():
        for variant, part in seen.get("details", {"": seen}).items():
            ordered = sorted(part["peers"].items(), key=lambda peer: float(peer[1]["us"]))
            listed = [f"{peer} {figures['us']:.1f}" for peer, figures in ordered]
            absent = [f"{peer}: {why}" for peer, why in part["absent_peers"].items()]
            yield f"{name}, {variant}" if variant else name, "; ".join(listed + absent)


def _asked(targets: list[dict[str, Any]]) -> str:
    """The targets, and what was seen where no column has it."""
    words = []
    for target in targets:
        beside = target["figure"] == "times_triangular" and target["seen"] is not None
        seen = f" (is {target['seen']:.1f}x)" if beside else ""
        words.append(WORDS[target["figure"]].format(target["limit"]) + seen)
    return ", ".join(words) or "-"


def _verdict(targets: list[dict[str, Any]]) -> str:
    """yes, no, or nothing where there is no target or nothing was measured."""
    known = [target["met"] for target in targets if target["met"] is not None]
    return "" if not known else "yes" if all(known) else "no"


def _ours(seen: Mapping[str, Any], form: str) -> str:
    """Our time, with the star if the rounds were disturbed."""
    return "-" if seen["ours_us"] is None else form.format(seen["ours_us"]) + "*" * seen["disturbed"]


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else form.format(value)


def _markdown(columns: tuple[str, ...], rows: Iterator[tuple[str, ...]]) -> list[str]:
    return [f"| {' | '.join(cells)} |" for cells in (columns, ("---",) * len(columns), *rows)]
