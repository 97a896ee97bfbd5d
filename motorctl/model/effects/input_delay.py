"""Time between a command and its effect: computation, bus, amplifier."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pydantic import Field

from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.grids import log_step
from motorctl.model.knowledge import Picture, Spans
from motorctl.model.latency import PER_DECADE, longer_trial_times, trial_times
from motorctl.model.parameter import Parameter


class InputDelayOptions(EffectOptions):
    """How late a command acts."""

    time_s: float = Field(gt=0, le=10.0, description="pure delay; any part of a period")


class InputDelay(Effect):
    """What acts at t is the command of t - T."""

    name = "input_delay"
    kind = "command"
    title = "Delay of the command"
    formula = "u(t - T) in the place of u(t)"
    compensated = "the model's command is given T ahead"
    identified = "its time T by a scan, its gain tied to the command's"
    visible_in = (
        "high jerk: fast starts and stops of large acceleration; only commands that change "
        "within T tell it from a lag"
    )
    groups = frozenset({"command_timing"})
    revealed_by = ("fast_reversals",)
    Options = InputDelayOptions
    options: InputDelayOptions

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """None: the time is an option."""
        return ()

    @property
    def delay_s(self) -> float:
        """T."""
        return self.options.time_s

    @property
    def picture(self) -> Picture:
        """Response from the given command to the acting one."""
        return Picture(
            "command_response",
            "Gain and phase from the command that was given to the one that the motion shows.",
        )

    @classmethod
    def delaying(cls, delay_s: float) -> Effect | None:
        """Return this delay."""
        return cls(InputDelayOptions(time_s=delay_s))

    @classmethod
    def trials(cls, spans: Spans) -> Sequence[Effect]:
        """Return times from a fraction of a sample to tens of them."""
        return [cls(InputDelayOptions(time_s=time)) for time in trial_times(spans)]

    @classmethod
    def trials_beyond(cls, spans: Spans) -> Sequence[Effect]:
        """Return what slow links take."""
        return [cls(InputDelayOptions(time_s=time)) for time in longer_trial_times(spans)]

    def steps(self, spans: Spans) -> Mapping[str, float]:
        """Refine the time."""
        return {"time_s": log_step(self.options.time_s, PER_DECADE)}
