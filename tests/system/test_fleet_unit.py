"""The units that look at a fleet each night: systemd accepts them, and they may do little."""

from __future__ import annotations

import configparser
import shutil
from pathlib import Path

import pytest
from systemd_judged import analyze, exposure

from motorctl.cli.fleet import SOME_REFUSED
from motorctl.errors import ConfigError, DataError, RunError, UsageError

FOLDER = Path(__file__).parents[2] / "systemd"
NAME = "motorctl-fleet"
WORST_SECURITY = 1.5


@pytest.fixture
def service(tmp_path: Path) -> Path:
    """Return the service beside its timer, with a command that exists here."""
    stand_in = shutil.which("true")
    assert stand_in
    shutil.copy(FOLDER / f"{NAME}.timer", tmp_path)
    copy = tmp_path / f"{NAME}.service"
    text = (FOLDER / copy.name).read_text()
    copy.write_text(text.replace("/opt/motorctl/bin/motorctl", stand_in))
    return copy


def test_systemd_accepts_service_and_timer(service: Path) -> None:
    for unit in (service, service.with_suffix(".timer")):
        done = analyze("verify", "--man=no", str(unit))
        about_these = [line for line in done.stderr.splitlines() if NAME in line]
        assert (done.returncode, about_these) == (0, [])


def test_the_service_is_exposed_less_than_the_limit(service: Path) -> None:
    assert exposure(service) < WORST_SECURITY


def test_every_exception_says_why() -> None:
    lines = (FOLDER / f"{NAME}.service").read_text().splitlines()
    for key in ("UMask=", "RestrictAddressFamilies="):
        (at,) = (k for k, line in enumerate(lines) if line.startswith(key))
        assert "# Exception" in "\n".join(lines[at - 3 : at]), key
    for missing in ("MemoryDenyWriteExecute", "ProcSubset"):
        (line,) = (line for line in lines if line.startswith(f"#   {missing}="))
        assert len(line.split()) > 3, line


def test_what_moves_machines_goes_first_and_bad_logs_do_not_keep_the_page_back() -> None:
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(FOLDER / f"{NAME}.service")
    service = parser["Service"]
    assert (service["Nice"], service["CPUSchedulingPolicy"]) == ("19", "idle")
    assert int(service["OOMScoreAdjust"]) > 0
    assert service["SuccessExitStatus"] == str(SOME_REFUSED)
    failures = {1, *(each.exit_status for each in (RunError, UsageError, DataError, ConfigError))}
    assert SOME_REFUSED not in failures  # a night that crashed is told as failed
    commands = (FOLDER / f"{NAME}.service").read_text()
    assert commands.index("fleet diagnose") < commands.index("fleet report")
    gantry = (FOLDER / "motorctl@.service").read_text()
    assert f"User={service['User']}\n" in gantry  # whose logs it reads
