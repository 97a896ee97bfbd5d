"""Ask before a motion of a machine, with how much of each limit it uses and how long it takes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from pydantic import Field, TypeAdapter, ValidationError
from rich.table import Table

from motorctl.cli.asking import insist_on_yes
from motorctl.cli.terminal import Terminal
from motorctl.close_loop.machine_rig import AskedMotion
from motorctl.config.experiment_envelope import beyond_envelope
from motorctl.config.machine import Axis, Machine
from motorctl.errors import UsageError
from motorctl.motion import Peaks

_Minutes = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class Consents:
    """Asks a person before each motion, or holds it against the envelopes of the configuration.

    Parameters
    ----------
    yes
        Nobody is asked: every axis that moves is simulated, or has not tripped and stays within
        its envelope.
    kept
        Where it is noted how many minutes each axis has been moved for; None: nowhere.
    resume
        Whether those that are noted there count on.
    """

    def __init__(self, *, yes: bool, kept: Path | None = None, resume: bool = False) -> None:
        self._yes = yes
        self._kept = kept
        self._minutes: dict[str, float] = {}
        self.questions = 0
        """How often a person was asked."""
        if resume and kept and kept.is_file():
            self._minutes = _read(kept)

    @property
    def minutes(self) -> dict[str, float]:
        """How long each axis has been moved for, an earlier run that is gone on with included."""
        return dict(self._minutes)

    def ask(self, machine: Machine, motion: AskedMotion) -> None:
        """Return once the motion is agreed to.

        Raises
        ------
        UsageError
            Where it is not: by a person, or because it is beyond an envelope or an axis tripped.
        """
        moved = {
            name: trajectory.peaks()
            for plan in motion.plans.values()
            for name, trajectory in plan.trajectories.items()
        }
        for name in moved:
            self._minutes[name] = self._minutes.get(name, 0.0) + motion.duration_s / 60.0
        self._show(machine, motion, moved)
        if self._yes:
            self._hold_against_envelopes(machine, motion, moved)
            self._note()
            return
        self.questions += 1
        insist_on_yes(
            "Run it?",
            nobody="nobody is there to say yes to this motion: run this in a terminal; or with "
            "--yes, where axes.NAME.experiments in the configuration allows it",
            refused="nothing was moved: nobody said yes",
        )
        self._note()

    def _note(self) -> None:
        if self._kept is None:
            return
        draft = self._kept.with_name(f"{self._kept.name}.tmp")
        try:
            self._kept.parent.mkdir(parents=True, exist_ok=True)
            draft.write_text(json.dumps(self._minutes))
            draft.replace(self._kept)  # whoever is killed meanwhile leaves the old one
        except OSError as error:
            raise UsageError(f"{self._kept}: cannot be written: {error.strerror}") from error

    def _hold_against_envelopes(
        self, machine: Machine, motion: AskedMotion, moved: dict[str, Peaks]
    ) -> None:
        for name, peaks in moved.items():
            axis = machine.axes[name]
            if machine.drivers[axis.driver].cls.simulated:
                continue
            if name in motion.tripped:
                raise UsageError(
                    f"axis {name} tripped: {motion.tripped[name]}. --yes resets no axis: look at "
                    f"the machine, `motorctl reset {name}`, then go on with --resume"
                )
            beyond = list(beyond_envelope(axis, peaks, self._minutes[name]))
            if beyond:
                told = axis.units.words("; ".join(beyond))
                raise UsageError(f"axis {name}: --yes does not do, a person has to say yes: {told}")

    def _show(self, machine: Machine, motion: AskedMotion, moved: dict[str, Peaks]) -> None:
        table = Table(
            title=f"next motion: {', '.join(motion.plans)}, {motion.duration_s:.0f} s",
            title_justify="left",
        )
        for heading in ("axis", "from", "to", "speed", "of limit", "acceleration", "of limit"):
            table.add_column(heading, justify="left" if heading == "axis" else "right")
        for name, peaks in moved.items():
            table.add_row(*_row(machine.axes[name], peaks))
        console = Terminal(stderr=True)
        console.print(table)
        for name, why in motion.tripped.items():
            if name not in moved:
                continue
            told = f"  axis {name} tripped and is reset before: {why}"
            console.print(told, markup=False, highlight=False)
        if motion.other_models:
            names = ", ".join(motion.other_models)
            told = f"  axis {names}: with other models than ran when this began"
            console.print(told, markup=False, highlight=False)


def _read(kept: Path) -> dict[str, float]:
    """Return the minutes that were noted; what cannot be read allows nothing."""
    try:
        return TypeAdapter(dict[str, _Minutes]).validate_json(kept.read_bytes())
    except (ValidationError, OSError) as error:
        raise UsageError(
            f"{kept}: is damaged: it should tell how many minutes each axis has been moved for, as "
            '{"x": 1.5}; write it anew, or leave --resume out and begin anew'
        ) from error


def _row(axis: Axis, peaks: Peaks) -> tuple[str, ...]:
    limits, words = axis.limits, axis.units.words
    return (
        axis.name,
        words(f"{peaks.range_m[0]:.4g} m"),
        words(f"{peaks.range_m[1]:.4g} m"),
        words(f"{peaks.max_velocity_m_s:.3g} m/s"),
        f"{peaks.max_velocity_m_s / limits.max_velocity_m_s:.0%}",
        words(f"{peaks.max_acceleration_m_s2:.3g} m/s^2"),
        f"{peaks.max_acceleration_m_s2 / limits.max_acceleration_m_s2:.0%}",
    )
