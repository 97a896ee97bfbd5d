"""The codec of the CAN driver agrees with cantools, bit by bit, inline and from DBC files."""

import math
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import cantools
import numpy as np
import pytest
from can_bench import COMMAND, STATE, Bench, answering, bits, bus, frames_of_both, message, opened
from hypothesis import given, settings
from hypothesis import strategies as st

from motorctl.hal import Channel, Inputs, Outputs, Status
from motorctl_can import CanDriver, CanOptions

pytestmark = pytest.mark.wall_clock(lanes=3)

LENGTHS = (*range(1, 9), 12, 16, 20, 24, 32, 48, 64)
NAMES = {"x": "X", "y": "Y"}


@st.composite
def placed(draw, wanted):
    """Return the signals with their places, little and big endian mixed, and the frame's length."""
    signals, byte = [], 0
    for name, width, more in draw(st.permutations(wanted)):
        gap, big = draw(st.integers(0, 7)), draw(st.booleans())
        line = 8 * byte + gap
        start = line // 8 * 8 + 7 - line % 8 if big else line
        signals.append({"name": name, "bits": width, "start": start, "big": big, **more})
        byte += (gap + width + 7) // 8
    return signals, draw(st.sampled_from([n for n in LENGTHS if n >= byte]))


@st.composite
def layouts(draw):
    counter = draw(st.integers(2, 64))
    scale = draw(st.sampled_from([0.0005, 10 / 32767, 0.25, -0.01, 1.0]))
    # 0 V can be said exactly
    offset = scale * draw(st.integers(-100, 0)) if scale > 0 else scale * draw(st.integers(-9, 9))
    volt_bits = draw(st.integers(9, 32))
    signed = draw(st.booleans()) or offset * scale > 0
    volts = {"scale": scale, "offset": offset, "signed": signed}
    commands = [("VoltsX", volt_bits, volts), ("VoltsY", volt_bits, volts)]
    commands += [("EnableX", 1, {}), ("EnableY", 1, {}), ("Number", 8, {})]
    counts_signed = {"signed": draw(st.booleans())}
    states = [("CountsX", counter, counts_signed), ("CountsY", counter, counts_signed)]
    states += [("LostX", draw(st.integers(1, 9)), {}), ("Chain", 1, {})]
    states += [("Number", draw(st.integers(4, 20)), {})]
    return draw(placed(commands)), draw(placed(states)), counter


def dbc_text(command, state):
    def lines(identifier, name, layout, sender, receiver):
        signals, length = layout
        yield f"BO_ {identifier} {name}: {length} {sender}"
        for s in signals:
            order, sign = 0 if s["big"] else 1, "-" if s.get("signed") else "+"
            scale = f"({s.get('scale', 1)!r},{s.get('offset', 0)!r})"
            place = f"{s['start']}|{s['bits']}@{order}{sign}"
            yield f' SG_ {s["name"]} : {place} {scale} [0|0] "" {receiver}'

    text = ['VERSION ""', "BU_: host device"]
    text += lines(COMMAND, "Command", command, "host", "device")
    text += lines(STATE, "State", state, "device", "host")
    return "\n".join(text) + "\n"


MEANS = {
    "Volts": "volts",
    "Enable": "enable",
    "Counts": "counts",
    "Lost": "encoder_lost",
    "Chain": "estop",
    "Number": "sequence",
}


def inline(identifier, direction, layout):
    signals, length = layout
    table = {}
    for s in signals:
        name = s["name"]
        stem, axis = (name[:-1], name[-1].lower()) if name[-1] in "XY" else (name, "all")
        table[name] = {
            "means": MEANS[stem],
            "axis": axis,
            "start": s["start"],
            "bits": s["bits"],
            "byte_order": "big" if s["big"] else "little",
            "inverted": name == "Chain",
            **{key: s[key] for key in ("scale", "offset", "signed") if key in s},
        }
    return {"id": identifier, "direction": direction, "length": length, "signals": table}


def from_dbc():
    axes = {
        a: {
            "volts": f"Command.Volts{n}",
            "enable": f"Command.Enable{n}",
            "counts": f"State.Counts{n}",
        }
        for a, n in NAMES.items()
    }
    axes["x"]["encoder_lost"] = "State.LostX"
    numbers = ["Command.Number", "State.Number"]
    chain = {"signal": "State.Chain", "inverted": True}
    return {**axes, "all": {"sequence": numbers, "estop": chain}}


def whole(value, bits, signed):
    value &= (1 << bits) - 1
    return value - (1 << bits) if signed and value >> (bits - 1) else value


@pytest.mark.slow
@settings(max_examples=40)
@given(layouts(), st.booleans(), st.data())
def test_what_cantools_encodes_is_read_and_what_is_written_cantools_decodes(layout, dbc, data):
    command, state, counter = layout
    text = dbc_text(command, state)
    database = cantools.database.load_string(text, "dbc")
    with TemporaryDirectory() as folder:
        given_options = {"interface": "virtual", "channel": "codec", "fd": True, "max_age_s": 0}
        if dbc:
            Path(folder, "some.dbc").write_text(text)
            given_options |= {"dbc": "some.dbc", "signals": from_dbc()}
        else:
            frames = {
                "command": inline(COMMAND, "command", command),
                "state": inline(STATE, "state", state),
            }
            given_options["frames"] = frames
        chosen = CanOptions.model_validate(given_options, context={"directory": folder})

    def raw_state(number):
        values = {}
        for s in state[0]:
            value = whole(data.draw(st.integers(0, 2**64 - 1)), s["bits"], s.get("signed", False))
            values[s["name"]] = value
        bits = next(s["bits"] for s in state[0] if s["name"] == "Number")
        values["Number"] = number & (1 << bits) - 1
        return values

    def encoded(values):
        return bytes(database.encode_message("State", values, scaling=False))

    with bus(chosen.channel) as peer:
        bench = Bench(chosen, peer, counter)
        with answering(peer, {STATE: encoded(raw_state(0))}):
            bench.driver.open()
        try:
            for k in range(1, 4):
                values = raw_state(k)
                bench.send(encoded(values), is_fd=True)
                counts, status = bench.read()
                # a counter of 64 bits without sign wraps into the loop's int64
                assert counts == [whole(values[f"Counts{n}"], 64, True) for n in "XY"]
                estop = 0 if values["Chain"] else int(Status.ESTOP)
                lost = int(Status.ENCODER_LOST) if values["LostX"] else 0
                assert status == [estop | lost, estop]
            bench.sent()
            for _ in range(3):
                volts = data.draw(st.tuples(*[st.floats(-40, 40)] * 2))
                enable = data.draw(st.tuples(*[st.integers(0, 1)] * 2))
                bench.outputs.volts[:], bench.outputs.enable[:] = volts, enable
                bench.driver.write(bench.outputs)
                (got,) = bench.sent()
                decoded = database.decode_message("Command", bytes(got.data), scaling=False)
                for i, n in enumerate("XY"):
                    s = next(s for s in command[0] if s["name"] == f"Volts{n}")
                    assert decoded[f"Enable{n}"] == enable[i]
                    assert decoded[f"Volts{n}"] == wanted_raw(volts[i] * enable[i], s)
        finally:
            bench.driver.close()


def wanted_raw(volts, signal):
    bits, signed = signal["bits"], signal["signed"]
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    raw = int(np.rint((volts - signal["offset"]) / signal["scale"]))
    return min(max(raw, low), high)


def sent_volts(bench, volts, enable):
    bench.outputs.volts[:], bench.outputs.enable[:] = volts, enable
    bench.driver.write(bench.outputs)
    (got,) = bench.sent()
    data = bytes(got.data)
    raw = [int.from_bytes(data[i : i + 2], "little", signed=True) for i in (0, 2)]
    return [r * 0.0005 for r in raw], [data[4] & 1, data[4] >> 1 & 1], data[5]


def test_volts_are_clamped_and_never_wrapped():
    with opened() as bench:

        @given(st.floats(allow_nan=False, width=64))
        def ask(volts):
            (sent, _), _, _ = sent_volts(bench, (volts, 0.0), 1)
            assert sent == pytest.approx(min(max(volts, -16.384), 16.3835), abs=0.00026)

        ask()


def test_not_a_number_disables_its_axis_and_sends_zero():
    with opened() as bench:
        volts, enable, _ = sent_volts(bench, (math.nan, 2.0), 1)
        assert (volts, enable) == ([0.0, 2.0], [0, 1])


def test_disabled_means_zero_volts_whatever_is_asked():
    with opened() as bench:
        volts, enable, _ = sent_volts(bench, (5.0, -5.0), (0, 1))
        assert (volts, enable) == ([0.0, -5.0], [0, 1])


def test_the_sequence_of_commands_counts_every_frame_and_wraps():
    with opened() as bench:
        numbers = [sent_volts(bench, 0.0, 0)[2] for _ in range(300)]
        assert all((b - a) % 256 == 1 for a, b in pairwise(numbers))


def test_one_enable_for_all_is_on_only_while_every_axis_is_enabled():
    frames = frames_of_both()
    signals = frames["command"]["signals"]
    del signals["enable_x"], signals["enable_y"]
    signals["enable"] = bits("enable", 32, 1, inverted=True)
    with opened(frames=frames) as bench:
        wire = [sent_volts(bench, 0.0, both)[1][0] for both in ((0, 0), (1, 0), (0, 1), (1, 1))]
        assert wire == [1, 1, 1, 0]  # inverted: 1 is off


def test_the_watchdog_time_is_in_every_command():
    frames = frames_of_both()
    frames["command"]["length"] = 7
    frames["command"]["signals"]["watchdog"] = bits("watchdog", 48, 8, scale=0.001)
    with opened(frames=frames, watchdog_s=0.02) as bench:
        for _ in range(2):
            bench.driver.write(bench.outputs)
        bench.driver.safe()
        assert {m.data[6] for m in bench.sent()} == {20}


def test_an_axis_alone_needs_no_second():
    frames = {
        "command": inline(
            COMMAND,
            "command",
            (
                [
                    {"name": "VoltsX", "bits": 16, "start": 0, "big": False, "signed": True}
                    | {"scale": 0.001},
                    {"name": "EnableX", "bits": 1, "start": 16, "big": False},
                ],
                3,
            ),
        ),
        "state": inline(
            STATE,
            "state",
            (
                [
                    {"name": "CountsX", "bits": 16, "start": 7, "big": True},
                ],
                2,
            ),
        ),
    }
    chosen = CanOptions.model_validate(
        {"interface": "virtual", "channel": "alone", "frames": frames}
    )
    with bus("alone") as peer:
        driver = CanDriver(chosen, [Channel("x", 3, 1e-6, 16, 10.0)], 1e-3)
        assert not driver.problems()
        with answering(peer, {STATE: b"\x12\x34"}):
            driver.open()
        inputs = Inputs(1)
        peer.send(message(b"\x12\x35"))
        driver.read(inputs)
        assert (inputs.counts[0], inputs.status[0]) == (0x1235, 0)
        driver.write(Outputs(1))
        driver.close()
