"""What can be measured: subjects, each of which gives figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from motorctl.errors import UsageError
from motorctl.latency.figure import Figure, missed
from motorctl.latency.host import host_facts
from motorctl.latency.progress import Progress, part_of
from motorctl_benchmarks.findings import Findings, TextTable
from motorctl_benchmarks.law_figures import law_figures
from motorctl_benchmarks.start_figures import start_figures
from motorctl_benchmarks.tick_figures import tick_figures
from motorctl_benchmarks.virtual_figures import virtual_figures

if TYPE_CHECKING:  # the analysis takes long to import: the campaign does so when it runs
    from motorctl_benchmarks.buses.figures import BusesOptions
    from motorctl_benchmarks.closing.findings import ClosingOptions
    from motorctl_benchmarks.control_socket.session import SocketOptions
    from motorctl_benchmarks.diagnosis.campaign import CampaignOptions
    from motorctl_benchmarks.experiments.findings import ExperimentsOptions
    from motorctl_benchmarks.fleet.findings import FleetOptions
    from motorctl_benchmarks.other_machines.findings import MachinesOptions
    from motorctl_benchmarks.real_machines.findings import RecordingsOptions
    from motorctl_benchmarks.safety.findings import SafetyOptions
    from motorctl_benchmarks.swaps.findings import SwapsOptions
    from motorctl_benchmarks.tuning.findings import TuningOptions

    Options = (
        BusesOptions
        | CampaignOptions
        | ClosingOptions
        | ExperimentsOptions
        | FleetOptions
        | MachinesOptions
        | RecordingsOptions
        | SafetyOptions
        | SocketOptions
        | SwapsOptions
        | TuningOptions
    )

Part = Callable[[Progress], tuple[list[Figure], list[str]]]

SPEED: Sequence[Part] = (law_figures, tick_figures, virtual_figures, start_figures)
"""Measured one after the other."""


def _speed(progress: Progress, _options: Options | None) -> Findings:
    figures: list[Figure] = []
    notes: list[str] = []
    for k, part in enumerate(SPEED):
        more, remarks = part(part_of(progress, k / len(SPEED), (k + 1) / len(SPEED)))
        figures += more
        notes += remarks
    return Findings(tuple(figures), tuple(notes))


def _diagnosis(progress: Progress, options: Options | None) -> Findings:
    from motorctl_benchmarks.diagnosis.campaign import CampaignOptions
    from motorctl_benchmarks.diagnosis.findings import diagnosis_findings

    asked = options or CampaignOptions()
    assert isinstance(asked, CampaignOptions)
    return diagnosis_findings(progress, asked)


def _machines(progress: Progress, options: Options | None) -> Findings:
    from motorctl_benchmarks.other_machines.findings import MachinesOptions, machine_findings

    asked = options or MachinesOptions()
    assert isinstance(asked, MachinesOptions)
    return machine_findings(progress, asked)


def _recordings(progress: Progress, options: Options | None) -> Findings:
    from motorctl_benchmarks.real_machines.findings import RecordingsOptions, recordings_findings

    asked = options or RecordingsOptions()
    assert isinstance(asked, RecordingsOptions)
    return recordings_findings(progress, asked)


def _safety(progress: Progress, options: Options | None) -> Findings:
    from motorctl_benchmarks.safety.findings import SafetyOptions, safety_findings

    asked = options or SafetyOptions()
    assert isinstance(asked, SafetyOptions)
    return safety_findings(progress, asked)


def _socket(progress: Progress, options: Options | None) -> Findings:
    from motorctl_benchmarks.control_socket.figures import socket_findings
    from motorctl_benchmarks.control_socket.session import SocketOptions

    asked = options or SocketOptions()
    assert isinstance(asked, SocketOptions)
    return socket_findings(progress, asked)


def _buses(progress: Progress, options: Options | None) -> Findings:
    from motorctl_benchmarks.buses.figures import BusesOptions, bus_findings

    asked = options or BusesOptions()
    assert isinstance(asked, BusesOptions)
    return bus_findings(progress, asked)


def _tuning(progress: Progress, options: Options | None) -> Findings:
    from motorctl_benchmarks.tuning.findings import TuningOptions, tuning_findings

    asked = options or TuningOptions()
    assert isinstance(asked, TuningOptions)
    return tuning_findings(progress, asked)


def _experiments(progress: Progress, options: Options | None) -> Findings:
    from motorctl_benchmarks.experiments.findings import ExperimentsOptions, experiments_findings

    asked = options or ExperimentsOptions()
    assert isinstance(asked, ExperimentsOptions)
    return experiments_findings(progress, asked)


def _closing(progress: Progress, options: Options | None) -> Findings:
    from motorctl_benchmarks.closing.findings import ClosingOptions, closing_findings

    asked = options or ClosingOptions()
    assert isinstance(asked, ClosingOptions)
    return closing_findings(progress, asked)


def _fleet(progress: Progress, options: Options | None) -> Findings:
    from motorctl_benchmarks.fleet.findings import FleetOptions, fleet_findings

    asked = options or FleetOptions()
    assert isinstance(asked, FleetOptions)
    return fleet_findings(progress, asked)


def _swaps(progress: Progress, options: Options | None) -> Findings:
    from motorctl_benchmarks.swaps.findings import SwapsOptions, swaps_findings

    asked = options or SwapsOptions()
    assert isinstance(asked, SwapsOptions)
    return swaps_findings(progress, asked)


SUBJECTS: Mapping[str, Callable[[Progress, Options | None], Findings]] = {
    "speed": _speed,
    "diagnosis": _diagnosis,
    "buses": _buses,
    "machines": _machines,
    "recordings": _recordings,
    "campaign": _safety,
    "socket": _socket,
    "tuning": _tuning,
    "experiments": _experiments,
    "closing": _closing,
    "fleet": _fleet,
    "swaps": _swaps,
}
WITH_CASES = (
    "diagnosis",
    "buses",
    "machines",
    "recordings",
    "campaign",
    "socket",
    "tuning",
    "experiments",
    "closing",
    "fleet",
    "swaps",
)
"""Subjects that take options."""


@dataclass(frozen=True)
class Result:
    """The figures of one subject, and the machine that they were measured on."""

    subject: str
    host: dict[str, Any]
    figures: tuple[Figure, ...]
    notes: tuple[str, ...]
    mistakes: tuple[Mapping[str, str], ...] = ()
    """Cases that came out wrong: case, truth and answer."""
    data: Mapping[str, Any] = field(default_factory=dict)
    """What else the subject tells, as plain data by name."""
    tables: tuple[TextTable, ...] = ()
    head: str = ""
    """A line of Markdown that stands above the tables in a page; empty: they are for the terminal
    alone."""
    failed: bool = False
    """The exit status shall tell that something is not as it has to be."""

    @property
    def missed(self) -> list[str]:
        """Which targets are not met, a plain sentence each."""
        return missed(self.figures)

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "subject": self.subject,
            "host": self.host,
            "figures": [figure.document() for figure in self.figures],
            "missed": self.missed,
            "notes": list(self.notes),
            "mistakes": [dict(row) for row in self.mistakes],
            **({"head": self.head} if self.head else {}),
            **self.data,
        }


def measure(subject: str, progress: Progress, options: Options | None = None) -> Result:
    """Measure a subject.

    Parameters
    ----------
    subject
        A key of SUBJECTS.
    progress
        Called with the share done, 0 to 1.
    options
        Of the subject diagnosis, buses, machines, recordings, campaign, socket, tuning,
        experiments, closing, fleet or swaps.

    Raises
    ------
    UsageError
        The subject is unknown, or takes no such options.
    """
    if subject not in SUBJECTS:
        raise UsageError(f"there is no bench '{subject}'; there are: {', '.join(SUBJECTS)}")
    if options is not None and subject not in WITH_CASES:
        raise UsageError(
            f"bench {subject} takes no cases; they are for bench {' and '.join(WITH_CASES)}"
        )
    host = host_facts()
    found = SUBJECTS[subject](progress, options)
    return Result(
        subject,
        host,
        found.figures,
        found.notes,
        found.mistakes,
        found.data,
        found.tables,
        found.head,
        found.failed,
    )
