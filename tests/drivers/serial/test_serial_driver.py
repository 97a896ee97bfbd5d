"""The serial driver before a box that was written from the protocol's page alone."""

import gc
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from serial_bench import (
    PERIOD_S,
    SAFE,
    START_STREAM,
    STOP_STREAM,
    Box,
    box_running,
    channels,
    driver_for,
    rig_open,
    until,
)

import motorctl_serial
from motorctl.hal import Inputs, Outputs, RunError, Status
from motorctl_serial import SerialDriver, SerialOptions

pytestmark = pytest.mark.wall_clock(lanes=3)

MODES = ["poll", "exchange", "stream"]


def moved(rig, counts):
    """Exchange until the counts are these, and give the status."""
    for _ in range(200):
        rig.write(0.0, enable=0)
        time.sleep(1e-3)
        seen, status = rig.read()
        if seen == counts and not status[0] & Status.STALE:
            return status
    raise AssertionError(f"counts {counts} did not come, but {seen}")


@pytest.mark.parametrize("mode", MODES)
def test_counts_come_and_volts_go(mode):
    with rig_open(mode=mode) as rig:
        rig.box.counts = [2**31 - 1, -(2**31)]
        rig.box.status = [0b00111000, 0b10000011]
        assert moved(rig, [2**31 - 1, -(2**31)]) == [0b00111000, 0b10000011]
        rig.write(2.5, -20.0)
        until(lambda: rig.box.enabled == [True, True])
        assert rig.box.volts == pytest.approx([2.5, -10.0], abs=2e-4)
        rig.write(2.5, np.nan, enable=(1, 1))
        until(lambda: rig.box.enabled == [True, False])
        assert rig.box.volts[1] == 0.0


@pytest.mark.parametrize("mode", MODES)
def test_after_open_and_after_close_everything_is_zero_and_disabled(mode):
    with rig_open(mode=mode) as rig:
        assert rig.box.enabled == [False, False]
        rig.write(1.0, 1.0)
        until(lambda: rig.box.enabled == [True, True])
        rig.driver.close()
        until(lambda: rig.box.enabled == [False, False])
        if mode == "stream":
            until(lambda: rig.box.heard[-1][0] == STOP_STREAM)
        assert rig.read()[1] == [Status.COMMUNICATION_LOST | Status.STALE] * 2
        rig.write(1.0, 1.0)


def test_a_poll_brings_what_is_sampled_at_the_read():
    with rig_open(mode="poll", period_s=8e-3) as rig:
        for count in range(10):
            rig.box.counts = [count, -count]
            assert rig.read_fresh()[0] == [count, -count]


def test_an_exchange_brings_what_was_sampled_at_the_last_write():
    with rig_open(mode="exchange") as rig:
        rig.read()
        rig.box.counts = [5, 6]
        rig.write(0.0, enable=0)
        until(lambda: rig.box.sample >= 2)
        rig.box.counts = [7, 8]
        assert rig.read_fresh()[0] == [5, 6]
        assert rig.read()[1] == [Status.STALE] * 2


def test_a_stream_goes_on_without_being_asked():
    with rig_open(mode="stream") as rig:
        first = rig.box.sample
        until(lambda: rig.box.sample > first + 5)
        assert [body[0] for body in rig.box.heard].count(START_STREAM) == 1


@pytest.mark.parametrize(("mode", "delay"), [("poll", 0.0), ("exchange", 1.0), ("stream", 0.5)])
def test_the_delay_of_the_exchange_is_told(mode, delay):
    assert driver_for("/dev/null", mode=mode).exchange_delay_periods == delay


def test_channels_are_taken_by_their_numbers():
    with rig_open(2, 0, box={"channels": 3}) as rig:
        rig.box.counts = [100, 200, 300]
        assert rig.read_fresh()[0] == [300, 100]
        rig.write(3.0, 1.0)
        until(lambda: rig.box.enabled == [True, False, True])
        assert rig.box.volts == pytest.approx([1.0, 0.0, 3.0], abs=2e-4)


@pytest.mark.parametrize("bits", [8, 16, 24, 32])
def test_counts_are_sign_extended_from_the_counters_width(bits):
    with rig_open(box={"counter_bits": bits}, counter_bits=bits) as rig:
        rig.box.counts = [2 ** (bits - 1) - 1, -(2 ** (bits - 1))]
        assert rig.read_fresh()[0] == rig.box.counts
        if bits < 32:
            rig.box.counts = [2 ** (bits - 1), 2**bits - 1]
            assert rig.read_fresh()[0] == [-(2 ** (bits - 1)), -1]


@pytest.mark.parametrize("mode", MODES)
def test_an_index_mark_is_told_once_although_the_device_repeats_it(mode):
    with rig_open(mode=mode) as rig:
        for mark in (1234, -99):
            rig.box.pass_mark(1, mark)
            told = []
            deadline_s = time.monotonic() + 2.0
            while rig.box.marks[1][0] or len(told) == 0:
                assert time.monotonic() < deadline_s
                told += marks_of(rig)
            for _ in range(5):
                told += marks_of(rig)
            assert told == [(1, mark)]


def marks_of(rig):
    """Exchange once; give the index marks that the read tells of."""
    rig.write(0.0, enable=0)
    time.sleep(1e-3)
    _, status = rig.read()
    return [
        (i, int(rig.inputs.index_counts[i]))
        for i, word in enumerate(status)
        if word & Status.INDEX_LATCHED
    ]


def test_an_index_mark_survives_frames_that_are_lost():
    with rig_open(mode="poll") as rig:
        rig.box.pass_mark(0, 77)
        lost = iter([b"", b"", b""])
        rig.box.mangle = lambda wire: next(lost, wire)
        told = []
        for _ in range(10):
            told += marks_of(rig)
        assert told == [(0, 77)]


@pytest.mark.parametrize(
    ("box", "options", "words"),
    [
        ({"versions": (2, 3)}, {}, ["versions 2 to 3", "version 1"]),
        ({"channels": 1}, {}, ["1 channels"]),
        ({"counter_bits": 16}, {}, ["16 bits", "axis0", "counter_bits: 32"]),
        ({"modes": 6}, {}, ["mode: poll"]),
        ({"max_rate_hz": 499}, {}, ["499 Hz", "500 Hz"]),
        ({"full_scale_v": 5.0}, {}, ["5 V", "axis0", "max_voltage_v: 10"]),
        ({"armed_ms": 500}, {}, ["500 ms", "watchdog_s", "20 ms"]),
        ({"mute": True}, {"connect_s": 0.3}, ["connect_s: 0.3", "baud"]),
        ({}, {"low_latency": "require"}, ["low_latency"]),
    ],
)
def test_open_refuses_a_device_that_does_not_fit(box, options, words):
    with box_running(**box) as device:
        driver = driver_for(device.port, **options)
        with pytest.raises(RunError) as refused:
            driver.open()
        for word in [device.port, *words]:
            assert word in str(refused.value)
        assert "\n" not in str(refused.value)
        # Nothing is left open that would be in the way.
        serial.Serial(device.port, exclusive=True).close()


def test_a_capabilities_frame_that_speaks_other_versions_is_refused_too():
    with box_running() as device:
        device._capabilities_of = device._capabilities
        plain = device._capabilities

        def newer(answers, watchdog_ms):
            body = bytearray(plain(answers, watchdog_ms))
            body[2:4] = 4, 7
            return bytes(body)

        device._capabilities = newer
        with pytest.raises(RunError, match=r"versions 4 to 7 .* version 1"):
            driver_for(device.port).open()


def test_open_waits_for_a_device_that_starts_late():
    with box_running(mute=True) as device:
        driver = driver_for(device.port, connect_s=2.0)
        answers = iter([b"", b""])
        device.mute, device.mangle = False, lambda wire: next(answers, wire)
        driver.open()
        driver.close()


@pytest.mark.parametrize(
    ("port", "cause"),
    [
        ("/dev/no_such_port", "No such file or directory"),
        ("/dev/null", "is no serial port"),
        ("/tmp", "Is a directory"),
    ],
)
def test_open_names_a_port_that_is_none(port, cause):
    with pytest.raises(RunError, match=f"^port {port}: {cause}$"):
        driver_for(port).open()


def test_open_names_a_port_that_is_in_use():
    with (
        box_running() as device,
        serial.Serial(device.port, exclusive=True),
        pytest.raises(RunError, match=rf"{device.port}.*in use"),
    ):
        driver_for(device.port).open()


def test_open_names_a_baud_rate_that_the_port_refuses(monkeypatch):
    def refuses(port, baud):
        raise ValueError("Failed to set custom baud rate")

    monkeypatch.setattr(serial.Serial, "_set_special_baudrate", refuses)
    with (
        box_running() as device,
        pytest.raises(RunError, match=rf"{device.port}.*baud: 1234567"),
    ):
        driver_for(device.port, baud=1234567).open()


def test_open_names_a_baud_rate_that_the_port_rounds(monkeypatch):
    def rounds(port, baud):
        port.baudrate_asked = baud

    monkeypatch.setattr(serial.Serial, "_set_special_baudrate", rounds)
    with (
        box_running() as device,
        pytest.raises(RunError, match=rf"{device.port}.*baud: 1234567 .* would be \d+"),
    ):
        driver_for(device.port, baud=1234567).open()


def test_a_custom_baud_rate_that_the_port_takes_is_taken():
    with rig_open(baud=1234567) as rig:
        assert rig.read_fresh()[0] == [0, 0]


def test_rs485_that_the_port_refuses_is_named():
    with box_running() as device, pytest.raises(RunError, match=rf"{device.port}.*rs485"):
        driver_for(device.port, rs485={}).open()


def test_low_latency_that_a_port_refuses_is_noted(monkeypatch):
    with rig_open() as rig:
        assert rig.driver.notes == ()  # a pseudo-terminal has no such mode
    monkeypatch.setattr("motorctl_serial.port.PSEUDO_TERMINALS", ())  # as if it had
    with rig_open(baud=921600) as rig:
        (note,) = rig.driver.notes
        assert note.startswith(f"port {rig.box.port}: low_latency is refused (")
        assert "latency_timer" in note
    with rig_open(baud=921600, low_latency="no") as rig:
        assert rig.driver.notes == ()


def test_what_the_device_said_of_itself_can_be_read():
    with rig_open() as rig:
        assert rig.driver.device.name == "bench box"


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({"baud": 0}, "baud"),
        ({"baud": -9600}, "baud"),
        ({"baud": 10**12}, "baud"),
        ({"mode": "interrupt"}, "mode"),
        ({"wait_s": 0.0}, "wait_s"),
        ({"wait_s": float("nan")}, "wait_s"),
        ({"mode": "exchange", "wait_s": 1e-3}, "wait_s"),
        ({"watchdog_s": 0.0}, "watchdog_s"),
        ({"watchdog_s": 0.0105}, "watchdog_s"),
        ({"watchdog_s": 66.0}, "watchdog_s"),
        ({"mode": "stream", "half_duplex": True}, "half_duplex"),
        ({"mode": "stream", "rs485": {}}, "rs485"),
        ({"rs485": {"loopback": True}}, "rs485"),
        ({"low_latency": "yes"}, "low_latency"),
        ({"port": ""}, "port"),
        ({"port": "/dev/tty\0USB0"}, "port"),
        ({"prot": "/dev/ttyUSB0"}, "prot"),
    ],
)
def test_options_that_cannot_be_are_refused_by_their_key(options, key):
    with pytest.raises(ValidationError) as refused:
        SerialOptions.model_validate({"port": "/dev/ttyUSB0", "baud": 921600, **options})
    assert [error["loc"][0] for error in refused.value.errors()] == [key]


@pytest.mark.parametrize(
    ("options", "numbers", "bits", "key", "words"),
    [
        ({}, (0, 9), 32, (), "axes.axis9.channel is 9, but the protocol carries channels 0 to 7"),
        ({}, (0,), 64, (), "axes.axis0.encoder.counter_bits is 64, but the protocol carries"),
        ({"watchdog_s": 0.003}, (0,), 32, ("watchdog_s",), "watchdog_s: found 0.003"),
        ({"wait_s": PERIOD_S}, (0,), 32, ("wait_s",), "wait_s: found 0.002"),
        ({"wait_s": 0.5e-3, "baud": 115200}, (0,), 32, ("wait_s",), "wait_s: found 0.0005"),
    ],
)
def test_what_does_not_fit_the_channels_is_told_with_its_key(options, numbers, bits, key, words):
    checked = SerialOptions.model_validate({"port": "/dev/ttyS0", "baud": None, **options})
    driver = SerialDriver(checked, channels(*numbers, counter_bits=bits), PERIOD_S)
    assert [path for path, _ in driver.problems()] == [key]
    with pytest.raises(RunError, match=f"^port /dev/ttyS0: {words}"):
        driver.open()


def test_the_budget_tells_bytes_bits_turnaround_and_share():
    options = SerialOptions(port="/dev/ttyUSB0", baud=1_000_000)
    budget = SerialDriver(options, channels(0, 1), 2e-3).rate_budget()
    for words in (
        "POLL 6",
        "STATE 29",
        "COMMAND 11",
        "46 bytes",
        "460 us",
        "1000 us",
        "USB",
        "73%",
    ):
        assert words in budget.arithmetic
    assert budget.max_rate_hz == pytest.approx(0.8 / 1.46e-3)


@given(st.integers(9600, 12_000_000), st.integers(1, 8), st.booleans())
def test_more_baud_or_fewer_channels_never_lower_the_budget(baud, count, half_duplex):
    def rate(baud, count, half_duplex):
        options = SerialOptions(port="/dev/ttyS0", baud=baud, half_duplex=half_duplex)
        return SerialDriver(options, channels(*range(count)), 1e-3).rate_budget().max_rate_hz

    here = rate(baud, count, half_duplex)
    assert rate(baud + 1000, count, half_duplex) >= here
    assert rate(baud, max(1, count - 1), half_duplex) >= here
    assert rate(baud, count, half_duplex=True) <= here


def test_safe_before_open_reaches_the_device():
    with box_running() as device:
        with_session = driver_for(device.port)
        with_session.open()
        outputs = Outputs(2)
        outputs.volts[:], outputs.enable[:] = 1.0, 1
        with_session.write(outputs)
        until(lambda: device.enabled == [True, True])
        with_session._port.close()  # as if its process had died
        other = driver_for(device.port)
        other.safe()
        until(lambda: device.enabled == [False, False])
        assert device.heard[-1][0] == SAFE
        with_session._port = None


def test_safe_tells_whether_the_port_took_it():
    absent = driver_for("/dev/no_such_port")
    assert absent.safe_sent is None
    absent.safe()
    told = "port /dev/no_such_port: No such file or directory"
    assert (absent.safe_sent, absent.safe_failed) == (False, told)
    with box_running() as device:
        driver, other = driver_for(device.port), driver_for(device.port)
        driver.safe()
        assert driver.safe_sent is True
        driver.open()
        driver.safe()
        assert (driver.safe_sent, driver.safe_failed) == (True, "")
        other.safe()
        told = f"port {device.port}: in use by another program"
        assert (other.safe_sent, other.safe_failed) == (False, told)
        device.vanish()
        driver.safe()
        told = f"port {device.port}: it has vanished"
        assert (driver.safe_sent, driver.safe_failed) == (False, told)
        driver.close()


def test_safe_never_raises_in_any_state():
    driver_for("/dev/no_such_port").safe()
    with box_running() as device:
        driver = driver_for(device.port)
        driver.safe()
        driver.open()
        driver.safe()
        driver.safe()
        device.vanish()
        driver.safe()
        inputs = Inputs(2)
        driver.read(inputs)
        driver.safe()
        driver.close()
        driver.safe()
        driver.close()


def test_close_and_open_begin_anew():
    with rig_open() as rig:
        for _ in range(3):
            rig.driver.close()
            rig.driver.open()
            assert rig.read_fresh()[1] == [0, 0]
        with pytest.raises(RunError, match="open already"):
            rig.driver.open()


def test_no_descriptor_is_left_after_many_openings():
    with box_running() as device:
        driver = driver_for(device.port)
        before = len(list(Path("/proc/self/fd").iterdir()))
        for _ in range(5):
            driver.open()
            driver.close()
            device.mute = True
            with pytest.raises(RunError):
                driver_for(device.port, connect_s=0.05).open()
            device.mute = False
        assert len(list(Path("/proc/self/fd").iterdir())) == before


@pytest.mark.parametrize("mode", MODES)
def test_memory_does_not_grow(mode):
    exchanges = 1500
    with rig_open(mode=mode) as rig:

        def run(times):
            for _ in range(times):
                rig.driver.read(rig.inputs)
                rig.driver.write(rig.outputs)

        def held():
            gc.collect()
            ours = tracemalloc.Filter(True, f"{Path(motorctl_serial.__file__).parent}/*")
            shot = tracemalloc.take_snapshot().filter_traces([ours])
            return sum(trace.size for trace in shot.traces)

        tracemalloc.start()
        try:
            run(300)
            before = held()
            run(exchanges)
            after = held()
        finally:
            tracemalloc.stop()
        # The smallest thing that can be kept for each exchange takes 8 bytes.
        assert after - before < 2 * exchanges


def test_a_box_that_was_never_started_leaves_nothing_behind():
    Box().end()
