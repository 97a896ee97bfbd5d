"""From a log and a configuration to tuned gains, tried out where the machine can be simulated."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from motorctl.config import Machine, load
from motorctl.config.analysis import LoopGains, LoopMargins
from motorctl.errors import RunError, UsageError
from motorctl.identify.refine.model_text import text_of
from motorctl.identify.refine.refinement import moved_text
from motorctl.identify.refine.yaml_text import YamlText
from motorctl.log import Recording, read_recording
from motorctl.loop.simulation import simulate
from motorctl.tune.candidates import MarginsWanted
from motorctl.tune.choice import Candidate, choose_gains, margins_of
from motorctl.tune.predicted import Prediction, Predictor
from motorctl.tune.recorded_loop import RecordedLoop, recorded_loop
from motorctl.tune.trade_off import TradeOff, trade_off

Progress = Callable[[str, float], None]

NOISE_PER_LIMIT = 0.05
"""Noise of the command at rest that is allowed unless told otherwise, as a part of the axis'
voltage limit. More heats the motor and sounds, less holds gains down that coarse encoders could
bear: the published gains of the shipped gantry make a fifth of it."""
DIGITS = 4
"""Significant digits of the gains that are written. Fewer move the margins, more pretend."""


@dataclass(frozen=True)
class Tuning:
    """Gains before and after, and what they do."""

    loop: RecordedLoop
    wanted: MarginsWanted
    before: LoopGains
    before_margins: LoopMargins
    before_prediction: Prediction
    chosen: Candidate
    margins: LoopMargins
    bound_by: str
    curves: TradeOff
    text: str
    """The configuration with the tuned gains."""
    tried_out: RecordedLoop | None = None
    """A run with them in virtual time; None where it was not tried out."""

    @property
    def gains(self) -> LoopGains:
        """The tuned gains, as they are written."""
        return self.chosen.gains


def tune(
    recording: Recording,
    machine: Machine,
    axis: str,
    out: Path,
    wanted: MarginsWanted,
    progress: Progress,
) -> Tuning:
    """Choose the gains of an axis and return them with the text of the tuned configuration.

    Parameters
    ----------
    recording
        A log of the axis following its program.
    machine
        The configuration that is tuned.
    axis
        Its axis.
    out
        Where the tuned configuration will stand.
    wanted
        The margins; a noise of NaN stands for `NOISE_PER_LIMIT` of the axis' voltage.
    progress
        Told what is being done, and the share of it that is.

    Returns
    -------
    Tuning
        The choice; nothing is written yet.

    Raises
    ------
    UsageError
        The recording is not of this axis and model, or the text cannot be changed in place.
    DataError
        The recording does not tell the loop.
    RunError
        No gains keep what is wanted.
    """
    progress("reading the loop from the log", 0.0)
    loop = recorded_loop(recording, machine, axis)
    if math.isnan(wanted.command_noise_v):
        wanted = replace(wanted, command_noise_v=NOISE_PER_LIMIT * loop.max_voltage_v)
    choice = choose_gains(loop, wanted, progress)
    predictor = Predictor(loop)
    chosen = replace(choice.chosen, gains=_rounded(choice.chosen.gains))
    chosen = replace(chosen, prediction=predictor.predict(chosen.gains))
    return Tuning(
        loop=loop,
        wanted=wanted,
        before=loop.gains,
        before_margins=margins_of(loop.plant, loop.gains, loop.period_s),
        before_prediction=predictor.predict(loop.gains),
        chosen=chosen,
        margins=margins_of(loop.plant, chosen.gains, loop.period_s),
        bound_by=choice.bound_by,
        curves=trade_off(choice.tried, wanted, loop.d_hat_max_v),
        text=_text(machine, axis, chosen.gains, out),
    )


def record_program(machine: Machine, log: Path, progress: Progress) -> Recording:
    """Simulate the machine's programs and return the log.

    Raises UsageError where a driver does not support virtual time, RunError where an axis trips.
    """
    if not machine.followed_programs:
        raise UsageError(
            f"{machine.source}: no axis has a program, so there is no error to lower; name one in "
            "the configuration, or give a log of a motion"
        )
    simulate(machine, log, progress=lambda share: progress("simulating the programs", share))
    return read_recording(log, gaps="keep")


def try_out(tuning: Tuning, config: Path, log: Path, progress: Progress) -> Tuning:
    """Simulate the tuned configuration and return what it did.

    Raises
    ------
    RunError
        Where an axis trips, or the error grew.
    """
    axis = tuning.loop.axis
    machine = load(config)
    done = recorded_loop(record_program(machine, log, progress), machine, axis)
    if done.eF_m > tuning.loop.eF_m:
        raise RunError(
            f"axis {axis}: tried out, the tuned gains have an eF of {done.eF_m * 1e6:.3g} um where "
            f"it was {tuning.loop.eF_m * 1e6:.3g} um, so nothing was written; ask for more margin"
        )
    return replace(tuning, tried_out=done)


def write_checked(tuning: Tuning, out: Path) -> Path:
    """Write the tuned configuration beside where it shall stand, check it, and return the file.

    Raises ConfigError where it is not valid, UsageError where it cannot be written.
    """
    beside = out.with_name(f".{out.stem}.tuning{out.suffix}")
    try:
        beside.write_text(tuning.text, encoding="utf-8", newline="")
    except OSError as error:
        raise UsageError(f"{out}: cannot be written: {error.strerror}") from error
    try:
        load(beside)
    except BaseException:
        beside.unlink()
        raise
    return beside


def _rounded(gains: LoopGains) -> LoopGains:
    return LoopGains(*(float(f"{value:.{DIGITS}g}") for value in vars(gains).values()))


def _text(machine: Machine, axis: str, gains: LoopGains, out: Path) -> str:
    text = YamlText(moved_text(machine, out))
    try:
        for key, value in vars(gains).items():
            text.replace(("axes", axis, "gains", key), text_of(value))
    except KeyError as error:
        raise UsageError(
            f"{machine.source}: axes.{axis}.gains is written so that it cannot be changed in place "
            "(by an alias or a merged key); write its keys out"
        ) from error
    return text.applied()
