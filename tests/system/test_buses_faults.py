"""Every fault to order, from the wire to the axis: what docs/drivers/gantry_device.md promises."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from buses_bench import (
    AXES,
    BUSES,
    END_S,
    HOLD_S,
    SLACK_S,
    WATCHDOG_S,
    Bus,
    Outcome,
    run_with,
)
from fault_sequence import Spell, run_through

from motorctl.log.sample import AxisState, FaultCause, SampleFlag

pytestmark = pytest.mark.wall_clock(lanes=3)

REFUSED = "a message was refused"
GONE = "the bus or the port is gone"
ANEW = "the device restarted"
SILENT = "no new sample from the device"
BROKEN = "the amplifier reports a fault"

IN_THE_LOG = {
    REFUSED: "CORRUPT",
    GONE: "BUS_OFF",
    ANEW: "DEVICE_RESTARTED",
    SILENT: "STALE",
    BROKEN: "AMPLIFIER_FAULT",
}
"""The same in the words of `motorctl log info`."""

SERIAL = ("serial poll", "serial exchange", "serial stream")
CAN = ("can udp_multicast", "slcan")
MODBUS = ("modbus tcp", "modbus rtu")
CANOPEN = "canopen"
NUMBERED = (*SERIAL, *CAN, *MODBUS)
"""Their samples bring a number, which a fault may spoil."""
EVERY = (*NUMBERED, CANOPEN)
FEW = ("serial poll", "can udp_multicast", CANOPEN, "modbus tcp")
FEW_AND_LONG = [bus if bus in FEW else pytest.param(bus, marks=pytest.mark.long) for bus in EVERY]


@dataclass(frozen=True)
class Promise:
    """What becomes of an axis."""

    causes: tuple[FaultCause, ...]
    words: tuple[str, ...] = ()
    off_s: float | None = None
    """From the fault's begin until the device's amplifiers are off for good; None: no promise."""
    watchdog_trips: int = 0


def held(*words: str, off_s: float = HOLD_S, watchdog_trips: int = 0) -> Promise:
    """Return the promise that an axis goes on for the allowed time, then trips."""
    return Promise((FaultCause.NO_NEW_SAMPLE,), (SILENT, *words), off_s, watchdog_trips)


BY_WATCHDOG = held(off_s=WATCHDOG_S, watchdog_trips=1)
PORT_GONE = Promise((FaultCause.COMMUNICATION,), (GONE,), WATCHDOG_S, 1)
RESET_S = 0.05
RESTARTED = Promise((FaultCause.ENCODER_LOST,), (ANEW,), RESET_S)
ANYTHING_WRONG = Promise(
    (
        FaultCause.ENCODER_LOST,
        FaultCause.ENCODER_JUMP,
        FaultCause.AMPLIFIER,
        FaultCause.ESTOP,
        FaultCause.LIMIT_SWITCH,
        FaultCause.COMMUNICATION,
        FaultCause.NO_NEW_SAMPLE,
    )
)
"""Of content that is wrong in any place."""


def _each(promise: Promise, **others: Promise) -> dict[str, Promise]:
    return dict.fromkeys(EVERY, promise) | {k.replace("_", " ", 1): v for k, v in others.items()}


ORDERS: dict[str, dict[str, Any]] = {
    "loss": {"kind": "loss"},
    "loss to the device": {"kind": "loss", "way": "to_device"},
    "silence": {"kind": "silence"},
    "delay": {"kind": "delay", "amount_s": 0.06},
    "wrong length": {"kind": "wrong_length"},
    "bit errors": {"kind": "bit_errors"},
    "stuck sequence": {"kind": "wrong_sequence", "sequence": "stuck"},
    "random sequence": {"kind": "wrong_sequence", "sequence": "random"},
    "short reset": {"kind": "reset", "duration_s": RESET_S},
    "long reset": {"kind": "reset", "duration_s": 0.5},
    "unplug": {"kind": "unplug", "duration_s": 1.0},
    "short unplug": {"kind": "unplug", "duration_s": 0.03},
    "amplifier fault": {"kind": "amplifier_fault", "duration_s": 0.5},
    "counter jump": {"kind": "counter_jump", "counts": 60_000},
}
PROMISES: dict[str, Mapping[str, Promise]] = {
    # The first, as its random numbers are those of its place: on TCP some replies are taken all the
    # same, and with fewer of them or more it is motion that trips the axis.
    "wrong length": _each(
        held(REFUSED),
        modbus_tcp=Promise((FaultCause.NO_NEW_SAMPLE, FaultCause.COMMUNICATION)),
        modbus_rtu=held(),  # the last tick may have been one without any reply
    ),
    "loss": _each(held()),
    "loss to the device": _each(BY_WATCHDOG),
    "silence": _each(BY_WATCHDOG),
    "delay": _each(held(off_s=HOLD_S + 0.06)),
    "bit errors": {name: held(REFUSED) for name in SERIAL}
    | {"modbus rtu": held()}
    | dict.fromkeys((*CAN, CANOPEN, "modbus tcp"), ANYTHING_WRONG),
    "stuck sequence": dict.fromkeys((*SERIAL, *CAN), held()) | dict.fromkeys(MODBUS, held(REFUSED)),
    "random sequence": {name: held(REFUSED) for name in MODBUS},
    "short reset": _each(
        RESTARTED, modbus_tcp=Promise((FaultCause.COMMUNICATION,), (GONE,), RESET_S)
    ),
    "long reset": _each(
        held(off_s=0.0), modbus_tcp=Promise((FaultCause.COMMUNICATION,), (GONE,), 0.0)
    ),
    "unplug": _each(PORT_GONE, can_udp_multicast=BY_WATCHDOG, canopen=BY_WATCHDOG),
    "short unplug": {name: PORT_GONE for name in NUMBERED if name != "can udp_multicast"},
    # What no wire does is the same on all of them: a numbered one stands for those.
    "amplifier fault": dict.fromkeys(
        ("serial poll", CANOPEN), Promise((FaultCause.AMPLIFIER,), (BROKEN,), 0.0)
    ),
    "counter jump": dict.fromkeys(
        ("serial poll", CANOPEN), Promise((FaultCause.ENCODER_JUMP,), (), 0.0)
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("bus_name", FEW_AND_LONG)
def test_each_fault_that_stays_trips_the_axes_as_promised_and_a_reset_brings_them_back(
    tmp_path: Path, bus_name: str
) -> None:
    bus = BUSES[bus_name]
    promises = {name: of[bus_name] for name, of in PROMISES.items() if bus_name in of}
    outcome, spells = run_through(tmp_path, bus, {name: ORDERS[name] for name in promises})
    for number, spell in enumerate(spells):
        with _told_of(spell):
            promise = promises[spell.name]
            assert spell.told["fired"] >= 1
            for axis in AXES:
                _the_log_and_status_tell(spell, axis, promise)
                # Once for each start: the last one was under way when this fault came.
                motions = outcome.log.metadata["motions"]
                assert sum(axis in motion["axes"] for motion in motions) >= number + 1
            if promise.causes == (FaultCause.NO_NEW_SAMPLE,):
                _it_was_held_first(spell, bus)
            _the_device_is_off(spell, promise)
            assert spell.opened or not {GONE, ANEW} & set(promise.words)
    assert outcome.exit_status == 0
    assert outcome.ended_in_s < END_S
    assert "Traceback" not in outcome.said
    assert "NOT be safe" not in outcome.said


@contextmanager
def _told_of(spell: Spell) -> Iterator[None]:
    """Name the fault in what fails."""
    try:
        yield
    except AssertionError as error:
        error.add_note(f"fault '{spell.name}' of {spell.at_s:g} s: {spell.told}")
        raise


def _the_log_and_status_tell(spell: Spell, axis: str, promise: Promise) -> None:
    outcome, rows = spell.outcome, spell.rows
    cause, recorded = spell.cause(axis), outcome.log.axes[axis]
    assert cause in promise.causes
    told = spell.status["axes"][axis]
    assert told["state"] == "fault"
    assert told["fault"]["cause"] == cause.name.lower()
    message = told["fault"]["message"]
    assert all(words in message for words in promise.words), message
    assert f"axis {axis}: fault: {message}" in outcome.said
    first_s, last_s = outcome.log.time_s[[rows.start, rows.stop]]
    (noted,) = [
        fault
        for fault in outcome.info.faults
        if fault.axis == axis and first_s <= fault.time_s <= last_s
    ]
    assert noted.cause == cause.name
    assert {IN_THE_LOG[words] for words in promise.words} <= set(noted.device)
    trip = spell.trip_row(axis)
    assert recorded.state is not None
    assert recorded.fault is not None
    assert (recorded.state[trip : rows.stop] == AxisState.FAULT).all()
    assert (recorded.fault[trip : rows.stop] == cause).all()
    assert (recorded.command[trip : rows.stop] == 0.0).all()
    # It was on its way, not at rest, and not before the fault's time.
    assert (recorded.state[rows.start : trip] == AxisState.RUNNING).all()
    assert outcome.log.time_s[trip] - outcome.began_s > spell.at_s - SLACK_S - spell.pause_s


def _it_was_held_first(spell: Spell, bus: Bus) -> None:
    """As many ticks as configured, each flagged; one more trips."""
    log, pauses = spell.outcome.log, _pause_ticks(spell)
    for axis in AXES:
        trip = spell.trip_row(axis)
        held = spell.outcome.flag(axis, SampleFlag.HELD)[: trip + 1]
        fresh = np.flatnonzero(~held)[-1]
        ticks = round((log.time_s[trip] - log.time_s[fresh]) * bus.rate_hz)
        assert bus.hold_ticks + 1 - pauses <= ticks <= bus.hold_ticks + 1 + pauses


def _pause_ticks(spell: Spell) -> int:
    return int(np.ceil(spell.pause_s / spell.outcome.log.period_s)) + 1


def _the_device_is_off(spell: Spell, promise: Promise) -> None:
    off_s = spell.told["off_after_s"]
    assert off_s is not None, "an amplifier was still on"
    if promise.off_s is not None:
        # Two periods: the tick in which the fault began, and the one that takes the enable away.
        late_s = SLACK_S + 3 * spell.outcome.log.period_s + 2 * spell.pause_s
        assert off_s <= promise.off_s + late_s
        assert spell.told["watchdog_trips"] == promise.watchdog_trips


AT_S = 2.0
SPELL_S = 0.3
EACH_S = 0.5
CALM_BEGIN_S, CALM_S = 0.3, 0.1
"""It is calm from then on to the first spell, and for so long before each."""
SLOW_HZ = 200.0
"""Below, the jitter of the other buses is not longer than a period."""
PASSING: dict[str, dict[str, Any]] = {
    "delay": {"kind": "delay", "amount_s": 0.5e-3},
    "jitter": {"kind": "jitter", "amount_s": 8e-3},
    "loss": {"kind": "loss", "share": 0.2},
    "loss to the device": {"kind": "loss", "share": 0.2, "way": "to_device"},
    "duplicates": {"kind": "duplicates", "every": 2},
    "reordering": {"kind": "reordering", "every": 5},
    "bit errors": {"kind": "bit_errors", "share": 0.1},
    "wrong length": {"kind": "wrong_length", "share": 0.1},
    "stuck sequence": {"kind": "wrong_sequence", "sequence": "stuck", "share": 0.2},
    "random sequence": {"kind": "wrong_sequence", "sequence": "random", "share": 0.2},
    "silence": {"kind": "silence", "duration_s": 0.04},
    "babbling": {"kind": "babbling", "rate_hz": 100},
}
NOT_PASSING = {
    "stuck sequence": (CANOPEN,),  # there is no number
    "bit errors": (*CAN, CANOPEN, "modbus tcp"),  # what passes their own checksums is content
    "wrong length": ("modbus tcp",),  # may lose step with the stream
    "random sequence": (
        *CAN,
        CANOPEN,
    ),  # right numbers look old until they have caught up with a wrong one
}
NEVER_HELD = {
    "duplicates": (*SERIAL, *CAN, "modbus tcp"),
    "babbling": (*CAN, CANOPEN, "modbus tcp"),
    "loss to the device": ("serial stream",),  # of commands, and the next is newer
}
MAY_BE_HELD = ("delay", "babbling")
"""All others are, in some ticks: noise on a line may fall between two frames."""
SOME_TICKS = 0.1
"""Share of ticks that a busy machine may have held by itself."""
ONE_OF_EACH = ("serial poll", "can udp_multicast", "modbus tcp")
"""A stream of bytes, frames and requests: CANopen's frames are those of CAN."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "bus_name",
    [bus if bus in ONE_OF_EACH else pytest.param(bus, marks=pytest.mark.long) for bus in EVERY],
)
def test_a_fault_that_passes_is_held_over_and_a_counter_that_wraps_on_the_way_is_no_jump(
    tmp_path: Path, bus_name: str
) -> None:
    bus = BUSES[bus_name]
    chosen = {k: v for k, v in PASSING.items() if bus_name not in NOT_PASSING.get(k, ())}
    if bus.rate_hz < SLOW_HZ:  # an answer that is late by less than a period need not be missed
        chosen["jitter"] = chosen["jitter"] | {"amount_s": 2.0 / bus.rate_hz}
    orders = [
        {"duration_s": SPELL_S, **order, "at_s": AT_S + EACH_S * k}
        for k, order in enumerate(chosen.values())
    ]
    wraps, offsets_m = _wraps(bus)  # behind the others, whose random numbers are those of a place
    run_s = AT_S + EACH_S * len(orders)
    outcome = run_with(tmp_path, bus, [*orders, *wraps], run_s=run_s, offsets_m=offsets_m)
    for axis in AXES:
        assert outcome.status["axes"][axis]["state"] == "running", outcome.said
        assert (outcome.log.axes[axis].fault == 0).all()
        _did_not_jump(outcome, axis)
    held_ticks = outcome.flag("x", SampleFlag.HELD)
    reports = outcome.report["faults"][: len(orders)]
    for name, order, told in zip(chosen, orders, reports, strict=True):
        assert told["fired"] >= 1, name
        end_s = order["at_s"] + order["duration_s"]
        flagged = held_ticks[outcome.window(order["at_s"], end_s + 0.1)]
        if bus_name in NEVER_HELD.get(name, ()):
            # what streams by a clock of its own comes now before the tick, now after it
            calm = [(CALM_BEGIN_S, AT_S), (order["at_s"] - CALM_S, order["at_s"])]
            anyhow = max(held_ticks[outcome.window(*span)].mean() for span in calm)
            assert flagged.mean() <= anyhow + SOME_TICKS, name
        elif name not in MAY_BE_HELD:
            assert flagged.any(), name
    assert outcome.report["watchdog_trips"] == 0
    assert outcome.exit_status == 0
    assert outcome.ended_in_s < END_S


def _wraps(bus: Bus) -> tuple[list[dict[str, Any]], tuple[float, float]]:
    """Return orders that set both counters beside their edge, and what is zero then."""
    edge = 2 ** (bus.counter_bits - 1)
    # One begins below the edge on its way up, the other above it: it comes back over it.
    left = (30_000, -30_000)
    offsets_m = (-(edge - left[0]) * 0.5e-6, -(-edge - left[1]) * 0.5e-6)
    wraps = [{"kind": "counter_wrap", "counts": n, "channel": k} for k, n in enumerate(left)]
    return wraps, offsets_m


def _did_not_jump(outcome: Outcome, axis: str) -> None:
    """Insist on motion from 0 to 60 mm and back, over an edge at 15 mm, before any fault."""
    calm = slice(0, outcome.window(0.0, AT_S).stop)
    position = outcome.log.axes[axis].position
    assert position[calm].max() > 0.05
    moved, passed = np.diff(position[calm]), np.diff(outcome.log.time_s[calm])
    assert (np.abs(moved) < 0.2 * passed + 1e-3).all()


def test_the_page_has_a_row_for_every_fault() -> None:
    page = (Path(__file__).parents[2] / "docs/drivers/gantry_device.md").read_text()
    rows = page.partition("| kind | CAN |")[2].partition("## The report")[0]
    for order in (*ORDERS.values(), *PASSING.values()):
        assert f"| `{order['kind']}`" in rows or f", `{order['kind']}`" in rows, order["kind"]
