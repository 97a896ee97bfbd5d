"""Take a gantry out of a system again; what people and the daemon wrote stays."""

from __future__ import annotations

from pathlib import Path

from motorctl.service import files
from motorctl.service.configurators import (
    NOBODY_BUT_ROOT,
    files_of_configurators,
    group_of_configurators,
)
from motorctl.service.outcome import Outcome, unit_of
from motorctl.service.system import System

KEPT = {
    files.CONFIGURATIONS: "configurations",
    Path("/var/log/motorctl"): "logs",
    Path("/var/lib/motorctl"): "what was learned",
    Path("/var/cache/motorctl"): "compiled loops",
}
"""What is never removed, where it is there."""


def remove(name: str, root: Path = Path("/"), dry_run: bool = False) -> Outcome:
    """Stop a gantry, and remove its rules; with the last one also unit, user's file and rules.

    Configuration, logs, what was learned, the user and the group stay.

    Parameters
    ----------
    name
        Of the gantry.
    root
        The folder of the system.
    dry_run
        Whether it only tells what it would do.

    Returns
    -------
    Outcome
        What was done. Done again, it finds nothing to remove.

    Raises
    ------
    UsageError
        Where this program may not.
    RunError
        Where a file cannot be removed, or systemd or udev refuse.
    """
    system = System(root.resolve(), dry_run)
    system.insist("removing")
    outcome = Outcome(name, system.root, dry_run)
    there = files.installed(system.root)
    if name not in there:
        outcome.tell("unchanged", unit_of(name), "it is not installed")
        return outcome
    before = files.accounts(system.root)
    system.run(outcome, "systemctl", "disable", "--now", unit_of(name))
    system.remove(files.rules_of(name), outcome)
    configurators = group_of_configurators(system.root, name)
    for path in files_of_configurators(name, configurators):
        system.remove(path, outcome)
    if configurators is not None:
        system.give_to_root(files.configuration_of(name), outcome)
    if others := [other for other in there if other != name]:
        outcome.tell("kept", files.UNIT, f"for {', '.join(others)}")
    else:
        for path in (files.UNIT, files.SYSUSERS, files.RULES):
            if files.is_ours(system.at(path)):
                system.remove(path, outcome)
            elif system.at(path).exists():
                outcome.tell("kept", path, "not written by motorctl")
    system.run(outcome, "systemctl", "daemon-reload")
    system.run(outcome, "udevadm", "control", "--reload")
    for path, what in KEPT.items():
        if system.at(path).is_dir():
            outcome.tell("kept", path, what)
    if system.running and before is not None and not others:
        outcome.tell("kept", f"user {before.user}, group {before.group}", "files belong to them")
        if before.operators is not None:
            outcome.tell("kept", f"group {before.operators}", "people are its members")
    if configurators not in {None, NOBODY_BUT_ROOT}:
        outcome.tell("kept", f"group {configurators}", "people are its members")
    return outcome
