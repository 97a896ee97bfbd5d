"""From a log and a configuration to tuned gains, tried out where the machine can be simulated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from motorctl.config import Machine, load
from motorctl.config.analysis import LoopGains, LoopMargins
from motorctl.config.axis_keys import CommandFilterKeys
from motorctl.config.loop_rules import filter_of
from motorctl.errors import RunError, UsageError
from motorctl.identify.refine.model_text import text_of
from motorctl.identify.refine.refinement import meaning_of, moved_text
from motorctl.identify.refine.written_beside import written_beside
from motorctl.identify.refine.yaml_text import Item, YamlText, flow
from motorctl.log import Recording, read_recording
from motorctl.loop.simulation import simulate
from motorctl.loop.virtual import require_virtual_time
from motorctl.response.measurement import Measurement
from motorctl.tune.candidates import MarginsWanted
from motorctl.tune.choice import Candidate, choose_gains, keeps, margins_of
from motorctl.tune.predicted import Prediction, Predictor
from motorctl.tune.recorded_loop import RecordedLoop, recorded_loop
from motorctl.tune.same_loop import require_nothing_learned
from motorctl.tune.trade_off import TradeOff, trade_off

Progress = Callable[[str, float], None]

NOISE_PER_LIMIT = 0.05
"""Noise of the command at rest that is allowed unless told otherwise, as a part of the axis'
voltage limit. More heats the motor and sounds, less holds gains down that coarse encoders could
bear: the published gains of the shipped gantry make a fifth of it."""
SLIGHTLY = 0.999
"""Factor on gains that only try whether the text can be changed. Nearer to 1 is lost in the digits
that are written, further from it may be no valid configuration."""
GAIN_KEYS = ("k1_1_s", "ks_v_s_m", "gamma_d")
"""Keys of `gains` that are chosen."""


@dataclass(frozen=True)
class Tuning:
    """Gains before and after, and what they do."""

    loop: RecordedLoop
    wanted: MarginsWanted
    before_margins: LoopMargins
    before_prediction: Prediction
    """Of the gains of the log: its error in the band that is predicted."""
    chosen: Candidate
    margins: LoopMargins
    bound_by: str
    curves: TradeOff
    without_filter: Candidate | None = None
    """The best without a command filter, where one was chosen."""
    filters_tried: int = 0
    tried_out: RecordedLoop | None = None
    """A run with them in virtual time; None where it was not tried out."""

    @property
    def error_for_margin(self) -> bool:
        """Whether the gains of the log do not keep what is wanted: that may cost error."""
        return not keeps(self.before_margins, self.wanted)

    @property
    def before(self) -> LoopGains:
        """The gains of the log."""
        return self.loop.gains

    @property
    def gains(self) -> LoopGains:
        """The tuned gains, as they are written."""
        return self.chosen.gains


def require_tunable(machine: Machine, axis: str, out: Path, *, hardware: bool = True) -> None:
    """Insist that the axis is there, and that its gains alone can be changed in the text.

    Raises UsageError, before anything takes time.
    """
    if axis not in machine.axes:
        known = ", ".join(machine.axes)
        raise UsageError(f"{machine.source}: no axis '{axis}'; it has: {known}")
    gains = machine.axes[axis].gains
    # As they would be written: digits that the text has no room for would be another value.
    k1, ks, gamma_d = (float(text_of(SLIGHTLY * getattr(gains, key))) for key in GAIN_KEYS)
    other = LoopGains(k1, ks, gamma_d, filter_of(gains, machine.period_of(axis)))
    write_beside(machine, axis, other, out, hardware=hardware).unlink()


def tune(
    recording: Recording,
    machine: Machine,
    axis: str,
    wanted: MarginsWanted,
    progress: Progress,
    response: Measurement | None = None,
) -> Tuning:
    """Choose the gains of an axis.

    Parameters
    ----------
    recording
        A log of the axis following its program.
    machine
        The configuration that is tuned.
    axis
        Its axis.
    wanted
        The margins; without a noise, `NOISE_PER_LIMIT` of the axis' voltage.
    progress
        Told what is being done, and the share of it that is.
    response
        The axis' measured response: margins are those around it.

    Returns
    -------
    Tuning
        The choice; nothing is written.

    Raises
    ------
    UsageError
        The recording is not of this axis and loop.
    DataError
        The recording does not tell the loop.
    RunError
        No gains keep what is wanted.
    """
    progress("reading the loop from the log", 0.0)
    if axis in recording.axes:
        require_nothing_learned(recording, axis)
    loop = recorded_loop(recording, machine, axis, response=response)
    if wanted.command_noise_v is None:
        wanted = replace(wanted, command_noise_v=NOISE_PER_LIMIT * loop.max_voltage_v)
    choice = choose_gains(loop, wanted, progress)
    return Tuning(
        loop=loop,
        wanted=wanted,
        before_margins=margins_of(loop, loop.gains),
        before_prediction=Predictor(loop).predict(loop.gains),
        chosen=choice.chosen,
        margins=choice.margins,
        bound_by=choice.bound_by,
        curves=trade_off(choice.tried, wanted, loop.d_hat_max_v),
        without_filter=choice.without_filter,
        filters_tried=choice.filters_tried,
    )


def record_program(machine: Machine, axis: str, log: Path, progress: Progress) -> Recording:
    """Simulate the machine's programs and return the log.

    Raises UsageError where the axis has no program or a driver no virtual time, RunError where an
    axis trips.
    """
    if machine.axes[axis].program is None:
        raise UsageError(
            f"{machine.source}: axis {axis} has no program, so there is no error to lower; name "
            "one in the configuration, or give a log of a motion with --recording"
        )
    try:
        require_virtual_time(machine)
    except UsageError as error:
        raise UsageError(
            f"{error}: give a log of the axis following its program with --recording"
        ) from error
    simulate(machine, log, progress=lambda share: progress("simulating the programs", share))
    return replace(read_recording(log, gaps="keep"), source="a simulated run")


def write_beside(
    machine: Machine, axis: str, gains: LoopGains, out: Path, *, hardware: bool = True
) -> Path:
    """Write the tuned configuration beside where it shall stand, and return the file.

    It is loaded, and means what the old one did but for the axis' gains. Raises ConfigError where
    it is not valid, UsageError where it cannot be written or means anything else.
    """
    beside = written_beside(out, _text(machine, axis, gains, out))
    try:
        _require_intended(machine, axis, gains, load(beside, hardware=hardware))
    except BaseException:
        beside.unlink()
        raise
    return beside


def try_out(tuning: Tuning, config: Path, log: Path, progress: Progress) -> Tuning:
    """Simulate the tuned configuration and return what it did.

    Raises
    ------
    RunError
        Where an axis trips, or the error grew though the gains before kept the margins, too.
    """
    axis = tuning.loop.axis
    machine = load(config)
    done = recorded_loop(record_program(machine, axis, log, progress), machine, axis)
    words = tuning.loop.units.words
    if done.eF_m > tuning.loop.eF_m and not tuning.error_for_margin:
        raise RunError(
            f"axis {axis}: tried out, the tuned gains have an eF of "
            f"{words(f'{done.eF_m * 1e6:.3g} µm')} where it was "
            f"{words(f'{tuning.loop.eF_m * 1e6:.3g} µm')}, so nothing was written; ask for more "
            "margin"
        )
    return replace(tuning, tried_out=done)


def _text(machine: Machine, axis: str, gains: LoopGains, out: Path) -> str:
    text = YamlText(moved_text(machine, out))
    try:
        for key in GAIN_KEYS:
            text.replace(("axes", axis, "gains", key), text_of(getattr(gains, key)))
        _write_filter(text, ("axes", axis, "gains"), gains)
    except KeyError as error:
        raise _not_in_place(machine, axis) from error
    return text.applied()


def _write_filter(text: YamlText, place: tuple[str, ...], gains: LoopGains) -> None:
    """Write the filter behind its key, or a new key; raises KeyError where that is not possible.

    In a block of keys each that stays is changed where it stands, beside its comment.
    """
    keys, key = filter_keys(gains) or {}, (*place, "command_filter")
    items = [Item(name, value) for name, value in keys.items()]
    words = flow(items) if items else "null"
    written = text.keys_of_block(key)
    if written and written <= keys.keys():
        for name in written:
            text.replace((*key, name), keys[name])
        if new := [item for item in items if item.key not in written]:
            text.append(key, new)
    elif written:
        text.replace_mapping(key, words)
    elif text.has(key):
        text.replace(key, words)
    elif keys:
        text.append(place, [Item("command_filter", words)])


def filter_keys(gains: LoopGains) -> dict[str, str] | None:
    """Return a filter as the configuration has it, its values as they are written; None: none."""
    own = gains.command_filter
    if own is None:
        return None
    numbers = {"frequency_hz": own.frequency_hz, "damping": own.damping}
    if own.kind == "notch":
        numbers["depth"] = own.depth
    return {"kind": own.kind} | {key: text_of(value) for key, value in numbers.items()}


def _require_intended(machine: Machine, axis: str, gains: LoopGains, after: Machine) -> None:
    """Raise UsageError where the new text means anything else than the old one with these gains."""
    meant = meaning_of(machine)
    meant["axes"][axis]["gains"] |= {key: getattr(gains, key) for key in GAIN_KEYS}
    own = filter_keys(gains)
    if own is not None:
        numbers = {key: float(value) for key, value in own.items() if key != "kind"}
        keys = CommandFilterKeys.model_validate({"kind": own["kind"], **numbers})
        meant["axes"][axis]["gains"]["command_filter"] = keys.model_dump(mode="json")
    else:
        meant["axes"][axis]["gains"]["command_filter"] = None
    if meaning_of(after) != meant:
        raise _not_in_place(machine, axis)


def _not_in_place(machine: Machine, axis: str) -> UsageError:
    return UsageError(
        f"{machine.source}: axes.{axis}.gains is written in a way that cannot be changed in place; "
        "write it out without anchors, aliases and merged keys"
    )
