"""Whatever is wrong with the options of the CAN driver is told with the key that is at fault."""

import copy

import pytest
from can_bench import bits, channels, frames_apart, frames_of_both, options, told

from motorctl.hal import Channel
from motorctl_can import CanDriver, CanOptions


def edited(*path_and_value, base=frames_of_both):
    """Change one entry of a good layout; None takes it away."""
    *path, last, value = path_and_value
    frames = copy.deepcopy(base())
    place = frames
    for key in path:
        place = place[key]
    if value is None:
        del place[last]
    else:
        place[last] = value
    return {"frames": frames}


def signal(frame, name, value):
    return edited(frame, "signals", name, value)


CASES = {
    "signals that overlap": (
        edited("positions", "signals", "counts_y", "start", 20),
        "frames.positions.signals.counts_y.start",
        "overlaps 'positions.counts_x'",
    ),
    "a signal beyond its frame": (
        edited("positions", "length", 7),
        "frames.positions.signals.sequence.start",
        "goes to byte 7",
    ),
    "a big-endian signal beyond its frame": (
        signal("positions", "boot", bits("boot", 57, 4, byte_order="big")),
        "frames.positions.signals.boot.start",
        "goes to byte 8",
    ),
    "a length that no frame has": (
        {**edited("positions", "length", 9), "fd": True},
        "frames.positions.length",
        "no length of a frame",
    ),
    "an FD length on a classic bus": (
        edited("positions", "length", 12),
        "frames.positions.length",
        "needs fd: true",
    ),
    "a length below 0": (edited("command", "length", -1), "frames.command.length", "no length"),
    "two frames of one identifier": (
        edited("positions", "id", 0x200),
        "frames.positions.id",
        "is that of 'command'",
    ),
    "SYNC with a frame's identifier": (
        {"sync": {"id": 0x180, "wait_s": 1e-4}},
        "sync.id",
        "identifier of frame 'positions'",
    ),
    "an identifier of more than 11 bits": (
        edited("positions", "id", 0x800),
        "frames.positions.id",
        "extended: true",
    ),
    "a SYNC identifier of more than 29 bits": (
        {"sync": {"id": 1 << 29, "extended": True, "wait_s": 1e-4}},
        "sync.id",
        "29 bits",
    ),
    "a meaning given twice": (
        signal("positions", "chain", bits("encoder_lost", 50, 1, "x")),
        "frames.positions.signals.chain.means",
        "given twice for axis 'x'",
    ),
    "a meaning given for all and for one": (
        signal("positions", "chain", bits("amplifier_fault", 50, 1)),
        "frames.positions.signals.chain.means",
        "given twice",
    ),
    "two sequences in a frame": (
        signal("positions", "boot", bits("sequence", 52, 4)),
        "frames.positions.signals.sequence.means",
        "given twice for frame 'positions'",
    ),
    "an axis without volts": (edited("command", "signals", "volts_y", None), "frames", "no volts"),
    "an axis without enable": (
        edited("command", "signals", "enable_y", None),
        "frames",
        "axis 'y' has no enable",
    ),
    "an axis without counts": (
        edited("positions", "signals", "counts_y", None),
        "frames",
        "axis 'y' has no counts",
    ),
    "counts in a command": (
        signal("command", "more", bits("counts", 34, 4, "x")),
        "frames.command.signals.more.means",
        "not for a command frame",
    ),
    "volts in a state frame": (
        signal("positions", "boot", bits("volts", 52, 4, "x")),
        "frames.positions.signals.boot.means",
        "not for a state frame",
    ),
    "counts of all axes": (
        signal("positions", "counts_y", bits("counts", 24, 24)),
        "frames.positions.signals.counts_y.axis",
        "should name one axis",
    ),
    "a sequence of an axis": (
        signal("positions", "sequence", bits("sequence", 56, 8, "x")),
        "frames.positions.signals.sequence.axis",
        "should be absent",
    ),
    "a sequence too short": (
        signal("positions", "sequence", bits("sequence", 56, 3)),
        "frames.positions.signals.sequence.bits",
        "at least 4",
    ),
    "a scale of 0": (
        edited("command", "signals", "volts_x", "scale", 0.0),
        "frames.command.signals.volts_x.scale",
        "other than 0",
    ),
    "counts with a scale": (
        edited("positions", "signals", "counts_x", "scale", 2.0),
        "frames.positions.signals.counts_x.scale",
        "taken raw",
    ),
    "volts that cannot be 0": (
        edited("command", "signals", "volts_x", "offset", 100.0),
        "frames.command.signals.volts_x.offset",
        "cannot represent 0 V",
    ),
    "inverted counts": (
        edited("positions", "signals", "counts_x", "inverted", True),
        "frames.positions.signals.counts_x.inverted",
        "not for counts",
    ),
    "an index mark without its count": (
        signal("positions", "boot", bits("index_latched", 52, 1, "x")),
        "frames.positions.signals.boot.means",
        "needs index_counts",
    ),
    "the count of a mark that is not told when passed again": (
        signal("positions", "boot", bits("index_counts", 52, 4, "x")),
        "frames.positions.signals.boot.means",
        "needs index_latched of axis 'x': a mark that is passed twice",
    ),
    "a frame without signals": (
        edited("spare", {"id": 1, "direction": "state", "length": 0, "signals": {}}),
        "frames.spare.signals",
        "at least one",
    ),
    "an unknown meaning": (
        signal("positions", "chain", bits("stop", 50, 1)),
        "frames.positions.signals.chain.means",
        "'estop'",
    ),
    "an unknown direction": (
        edited("positions", "direction", "in"),
        "frames.positions.direction",
        "'state'",
    ),
    "an unknown interface": ({"interface": "socketcam"}, "interface", "'socketcan'"),
    "an impossible bitrate": ({"bitrate": 2000000}, "bitrate", "1000000"),
    "a bitrate that slcan has not": (
        {"interface": "slcan", "bitrate": 123456},
        "bitrate",
        "none of slcan's",
    ),
    "slcan with FD but no data rate": (
        {"interface": "slcan", "fd": True},
        "data_bitrate",
        "2000000 or 5000000",
    ),
    "a data rate without FD": ({"data_bitrate": 5000000}, "data_bitrate", "needs fd"),
    "a data rate below the bitrate": (
        {"fd": True, "data_bitrate": 500000},
        "data_bitrate",
        "below the bitrate",
    ),
    "no layout at all": ({"frames": None}, "frames", "one of the two"),
    "a layout and a DBC file": ({"dbc": "some.dbc"}, "frames", "one of the two"),
    "signals beside frames": (
        {"signals": {"x": {"volts": "Command.VoltsX"}}},
        "signals",
        "belongs to dbc",
    ),
    "an empty layout": ({"frames": {}}, "frames", "not be empty"),
    "an unknown key": ({"baudrate": 1}, "baudrate", "not permitted"),
    "a watchdog that cannot be sent": ({"watchdog_s": 0.1}, "watchdog_s", "no way to the device"),
    "a watchdog signal without its time": (
        signal("command", "watchdog", bits("watchdog", 34, 6, scale=0.001)),
        "watchdog_s",
        "is missing",
    ),
    "a watchdog beyond its signal": (
        {
            **signal("command", "watchdog", bits("watchdog", 34, 6, scale=0.001)),
            "watchdog_s": 0.1,
        },
        "watchdog_s",
        "0.001 to 0.063 s",
    ),
    "a watchdog so short that it would be sent as 0, which is off": (
        {
            **signal("command", "watchdog", bits("watchdog", 34, 6, scale=0.001)),
            "watchdog_s": 0.0005,
        },
        "watchdog_s",
        "0.001 to 0.063 s",
    ),
    "a watchdog whose raw number would be 0": (
        {
            **signal("command", "watchdog", bits("watchdog", 34, 6, scale=0.001, offset=0.1)),
            "watchdog_s": 0.1,
        },
        "watchdog_s",
        "0 there is off",
    ),
    "a multicast address that is none": (
        {"interface": "udp_multicast", "channel": "10.0.0.1"},
        "channel",
        "multicast group",
    ),
    "a wait of nothing": ({"sync": {"id": 1, "wait_s": 0}}, "sync.wait_s", "greater than 0"),
    "no channel": ({"channel": ""}, "channel", "at least 1"),
}


@pytest.mark.parametrize("case", CASES)
def test_a_wrong_option_is_refused_with_its_key(case):
    change, key, words = CASES[case]
    good = {"interface": "virtual", "channel": "here", "frames": frames_of_both()}
    CanOptions.model_validate(good)
    assert any(loc == key and words in text for loc, text in told({**good, **change})), told(
        {**good, **change}
    )


def test_several_problems_are_told_at_once():
    frames = edited("positions", "id", 0x200)["frames"]
    frames["command"]["length"] = 9
    assert len(told({"interface": "virtual", "channel": "here", "frames": frames})) >= 2


def test_keys_layout_sync_and_watchdog_are_told_at_once():
    frames = edited("positions", "signals", "counts_y", "start", 20)["frames"]
    given = {"interface": "virtual", "channel": "here", "frames": frames, "data_bitrate": 5000000}
    given |= {"watchdog_s": 0.1, "sync": {"id": 0x180, "wait_s": 1e-4}}
    assert {key for key, _ in told(given)} == {
        "data_bitrate",
        "frames.positions.signals.counts_y.start",
        "sync.id",
        "watchdog_s",
    }


def test_a_watchdog_signal_that_cannot_be_is_told_once():
    frames = signal("command", "watchdog", bits("watchdog", 34, 6, scale=0.0))["frames"]
    given = {"interface": "virtual", "channel": "here", "frames": frames, "watchdog_s": 0.1}
    assert [key for key, _ in told(given)] == ["frames.command.signals.watchdog.scale"]


def test_counts_must_be_as_wide_as_the_counter():
    driver = CanDriver(options(frames=frames_apart()), channels(24), 1e-3)
    keys = [key for key, _ in driver.problems()]
    assert keys == [("frames", f"state_{a}", "signals", f"counts_{a}", "bits") for a in "xy"]
    assert "counter_bits 24" in driver.problems()[0][1]


def test_an_axis_that_is_not_in_the_layout_or_not_in_the_machine_is_told():
    ((key, text),) = CanDriver(options(), channels(axes="xyz"), 1e-3).problems()
    assert (key, "'z'" in text) == (("frames",), True)
    ((key, text),) = CanDriver(options(), channels(axes="x"), 1e-3).problems()
    assert key == ("frames", "command", "signals", "volts_y", "axis")
    assert "serves: x" in text


def test_volts_that_the_frame_cannot_carry_are_told():
    high = [Channel(a, i, 1e-6, 24, 20.0) for i, a in enumerate("xy")]
    keys = [key for key, _ in CanDriver(options(), high, 1e-3).problems()]
    assert keys == [("frames", "command", "signals", f"volts_{a}", "bits") for a in "xy"]


def volts_problems(**volts):
    frames = frames_of_both()
    for axis in "xy":
        frames["command"]["signals"][f"volts_{axis}"] |= volts
    return CanDriver(options(frames=frames), channels(), 1e-3).problems()


@pytest.mark.parametrize("scale", [10 / 32767, 10 / 32768, -10 / 32768, 0.001])
def test_volts_that_miss_the_limit_by_a_step_at_most_are_enough(scale):
    assert not volts_problems(scale=scale)


@pytest.mark.parametrize(
    ("volts", "key", "words"),
    [
        ({"scale": 25.0}, "scale", "steps of 25 V"),  # 10 V would be sent as 0
        ({"scale": 1e300}, "scale", "0.2 V at most"),
        ({"scale": 0.1, "bits": 8, "signed": False}, "bits", "0 to 25.5 V"),
        ({"scale": 0.15, "bits": 7}, "bits", "-9.6 to 9.45 V"),
    ],
)
def test_volts_that_say_the_limits_roughly_or_not_at_all_are_told(volts, key, words):
    found = volts_problems(**volts)
    assert [k[3:] for k, _ in found] == [("volts_x", key), ("volts_y", key)]
    assert all(words in text and "limits.max_voltage_v 10" in text for _, text in found)


def test_volts_that_cannot_say_zero_are_told():
    found = volts_problems(scale=0.001, offset=0.4e-3 + 1e-3 * 0.6)
    assert not found  # a whole step
    found = volts_problems(scale=0.1, bits=16, offset=0.05)
    assert [k[-1] for k, _ in found] == ["offset", "offset"]
    assert "0 V would be sent as" in found[0][1]


def test_a_read_that_looks_at_too_few_frames_is_told():
    ((key, text),) = CanDriver(options(max_frames_per_read=1), channels(), 1e-3).problems()
    assert key == ("max_frames_per_read",)
    assert "at least" in text


def test_a_watchdog_that_one_late_period_would_trip_is_told():
    chosen = options(
        **signal("command", "watchdog", bits("watchdog", 34, 6, scale=0.001)), watchdog_s=0.0024
    )
    assert not CanDriver(chosen, channels(), 1e-3).problems()
    ((key, text),) = CanDriver(chosen, channels(), 1.1e-3).problems()
    assert key == ("watchdog_s",)
    assert text == "found 0.0024, sent as 0.002 s, must be at least 2 periods of 0.0011 s"


def test_a_wait_shorter_than_the_bus_needs_is_told():
    chosen = options(interface="socketcan", channel="can0", sync={"id": 1, "wait_s": 150e-6})
    ((key, text),) = CanDriver(chosen, channels(), 1e-3).problems()
    assert key == ("sync", "wait_s")
    assert "190.0 us" in text


def test_what_a_layout_leaves_open_is_told_and_is_no_problem():
    bare = {
        "command": {
            "id": 0x200,
            "direction": "command",
            "length": 3,
            "signals": {
                "volts": {"means": "volts", "axis": "x", "start": 0, "bits": 16, "signed": True,
                          "scale": 0.001},
                "on": {"means": "enable", "axis": "x", "start": 16, "bits": 1},
            },
        },
        "state": {
            "id": 0x180,
            "direction": "state",
            "length": 3,
            "signals": {"n": {"means": "counts", "axis": "x", "start": 0, "bits": 24}},
        },
    }  # fmt: skip
    given = {"interface": "virtual", "channel": "advice", "frames": bare}
    driver = CanDriver(CanOptions.model_validate(given), [Channel("x", 0, 1e-6, 24, 10.0)], 1e-3)
    assert not driver.problems()
    said = " ".join(driver.advice())
    for words in ("watchdog", "no sequence in state", "no boot for x", "no estop for x"):
        assert words in said
    assert "no limit_negative and limit_positive for x: a limit switch there is not seen" in said
    for guard in ("guards.amplifier", "guards.encoder_lost", "guards.estop"):
        assert f"the device has no way to tell of one, and {guard} never trips on it" in said


def test_a_limit_switch_that_one_axis_alone_has_is_missed_at_the_others():
    frames = {
        "command": {
            "id": 0x200,
            "direction": "command",
            "length": 6,
            "signals": {
                f"{means}_{axis}": {
                    "means": means,
                    "axis": axis,
                    "start": at + 20 * n,
                    "bits": bits,
                }
                for n, axis in enumerate("xy")
                for means, at, bits in (("volts", 0, 16), ("enable", 16, 1))
            },
        },
        "state": {
            "id": 0x180,
            "direction": "state",
            "length": 7,
            "signals": {
                **{
                    f"n_{axis}": {"means": "counts", "axis": axis, "start": 24 * n, "bits": 24}
                    for n, axis in enumerate("xy")
                },
                "low": {"means": "limit_negative", "start": 48, "bits": 1},
                "high_y": {"means": "limit_positive", "axis": "y", "start": 49, "bits": 1},
            },
        },
    }
    for axis in "xy":
        signal = frames["command"]["signals"][f"volts_{axis}"]
        signal |= {"signed": True, "scale": 0.001}
    given = {"interface": "virtual", "channel": "switches", "frames": frames}
    axes = [Channel(axis, n, 1e-6, 24, 10.0) for n, axis in enumerate("xy")]
    driver = CanDriver(CanOptions.model_validate(given), axes, 1e-3)
    assert not driver.problems()
    told = [said for said in driver.advice() if "limit_" in said]
    assert len(told) == 1
    assert told[0].startswith("no limit_positive for x: ")
