"""What a device file says of CANopen."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from motorctl_devices.orders import Settings


class DriveShape(Settings):
    """The drive of one channel."""

    node: Annotated[int, Field(ge=1, le=127)]
    rated_torque_v: Annotated[float, Field(gt=0, le=1e6)] = Field(
        description="the voltage that acts at 1000 thousandths of the rated torque"
    )


class CanopenShape(Settings):
    """Drives of CiA 402 on a CAN bus, one a channel."""

    interface: Literal["socketcan", "udp_multicast", "virtual"]
    channel: Annotated[str, Field(min_length=1)]
    port: Annotated[int, Field(ge=1, le=65535)] = 43113
    nodes: list[DriveShape] = Field(min_length=1, max_length=8)
