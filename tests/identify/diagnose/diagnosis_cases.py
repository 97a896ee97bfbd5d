"""Recordings of machines with known causes in them, and what the diagnosis says of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from motorctl.identify.diagnose.recording import diagnose_recording
from motorctl.identify.fit.declared_models import declared_models
from motorctl.log import Recording, read_recording
from motorctl_benchmarks.diagnosis.cases import Case
from motorctl_benchmarks.diagnosis.motions import START_GRID_M
from motorctl_benchmarks.diagnosis.record import record_case

DURATION_S = 10.0


def recorded(case: Case, folder: Path, duration_s: float = DURATION_S) -> Recording:
    """Simulate a case and read its log."""
    return read_recording(record_case(case, folder, duration_s=duration_s), gaps="keep")


def diagnosed(case: Case, folder: Path, duration_s: float = DURATION_S):
    """Simulate a case and diagnose the axis under test."""
    recording = recorded(case, folder, duration_s)
    models = declared_models(recording, None, case.axis)
    return diagnose_recording(recording, models).axes[case.axis]


def names(diagnosis) -> list[str]:
    """Return the effects that a diagnosis names."""
    return [effect.name for effect in diagnosis.effects]


def travel(case: Case) -> tuple[float, float]:
    """Return the travel of the axis under test."""
    low, high = case.config["axes"][case.axis]["limits"]["travel_m"]
    return low, high


def moving(case: Case, start: float, moves: list[tuple[float, float, float, float]]) -> Case:
    """Let the axis under test follow other moves: target, velocity, acceleration, dwell.

    Start and targets are shares of the travel.
    """
    low, high = travel(case)

    def place(share: float) -> float:
        return round((low + share * (high - low)) / START_GRID_M) * START_GRID_M

    program = {
        "kind": "moves",
        "axis": case.axis,
        "start_m": place(start),
        "moves": [
            {
                "target_m": place(target),
                "max_velocity_m_s": velocity,
                "max_acceleration_m_s2": acceleration,
                "max_jerk_m_s3": acceleration / 0.02,
                "dwell_s": dwell,
            }
            for target, velocity, acceleration, dwell in moves
        ],
    }
    config = case.config
    driver = config["axes"][case.axis]["driver"]
    channel = str(config["axes"][case.axis]["channel"])
    sim = config["drivers"][driver]
    plant = sim["plants"][channel] | {"initial_position_m": program["start_m"]}
    sim = sim | {"plants": sim["plants"] | {channel: plant}}
    programs = config["programs"] | {f"motion_{case.axis}": program}
    changed = config | {"drivers": config["drivers"] | {driver: sim}, "programs": programs}
    return replace(case, config=changed)


def undecided_between(diagnosis, one: str, other: str) -> bool:
    """Tell whether a diagnosis says that it cannot tell the two apart, or names neither."""
    if diagnosis.verdict == "insufficient_data":
        return True
    for effect in diagnosis.effects:
        rival = {one: other, other: one}.get(effect.name)
        if rival is not None and rival not in effect.indistinguishable_from:
            return False
    return True
