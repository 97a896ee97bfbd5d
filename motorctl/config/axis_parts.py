"""One axis while it is being checked: whatever of it could be read, so that all can be told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from motorctl.config.analysis import required_command, smallest_slope
from motorctl.config.axis_model import AxisModel, build_model
from motorctl.config.document import Document, KeyPath
from motorctl.config.hardware import Wiring
from motorctl.config.loop_rules import check_monotonicity, check_stability
from motorctl.config.machine import Estimate, Gains
from motorctl.config.rules import (
    check_adaptation,
    check_encoder,
    check_gains,
    check_homing,
    check_limits,
    check_other_axes,
    check_range,
    check_timing,
)
from motorctl.config.shape import (
    AdaptationShape,
    EncoderShape,
    GainsShape,
    HomingShape,
    LimitsShape,
    Shape,
)
from motorctl.config.validation import validate
from motorctl.model import EffectList
from motorctl.motion import AxisLimits, RequiredVoltage

S = TypeVar("S", bound=Shape)


@dataclass(frozen=True)
class AxisParts:
    """The parts of an axis; None where a part is missing or wrong."""

    name: str
    encoder: EncoderShape | None
    limits: LimitsShape | None
    gains: Gains | None
    adaptation: AdaptationShape | None
    homing: HomingShape | None
    declared: AxisModel | None
    model: EffectList | None
    """What the axis runs."""

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """The estimates of `model`."""
        if self.declared is None or self.model is None:
            return ()
        return self.declared.estimates_of(self.model)

    def motion_limits(self) -> AxisLimits | None:
        """Give what a program may ask of the axis."""
        limits = self.limits
        if limits is None or not limits.travel_m[0] < limits.travel_m[1]:
            return None
        return AxisLimits(
            limits.travel_m,
            limits.max_velocity_m_s,
            limits.max_acceleration_m_s2,
            limits.max_jerk_m_s3,
            limits.max_voltage_v,
        )

    def required_voltage(self) -> RequiredVoltage | None:
        """Give the command that motion needs at theta_hat(0), where its map can be inverted."""
        if self.model is None or self.limits is None:
            return None
        theta = np.array([estimate.initial for estimate in self.estimates])
        u_max = self.limits.max_voltage_v
        if not smallest_slope(self.model, theta, u_max, self.limits.travel_m)[0] > 0.0:
            return None
        return required_command(self.model, theta, u_max)

    def wiring(self, document: Document) -> Wiring | None:
        """Give what the axis says of its channel."""
        driver = document.at(("axes", self.name, "driver"))
        channel = document.at(("axes", self.name, "channel"))
        if self.encoder is None or self.limits is None:
            return None
        if not isinstance(driver, str) or not isinstance(channel, int):
            return None
        return Wiring(
            self.name,
            driver,
            channel,
            self.encoder.resolution_m,
            self.encoder.counter_bits,
            self.limits.max_voltage_v,
        )


def read_axis(document: Document, name: str) -> AxisParts:
    """Read what can be read of an axis; problems of its effects are noted."""
    path: KeyPath = ("axes", name)

    def part(key: str, shape: type[S]) -> S | None:
        return validate(document, (*path, key), shape, document.at((*path, key)), quiet=True)

    gains = part("gains", GainsShape)
    declared = build_model(document, (*path, "model"))
    axis = document.at(path)
    model = None
    if declared and isinstance(axis, dict):
        controller = axis.get("controller", "C2")
        model = declared.declared
        if controller != "C2":
            model = model.without_electromagnetic() if controller == "C1" else None
    return AxisParts(
        name,
        part("encoder", EncoderShape),
        part("limits", LimitsShape),
        None if gains is None else Gains(**gains.model_dump()),
        part("adaptation", AdaptationShape)
        if isinstance(axis, dict) and "adaptation" in axis
        else AdaptationShape(),
        part("homing", HomingShape),
        declared,
        model,
    )


def check_axis(document: Document, parts: AxisParts, rate_hz: float | None) -> None:
    """Apply every rule whose parts could be read."""
    path: KeyPath = ("axes", parts.name)
    limits, encoder, adaptation = parts.limits, parts.encoder, parts.adaptation
    check_range(document, (*path, "limits", "travel_m"))
    if limits:
        check_limits(document, (*path, "limits"), limits)
        if parts.homing:
            check_homing(document, (*path, "homing"), parts.homing, limits, encoder)
        if encoder and rate_hz:
            check_encoder(document, path, encoder, limits, rate_hz)
        if parts.model and adaptation:
            margin = adaptation.monotonicity_margin
            check_monotonicity(
                document,
                path,
                parts.model,
                parts.estimates,
                limits.max_voltage_v,
                margin,
                limits.travel_m,
            )
    if parts.declared:
        axes = document.at(("axes",))
        check_other_axes(document, parts.name, parts.declared.declared, axes)
    if rate_hz and adaptation:
        before = len(document.problems)
        check_adaptation(document, (*path, "adaptation"), adaptation, rate_hz)
        if parts.model:
            model_path = (*path, "model")
            check_timing(document, model_path, parts.model, adaptation.input_delay_s, rate_hz)
        if parts.gains and parts.model:
            sound = check_gains(document, (*path, "gains"), parts.gains, rate_hz)
            if sound and len(document.problems) == before:
                check_stability(
                    document,
                    (*path, "gains"),
                    parts.model,
                    parts.estimates,
                    parts.gains,
                    1.0 / rate_hz,
                    adaptation.input_delay_s,
                )
