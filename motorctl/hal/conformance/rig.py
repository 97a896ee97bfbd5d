"""What the suite has to know of a driver, and what it may do with the device at the other end."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import numpy as np
import pytest
from numpy.typing import NDArray

from motorctl.hal import Channel, Driver


@dataclass(frozen=True)
class Received:
    """What the device obeys now, an entry a channel in the driver's order."""

    volts: NDArray[np.float64]
    enabled: NDArray[np.bool_] | None
    """None where the device does not show it."""


class Rig:
    """A driver, and the device at its other end. Every test gets a new one.

    The attributes describe the driver. The methods below `make_driver` are hooks: override those
    that you can offer. A check whose hook is missing is skipped, and says so. Nothing but zero
    volts and disable is sent where `received` is not offered, since that may be a real machine.

    The device may live in a thread or process of its own. It must not keep what it receives for
    ever: the endurance check measures the memory of this process.
    """

    driver_class: type[Driver]
    options: Mapping[str, Any] = {}
    """As they stand in a configuration, without ``type``."""
    channels: Sequence[Channel] = (
        Channel("x", 0, 0.5e-6, 32, 10.0),
        Channel("y", 1, 0.5e-6, 32, 10.0),
    )
    period_s: float = 5e-3
    type_name: str | None = None
    """The name under which the driver is installed, if it is."""
    absent: str | None = None
    """What the error of `open` must name where the device is not there, such as its port.
    None: this device cannot be absent."""
    volts_tolerance_v: float = 1e-9
    """The furthest that received volts may lie from sent ones: about half a step of the format."""
    full_scale_v: float = float("inf")
    """The most that the wire format carries."""
    virtual: bool = False
    """Exchange in virtual time."""
    own_device: bool = False
    """Each driver has a device of its own, as a simulated one: no other driver reaches it."""
    exchanges: int = 20_000
    """How many of them the endurance check makes."""
    within_exchanges: int = 20
    """So many exchanges after its cause an effect may be seen, at the latest."""
    patience_s: float = 2.0
    """But no check gives up before so long: other programs may hold the device up."""
    safe_s: float = 2.0
    """The longest that `safe` may take, whatever happened."""
    in_flight: int = 2
    """So many replies may be on their way while a fault begins."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def stop(self) -> None:
        """Release everything, whatever happened before. Called at the end of each test."""

    def directory_context(self) -> Mapping[str, Any]:
        """Return the context that options are validated in: where files that they name are."""
        return {}

    def make_driver(self) -> Driver:
        """Make the driver from options, channels and period; not yet open."""
        options = self.driver_class.Options.model_validate(
            dict(self.options), context=dict(self.directory_context())
        )
        return self.driver_class(options, self.channels, self.period_s)

    # Hooks from here on.

    def start(self) -> None:
        """Let the device be present: counts 0, amplifiers disabled. Before, it is absent."""
        raise NotImplementedError

    def pass_period(self, driver: Driver) -> None:
        """Let one period pass between a write and the next read.

        Override it to wait for the device instead, and the checks become independent of how busy
        the machine is: until it has taken the last command and its reply, if any, is there.
        """
        if self.virtual:
            driver.advance()
        else:
            time.sleep(self.period_s)

    def move_to(self, counts: NDArray[np.int64]) -> None:
        """Let each channel's encoder stand at a count, signed, of the channel's width."""
        raise NotImplementedError

    def received(self) -> Received:
        """Tell what the amplifiers obey now."""
        raise NotImplementedError

    def lose_next_reply(self) -> None:
        """Let one reply of the device never arrive."""
        raise NotImplementedError

    def garble_next_reply(self, random: np.random.Generator) -> None:
        """Let one reply arrive damaged in a way that the driver can and must notice.

        Called many times: damage another place, shorten, lengthen, as `random` says.
        """
        raise NotImplementedError

    def go_silent(self) -> None:
        """Let the device listen but answer no more."""
        raise NotImplementedError

    def speak_again(self) -> None:
        """End `go_silent`."""
        raise NotImplementedError

    def restart(self) -> None:
        """Let the device lose its power for a moment: counts 0, disabled, with a new session."""
        raise NotImplementedError

    def vanish(self) -> None:
        """Let the device be gone in a way that the driver can know of: unplugged, port closed."""
        raise NotImplementedError

    def come_back(self) -> None:
        """End `vanish`; the device has restarted."""
        raise NotImplementedError


def offers(rig: Rig, hook: str) -> bool:
    """Return whether a rig overrides a hook."""
    return getattr(type(rig), hook) is not getattr(Rig, hook)


def needs(rig: Rig, *hooks: str) -> None:
    """Skip the test where the rig lacks one of the hooks."""
    missing = [hook for hook in hooks if not offers(rig, hook)]
    if missing:
        pytest.skip(f"{type(rig).__name__} offers no {', '.join(missing)}")
