"""Signals may be named in a DBC file: what is read of it, and what is refused, with its key."""

import pickle

import pytest
from can_bench import channels, told

from motorctl.hal import Channel
from motorctl_can import CanDriver, CanOptions

DBC = """VERSION ""
BU_: host device
BO_ 512 Command: 6 host
 SG_ VoltsX : 0|16@1- (0.0005,0) [-16.384|16.3835] "V" device
 SG_ VoltsY : 16|16@1- (0.0005,0) [-12|12] "V" device
 SG_ EnableX : 32|1@1+ (1,0) [0|1] "" device
 SG_ EnableY : 33|1@1+ (1,0) [0|1] "" device
 SG_ Sequence : 40|8@1+ (1,0) [0|255] "" device
BO_ 2147484032 Positions: 8 device
 SG_ CountX : 7|24@0- (0.0005,3) [0|0] "mm" host
 SG_ CountY : 31|24@0- (1,0) [0|0] "" host
 SG_ ChainClosed : 48|1@1+ (1,0) [0|1] "" host
 SG_ Sequence : 56|8@1+ (1,0) [0|255] "" host
BO_ 385 Muxed: 8 device
 SG_ Which M : 0|8@1+ (1,0) [0|0] "" host
 SG_ First m0 : 8|24@1- (1,0) [0|0] "" host
BO_ 386 Floats: 8 device
 SG_ Metres : 0|32@1- (1,0) [0|0] "m" host
SIG_VALTYPE_ 386 Metres : 1;
"""
POINTERS = {
    "x": {"volts": "Command.VoltsX", "enable": "Command.EnableX", "counts": "Positions.CountX"},
    "y": {"volts": "Command.VoltsY", "enable": "Command.EnableY", "counts": "Positions.CountY"},
    "all": {
        "sequence": ["Command.Sequence", "Positions.Sequence"],
        "estop": {"signal": "Positions.ChainClosed", "inverted": True},
    },
}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "bench.dbc").write_text(DBC)
    return tmp_path


def dbc_options(**pointers):
    signals = {axis: {**POINTERS.get(axis, {}), **more} for axis, more in pointers.items()}
    return {
        "interface": "virtual",
        "channel": "here",
        "dbc": "bench.dbc",
        "signals": {**POINTERS, **signals},
    }


def test_a_dbc_file_stands_beside_the_yaml_file_and_its_absolute_path_is_kept(folder, monkeypatch):
    chosen = CanOptions.model_validate(dbc_options(), context={"directory": folder})
    assert chosen.dbc == folder / "bench.dbc"
    command, positions = chosen.layout.frames
    assert (command.identifier, command.extended, command.command) == (512, False, True)
    assert (positions.identifier, positions.extended, positions.command) == (384, True, False)
    assert not CanDriver(chosen, channels(), 1e-3).problems()
    assert pickle.loads(pickle.dumps(chosen)).layout == chosen.layout
    again = CanOptions.model_validate(chosen.model_dump(mode="json"))
    assert (again, again.layout) == (chosen, chosen.layout)
    monkeypatch.chdir(folder)
    assert CanOptions.model_validate(dbc_options()).dbc == folder / "bench.dbc"


@pytest.mark.parametrize(
    ("more", "key", "words"),
    [
        ({"x": {"counts": "Positions.ContX"}}, "signals.x.counts", "did you mean 'Positions.Count"),
        ({"x": {"counts": "Muxed.First"}}, "signals.x.counts", "multiplexed"),
        ({"x": {"counts": "Floats.Metres"}}, "signals.x.counts", "floating-point"),
        ({"y": {"counts": "Positions.CountX"}}, "signals.y.counts", "signals.x.counts already"),
        ({"x": {"volts": "Positions.CountX"}}, "signals.x.counts", "already"),
        ({"x": {"encoder_lost": "Command.Sequence"}}, "signals.all.sequence.0", "already"),
        ({"x": {"stop": "Command.Sequence"}}, "signals.x.stop.[key]", "estop"),
        ({"z": {"volts": "Command.Sequence"}}, "signals.z.volts", "already"),
    ],
)
def test_a_wrong_pointer_into_a_dbc_file_is_refused(folder, more, key, words):
    found = told(dbc_options(**more), {"directory": folder})
    assert any(loc == key and words in text for loc, text in found), found


@pytest.mark.parametrize("counts", [None, 3, True])
def test_a_pointer_that_is_none_is_one_message(folder, counts):
    (found,) = told(dbc_options(y={"counts": counts}), {"directory": folder})
    text = "should be Frame.Signal, {signal: Frame.Signal, inverted: true}, or a list of"
    assert (found[0], text in found[1]) == ("signals.y.counts", True)


def test_an_axis_that_dbc_pointers_leave_incomplete_is_refused(folder):
    given = dbc_options()
    given["signals"] = {**POINTERS, "y": {"counts": "Positions.CountY"}}
    found = told(given, {"directory": folder})
    text = (
        "axis 'y' has no volts; every axis needs volts, enable and counts (the layout names: x, y)"
    )
    assert ("signals", text) in found


@pytest.mark.parametrize("text", [None, "", "BO_ nonsense", DBC.replace("31|24@0-", "23|24@0-")])
def test_a_dbc_file_that_is_missing_or_broken_is_refused(tmp_path, text):
    assert text != DBC
    if text is not None:
        (tmp_path / "bench.dbc").write_text(text)
    found = told(dbc_options(), {"directory": tmp_path})
    assert {loc.split(".")[0] for loc, _ in found} <= {"dbc", "signals"}


def test_a_dbc_file_limits_the_volts_that_are_sent(folder):
    chosen = CanOptions.model_validate(dbc_options(), context={"directory": folder})
    wide = [Channel(a, i, 1e-6, 24, 13.0) for i, a in enumerate("xy")]
    ((key, text),) = CanDriver(chosen, wide, 1e-3).problems()
    assert key == ("signals", "y", "volts")
    assert "-12 to 12 V" in text
