"""The unit file: systemd accepts it, and its hardening leaves real time and compilation alone."""

from __future__ import annotations

import configparser
import re
import shutil
from pathlib import Path

import pytest
from systemd_judged import analyze, exposure

from motorctl.config import ALLOWED_CODE

FOLDER = Path(__file__).parents[2] / "systemd"
UNIT = FOLDER / "motorctl@.service"
WORST_SECURITY = 3.0


@pytest.fixture
def service() -> configparser.SectionProxy:
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(UNIT)
    return parser["Service"]


@pytest.fixture
def unit(tmp_path: Path, service: configparser.SectionProxy) -> Path:
    """Return the unit of one gantry, with a command that exists here."""
    installed = service["ExecStart"].split()[0]
    stand_in = shutil.which("true")
    assert stand_in
    copy = tmp_path / UNIT.name.replace("@", "@left")
    copy.write_text(UNIT.read_text().replace(installed, stand_in))
    return copy


def test_systemd_accepts_the_unit(unit: Path) -> None:
    done = analyze("verify", "--man=no", str(unit))
    about_this = [line for line in done.stderr.splitlines() if unit.stem in line]
    assert (done.returncode, about_this) == (0, [])


def test_the_unit_is_exposed_less_than_the_limit(unit: Path) -> None:
    assert exposure(unit) < WORST_SECURITY


def test_the_unit_takes_what_real_time_needs(service: configparser.SectionProxy) -> None:
    assert service["Type"] == "notify"
    assert int(service["LimitRTPRIO"]) >= 80
    assert service["LimitMEMLOCK"] == "infinity"
    assert float(service["WatchdogSec"]) > 0


def test_each_gantry_has_folders_of_its_own(service: configparser.SectionProxy) -> None:
    for directory in ("RuntimeDirectory", "StateDirectory", "LogsDirectory"):
        assert service[directory] == "motorctl/%i"
    assert "/etc/motorctl/%i.yaml" in service["ExecStart"]
    assert service["CacheDirectory"] == "motorctl"  # found by digests: shared


def test_a_service_runs_no_code_that_only_its_configuration_names(
    service: configparser.SectionProxy,
) -> None:
    assert f"--only-allowed-code {ALLOWED_CODE}" in service["ExecStart"]


def test_hardening_does_not_break_the_loop(service: configparser.SectionProxy) -> None:
    breaking = ("RestrictRealtime", "MemoryDenyWriteExecute", "PrivateDevices", "PrivateNetwork")
    assert not [key for key in (*breaking, "PrivateUsers", "ProcSubset") if key in service]
    families = service["RestrictAddressFamilies"].split()
    assert {"AF_UNIX", "AF_CAN", "AF_INET", "AF_INET6"} <= set(families)


def test_serial_lines_and_idle_states_are_left_open() -> None:
    allowed = re.findall(r"^DeviceAllow=(\S+) rw$", UNIT.read_text(), re.MULTILINE)
    majors = {"ttyS": 4, "ttyACM": 166, "ttyUSB": 188, "ttyAMA": 204}  # devices.txt of the kernel
    assert {f"char-{major}" for major in majors.values()} <= set(allowed)
    assert "/dev/cpu_dma_latency" in allowed


def test_every_exception_says_why() -> None:
    """What is weaker than it could be has a comment right above, or is listed as not set."""
    lines = UNIT.read_text().splitlines()
    for key in ("SystemCallFilter=@chown", "UMask=", "SupplementaryGroups=", "DevicePolicy="):
        (at,) = (k for k, line in enumerate(lines) if line.startswith(key))
        above = "\n".join(lines[max(0, at - 3) : at])
        assert "# Exception" in above, key
    for missing in ("RestrictRealtime", "MemoryDenyWriteExecute", "PrivateUsers", "ProcSubset"):
        (line,) = (line for line in lines if line.startswith(f"#   {missing}="))
        assert len(line.split()) > 3, line


def test_the_loop_outlives_a_dead_supervisor(service: configparser.SectionProxy) -> None:
    # With `mixed` or `process` the loop would be killed in motion, or left behind for good.
    assert service["KillMode"] == "control-group"


def test_bad_configuration_is_not_tried_again(service: configparser.SectionProxy) -> None:
    assert service["Restart"] == "on-failure"
    assert service["RestartPreventExitStatus"] == "2"


def test_the_files_beside_the_unit_name_its_user(service: configparser.SectionProxy) -> None:
    sysusers = (FOLDER / "motorctl.sysusers").read_text()
    assert f"u {service['User']} " in sysusers
    for group in (service["Group"], service["SupplementaryGroups"]):
        assert f"g {group} " in sysusers
        assert f'GROUP="{group}"' in (FOLDER / "60-motorctl.rules").read_text()
