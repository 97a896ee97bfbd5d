"""The amplifier's current follows its command with a first-order lag."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pydantic import Field

from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.grids import log_step
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.latency import PER_DECADE, longer_trial_times, trial_times
from motorctl.model.parameter import Parameter


class InputLagOptions(EffectOptions):
    """How slow the amplifier is."""

    time_s: float = Field(gt=0, le=10.0, description="time constant of the lag")


class InputLag(Effect):
    """What acts is the command behind 1/(1 + tau s)."""

    name = "input_lag"
    kind = "command"
    title = "Lag of the amplifier"
    formula = "tau di/dt = u - i, with i in the place of u"
    compensated = "lead of the model's command by tau"
    identified = "its time tau by a scan, its gain tied to the command's"
    visible_in = (
        "high jerk: fast starts and stops of large acceleration; only commands that change "
        "within tau tell it from a delay"
    )
    groups = frozenset({"command_timing"})
    revealed_by = ("fast_reversals",)
    Options = InputLagOptions
    options: InputLagOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """None: the time is an option."""
        return ()

    @property
    def lag_s(self) -> float:
        """tau."""
        return self.options.time_s

    @property
    def picture(self) -> Picture:
        """Response from the given command to the acting one."""
        return Picture(
            "command_response",
            "Gain and phase from the command that was given to the one that the motion shows.",
        )

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return times from a fraction of a sample to tens of them."""
        return [cls(InputLagOptions(time_s=time)) for time in trial_times(spans)]

    @classmethod
    def trials_beyond(cls, spans: Spans) -> Sequence[Effect]:
        """Return what slow filters take."""
        return [cls(InputLagOptions(time_s=time)) for time in longer_trial_times(spans)]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine the time."""
        return {"time_s": log_step(self.options.time_s, PER_DECADE)}
