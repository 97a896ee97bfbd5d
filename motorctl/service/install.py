"""Put a gantry into a system as a service: checked first, then written, the same each time."""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from motorctl.config import ALLOWED_CODE, AllowedCode, load
from motorctl.config.hardware import channels_of, wirings_of
from motorctl.config.machine import Machine
from motorctl.errors import ConfigError, UsageError
from motorctl.hal import NetworkInterface
from motorctl.service import files
from motorctl.service.configurators import (
    NOBODY_BUT_ROOT,
    files_of_configurators,
    group_of_configurators,
    tmpfiles_of,
)
from motorctl.service.outcome import Outcome, unit_of
from motorctl.service.system import System

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
NAME_IN_WORDS = "up to 64 letters, digits and _ . -, beginning with a letter or digit"
ACCOUNT = re.compile(r"[a-z_][a-z0-9_-]{0,30}")
ACCOUNT_IN_WORDS = "up to 31 small letters, digits and _ -, beginning with a letter or _"
INTERFACE = re.compile(r"[A-Za-z0-9_.-]{1,15}")
SETTINGS = re.compile(r"[A-Za-z0-9 _.:-]*")
USUAL_ACCOUNT = "motorctl"
HIDDEN = (Path("/home"), Path("/root"), Path("/run/user"), Path("/tmp"), Path("/var/tmp"))
"""What the unit does not show to the daemon."""


@dataclass(frozen=True)
class Request:
    """What a user asks for; None: the usual, or what is installed already."""

    name: str
    config: Path | None = None
    """Copied to /etc/motorctl; None: what is there already."""
    user: str | None = None
    group: str | None = None
    operators: str | None = None
    """The same as the group: all its members may command."""
    configurators: str | None = None
    """Whose members may change the configuration; root: nobody else."""
    root: Path = Path("/")
    dry_run: bool = False


def install(request: Request) -> Outcome:
    """Write unit, user, group and device rules, and tell systemd and udev.

    Parameters
    ----------
    request
        What to install, and where.

    Returns
    -------
    Outcome
        What was done, and what is left to do. Done again, it finds everything unchanged.

    Raises
    ------
    UsageError
        Where it is refused before anything is changed: names, rights, files of others.
    ConfigError
        With every problem of the configuration.
    RunError
        Where a file cannot be written, or systemd or udev refuse.
    """
    _must_fit("name of a gantry", request.name, NAME, NAME_IN_WORDS)
    system = System(request.root.resolve(), request.dry_run)
    system.insist("installing")
    accounts = _accounts(request, system)
    configurators = _configurators(request, system, accounts)
    text, machine = _configuration(request, system)
    program = _program(system)
    configuration = files.configuration_of(request.name)
    planned = {
        **files.shared_files(program, accounts),
        **files_of_configurators(request.name, configurators),
        files.rules_of(request.name): files.device_rules(
            request.name, interfaces := _interfaces(machine)
        ),
    }
    _refuse_foreign(system, planned)

    outcome = Outcome(request.name, system.root, request.dry_run)
    for path, content in planned.items():
        system.write(path, content, outcome)
    system.write(configuration, text, outcome)
    users = [path for path in planned if path.parent == files.SYSUSERS.parent]
    system.run(outcome, "systemd-sysusers", *map(str, users))
    if configurators is not None:
        system.run(outcome, "systemd-tmpfiles", "--create", str(tmpfiles_of(request.name)))
    system.run(outcome, "systemctl", "daemon-reload")
    system.run(outcome, "udevadm", "control", "--reload")
    system.run(outcome, "udevadm", "trigger", "--sysname-match=cpu_dma_latency")
    system.run(outcome, "udevadm", "trigger", "--subsystem-match=tty")
    for one in interfaces:
        found = (f"--sysname-match={one.name}", "--subsystem-match=net")
        system.run(outcome, "udevadm", "trigger", "--action=add", *found)
    outcome.next += _next(system, request.name, accounts, configurators, program)
    return outcome


def _must_fit(what: str, given: str, pattern: re.Pattern[str], right: str) -> None:
    if not pattern.fullmatch(given):
        raise UsageError(f"{what} '{given}': should be {right}")


def _accounts(request: Request, system: System) -> files.Accounts:
    before = files.accounts(system.root) or files.Accounts(USUAL_ACCOUNT, USUAL_ACCOUNT)
    user, group = request.user or before.user, request.group or before.group
    operators = request.operators or before.operators
    for what, given in (("--user", user), ("--group", group), ("--operators", operators)):
        if given is None:
            continue
        _must_fit(what, given, ACCOUNT, ACCOUNT_IN_WORDS)
        if given == "root":
            why = "root may command all the same: name a group of people"
            if what != "--operators":
                why = "the daemon needs no rights of root, only those of udev"
            raise UsageError(f"{what} root: {why}")
    return files.Accounts(user, group, None if operators == group else operators)


def _configurators(request: Request, system: System, accounts: files.Accounts) -> str | None:
    group = request.configurators
    if group is None:
        return group_of_configurators(system.root, request.name)
    _must_fit("--configurators", group, ACCOUNT, ACCOUNT_IN_WORDS)
    if group == accounts.group:
        raise UsageError(
            f"--configurators {group}: that is the socket's group, so whoever may look could "
            "change the configuration: name another one"
        )
    return group


def _configuration(request: Request, system: System) -> tuple[str, Machine]:
    """Return the configuration's text and the machine that it describes where it will be."""
    path = files.configuration_of(request.name)
    place = system.at(path)
    source = request.config or place
    if not source.is_file():
        if request.config is not None:
            raise UsageError(f"--config {source}: there is no such file")
        raise UsageError(f"{place} is not there: name the configuration with --config FILE")
    allowed = AllowedCode.read(system.at(ALLOWED_CODE))
    machine = load(source, allowed_code=allowed)
    text = source.read_text()
    if place.is_file() and place.read_text() != text:
        raise UsageError(
            f"{place} is there and is not {source}: edit it and leave --config out, or move it away"
        )
    if place.is_file() and not place.stat().st_mode & 0o044:
        raise UsageError(f"{place}: the daemon may not read it: chmod 0644")
    if not place.is_file():
        _must_hold_there(text, source, place, allowed)
    return text, machine


def _must_hold_there(text: str, source: Path, place: Path, allowed: AllowedCode) -> None:
    """Raise UsageError where files that a configuration names do not lie beside its new place."""
    with tempfile.TemporaryDirectory() as name:
        there = Path(name)
        if place.parent.is_dir():
            shutil.copytree(place.parent, there, dirs_exist_ok=True)
        (there / place.name).write_text(text)
        try:
            load(there / place.name, allowed_code=allowed)
        except ConfigError as error:
            told = str(error).replace(f"{there}/", f"{place.parent}/")
            raise UsageError(
                f"{source} is valid where it is, but not in {place.parent}; copy what it names "
                f"there first:\n{told}"
            ) from error


def _program(system: System) -> Path:
    """Return the command that the unit starts, as that system names it."""
    own = Path(sys.prefix) / "bin" / files.DEFAULT_PROGRAM.name
    if not system.running:
        inside = own.is_relative_to(system.root)
        return Path("/") / own.relative_to(system.root) if inside else files.DEFAULT_PROGRAM
    if not own.exists():
        raise UsageError(f"{own} is not there: install motorctl with pip, then start it from there")
    for path in (own, own.with_name("python").resolve()):
        hidden = next((one for one in HIDDEN if path.is_relative_to(one)), None)
        if hidden is not None:
            raise UsageError(
                f"{path}: a service cannot use it, as it sees nothing of {hidden}; install "
                f"motorctl where every user may read it, as in "
                f"{files.DEFAULT_PROGRAM.parent.parent}"
            )
    return own


def _interfaces(machine: Machine) -> list[NetworkInterface]:
    found: list[NetworkInterface] = []
    wirings = wirings_of(machine.axes.values())
    for name, setup in machine.drivers.items():
        if not (channels := channels_of(name, wirings)):
            continue
        driver = setup.cls(setup.options, channels, machine.period_of(channels[0].axis))
        for one in driver.network_interfaces():
            # what stands in a rule is run by root
            if not (INTERFACE.fullmatch(one.name) and SETTINGS.fullmatch(one.settings)):
                raise UsageError(
                    f"driver {name}: network interface '{one.name}' with '{one.settings}': only "
                    "letters, digits and _ . : - may stand in a device rule"
                )
            found.append(one)
    return found


def _refuse_foreign(system: System, planned: Iterable[Path]) -> None:
    places = [system.at(path) for path in planned]
    foreign = [str(p) for p in places if (p.exists() or p.is_symlink()) and not files.is_ours(p)]
    if foreign:
        raise UsageError(
            f"not written by motorctl, so left alone: {', '.join(foreign)}; move it away first"
        )


def _next(
    system: System,
    name: str,
    accounts: files.Accounts,
    configurators: str | None,
    program: Path,
) -> list[str]:
    unit = unit_of(name)
    if not system.running:
        told = [f"systemctl --root={system.root} enable {unit}"]
        if not system.at(program).exists():
            folder = program.parent.parent
            told.insert(0, f"install motorctl in that system, so that {folder} holds it")
        return told
    group, operators = accounts.group, accounts.operators
    people = [f"usermod -aG {group} USER          members of the group may command the machine"]
    if operators is not None:
        people = [
            f"usermod -aG {group},{operators} USER          operators: may command the machine",
            f"usermod -aG {group} USER          observers: may look, and stop it at once",
        ]
    if configurators not in {None, NOBODY_BUT_ROOT}:
        may = f"configurators: may change {files.configuration_of(name)}"
        people.insert(0, f"usermod -aG {configurators} USER          {may}")
    return [
        *people,
        f"systemctl enable --now {unit}",
        "motorctl status",
    ]
