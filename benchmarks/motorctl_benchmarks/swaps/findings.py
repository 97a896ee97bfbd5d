"""`motorctl bench swaps`: other models while an axis holds, and kills around such a change."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress, part_of
from motorctl_benchmarks.findings import Findings, TextTable
from motorctl_benchmarks.swaps.gantry import AXIS, BESIDE, OTHERS, OWN, PULL_V, written_models
from motorctl_benchmarks.swaps.killing import LOOP, SUPERVISOR, Kill, kill_around_changes
from motorctl_benchmarks.swaps.swapping import Swapping, swap_models

BUMP = 0.01
"""So much of the voltage limit a command may step by where another model takes over."""
KILLS_PER_SWAP = 0.25
NONE = Target("value", "<=", 0.0)


@dataclass(frozen=True)
class SwapsOptions:
    """What is asked for."""

    swaps: int = 200
    """Changes of models; and a quarter as many kills."""
    seed: int = 1

    @property
    def kills(self) -> int:
        """How many processes are killed."""
        return max(round(KILLS_PER_SWAP * self.swaps), 1)


def swaps_findings(progress: Progress, options: SwapsOptions) -> Findings:
    """Change models, then kill. Raises RunError where a daemon does not start, or axes not hold."""
    with tempfile.TemporaryDirectory(prefix="motorctl-") as scratch:
        held, killed = Path(scratch) / "held", Path(scratch) / "killed"
        held.mkdir()
        killed.mkdir()
        swapping = swap_models(
            written_models(held), held, options.swaps, options.seed, part_of(progress, 0.0, 0.5)
        )
        kills = kill_around_changes(
            written_models(killed), killed, options.kills, options.seed,
            part_of(progress, 0.5, 1.0),
        )  # fmt: skip
    return found_of(swapping, kills)


def found_of(swapping: Swapping, kills: Sequence[Kill]) -> Findings:
    """Return figures and tables of both."""
    wrong = [kill for kill in kills if kill.wrong]
    largest_v = max(swap.bump_v for swap in swapping.swaps)
    figures = (
        Figure("bump", f"largest bump of the command of {AXIS} as another model takes over",
               100.0 * largest_v / swapping.max_voltage_v, "% of uM",
               target=Target("value", "<=", 100.0 * BUMP)),
        Figure("faults", "faults meanwhile", float(swapping.faults), "", target=NONE),
        Figure("rows_lost", "rows lost or twice", float(swapping.lost + swapping.twice), "",
               target=NONE),
        Figure("models", "logs of another model than was asked for", float(len(swapping.unlike)),
               "", target=NONE),
        Figure("kills", "kills after which something is not whole", float(len(wrong)), "",
               target=NONE),
    )  # fmt: skip
    mistakes = [
        *({"case": "log", "truth": "as asked for", "answer": words} for words in swapping.unlike),
        *(
            {"case": f"kill {k + 1}", "truth": "whole", "answer": "; ".join(kill.wrong)}
            for k, kill in enumerate(kills)
            if kill.wrong
        ),
    ]
    # A step of the command that the encoder's counts explain is none of the models'.
    held = [abs(swap.holds_v) for swap in swapping.swaps]
    notes = (
        f"A weight pulls at {AXIS} with {PULL_V:g} V; it moves before each change, and then holds "
        f"with {min(held):.2g} to {max(held):.2g} V.",
        f"{swapping.rows} rows. From the question to the answer: median "
        f"{np.median(swapping.waited_s):.1f} s, at most {max(swapping.waited_s):.1f} s.",
    )
    return Findings(
        figures,
        notes,
        tuple(mistakes),
        data={
            "swaps": [asdict(swap) for swap in swapping.swaps],
            "kills": [asdict(kill) for kill in kills],
        },
        tables=(_steps(swapping), _ends(kills)),
        failed=any(figure.met is False for figure in figures),
    )


def _steps(swapping: Swapping) -> TextTable:
    rows = []
    for other in OTHERS:
        for before, after in ((OWN, other), (other, OWN)):
            swaps = [s for s in swapping.swaps if (s.before, s.after) == (before, after)]
            if swaps:
                rows.append(
                    (
                        f"{before} → {after}",
                        str(len(swaps)),
                        _share(max(s.bump_v for s in swaps), swapping),
                        _share(max(abs(s.step_v) for s in swaps), swapping),
                        str(sum(s.counts_v != 0.0 for s in swaps)),
                        _share(max(s.beside_v for s in swaps), swapping),
                    )
                )
    columns = (
        f"model of {AXIS}",
        "changes",
        f"largest bump of {AXIS}, % of uM",
        "step with what counts add",
        "changes in which a count came",
        f"step of {BESIDE}, which keeps its model",
    )
    return TextTable("from the last tick of a model to the first of the next", columns, tuple(rows))


def _share(step_v: float, swapping: Swapping) -> str:
    return f"{100.0 * step_v / swapping.max_voltage_v:.2g}"


def _ends(kills: Sequence[Kill]) -> TextTable:
    rows = []
    for process in (SUPERVISOR, LOOP):
        own = [kill for kill in kills if kill.process == process]
        rows.append(
            (
                process,
                str(len(own)),
                str(sum(kill.at_s < 0.0 for kill in own)),
                str(sum(kill.at_s >= 0.0 and not kill.answered for kill in own)),
                str(sum(kill.answered for kill in own)),
                str(sum(not kill.new for kill in own)),
                str(sum(kill.new for kill in own)),
                str(sum(bool(kill.wrong) for kill in own)),
            )
        )
    columns = (
        "killed",
        "times",
        "before the question",
        "before the answer",
        "after it",
        "last log: old model",
        "new model",
        "half, lost or not recovered",
    )
    return TextTable("kills around a change, and what the next start found", columns, tuple(rows))
