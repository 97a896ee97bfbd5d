"""The gantries behind their buses, and hands for systemd and for the daemon."""

from __future__ import annotations

import contextlib
import json
import re
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import loop_config
from transcript import RESULT

MOTORCTL = "/opt/motorctl/bin/motorctl"
BUSES = {"left": "vcan0", "right": "vcan1"}
DRIVES, DRIVES_BUS = "drives", "vcan2"
"""The gantry that is two drives on CANopen."""
RATE_HZ = 25
"""Two loops and two devices on two emulated processors, which may have less than a real one: at
50 Hz one daemon alone took half of a processor on a slow day."""
SLOWER = 0.4
"""What is left of the bandwidth of the gains, which are for 100 Hz."""
PAUSE_S = 0.9
"""For so long it stands still at times, as the computer that emulates it has other work."""
DRIVES_PAUSE_S = 0.76
"""What the drives' watchdog leaves of it: they wait no longer than that less a heartbeat's time."""
PATIENCE_S = 900.0
"""An emulated processor is slow, and some days slower: a start took 70 s, or more than 300 s."""
DEVICE_WATCHDOG_S = loop_config.device_file()["watchdog_s"]
COMPILED = "/var/cache/motorctl"
ENVIRONMENT = "NUMBA_CPU_NAME=generic OMP_NUM_THREADS=1"
DEVICE_UNIT = f"""[Unit]
Description=the gantry behind %i
[Service]
Environment={ENVIRONMENT} CACHE_DIRECTORY=/var/cache/device
ExecStartPre=/bin/sh -c "modprobe vcan; [ -e /sys/class/net/%i ] || ip link add dev %i type vcan"
# that it is up is the business of the rules that motorctl installs
ExecStartPre=/bin/sh -c "until ip -o link show %i | grep -q '[<,]UP[,>]'; do sleep 0.2; done"
ExecStart={MOTORCTL} gantry-device /job/device-%i.yaml --json
StandardOutput=append:{RESULT}/device-%i.jsonl
StandardError=journal
[Install]
WantedBy=multi-user.target
"""


def shell(command: str, status: int = 0, timeout_s: float = PATIENCE_S) -> str:
    """Run a command and return what it said. Raises RuntimeError where its status is another."""
    done = subprocess.run(
        ["/bin/bash", "-c", command],
        capture_output=True,
        text=True,
        check=False,
        timeout=timeout_s,
    )
    said = f"{done.stdout}{done.stderr}".strip()
    if done.returncode != status:
        raise RuntimeError(f"{command}: exit status {done.returncode}, not {status}: {said}")
    return said


def wait_for(what: str, reached: Callable[[], Any], timeout_s: float = PATIENCE_S) -> float:
    """Wait until something is so; return how long that took. Raises TimeoutError."""
    began = time.monotonic()
    while not reached():
        if time.monotonic() - began > timeout_s:
            raise TimeoutError(f"{what}: not within {timeout_s:g} s")
        time.sleep(0.05)
    return time.monotonic() - began


def write_files() -> None:
    """Write configurations and device files, and the unit of the devices."""
    for name, bus in BUSES.items():
        device = loop_config.device_file()
        device["serve"]["can"]["channel"] = bus
        _write_gantry(name, bus, loop_config.can_driver() | {"channel": bus}, device)
    _write_gantry(DRIVES, DRIVES_BUS, drives_driver(), drives_device())
    Path("/etc/systemd/system/device@.service").write_text(DEVICE_UNIT)
    # code that was compiled outside, for every processor
    drop_in = Path("/etc/systemd/system/motorctl@.service.d/emulated.conf")
    drop_in.parent.mkdir(exist_ok=True)
    drop_in.write_text(f"[Service]\nEnvironment={ENVIRONMENT}\nTimeoutStartSec={PATIENCE_S:.0f}\n")
    shell(f"cp -a /job/kept/motorctl {COMPILED}; cp -a {COMPILED} /var/cache/device")
    shell("systemctl daemon-reload")


def _write_gantry(name: str, bus: str, driver: dict[str, Any], device: dict[str, Any]) -> None:
    driver["late"] = {"hold_ticks": RATE_HZ, "predict": True}
    machine = loop_config.config(driver) | {"name": name, "rate_hz": RATE_HZ}
    # no emulated processor wakes up that exactly, and the supervisor waits for it, too
    # beside the others, the third gantry's has least of all
    timeout_s = 10.0 if name == DRIVES else 2.0
    machine["loop"] |= {"spin_s": 0.0, "supervisor_timeout_s": timeout_s}
    for axis in machine["axes"].values():
        axis["guards"] = {"host_frozen": {"time_s": DRIVES_PAUSE_S if name == DRIVES else PAUSE_S}}
        axis["gains"] = axis["gains"] | {"k1_1_s": SLOWER * axis["gains"]["k1_1_s"]}
        axis["gains"]["ks_v_s_m"] *= SLOWER
        axis["adaptation"]["filter_rad_s"] *= SLOWER
        axis["encoder"]["counter_bits"] = device["channels"][0]["counter_bits"]
    Path(f"/job/{name}.yaml").write_text(json.dumps(machine, indent=1))
    device["rate_hz"] = RATE_HZ
    Path(f"/job/device-{bus}.yaml").write_text(json.dumps(device))


def drives_driver() -> dict[str, Any]:
    """Return the options of two drives; they act at once, so the list is the other gantries'."""
    nodes = {axis: {"node": number, "rated_torque_v": 10} for number, axis in enumerate("xy", 1)}
    return {
        "type": "canopen",
        "interface": "socketcan",
        "channel": DRIVES_BUS,
        "nodes": nodes,
        "sync": {"wait_s": 0.7 / RATE_HZ},
        "command_at": "arrival",
        "watchdog_s": DEVICE_WATCHDOG_S,
        "heartbeat_s": 0.5 * PAUSE_S,
        "open_timeout_s": 60.0,
    }


def drives_device() -> dict[str, Any]:
    """Return the file of these drives."""
    device = loop_config.device_file()
    for channel in device["channels"]:
        channel["counter_bits"] = 32
    nodes = [{"node": number, "rated_torque_v": 10.0} for number in (1, 2)]
    canopen = {"interface": "socketcan", "channel": DRIVES_BUS, "nodes": nodes}
    return device | {"serve": {"canopen": canopen}}


class Service:
    """One gantry as systemd and its clients see it."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.unit = f"motorctl@{name}.service"
        self.bus = DRIVES_BUS if name == DRIVES else BUSES[name]

    def show(self, key: str) -> str:
        """Return a property of the unit."""
        return shell(f"systemctl show --value -p {key} {self.unit}")

    @property
    def restarts(self) -> int:
        """How often systemd has started it anew."""
        return int(self.show("NRestarts"))

    @property
    def supervisor(self) -> int:
        """The process that systemd watches."""
        return int(self.show("MainPID"))

    @property
    def loop(self) -> int:
        """The process that ticks."""
        pid: int = self.ask("status")["loop"]["pid"]
        return pid

    def ask(self, do: str, **arguments: Any) -> dict[str, Any]:
        """Send one request. Raises RuntimeError where it is refused, OSError where nobody hears."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
            connection.settimeout(60)
            connection.connect(f"/run/motorctl/{self.name}/motorctl.sock")
            connection.sendall(json.dumps({"id": 1, "do": do, **arguments}).encode() + b"\n")
            answer: dict[str, Any] = json.loads(connection.makefile().readline())
        if not answer["ok"]:
            raise RuntimeError(f"{do} {arguments}: {answer['error']['message']}")
        return answer

    def axis(self, axis: str = "x") -> dict[str, Any]:
        """Return the status of an axis."""
        status: dict[str, Any] = self.ask("status")["axes"][axis]
        return status

    def ready(self) -> bool:
        """Tell whether it ticks."""
        if self.show("ActiveState") != "active":
            return False
        try:
            return bool(self.ask("status")["loop"]["phase"] == "running")
        except (OSError, ValueError):
            return False

    def wait_until_anew(self, restarts: int) -> float:
        """Wait until systemd has started it once more; return how long that took."""
        took = wait_for("the restart", lambda: self.restarts > restarts and self.ready())
        if self.restarts != restarts + 1:
            raise RuntimeError(f"started anew {self.restarts - restarts} times")
        return took

    def begin_to_move(self, velocity_m_s: float = 0.01) -> None:
        """Enable x and let it go on a way of many seconds, to the far end from here."""
        wait_for("standing still", self.start)
        far = 0.35 if self.axis()["position_m"] < 0.2 else 0.05
        wait_for("the order", lambda: self._move(far, velocity_m_s), 60)
        wait_for("the motion", lambda: abs(self.axis()["velocity_m_s"]) > 0.3 * velocity_m_s)

    def _move(self, position_m: float, velocity_m_s: float) -> bool:
        """Tell x to go there, and tell whether the order came in time: the emulator pauses."""
        try:
            self.ask("move", axis="x", position_m=position_m, velocity_m_s=velocity_m_s)
        except RuntimeError as error:
            if "try again" in str(error) or "did not answer within" in str(error):
                return False
            raise
        return True

    def start(self) -> bool:
        """Enable x, and tell whether it could be: it may still coast."""
        if self.axis()["state"] == "fault":
            raise RuntimeError(self.axis()["fault"]["message"])
        try:
            self.ask("start", axis="x", hold=True)
        except RuntimeError as error:
            if "motorctl reset" in str(error):  # the emulator paused, and the device with it
                with contextlib.suppress(RuntimeError):
                    self.ask("reset", axis="x")
                return False
            if "moves" in str(error):
                return False
            raise
        return True

    def insist_on_off(self) -> None:
        """Raise RuntimeError unless nothing is enabled, as it is after each start."""
        states = {name: axis["state"] for name, axis in self.ask("status")["axes"].items()}
        if set(states.values()) != {"off"}:
            raise RuntimeError(f"after the start: {states}")


@dataclass
class Seen:
    """Commands on a bus: when each came, and whether it enabled a motor."""

    commands: list[tuple[float, bool, bool]] = field(default_factory=list)
    """Time [s], whether any motor was enabled, whether any voltage was not zero."""

    def safe_after(self, moment: float) -> float:
        """Return how long after a moment the last command that enables was out of force [s].

        That is when the next command disabled, or the device's own watchdog did, whatever came
        first. Raises RuntimeError where a command enabled after the first that did not, or none
        was seen before the moment.
        """
        before = [enabled for at, enabled, _ in self.commands if at < moment]
        if not before or not before[-1]:
            raise RuntimeError("no motor was enabled before")
        after = [entry for entry in self.commands if entry[0] >= moment]
        disabled = next((k for k, entry in enumerate(after) if not entry[1]), len(after))
        if any(enabled or volts for _, enabled, volts in after[disabled:]):
            raise RuntimeError("a motor was enabled again")
        last = max([at for at, enabled, _ in self.commands if enabled], default=moment)
        told = after[disabled][0] if disabled < len(after) else float("inf")
        return max(0.0, min(told, last + DEVICE_WATCHDOG_S) - moment)


@contextmanager
def watched(bus: str) -> Iterator[Seen]:
    """Note every command on a bus; what was seen can be read afterwards."""
    file, seen = Path(f"/tmp/{bus}.log"), Seen()
    with file.open("w") as out:
        process = subprocess.Popen(["candump", "-D", "-L", bus], stdout=out)
        time.sleep(1.0)
        try:
            yield seen
        finally:
            time.sleep(0.5)
            process.terminate()
            process.wait()
    pattern = re.compile(rf"\((\d+\.\d+)\) {bus} {loop_config.COMMAND:03X}#([0-9A-F]+)")
    for at, data in pattern.findall(file.read_text()):
        volts, enables = data[:8], int(data[8:10], 16)
        seen.commands.append((float(at), bool(enables & 3), volts != "00000000"))
