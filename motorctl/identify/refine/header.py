"""The comment at the head of a refined configuration: what was found, and what it is worth."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from pathlib import PurePath

from motorctl.identify.diagnose.report.parameter_text import percent, prefixed
from motorctl.identify.diagnose.result import AxisDiagnosis, FoundEffect, RecordingDiagnosis

WIDTH = 98
"""Width of the written file's head [characters]. Only looks depend on it. Convention."""
FIRST_LINES = ("# yaml-language-server", "%", "---", "#!")
"""What has to stay at the head of a file."""


def header_lines(
    diagnosis: RecordingDiagnosis, told: Sequence[tuple[str, Sequence[str]]]
) -> list[str]:
    """Return the comment's lines; `told` gives for each axis what was done with it."""
    source = PurePath(diagnosis.source).name
    lines = [
        f"Refined by motorctl from {source}: {diagnosis.duration_s:.4g} s at "
        f"{diagnosis.sample_rate_hz:g} Hz."
    ]
    for name, done in told:
        axis = diagnosis.axes[name]
        words = [*done, *error_words(axis)] if axis.verdict != "insufficient_data" else done
        for k, sentence in enumerate(words):
            start = f"axis {name}: " if k == 0 else "  "
            lines += textwrap.wrap(
                sentence, WIDTH - 4, initial_indent=f"  {start}", subsequent_indent="    "
            )
    for name, why in diagnosis.refused.items():
        lines += textwrap.wrap(
            f"axis {name}: unchanged, for it could not be diagnosed: {why}",
            WIDTH - 4,
            initial_indent="  ",
            subsequent_indent="    ",
        )
    return [f"# {line}".rstrip() for line in lines]


def with_header(text: str, lines: Sequence[str]) -> str:
    """Put comment lines at the head of a YAML text, below what has to stand first."""
    newline = "\r\n" if "\r\n" in text else "\n"
    own = text.splitlines(keepends=True)
    first = 0
    while first < len(own) and own[first].startswith(FIRST_LINES):
        first += 1
    block = [f"{line}{newline}" for line in lines]
    if first and not own[first - 1].endswith(("\n", "\r")):
        own[first - 1] += newline
    behind = own[first].rstrip() if first < len(own) else ""
    if behind not in ("#", ""):
        block.append(f"#{newline}" if behind.startswith("#") else newline)
    return "".join([*own[:first], *block, *own[first:]])


def error_words(axis: AxisDiagnosis) -> list[str]:
    """Return in words what the model leaves on held-out rows, before and after."""
    error, data = axis.error, axis.data
    before, after = error.held_out_before_rms, error.held_out_after_rms
    told = f"held-out error of the model {_arrow(before, after, error.unit)} rms"
    if data.force_per_command is not None:
        gain = abs(data.force_per_command)
        told += f" ({_arrow(gain * before, gain * after, data.force_unit)})"
    if math.isfinite(error.noise_floor_rms):
        told += f", noise floor {error.noise_floor_rms:.3g} {error.unit}"
    lines = [told]
    first, last = error.simulated_position_before_rms, error.simulated_position_after_rms
    if first is not None and last is not None and error.window_s is not None:
        scale, unit = prefixed(max(first, last), data.position_unit)
        lines.append(
            f"position simulated over {error.window_s:g} s: "
            f"{_arrow(first / scale, last / scale, unit.replace('µ', 'u'))} rms"
        )
    return lines


def found_words(found: FoundEffect) -> str:
    """Return in words how sure an effect is, and what it explains."""
    told = (
        f"{found.effect.title}: explains {percent(found.explained_fraction)} of the "
        f"explainable held-out error; confidence {found.confidence:.2f}"
    )
    if found.indistinguishable_from:
        told += f"; this motion cannot tell it from {', '.join(found.indistinguishable_from)}"
    return told


def _arrow(before: float, after: float, unit: str) -> str:
    return f"{before:.3g} -> {after:.3g} {unit}"
