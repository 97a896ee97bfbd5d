"""The tick's place between the machine and its drivers."""

import dataclasses

import numpy as np
import pytest
from loop_bench import Rig, Still, gantry, with_axes, with_driver

from motorctl.config.machine import DriverSetup
from motorctl.errors import RunError
from motorctl.hal import DriverOptions
from motorctl.loop.tick import make_drivers


def on_two_drivers(x: str, y: str, **classes):
    """Return the gantry with an axis on each of two drivers, which are listed as a, then b."""
    setups = {
        name: DriverSetup(name, "own", classes.get(name, Still), DriverOptions()) for name in "ab"
    }
    machine = with_axes(with_axes(gantry(), ["x"], driver=x), ["y"], driver=y, channel=0)
    return dataclasses.replace(machine, drivers=setups)


def assert_wired(x: str, y: str) -> None:
    rig = Rig(on_two_drivers(x, y))
    devices = rig.tick.drivers
    rig.tick.open(virtual=True)
    rig.start()
    devices[x].counts[0], devices[y].counts[0] = 2, 5
    rig.advance(1)
    assert rig.last("x")["position_m"] == pytest.approx(1.0e-6)
    assert rig.last("y")["position_m"] == pytest.approx(2.5e-6)
    assert devices[x].volts.tolist() == [rig.last("x")["command_v"]]
    assert devices[y].volts.tolist() == [rig.last("y")["command_v"]]
    assert devices[x].volts[0] != devices[y].volts[0]
    assert devices[x].enable.tolist() == devices[y].enable.tolist() == [1]


def test_axes_of_several_drivers_are_served_together():
    assert_wired("a", "b")


@pytest.mark.slow  # another wiring is another compiled tick
def test_axes_may_stand_in_another_order_than_their_drivers():
    assert_wired("b", "a")


def test_a_driver_is_told_what_it_serves():
    (driver,) = make_drivers(with_driver(gantry(), Still)).values()
    assert driver.period_s == pytest.approx(0.2e-3)
    assert [channel.axis for channel in driver.channels] == ["x", "y"]
    assert [channel.number for channel in driver.channels] == [0, 1]
    assert driver.channels[0].resolution_m == 0.5e-6
    assert driver.channels[0].counter_bits == 32
    assert driver.channels[0].max_voltage_v == 10.0


def with_channels(x: int, y: int):
    machine = with_driver(gantry(), Still)
    return with_axes(with_axes(machine, ["x"], channel=x), ["y"], channel=y)


def test_a_drivers_arrays_are_in_the_order_of_its_channels_numbers():
    (driver,) = make_drivers(with_channels(x=1, y=0)).values()
    assert [(c.axis, c.number) for c in driver.channels] == [("y", 0), ("x", 1)]


@pytest.mark.slow  # another wiring is another compiled tick
def test_axes_may_stand_in_another_order_than_their_channels():
    rig = Rig(with_channels(x=1, y=0))
    rig.tick.open(virtual=True)
    rig.start()
    rig.driver.counts[:] = 5, 2
    rig.advance(1)
    assert rig.last("x")["position_m"] == pytest.approx(1.0e-6)
    assert rig.last("y")["position_m"] == pytest.approx(2.5e-6)
    y_v, x_v = rig.driver.volts.tolist()
    assert (x_v, y_v) == (rig.last("x")["command_v"], rig.last("y")["command_v"])
    assert x_v != y_v


class DoesNotOpen(Still):
    """There is no such device."""

    def open(self) -> None:
        raise RunError("no device")


class NeverSafe(Still):
    """Breaks the contract in its last moment."""

    def safe(self) -> None:
        super().safe()
        raise OSError("gone")

    def close(self) -> None:
        super().close()
        raise OSError("gone as well")


def test_a_driver_that_does_not_open_leaves_every_output_safe_and_the_others_closed():
    rig = Rig(on_two_drivers("a", "b", b=DoesNotOpen))
    with pytest.raises(RunError, match="no device"):
        rig.tick.open(virtual=True)
    assert rig.tick.drivers["a"].calls == ["open", "safe", "close"]
    assert rig.tick.drivers["b"].calls == ["safe"]


def test_a_driver_that_fails_to_be_safe_keeps_no_other_from_it():
    rig = Rig(on_two_drivers("a", "b", a=NeverSafe))
    rig.tick.open(virtual=True)
    rig.start()
    with pytest.raises(RunError, match=r"driver a: .* its outputs safe: OSError: gone$"):
        rig.tick.close()
    assert rig.tick.drivers["b"].calls == ["open", "safe", "close"]
    assert rig.tick.drivers["b"].enable.tolist() == [0]


class NotReached(Still):
    """Its device does not get the order, which it says."""

    def safe(self) -> None:
        super().safe()
        self.safe_sent, self.safe_failed = False, "the line is cut"


def test_an_end_without_any_error_tells_of_outputs_that_could_not_be_made_safe():
    rig = Rig(on_two_drivers("a", "b", a=NotReached))
    rig.tick.open(virtual=True)
    rig.start()
    with pytest.raises(RunError) as told:
        rig.tick.close()
    assert str(told.value) == "driver a: the loop could not make its outputs safe: the line is cut"
    assert [driver.calls for driver in rig.tick.drivers.values()] == [["open", "safe", "close"]] * 2


def test_what_ended_the_ticks_is_not_hidden_by_outputs_that_could_not_be_made_safe():
    rig = Rig(on_two_drivers("a", "b", a=NotReached))
    rig.tick.open(virtual=True)

    def tick_and_close() -> None:
        try:
            raise OSError("the loop broke")
        finally:
            rig.tick.close()

    with pytest.raises(OSError, match="the loop broke"):
        tick_and_close()


def test_turnaround_is_measured_in_virtual_time_too_but_kept_out_of_the_rows():
    rig = Rig(with_driver(gantry(), Still))
    rig.tick.open(virtual=True)
    rig.advance(100)
    assert rig.turnaround_s.shape == (100, 4)
    assert (rig.turnaround_s > 0.0).all()
    assert np.allclose(rig.turnaround_s[:, 0], rig.turnaround_s[:, 1:].sum(axis=1))
    assert (rig.ticks_seen["turnaround_s"] == 0.0).all()
    assert (rig.ticks_seen["lateness_s"] == 0.0).all()
