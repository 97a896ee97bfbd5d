"""The unit file: systemd accepts it, and its hardening leaves real time and compilation alone."""

from __future__ import annotations

import configparser
import os
import shutil
import subprocess
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "systemd"
UNIT = FOLDER / "motorctl.service"


@pytest.fixture
def service() -> configparser.SectionProxy:
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(UNIT)
    return parser["Service"]


def test_systemd_accepts_the_unit(tmp_path: Path, service: configparser.SectionProxy) -> None:
    analyze = shutil.which("systemd-analyze")
    if analyze is None:
        pytest.skip("systemd-analyze is not installed")
    # Where the package is installed is not this test's business: an existing command stands in.
    installed = service["ExecStart"].split()[0]
    stand_in = shutil.which("true")
    assert stand_in
    copy = tmp_path / UNIT.name
    copy.write_text(UNIT.read_text().replace(installed, stand_in))
    done = subprocess.run(
        [analyze, "verify", "--man=no", str(copy)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "SYSTEMD_LOG_LEVEL": "info"},
    )
    about_this = [line for line in done.stderr.splitlines() if UNIT.stem in line]
    assert (done.returncode, about_this) == (0, [])


def test_the_unit_takes_what_real_time_needs(service: configparser.SectionProxy) -> None:
    assert service["Type"] == "notify"
    assert int(service["LimitRTPRIO"]) >= 80
    assert service["LimitMEMLOCK"] == "infinity"
    assert float(service["WatchdogSec"]) > 0
    for directory in ("RuntimeDirectory", "StateDirectory", "CacheDirectory", "LogsDirectory"):
        assert service[directory] == "motorctl"


def test_hardening_does_not_break_the_loop(service: configparser.SectionProxy) -> None:
    breaking = ("RestrictRealtime", "MemoryDenyWriteExecute", "PrivateDevices", "ProtectClock")
    assert not [key for key in (*breaking, "PrivateNetwork", "DevicePolicy") if key in service]
    families = service["RestrictAddressFamilies"].split()
    assert {"AF_UNIX", "AF_CAN", "AF_INET", "AF_INET6"} <= set(families)


def test_the_loop_outlives_a_dead_supervisor(service: configparser.SectionProxy) -> None:
    # With `mixed` or `process` the loop would be killed in motion, or left behind for good.
    assert service["KillMode"] == "control-group"


def test_bad_configuration_is_not_tried_again(service: configparser.SectionProxy) -> None:
    assert service["Restart"] == "on-failure"
    assert service["RestartPreventExitStatus"] == "2"


def test_the_files_beside_the_unit_name_its_user(service: configparser.SectionProxy) -> None:
    user = service["User"]
    sysusers = (FOLDER / "motorctl.sysusers").read_text()
    assert f"u {user} " in sysusers
    assert f'GROUP="{service["Group"]}"' in (FOLDER / "60-motorctl.rules").read_text()
