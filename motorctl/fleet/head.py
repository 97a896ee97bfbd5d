"""What a log says of itself in its footer, before a row of it is read."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from motorctl.config import Machine, load_resolved
from motorctl.config.chosen_code import allowed_by
from motorctl.errors import ConfigError, DataError
from motorctl.fleet.paths import ends_of, opened
from motorctl.flight.records import METADATA as FLIGHT_RECORD
from motorctl.log.columns import axes_of
from motorctl.log.convert import load_metadata
from motorctl.log.parquet_pieces import ParquetPieces
from motorctl.long_logs.footer import moved_in, times_of
from motorctl.model import known_effects
from motorctl.model.columns import form_key

_END_BYTES = 1 << 16
_FOOTER_END = b"PAR1"
SIMULATED = " (simulated)"
"""What is told behind a machine's name of logs that no machine recorded: they are no days of it."""
COPIES = (FLIGHT_RECORD, "capture")
"""Keys of metadata of logs whose rows another log has, too."""


class ConfigurationError(DataError):
    """A log's configuration cannot be read by who asks so, as without `--allow-code`."""


@dataclass(frozen=True)
class Declared:
    """Which model is meant, as workers elsewhere can read it."""

    model: str | None = None
    """None: what each log declares; C1, C2; else what messages call the configuration."""
    resolved: Mapping[str, Any] | None = None
    """The plain data of that configuration."""
    allow_code: tuple[str, ...] = ()

    def machine(self, config: Mapping[str, Any], source: str) -> Machine:
        """Return the machine that a log should be of. Raises DataError."""
        own = self.resolved is None
        plain = config if self.resolved is None else self.resolved
        try:
            return load_resolved(
                plain, source if own else self.model or source, may_run=allowed_by(self.allow_code)
            )
        except ConfigError as error:
            raise ConfigurationError(
                f"{source}: its configuration cannot be read:\n{error}"
            ) from error


@dataclass(frozen=True)
class LogHead:
    """A log, known by its footer."""

    source: str
    log_id: str
    """Of its content, whatever its name, place and age."""
    model_id: str
    """Of what is fitted to it."""
    limits_id: str
    """Of what it is held against to tell whether it is of the machine: encoder, travel, voltage."""
    machine: str
    """As it says; of one that was simulated in virtual time with `SIMULATED` behind."""
    host: str
    """The computer that recorded it."""
    run: str | None
    part: int | None
    begin_utc: datetime
    end_utc: datetime
    first_s: float
    """Time of its first row in the log's own count."""
    copied: bool
    """Whether its rows are those of another log: a flight record, or what a scope caught."""
    virtual: bool
    """Whether it was simulated in virtual time, which no clock of the day measured."""
    rate_hz: float
    group_rows: tuple[int, ...]
    moved: Mapping[str, tuple[bool, ...]]
    """Of each axis in which row groups its position changed."""
    programs: Mapping[str, str]
    """What each axis was to follow; empty where nothing."""

    @property
    def rows(self) -> int:
        """Of the whole log."""
        return sum(self.group_rows)


def read_head(source: str, declared: Declared) -> LogHead:
    """Read a log's footer.

    Parameters
    ----------
    source
        Where it is.
    declared
        Which model is meant.

    Raises
    ------
    DataError
        Where it is damaged, not of motorctl, empty, or of more than one recording.
    """
    with opened(source) as file:
        told = load_metadata(file.schema)
        config = told.get("config")
        machine, began = told.get("machine"), told.get("started_utc")
        if not isinstance(machine, str) or not isinstance(config, Mapping):
            raise DataError(
                f"{source}: does not say which machine it is of: a fleet has logs of motorctl; "
                "`motorctl diagnose` reads other recordings"
            )
        begin_utc = _moment(source, began)
        names = file.schema.names
        axes = axes_of(names)
        if not sum(file.group_rows) or not axes or "time_s" not in names:
            raise DataError(f"{source}: has no rows of an axis")
        pieces = ParquetPieces(source, file)
        begins_s, ends_s = times_of(source, pieces)
        first_s, last_s = float(begins_s[0]), float(ends_s[-1])
        moved = {axis: moved_in(pieces, axis) for axis in axes}
        group_rows = file.group_rows
    meant = declared.machine(config, source)
    described = config.get("axes")
    own = described if isinstance(described, Mapping) else {}
    rate = told.get("rate_hz") or config.get("rate_hz")
    host, run, part = told.get("host"), told.get("run"), told.get("part")
    virtual = "virtual_time" in told
    return LogHead(
        source=source,
        log_id=identity_of(source),
        model_id=_model_id(meant, declared),
        limits_id=_limits_id(meant),
        machine=machine + SIMULATED if virtual else machine,
        host=str(host.get("name", "")) if isinstance(host, Mapping) else "",
        run=run if isinstance(run, str) else None,
        part=part if isinstance(part, int) else None,
        begin_utc=begin_utc,
        end_utc=begin_utc + timedelta(seconds=last_s - first_s),
        first_s=first_s,
        copied=any(key in told for key in COPIES),
        virtual=virtual,
        rate_hz=float(rate) if isinstance(rate, int | float) and rate > 0 else 0.0,
        group_rows=group_rows,
        moved=moved,
        programs={axis: _program(own.get(axis)) for axis in axes},
    )


def damaged_id(source: str) -> str:
    """Return the identity of a file that is no log. Raises DataError where it is not there.

    Where it has a footer it is that of a log: should it be used later, it is known for the same.
    """
    size, begin, end = ends_of(source, _END_BYTES)
    if end.endswith(_FOOTER_END) and int.from_bytes(end[-8:-4], "little") + 8 <= size:
        return identity_of(source)
    return hashlib.sha256(b"damaged %d " % size + begin + end).hexdigest()


def identity_of(source: str) -> str:
    """Hash size and footer: it has the sizes and extremes of every column of every row group.

    Raises DataError where the file is not there, or is not to be read.
    """
    size, _, end = ends_of(source, _END_BYTES)
    length = int.from_bytes(end[-8:-4], "little") + 8
    if length > len(end):
        end = ends_of(source, length)[2]
    return hashlib.sha256(b"%d " % size + end[-length:]).hexdigest()


def _model_id(machine: Machine, declared: Declared) -> str:
    """Hash what answers depend on: declared effects, the inertia's bounds, and what is tried."""
    axes = {
        name: {
            "effects": [form_key(effect) for effect in axis.declared.effects],
            "mass_bounds": [
                [axis.estimates[place].lower, axis.estimates[place].upper]
                for place in (axis.model.index_of("acceleration"),)
                if place is not None
            ],
        }
        for name, axis in machine.axes.items()
    }
    tried = sorted({*known_effects(), *machine.further_effects})
    controller = declared.model if declared.resolved is None else None
    text = json.dumps([controller, axes, tried], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _limits_id(machine: Machine) -> str:
    """Hash what a log can be refused by, beside what is fitted."""
    axes = {
        name: [axis.encoder.resolution_m, *axis.limits.travel_m, axis.limits.max_voltage_v]
        for name, axis in machine.axes.items()
    }
    return hashlib.sha256(json.dumps(axes, sort_keys=True).encode()).hexdigest()


def _program(axis: object) -> str:
    return str(axis.get("program") or "") if isinstance(axis, Mapping) else ""


def _moment(source: str, began: object) -> datetime:
    try:
        moment = datetime.fromisoformat(str(began))
    except ValueError as error:
        raise DataError(
            f"{source}: its metadata `started_utc` is {began!r}, not a date and time: when it was "
            "recorded is not known"
        ) from error
    return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
