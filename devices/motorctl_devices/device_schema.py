"""The shape of a device file."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from motorctl_devices.canopen_shape import CanopenShape
from motorctl_devices.modbus_layout import ModbusShape
from motorctl_devices.orders import FaultOrder, Settings
from motorctl_devices.serial_box import SerialShape


class ChannelShape(Settings):
    """One motor with its encoder."""

    axis: Annotated[str, Field(min_length=1, max_length=32)] | None = Field(
        default=None, description="its name in the layout of frames; null: axis0, axis1, ..."
    )
    resolution_m: Annotated[float, Field(ge=1e-12, le=1)] = Field(description="metres a count")
    counter_bits: Annotated[int, Field(ge=8, le=64)] = Field(
        default=32, description="width at which the counter wraps"
    )
    max_voltage_v: Annotated[float, Field(gt=0, le=1e6)]


class ServeShape(Settings):
    """The bus that the device is on: one of these."""

    can: dict[str, Any] | None = None
    """As it stands in the file: `load` checks it, with libraries that no other bus needs."""
    canopen: CanopenShape | None = None
    serial: SerialShape | None = None
    modbus: ModbusShape | None = None

    @model_validator(mode="after")
    def _one_bus(self) -> Self:
        parts = (self.can, self.canopen, self.serial, self.modbus)
        if sum(part is not None for part in parts) != 1:
            raise ValueError("give one of can, canopen, serial and modbus")
        return self


class DeviceShape(Settings):
    """A simulated gantry behind a bus."""

    gantry: dict[str, Any] = Field(
        default_factory=dict, description="options of the driver sim: preset, seed, plants, ..."
    )
    channels: list[ChannelShape] = Field(min_length=1, max_length=8)
    rate_hz: Annotated[float, Field(ge=1, le=50_000)] = Field(
        description="the device's own sampling clock"
    )
    watchdog_s: Annotated[float, Field(ge=0.001, le=3600)] = Field(
        description="0 V and disabled when no command came for so long"
    )
    spin_s: Annotated[float, Field(ge=0, le=0.01)] = Field(
        default=0.0, description="before a frame by its own clock, spent awake"
    )
    seed: Annotated[int, Field(ge=0)] = Field(default=1, description="of the faults")
    serve: ServeShape
    faults: list[FaultOrder] = Field(default_factory=list, max_length=64)
