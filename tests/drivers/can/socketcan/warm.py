"""Compiles what the stories need, where compiling is fast: outside the machine, without a bus.

The daemon runs on the simulated gantry, and the device on a bus of its own process.
"""

import copy
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import yaml
from daemon_rig import Daemon
from loop_config import DEVICE, can_driver, config, device_file
from page_layouts import classic_driver, fd_driver

from motorctl.config import load_resolved
from motorctl.hal import Channel


def main() -> None:
    for driver in (classic_driver(), fd_driver()):
        driver.prepare()
    setup = load_resolved(config(can_driver()), "socketcan", hardware=True).drivers["gantry"]
    channels = [Channel(axis, k, 0.5e-6, 28, 10.0) for k, axis in enumerate("xy")]
    setup.cls(setup.options, channels, 0.01).prepare()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _device(folder)
        sim = {"type": "sim", "preset": "published_gantry", "seed": 1}
        like = config({**sim, "late": can_driver()["late"]})
        with Daemon(folder / "daemon", yaml.safe_dump(like, sort_keys=False)) as daemon:
            for axis in "xy":
                daemon.ask_when_it_stands("start", axis)
            time.sleep(1.0)
            daemon.ask("status")
            daemon.end()


def _device(folder: Path) -> None:
    data = copy.deepcopy(device_file())
    data["serve"]["can"]["interface"] = "virtual"
    path = folder / "device.yaml"
    path.write_text(yaml.safe_dump(data))
    with subprocess.Popen([*DEVICE, str(path)], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.send_signal(signal.SIGTERM)


if __name__ == "__main__":
    main()
