"""`motorctl gantry-device`: device files with mistakes, and the process itself."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import yaml
from gantry_device_bench import CHANNEL, MODBUS, SerialPeer, device_data, write_device
from gantry_device_frames import CHANNELS, FRAMES

from motorctl.errors import ConfigError, RunError, UsageError
from motorctl_devices import load_device
from motorctl_devices.orders import KEYS

pytestmark = pytest.mark.wall_clock(lanes=3)

TCP = {"modbus": {"tcp": {"port": 0}, **MODBUS}}


def _can(**changes: Any) -> dict[str, Any]:
    bus = {"interface": "virtual", "channel": "refused", "frames": FRAMES} | changes
    return device_data({"can": bus}, channels=CHANNELS)


def _without(serve: dict[str, Any], key: str) -> dict[str, Any]:
    return {"modbus": {k: v for k, v in serve["modbus"].items() if k != key}}


@pytest.mark.parametrize(
    ("data", "key", "words"),
    [
        (device_data(TCP, rate_hz="fast"), "rate_hz", "should be a number"),
        (device_data(TCP, speed=1), "speed", "unknown key"),
        (device_data({}), "serve", "one of can, canopen, serial and modbus"),
        (device_data({**TCP, "serial": {}}), "serve", "one of can, canopen, serial and modbus"),
        (device_data(TCP, gantry={"preset": "moon"}), "gantry.preset", "published_gantry"),
        (
            device_data(TCP, gantry={"plants": {0: {"mass": 1}}}),
            "gantry.plants.0.mass",
            "unknown key",
        ),
        (device_data(_without(TCP, "tcp")), "serve.modbus", "one of tcp and rtu"),
        (device_data(_without(TCP, "channels")), "serve.modbus.channels", "is missing"),
        (device_data(TCP, channels=[CHANNEL]), "serve.modbus.channels.1", "has 1 channels"),
        (
            device_data(TCP, channels=[dict(CHANNEL, counter_bits=16), CHANNEL]),
            "serve.modbus.channels.0.counts.bits",
            "found 32, the channel's counter_bits are 16",
        ),
        (
            device_data({"serial": {}}, channels=[dict(CHANNEL, counter_bits=64)]),
            "channels",
            "at most 32 bits",
        ),
        (_can(channel=None), "serve.can", "takes a channel"),
        (_can(frames={"command": FRAMES["command"]}), "serve.can.frames", "needs one counts"),
        (
            _can(frames={**FRAMES, "state": {**FRAMES["state"], "length": 12}}),
            "serve.can.frames.state.length",
            "no frame has that length",
        ),
        (
            _can(frames={**FRAMES, "state": {**FRAMES["state"], "length": 6}}),
            "serve.can.frames.state.signals",
            "",
        ),
        (_can(frames=None, dbc="none.dbc", signals={"x": {}}), "serve.can.dbc", "none.dbc"),
        (
            device_data(TCP, faults=[{"kind": "delay", "at_s": 1}]),
            "faults[0]",
            "delay needs amount_s",
        ),
        (device_data(TCP, faults=[{"kind": "dely", "at_s": 1}]), "faults[0].kind", "'delay'?"),
        (
            device_data(TCP, faults=[{"kind": "loss", "at_s": 1, "share": 0.1, "every": 2}]),
            "faults[0]",
            "one of share and every",
        ),
        (
            device_data(TCP, faults=[{"kind": "reset", "at_s": 1}]),
            "faults[0]",
            "reset needs duration_s",
        ),
        (
            device_data(TCP, faults=[{"kind": "counter_wrap", "counts": 1, "channel": 7}]),
            "faults[0].channel",
            "2 channels",
        ),
    ],
)
def test_a_mistake_is_told_with_file_line_and_key(tmp_path, data, key, words) -> None:
    path = write_device(tmp_path, data)
    with pytest.raises(ConfigError) as refused:
        load_device(path)
    found = [p for p in refused.value.problems if p.key == key]
    assert found, str(refused.value)
    assert words in found[0].message
    assert found[0].file == str(path)
    if key in data:
        lines = path.read_text().splitlines()
        assert lines[(found[0].line or 0) - 1].startswith(f"{key}:")
    else:
        assert found[0].line is not None


def test_the_example_of_the_page_is_a_device(tmp_path) -> None:
    page = Path(__file__).parents[2] / "docs" / "drivers" / "gantry_device.md"
    example = page.read_text().split("```yaml\n")[1].split("```")[0]
    path = tmp_path / "box.yaml"
    path.write_text(example)
    device = load_device(path, tmp_path / "link")
    device.release()
    assert [fault.order.kind for fault in device.schedule.faults] == ["bit_errors", "reset"]


def test_the_page_names_every_fault_with_its_keys() -> None:
    page = Path(__file__).parents[2] / "docs" / "drivers" / "gantry_device.md"
    rows: dict[str, str] = {}
    for row in page.read_text().splitlines():
        if row.startswith("| `"):
            rows.setdefault(row.split("|")[1].strip(), row)  # the first table is of the keys
    for kind, keys in KEYS.items():
        for key in keys:
            assert key.rstrip("*") in rows[f"`{kind}`"], (kind, key)


def test_a_link_needs_a_serial_port(tmp_path) -> None:
    with pytest.raises(UsageError, match="no serial port"):
        load_device(write_device(tmp_path, device_data(TCP)), tmp_path / "link")


def _open_and_close(path: Path, link: Path) -> None:
    device = load_device(path, link)
    device.open()
    try:
        assert str(link.readlink()) == device.endpoint.address
    finally:
        device.close()


@pytest.mark.parametrize("old", [None, "/dev/pts/99999"])
def test_a_link_takes_the_place_of_one_that_a_run_left(tmp_path, old) -> None:
    link = tmp_path / "box"
    if old is not None:
        link.symlink_to(old)
    _open_and_close(write_device(tmp_path, device_data({"serial": {}})), link)
    assert not link.is_symlink()


def test_a_link_takes_the_place_of_one_to_a_living_terminal(tmp_path) -> None:
    link = tmp_path / "box"
    numbers = os.openpty()
    link.symlink_to(os.ttyname(numbers[1]))
    _open_and_close(write_device(tmp_path, device_data({"serial": {}})), link)
    for number in numbers:
        os.close(number)


@pytest.mark.parametrize("target", ["precious", "/dev/null", "/dev/pts/../null", "gone"])
def test_a_link_to_anything_else_is_refused_and_stays(tmp_path, target) -> None:
    (tmp_path / "precious").write_text("a user's own")
    link = tmp_path / "box"
    link.symlink_to(target)
    device = load_device(write_device(tmp_path, device_data({"serial": {}})), link)
    with pytest.raises(RunError, match=f"^--link {link}: points to {target}, .*another path$"):
        device.open()
    device.release()
    assert str(link.readlink()) == target
    assert (tmp_path / "precious").read_text() == "a user's own"


def test_a_port_in_use_is_one_clear_message(tmp_path) -> None:
    first = load_device(write_device(tmp_path, device_data(TCP)))
    first.open()
    try:
        port = int(first.endpoint.address.rsplit(":")[-1])
        serve = {"modbus": {**TCP["modbus"], "tcp": {"port": port}}}
        second = load_device(write_device(tmp_path, device_data(serve)))
        with pytest.raises(RunError, match=f"127.0.0.1:{port}"):
            second.open()
        second.release()
    finally:
        first.close()


MAIN = "from motorctl.cli import main; main()"
NO_CAN = f"import sys; sys.modules['can'] = sys.modules['cantools'] = None; {MAIN}"
"""The command line where the libraries of CAN are not installed."""


def _start(path: Path, *options: str, main: str = MAIN) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", main, "gantry-device"]
    return subprocess.Popen(
        [*command, str(path), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_the_command_serves_until_a_signal_and_reports(tmp_path, number) -> None:
    link = tmp_path / "box"
    silence = {"kind": "loss", "at_s": 0.0, "every": 2}
    path = write_device(tmp_path, device_data({"serial": {}}, watchdog_s=0.1, faults=[silence]))
    with _start(path, "--link", str(link), "--json") as process:
        try:
            assert process.stderr is not None
            ready = process.stderr.readline()
            assert ready == f"ready: {link.readlink()}\n"
            with SerialPeer(link) as peer:
                peer.hello(watchdog_ms=30)
                peer.command((1.0, 0.0))
                time.sleep(0.2)
                for _ in range(4):
                    peer.send(4)
                time.sleep(0.1)
            process.send_signal(number)
            out, err = process.communicate(timeout=20)
        finally:
            process.kill()
    assert (process.returncode, err) == (0, "")
    told = json.loads(out)  # and nothing else is on stdout
    assert told["watchdog_trips"] == 1
    assert told["commands"] == 1
    assert told["exchanges"] >= 5
    assert told["samples"] > 5
    (fault,) = told["faults"]
    assert (fault["kind"], fault["at_s"], fault["fired"]) == ("loss", 0.0, 2)
    assert 0.02 <= fault["off_after_s"] < 0.15  # the watchdog took the amplifier away
    assert 0.03 <= told["watchdog_after_s"] < 0.13
    *_, (off_s, until_s) = told["off_s"]
    assert off_s < time.monotonic()
    assert until_s is None
    assert told["longest_pause_s"] >= 0.0
    assert told["travelled_counts"][0][1] > 10
    assert not link.is_symlink()


@pytest.mark.slow
@pytest.mark.parametrize("serve", [{"serial": {}}, TCP], ids=["serial", "modbus"])
def test_without_json_the_endpoint_is_on_stdout_and_no_bus_needs_the_libraries_of_can(
    tmp_path, serve
) -> None:
    with _start(write_device(tmp_path, device_data(serve)), main=NO_CAN) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline().startswith("ready: ")
            process.send_signal(signal.SIGTERM)
            out, err = process.communicate(timeout=20)
        finally:
            process.kill()
    assert (process.returncode, out, err) == (0, "", "")


@pytest.mark.slow
def test_without_the_libraries_of_can_its_device_says_how_to_install_them(tmp_path) -> None:
    path = write_device(tmp_path, _can())
    with _start(path, main=NO_CAN) as process:
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert err.startswith(f"motorctl: {path}:")
    assert "serve.can: module 'can' is missing; pip install 'motorctl[can]'" in err


@pytest.mark.slow
def test_a_wrong_file_ends_the_command_with_status_2_and_one_line(tmp_path) -> None:
    path = tmp_path / "device.yaml"
    path.write_text(yaml.safe_dump(device_data(TCP, rate_hz=-1)))
    with _start(path) as process:
        out, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert out == ""
    assert err.startswith(f"motorctl: {path}:")
    assert "rate_hz" in err
    assert len(err.splitlines()) == 1
