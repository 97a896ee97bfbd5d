"""The status document: what the daemon tells of itself, the loop and the axes."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.config.machine import Axis, Machine
from motorctl.daemon.axis_faults import faults_of
from motorctl.daemon.config_watch import ConfigWatch
from motorctl.daemon.flight_recorder import LOOP_ENDED, FlightRecorder
from motorctl.daemon.log_keeper import LogKeeper
from motorctl.daemon.model_changes import ModelChanges
from motorctl.daemon.recorder import Recorder
from motorctl.daemon.recording_watch import RecordingWatch
from motorctl.hal import Status
from motorctl.json_values import finite
from motorctl.log.sample import AxisState
from motorctl.loop import LoopMemory, Phase, reasons
from motorctl.loop.compiling_time import compiling_words
from motorctl.loop.faults import device_message
from motorctl.loop.states import State
from motorctl.version import VERSION

_NO_SAMPLES = Status.ENCODER_LOST | Status.COMMUNICATION_LOST
"""With one of them no sample can be trusted, and none is missed: the device is lost."""
_OF_THE_MOMENT = (
    "position_m",
    "velocity_m_s",
    "reference_m",
    "following_error_m",
    "command_v",
    "skew_m",
    "skew_reference_m",
    "skew_command_v",
)
"""What is no longer known of an axis once its loop is gone."""


class Report:
    """Reads everything that `status` tells from where it stands."""

    def __init__(self, machine: Machine, memory: LoopMemory, socket: Path) -> None:
        self.machine = machine
        """What runs; another one once its models have changed."""
        self._config = machine.source.absolute()  # what was begun with, wherever models come from
        self._memory = memory
        self._socket = socket
        self._started_at = time.monotonic()
        self.recorder: Recorder | None = None
        self.recording_watch: RecordingWatch | None = None
        self.flight: FlightRecorder | None = None
        self.keeper: LogKeeper | None = None
        self.config: ConfigWatch | None = None
        self.models: ModelChanges | None = None
        self.stopping = False
        self.loop_ended: str | None = None
        """Why no axis is led any more, where the loop did not end in order."""

    @property
    def uptime_s(self) -> float:
        """How long the daemon runs."""
        return time.monotonic() - self._started_at

    @property
    def preparing(self) -> str | None:
        """What is done before the loop ticks, and how long that takes; None where it has begun."""
        phase, so_far = self._memory.phase, f"{self.uptime_s:.0f} s so far"
        if phase is Phase.STARTING:
            return f"the loop process is starting: it loads its libraries; {so_far}"
        if phase is Phase.COMPILING:
            takes = compiling_words(len(self.machine.axes))
            return (
                f"the control loop is being compiled, once for this configuration ({takes}), or "
                f"taken from the cache; {so_far}"
            )
        return None

    def document(
        self, axes: Sequence[str], motions: Mapping[str, dict[str, Any]]
    ) -> dict[str, Any]:
        """Return the whole status, with these axes and what each of them follows."""
        index = list(self.machine.axes)
        statuses = self._memory.axis_status
        faults = faults_of(self.machine, statuses)
        if self.loop_ended is not None:
            statuses, faults = self._let_go(statuses.copy(), faults, self.loop_ended)
        return {
            "machine": self.machine.name,
            "daemon": self._daemon(),
            "loop": self.loop(),
            "recording": self._recording(),
            "axes": {
                name: self._axis(
                    statuses[index.index(name)],
                    self.machine.axes[name],
                    motions.get(name),
                    faults[name],
                )
                for name in axes
            },
        }

    def _let_go(
        self, statuses: NDArray[np.void], faults: Mapping[str, dict[str, Any] | None], why: str
    ) -> tuple[NDArray[np.void], dict[str, dict[str, Any] | None]]:
        """Return what is true of axes that were led by a loop that is gone: where is not known."""
        led = ~np.isin(statuses["state"], (AxisState.OFF, AxisState.FAULT))
        statuses["state"][led], statuses["inner_state"][led] = AxisState.FAULT, State.FAULT
        statuses["excitation_left"][led] = 0
        for name in _OF_THE_MOMENT:
            statuses[name][led] = np.nan
        told = {
            "cause": LOOP_ENDED,
            "guard": LOOP_ENDED,
            "code": None,
            "message": f"{why}; the journal tells whether its outputs are disabled; it can be "
            "commanded once the daemon is started anew",
        }
        return statuses, {
            name: told if gone else fault
            for (name, fault), gone in zip(faults.items(), led, strict=True)
        }

    def loop(self) -> dict[str, Any]:
        """Return the loop's part, with the timing of the whole run."""
        status = self._memory.status[0]
        timing = self.recorder.timing.result() if self.recorder else {}
        return {
            "phase": self._memory.phase.name.lower(),
            "preparing": self.preparing,
            "pid": int(status["pid"]),
            "rate_hz": self.machine.rate_hz,
            "ticks": int(status["tick"]),
            "time_s": finite(status["time_s"]),
            "overruns": int(status["overruns"]),
            "skipped_periods": int(status["skipped_periods"]),
            "waits": self.machine.loop.waits,
            "degraded": [*reasons(int(status["degraded"])), *self._memory.notes],
            "turnaround": timing.get("turnaround"),
            "lateness": timing.get("lateness"),
        }

    def summary(self) -> str:
        """Return in one line what the machine does."""
        states = ", ".join(
            f"{name} {_state(self._memory, i).name.lower()}"
            for i, name in enumerate(self.machine.axes)
        )
        overruns = int(self._memory.status["overruns"][0])
        return f"{states}; {overruns} overruns"

    def _daemon(self) -> dict[str, Any]:
        return {
            "version": VERSION,
            "pid": os.getpid(),
            "config": str(self._config),
            "config_difference": self.config.difference if self.config else None,
            "socket": str(self._socket),
            "uptime_s": round(self.uptime_s, 3),
            "stopping": self.stopping,
        }

    def _recording(self) -> dict[str, Any]:
        recorder = self.recorder
        seen = self.recording_watch or recorder  # it sees more than the recorder does
        return {
            # whoever reads it may have been started in another folder
            "file": str(recorder.path.absolute()) if recorder else None,
            "rows": recorder.rows_written if recorder else 0,
            "rows_lost": seen.rows_lost if seen else 0,
            "lost_because": recorder.lost_because if recorder else None,
            "failure": seen.failure if seen else None,
            **(self.keeper.status() if self.keeper else {}),
            "flight_records": self._flight_records(),
        }

    def _flight_records(self) -> dict[str, Any] | None:
        flight = self.flight
        if flight is None:
            return None
        return {
            "folder": str(flight.folder.absolute()),
            "newest": flight.newest.stem if flight.newest else None,
            "newest_path": str(flight.newest.absolute()) if flight.newest else None,
            "failure": flight.failure,
        }

    def _trouble(self, axis: Axis, status: np.void) -> str | None:
        """Return what the driver reports now; that a sample is missing, once it is for too long."""
        word = int(status["device_status"])
        if status["held_ticks"] <= self.machine.drivers[axis.driver].late.hold_ticks:
            word &= ~int(Status.STALE | Status.CORRUPT)
        return device_message(word) or None

    def _excitation(self, axis: Axis, status: np.void) -> dict[str, float] | None:
        """Return how long the axis is still excited; None where it is not."""
        left = int(status["excitation_left"])
        return {"left_s": left * self.machine.period_of(axis.name)} if left else None

    def _axis(
        self,
        status: np.void,
        axis: Axis,
        motion: dict[str, Any] | None,
        fault: dict[str, Any] | None,
    ) -> dict[str, Any]:
        state = AxisState(int(status["state"]))
        theta = status["theta_hat"][: len(axis.model)]
        return {
            "state": state.name.lower(),
            "drive_state": State(int(status["inner_state"])).drive.name.lower(),
            "fault": fault,
            "device": self._trouble(axis, status),
            "samples": {
                "missed": int(status["missed_ticks"]),
                "longest_missed": int(status["longest_missed_ticks"]),
                "allowed": self.machine.drivers[axis.driver].late.hold_ticks,
                "lost": bool(int(status["device_status"]) & _NO_SAMPLES),
            },
            "homed": bool(status["homed"]),
            "controller": axis.controller,
            "position_unit": axis.units.position,
            "trial_motions_left": self.models.on_trial(axis.name) if self.models else None,
            "position_m": finite(status["position_m"]),
            "velocity_m_s": finite(status["velocity_m_s"]),
            "reference_m": finite(status["reference_m"]),
            "following_error_m": finite(status["following_error_m"]),
            "command_v": finite(status["command_v"]),
            "travel_m": list(axis.limits.travel_m),
            "max_voltage_v": axis.limits.max_voltage_v,
            "motion": motion if state is AxisState.RUNNING else None,
            "excitation": self._excitation(axis, status),
            "motor_heat": _motor_heat(axis, status),
            **_dual_drive(axis, status),
            "d0_hat_v": finite(status["d0_hat_v"]),
            "theta_hat": dict(zip(axis.model.parameter_names, map(finite, theta), strict=True)),
            "theta_units": _theta_units(axis),
        }


def _theta_units(axis: Axis) -> dict[str, str]:
    """Return the unit of each parameter by its name; empty: a number."""
    units = map(axis.units.words, axis.model.parameter_units)
    return dict(zip(axis.model.parameter_names, units, strict=True))


def _motor_heat(axis: Axis, status: np.void) -> dict[str, float] | None:
    """Return how warm the model of the motor is; None where nobody knows the motor."""
    if axis.guards.thermal is None:
        return None
    continuous_v, heat_v2 = axis.guards.thermal.continuous_voltage_v, float(status["heat_v2"])
    return {
        "rms_command_v": heat_v2**0.5,
        "continuous_voltage_v": continuous_v,
        "load": heat_v2 / continuous_v**2,
    }


def _dual_drive(axis: Axis, status: np.void) -> dict[str, Any]:
    """Return what an axis with two motors tells besides."""
    if axis.dual_drive is None or axis.guards.skew is None:
        return {}
    return {
        "dual_drive": {
            "skew_m": finite(status["skew_m"]),
            "skew_reference_m": finite(status["skew_reference_m"]),
            "skew_command_v": finite(status["skew_command_v"]),
            "skew_limit_m": axis.guards.skew.limit_m,
            "second_device": device_message(int(status["second_device_status"])) or None,
        }
    }


def _state(memory: LoopMemory, index: int) -> AxisState:
    return AxisState(int(memory.axis_status["state"][index]))
