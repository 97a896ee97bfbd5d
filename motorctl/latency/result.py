"""What a latency measurement found: figures, verdict, and everything behind them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motorctl.config.machine import Machine
from motorctl.identify.compare.published import DEVICE, TURNAROUND_S
from motorctl.latency.cyclictest import Rival
from motorctl.latency.figure import Figure, Target, missed
from motorctl.latency.histogram import histogram_document
from motorctl.latency.loop_run import LoopRun
from motorctl.latency.ticks import TickTimes
from motorctl.latency.verdict import Verdict, judge

LATE_S = (50e-6, 100e-6)
"""A wake-up later than this is late; so is one later than a period."""
MEDIAN_TARGET = Target("value", "<", 2.0)
US = 1e6


@dataclass(frozen=True)
class Latency:
    """The loop's timing on this machine, and cyclictest's where it could be measured."""

    machine: Machine
    host: dict[str, Any]
    cpu: int
    duration_s: float
    moving: bool
    log: Path | None
    run: LoopRun
    times: TickTimes
    rival: Rival | None
    without_rival: str | None
    """Why cyclictest was not measured."""
    advice: tuple[str, ...]

    @property
    def verdict(self) -> Verdict:
        """LinuxCNC's grade for the worst lateness."""
        return judge(self.times.lateness.worst_s * US)

    @property
    def every_tick(self) -> bool:
        """Whether each period has its row or was skipped and counted as such."""
        return self.times.every_tick_is_there(self.run)

    @property
    def figures(self) -> tuple[Figure, ...]:
        """What has a target, and what has a peer."""
        lateness, rival = self.times.lateness, self.rival
        figures = [
            Figure(
                name="lateness_p50",
                title="median lateness",
                value=lateness.percentile_s(50.0) * US,
                unit="us",
                peer=None if rival is None else "cyclictest",
                peer_value=None if rival is None else rival.latency.percentile_s(50.0) * US,
                target=MEDIAN_TARGET,
            )
        ]
        figures += self._turnaround()
        for limit_s in (*LATE_S, self.machine.period_s):
            figures.append(
                self._share(
                    f"late_{limit_s * US:g}us",
                    f"wake-ups later than {limit_s * US:g} us",
                    lateness.share_beyond(limit_s),
                    None if rival is None else rival.latency.share_beyond(limit_s),
                )
            )
        figures.append(
            self._share(
                "skipped",
                "periods skipped",
                self.times.skipped_share,
                None if rival is None else rival.skipped_share,
            )
        )
        return tuple(figures)

    @property
    def missed(self) -> list[str]:
        """Which targets are not met, a plain sentence each."""
        return missed(self.figures)

    def document(self) -> dict[str, Any]:
        """Return the measurement as plain data."""
        run, times, rival = self.run, self.times, self.rival
        turnaround = times.parts["turnaround"]
        return {
            "machine": self.machine.name,
            "rate_hz": self.machine.rate_hz,
            "duration_s": self.duration_s,
            "axes": list(self.machine.axes),
            "moving": self.moving,
            "host": self.host,
            "cpu": self.cpu,
            "priority": self.machine.loop.priority,
            "spin_us": self.machine.loop.spin_s * US,
            "degraded": run.degraded,
            "stolen_share": run.stolen_share,
            "lateness": times.lateness.document()
            | {"histogram": histogram_document(times.lateness)},
            "turnaround": turnaround.document()
            | {
                "parts": {k: d.document() for k, d in times.parts.items() if k != "turnaround"},
                "histogram": histogram_document(turnaround),
            },
            "ticks": {
                "rows": times.rows,
                "measured": times.lateness.total,
                "every_tick": self.every_tick,
                "rows_lost": run.rows_lost,
                "periods_missing": times.periods_missing,
                "skipped_periods": run.skipped_periods,
                "overruns": run.overruns,
            },
            "refusals": run.refusals,
            "cyclictest": {"missing": self.without_rival}
            if rival is None
            else {
                "command": rival.command,
                "version": rival.version,
                "samples": rival.latency.total,
                "skipped_periods": rival.skipped,
                "latency": rival.latency.document()
                | {"histogram": histogram_document(rival.latency)},
            },
            "figures": [figure.document() for figure in self.figures],
            "missed": self.missed,
            "verdict": {"grade": self.verdict.grade, "sentence": self.verdict.sentence},
            "advice": list(self.advice),
            "log": None if self.log is None else str(self.log),
        }

    def _turnaround(self) -> list[Figure]:
        """Return the median turnaround beside the published one of the same controller."""
        median_us = self.times.parts["turnaround"].percentile_s(50.0) * US
        controllers = {axis.controller for axis in self.machine.axes.values()}
        published_us = max(TURNAROUND_S[c] for c in controllers) * US
        return [
            Figure(
                name="turnaround_p50",
                title="median turnaround",
                value=median_us,
                unit="us",
                peer=f"published, {DEVICE}",
                peer_value=published_us,
                ratio=published_us / median_us,
            )
        ]

    def _share(self, name: str, title: str, own: float, peers: float | None) -> Figure:
        return Figure(
            name=name,
            title=title,
            value=own * 100.0,
            unit="%",
            peer=None if peers is None else "cyclictest",
            peer_value=None if peers is None else peers * 100.0,
            ratio=peers / own if peers is not None and own > 0.0 else None,
            target=None if peers is None else Target("value", "<=", peers * 100.0),
        )
