"""What a daemon's status says, as metrics that are named as Prometheus' conventions ask."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    InfoMetricFamily,
    Metric,
    StateSetMetricFamily,
)

from motorctl.api.status import AxisStatus, MachineStatus
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import Phase
from motorctl.version import VERSION

BYTES_PER_MEGABYTE = 1e6
SECONDS_PER_HOUR = 3600.0
AXIS = ("axis",)
STATES = tuple(state.name.lower() for state in AxisState)
PHASES = tuple(phase.name.lower() for phase in Phase)
CAUSES = (
    *(cause.name.lower() for cause in FaultCause if cause is not FaultCause.NONE),
    "loop_ended",
)
"""Of a fault: those of logs, and that the loop is gone."""
QUANTILES = {"p50_s": "0.5", "p99_s": "0.99", "p999_s": "0.999"}

Told = Callable[[Mapping[str, Any]], float | None]
"""A number from a document; None where it is not known, and then no sample is exported."""


def _key(name: str, factor: float = 1.0) -> Told:
    def told(document: Mapping[str, Any]) -> float | None:
        value = document.get(name)
        return None if value is None else factor * value

    return told


def _within(part: str, name: str, factor: float = 1.0) -> Told:
    inner = _key(name, factor)
    return lambda document: inner(document.get(part) or {})


def _is_told(name: str) -> Told:
    return lambda document: float(document.get(name) is not None)


Family = tuple[type[Metric], str, str, Told]

OF_AXIS: Sequence[Family] = (
    (GaugeMetricFamily, "homed", "Whether it knows its place: soft limits are in force.",
     _key("homed")),
    (GaugeMetricFamily, "position_meters", "Measured position.", _key("position_m")),
    (GaugeMetricFamily, "reference_meters", "Where it is led.", _key("reference_m")),
    (GaugeMetricFamily, "velocity_meters_per_second", "Measured velocity.", _key("velocity_m_s")),
    (GaugeMetricFamily, "following_error_meters",
     "Position - reference, at the moment of the scrape.", _key("following_error_m")),
    (GaugeMetricFamily, "command_volts", "As written to the driver.", _key("command_v")),
    (GaugeMetricFamily, "command_limit_volts", "limits.max_voltage_v.", _key("max_voltage_v")),
    (GaugeMetricFamily, "disturbance_estimate_volts",
     "Fast estimate of the lumped disturbance.", _key("d0_hat_v")),
    (GaugeMetricFamily, "motor_load_ratio",
     "I²t: the motor's mean square command over its time constant, as a share of the continuous "
     "one; at 1 it trips. Only axes with guards.thermal have it.", _within("motor_heat", "load")),
    (GaugeMetricFamily, "skew_meters", "First end - second end, of a dual drive.",
     _within("dual_drive", "skew_m")),
    (GaugeMetricFamily, "device_trouble", "Whether the driver reports something that keeps it off.",
     _is_told("device")),
    (CounterMetricFamily, "missed_samples", "Ticks in which the driver had no new sample.",
     _within("samples", "missed")),
)  # fmt: skip
"""Of each axis, under `motorctl_axis_…`; of a rotary one with radians for meters."""
METERS, RADIANS = "meters", "radians"
OF_LOOP: Sequence[Family] = (
    (GaugeMetricFamily, "rate_hertz", "Of the loop.", _key("rate_hz")),
    (CounterMetricFamily, "ticks", "Ticks since the loop began.", _key("ticks")),
    (CounterMetricFamily, "overruns", "Ticks that ended after the next one was due.",
     _key("overruns")),
    (CounterMetricFamily, "skipped_periods", "Whole periods that were skipped, or waited for.",
     _key("skipped_periods")),
    (GaugeMetricFamily, "degradations", "How many things real time lacks; the status names them.",
     lambda loop: len(loop["degraded"])),
    (GaugeMetricFamily, "turnaround_max_seconds", "The longest turnaround of the whole run.",
     _within("turnaround", "max_s")),
    (GaugeMetricFamily, "lateness_max_seconds", "The latest wake-up of the whole run.",
     _within("lateness", "max_s")),
)  # fmt: skip
OF_RECORDER: Sequence[Family] = (
    (CounterMetricFamily, "rows", "Rows that were written.", _key("rows")),
    (CounterMetricFamily, "rows_lost", "Rows that were overwritten before they were written.",
     _key("rows_lost")),
    (GaugeMetricFamily, "failed", "Whether recording has stopped; the status says why.",
     _is_told("failure")),
    (GaugeMetricFamily, "trouble",
     "Whether it records but cannot begin the next log, or end one; the status says why.",
     _is_told("trouble")),
    (GaugeMetricFamily, "paused", "Whether it pauses as every axis is off.", _key("paused")),
    (GaugeMetricFamily, "disk_free_bytes", "Free space of the disk that is recorded to.",
     _within("disk", "free_mb", BYTES_PER_MEGABYTE)),
    (GaugeMetricFamily, "disk_free_files", "How many files can still be made on it.",
     _within("disk", "free_files")),
    (GaugeMetricFamily, "disk_left_seconds", "For how long that is enough.",
     _within("disk", "hours_left", SECONDS_PER_HOUR)),
    (CounterMetricFamily, "logs_removed", "Old logs that were removed to make room.",
     _within("retention", "removed")),
)  # fmt: skip
OF_DAEMON: Sequence[Family] = (
    (GaugeMetricFamily, "uptime_seconds", "How long the daemon runs.", _key("uptime_s")),
    (GaugeMetricFamily, "stopping", "Whether it is ending.", _key("stopping")),
    (GaugeMetricFamily, "config_changed", "Whether the file is another than what runs.",
     _is_told("config_difference")),
)  # fmt: skip


def down() -> Iterator[Metric]:
    """Yield what is told while no daemon answers."""
    yield GaugeMetricFamily("motorctl_up", "Whether the daemon answered this scrape.", 0.0)
    yield InfoMetricFamily("motorctl_exporter", "Who tells this.", {"version": VERSION})


def metrics_of(status: MachineStatus) -> Iterator[Metric]:
    """Yield all metrics of a status document; nothing is computed anew."""
    document = status.document
    yield GaugeMetricFamily("motorctl_up", "Whether the daemon answered this scrape.", 1.0)
    yield InfoMetricFamily("motorctl_exporter", "Who tells this.", {"version": VERSION})
    about = {"version": document["daemon"]["version"], "machine": status.machine}
    yield InfoMetricFamily("motorctl_daemon_build", "The daemon's version, and its machine.", about)
    yield from _families("motorctl_daemon", OF_DAEMON, document["daemon"])
    yield from _families("motorctl_loop", OF_LOOP, document["loop"])
    yield _state_set(
        "motorctl_loop_phase", "How far the loop is.", PHASES, [([], document["loop"]["phase"])]
    )
    for name in ("turnaround", "lateness"):
        yield _quantiles(name, document["loop"][name])
    yield from _families("motorctl_recorder", OF_RECORDER, document["recording"])
    yield from _of_axes(status.axes)


def _of_axes(axes: Mapping[str, AxisStatus]) -> Iterator[Metric]:
    states = [([name], axis.state) for name, axis in axes.items()]
    yield _state_set("motorctl_axis_state", "In which state an axis is.", STATES, states, AXIS)
    faults = [([name], axis.fault_cause) for name, axis in axes.items()]
    yield _state_set("motorctl_axis_fault", "What tripped an axis.", CAUSES, faults, AXIS)
    rotary = {name: axis for name, axis in axes.items() if axis.position_unit == "rad"}
    linear = {name: axis for name, axis in axes.items() if name not in rotary}
    for kind, name, help_, told in OF_AXIS:
        if METERS in name:
            yield _of(linear, (kind, name, help_, told))
            if rotary:
                yield _of(rotary, (kind, name.replace(METERS, RADIANS), help_, told))
        else:
            yield _of(axes, (kind, name, help_, told))


def _of(axes: Mapping[str, AxisStatus], family: Family) -> Metric:
    kind, name, help_, told = family
    metric = kind(f"motorctl_axis_{name}", help_, labels=AXIS)  # type: ignore[call-arg]
    for axis, status in axes.items():
        if (value := told(status.document)) is not None:
            metric.add_metric([axis], value)  # type: ignore[attr-defined]
    return metric


def _families(
    prefix: str, families: Sequence[Family], document: Mapping[str, Any]
) -> Iterator[Metric]:
    for kind, name, help_, told in families:
        family = kind(f"{prefix}_{name}", help_, labels=())  # type: ignore[call-arg]
        if (value := told(document)) is not None:
            family.add_metric([], value)  # type: ignore[attr-defined]
        yield family


def _state_set(
    name: str,
    help_: str,
    states: Sequence[str],
    current: Iterable[tuple[list[str], str | None]],
    labels: Sequence[str] = (),
) -> Metric:
    """Return which of the states is in force, by the values of the labels; None: none of them."""
    family = StateSetMetricFamily(name, help_, labels=labels)
    for values, state in current:
        family.add_metric(values, {each: each == state for each in states})
    return family


def _quantiles(name: str, found: Mapping[str, float] | None) -> Metric:
    """Return percentiles of all ticks of the run, as the status has them: neither sum nor count."""
    family = Metric(
        f"motorctl_loop_{name}_seconds", f"The {name} of the loop's ticks, of the whole run.",
        "summary",
    )  # fmt: skip
    for key, quantile in QUANTILES.items():
        if found is not None:
            family.add_sample(family.name, {"quantile": quantile}, found[key])
    return family
