"""A learning as the rows of a table, and what it rests on in words."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from motorctl.learn.learning import Learning

HEADINGS = ("eF µm", "rms µm", "repeats", "does not", "learned V", "peak V")


def headings(learning: Learning) -> tuple[str, ...]:
    """Return what stands over the columns, errors in the axis' unit."""
    return tuple(map(learning.loop.units.words, HEADINGS))


def rows(learning: Learning) -> Iterator[tuple[str, ...]]:
    """Yield a row for each repetition."""
    for k, trial in enumerate(learning.trials):
        each = trial.repetition
        name = f"run {k + 1}"
        yield (
            f"{name} *" if k == learning.best else name,
            f"{trial.eF_m * 1e6:.2f}",
            f"{each.rms_m * 1e6:.3f}",
            f"{each.repeats_rms_m * 1e6:.3f}",
            f"{each.left_over_rms_m * 1e6:.3f}",
            f"{np.sqrt(np.mean(each.learned**2)):.3f}",
            f"{np.abs(each.learned).max():.3f}",
        )


def words(learning: Learning) -> Iterator[str]:
    """Yield what the figures rest on."""
    filters, cycles = learning.filters, len(learning.trials[-1].repetition.error)
    yield f"over {cycles} cycles of '{learning.program}'; all are rms but eF and peak"
    if learning.best is not None:
        yield f"* is kept; run 1 is with {'what was learned before' if learning.before else 'none'}"
    runs = len(learning.trials)
    yield f"over after {runs} {'run' if runs == 1 else 'runs'}: {learning.ended}"
    yield (
        f"learned up to {filters.corner_hz:.3g} Hz, bound by {filters.bound_by}; each repetition "
        f"leaves at most {filters.shrinks_at_worst.max():.2f} of what repeats, for every plant "
        "that may be"
    )
    if learning.at_limit:
        yield (
            f"cut at {learning.limit_v:.3g} V (axes.{learning.axis}.learning.max_share): what is "
            "more than that stays in the error"
        )
    yield "it explains nothing: to fit and diagnose it is a part of the command"
