"""The files of the service: where each belongs, and what stands in it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from motorctl.hal import NetworkInterface

MARK = "# Written by `motorctl service install`, which overwrites it: "
"""Begins every file of ours, so that those of others are left alone."""
UNIT = Path("/etc/systemd/system/motorctl@.service")
SYSUSERS = Path("/etc/sysusers.d/motorctl.conf")
RULES = Path("/etc/udev/rules.d/60-motorctl.rules")
CONFIGURATIONS = Path("/etc/motorctl")
DEFAULT_PROGRAM = Path("/opt/motorctl/bin/motorctl")
"""Of the unit as it is shipped."""
_RULES_OF = "61-motorctl-{}.rules"


@dataclass(frozen=True)
class Accounts:
    """Whom the daemon runs as, and who may use it."""

    user: str
    group: str
    """Of the socket: whose members may connect."""
    operators: str | None = None
    """Of the members of `group`, those of this group may command; None: all of them."""


def shared_files(program: Path, accounts: Accounts) -> Mapping[Path, str]:
    """Return the files that all gantries share, by their places.

    Parameters
    ----------
    program
        The command that the unit starts.
    accounts
        Whom it runs as, and who may use it.
    """
    user, group, operators = accounts.user, accounts.group, accounts.operators
    unit = _shipped("motorctl@.service").replace(str(DEFAULT_PROGRAM), str(program))
    unit = re.sub(r"^User=.*$", f"User={user}", unit, flags=re.MULTILINE)
    unit = re.sub(r"^Group=.*$", f"Group={group}", unit, flags=re.MULTILINE)
    rules = _shipped("60-motorctl.rules").replace('GROUP="motorctl"', f'GROUP="{group}"')
    users = _shipped("motorctl.sysusers").replace("u motorctl ", f"u {user} ")
    users = users.replace("g motorctl ", f"g {group} ")
    if operators is not None:
        unit = re.sub(r"^(ExecStart=.*)$", rf"\1 --operators {operators}", unit, flags=re.MULTILINE)
        users += f"# Members of both groups may command the machine, those of {group} alone look.\n"
        users += f"g {operators} -\n"
    return {
        UNIT: f"{MARK}systemctl edit motorctl@NAME\n{unit}",
        SYSUSERS: f"{MARK}--user, --group, --operators\n{users}",
        RULES: f"{MARK}add a file beside it\n{rules}",
    }


def rules_of(name: str) -> Path:
    """Return the place of the device rules of one gantry; it tells that the gantry is installed."""
    return RULES.with_name(_RULES_OF.format(name))


def configuration_of(name: str) -> Path:
    """Return the place of the configuration of one gantry."""
    return CONFIGURATIONS / f"{name}.yaml"


def device_rules(name: str, interfaces: Iterable[NetworkInterface]) -> str:
    """Return the device rules of one gantry: its network interfaces come up when they appear."""
    lines = [f"{MARK}from {configuration_of(name)}"]
    for one in interfaces:
        link = f"/sbin/ip link set {one.name} up {one.settings}".rstrip()
        lines.append(
            f'ACTION=="add", SUBSYSTEM=="net", KERNEL=="{one.name}", RUN+="{link}"',
        )
    if len(lines) == 1:
        lines.append("# Its drivers need no network interface of their own.")
    return "\n".join(lines) + "\n"


def installed(root: Path) -> list[str]:
    """Return the names of the gantries that are installed in a system."""
    folder = root / RULES.parent.relative_to("/")
    before, after = _RULES_OF.split("{}")
    found = (path.name for path in folder.glob(_RULES_OF.format("*")) if is_ours(path))
    return sorted(name.removeprefix(before).removesuffix(after) for name in found)


def is_ours(path: Path) -> bool:
    """Return whether a file was written by an installation."""
    try:
        with path.open("rb") as file:
            return file.read(len(MARK)) == MARK.encode()
    except OSError:
        return False


def accounts(root: Path) -> Accounts | None:
    """Return whom the installed unit runs as and serves, or None where there is none of ours."""
    place = root / UNIT.relative_to("/")
    if not is_ours(place):
        return None
    unit = place.read_text()
    found = dict(re.findall(r"^(User|Group)=(.+)$", unit, re.MULTILINE))
    operators = re.search(r"^ExecStart=.* --operators (\S+)$", unit, re.MULTILINE)
    return Accounts(found["User"], found["Group"], operators[1] if operators else None)


def _shipped(name: str) -> str:
    package = Path(__file__).parent.parent
    installed_there = package / "systemd"
    folder = installed_there if installed_there.is_dir() else package.parent / "systemd"
    return (folder / name).read_text()
