"""The keys of a configuration file, as frozen pydantic models: these models are the machine.

A model knows names, types, units, defaults and what a single number may be; its descriptions go
into the JSON schema, into messages and into the records of the loop. What several numbers must be
to each other stands in `rules`. The keys of an axis stand in `axis_keys`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

AxisName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=32)]
Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.\-]*$", max_length=64)]
# No machine has numbers beyond these; within them the rules' arithmetic cannot overflow.
SMALLEST = 1e-12
Number = Annotated[float, Field(ge=-1e9, le=1e9)]
Positive = Annotated[float, Field(ge=SMALLEST, le=1e9)]
NotNegative = Annotated[float, Field(ge=0, le=1e9)]
Rate = Annotated[float, Field(gt=0, le=1e5)]
Range = tuple[Number, Number]
WAITING_PATIENCE_S = 5.0
"""How long at least the loop goes on without a sign of life from the supervisor [s], for a
simulated machine that waits for a busy computer: nothing of it can be damaged. Shorter stops it
while the computer is only busy, longer leaves a loop without a supervisor running. By hand."""


class Keys(BaseModel):
    """Base: unknown keys are errors, text is no number, every number is finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    def flat(self) -> dict[str, Any]:
        """Return the values by key; keys of a part have its name before them: ``stop_jerk_m_s3``.

        The compiled records have fields of these names, and are filled by them.
        """
        return dict(self._flattened(""))

    def _flattened(self, prefix: str) -> Iterator[tuple[str, Any]]:
        for key, value in self:
            if isinstance(value, Keys):
                yield from value._flattened(f"{prefix}{key}_")
            else:
                yield prefix + key, value


class OpenKeys(Keys):
    """A part whose further keys belong to a driver, an effect or a kind of program."""

    model_config = ConfigDict(extra="allow")

    @property
    def options(self) -> dict[str, Any]:
        """The further keys."""
        return dict(self.model_extra or {})


class LateSamples(Keys):
    """What happens where a tick finds no new sample of the device."""

    hold_ticks: Annotated[int, Field(ge=0, le=100_000)] = Field(
        default=3, description="so many of its ticks pass before its axes trip"
    )
    predict: bool = Field(
        default=False,
        description="meanwhile the model moves the position on, and one sample that no motion "
        "explains is left out; else position and command are held",
    )


class DriverKeys(OpenKeys):
    """A device; every key but these is an option of its driver."""

    type: str = Field(description="name of an installed driver, or package.module:Class")
    rate_hz: Rate | None = Field(
        default=None,
        description="exchanges a second, and ticks of its axes: the loop's rate or a whole part",
    )
    late: LateSamples = Field(
        default_factory=LateSamples, description="what happens in ticks without a new sample"
    )


class ProgramKeys(OpenKeys):
    """A motion; the further keys depend on its kind."""

    kind: str = Field(description="which motion: point_to_point, back_and_forth, circle, ...")


class LoopSettings(Keys):
    """How the loop process asks for real time, and what happens where it is not given."""

    cpu: Annotated[int, Field(ge=0, le=4095)] | None = Field(
        default=None, description="null: the highest isolated CPU, if there is one"
    )
    priority: Annotated[int, Field(ge=1, le=99)] = Field(default=80, description="SCHED_FIFO")
    spin_s: Annotated[float, Field(ge=0, le=0.01)] = Field(
        default=60e-6, description="the last part of a wait, spent awake"
    )
    without_realtime: Literal["degrade", "refuse", "wait"] = Field(
        default="degrade",
        description="where real time is not given: run and say what is missing; or do not start; "
        "or, for simulated machines, let their time wait while the computer pauses",
    )
    overrun_policy: Literal["count", "leaky_bucket", "stop"] = Field(
        default="count",
        description="count overruns; stop the machine at bucket_size of them in a leaky bucket; "
        "or stop it at the first",
    )
    bucket_size: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        default=10, description="overruns in a leaky bucket that stop the machine"
    )
    supervisor_timeout_s: Annotated[float, Field(ge=0.1, le=10)] = Field(
        default=0.5,
        description="so long without a sign of life from the supervisor, and every axis is "
        "stopped; longer only where the computer starves programs, as an emulated one does",
    )

    @property
    def waits(self) -> bool:
        """Whether the machine's time stands still while the computer pauses."""
        return self.without_realtime == "wait"

    @property
    def patience_s(self) -> float:
        """How long the loop goes on without a sign of life from the supervisor [s]."""
        return max(self.supervisor_timeout_s, WAITING_PATIENCE_S if self.waits else 0.0)
