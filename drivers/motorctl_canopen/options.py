"""Options of the CANopen driver."""

from __future__ import annotations

from collections import Counter
from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from motorctl_can.bus import BusOptions, refuse
from motorctl_can.checks import Wrong

HOST_NODE = 127


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class InputsOptions(_Part):
    """Which bits of the drive's digital inputs (60FDh) are switches; 0 to 2 are CiA 402's own."""

    limit_negative: int | None = Field(default=None, ge=0, le=31)
    """Bit of the switch at the negative end, 0 in CiA 402; null: none."""
    limit_positive: int | None = Field(default=None, ge=0, le=31)
    """Bit of the switch at the positive end, 1 in CiA 402; null: none."""
    home_switch: int | None = Field(default=None, ge=0, le=31)
    """Bit of the home switch, 2 in CiA 402; null: none."""
    inverted: bool = False
    """0 means pressed, for all of them."""

    def named(self) -> dict[str, int]:
        """Return the bit of each switch that there is."""
        switches = ("limit_negative", "limit_positive", "home_switch")
        return {name: bit for name in switches if (bit := getattr(self, name)) is not None}


class NodeOptions(_Part):
    """A drive."""

    node: int = Field(ge=1, le=127)
    """Number of the drive on the bus."""
    rated_torque_v: float = Field(gt=0, allow_inf_nan=False)
    """The command [V] that is sent as 1000 thousandths of the drive's rated torque (6076h)."""
    inputs: InputsOptions | None = None
    """Which digital inputs are switches; null: the inputs are not sent."""


class SyncOptions(_Part):
    """SYNC is sent once a period; the drives sample when it comes."""

    wait_s: float = Field(gt=0, le=1.0, allow_inf_nan=False)
    """How long a read waits for the drives' answers at most [s]; below the period."""


class CanopenOptions(BusOptions):
    """A CANopen bus and the drives on it; docs/drivers/canopen.md has a complete example."""

    nodes: dict[str, NodeOptions] = Field(min_length=1)
    """The drive of each axis, by the axis' name."""
    sync: SyncOptions
    """How the drives are let sample."""
    command_at: Literal["sync", "arrival"] = "sync"
    """When a drive takes a command: with the next SYNC, or as soon as it has come."""
    watchdog_s: float = Field(default=0.1, ge=0.002, le=65.535)
    """A drive that hears no heartbeat of motorctl for so long goes into Fault [s]; at least
    four periods. Longer leaves a drive on for longer when the computer dies."""
    heartbeat_s: float = Field(default=0.05, ge=0.001, le=20.0)
    """How often each drive says that it is there [s]; three missing ones in a row are a drive
    that is silent."""
    host_node: int = Field(default=HOST_NODE, ge=1, le=127)
    """Node number of motorctl's own heartbeat; no drive may have it."""
    enable_timeout_s: float = Field(default=1.0, gt=0, le=60, allow_inf_nan=False)
    """How long a drive may take to be enabled, and to be disabled [s]."""
    open_timeout_s: float = Field(default=2.0, gt=0, le=60, allow_inf_nan=False)
    """How long opening waits for a drive's boot-up, statusword and mode [s]."""
    max_frames_per_read: int = Field(default=64, ge=1, le=10000)
    """A read looks at no more frames; lower loses samples on a busy bus, higher lets a babbling
    one take the tick's time."""

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        wrong = list(self.wrong_in_bus())
        numbers = Counter(node.node for node in self.nodes.values())
        for axis, node in self.nodes.items():
            where = ("nodes", axis, "node")
            if numbers[node.node] > 1:
                wrong.append(Wrong(where, node.node, "is the number of two drives"))
            if node.node == self.host_node:
                text = "is host_node, under which motorctl sends its heartbeat; give one another"
                wrong.append(Wrong(where, node.node, text))
        refuse(wrong, "CanopenOptions")
        return self
