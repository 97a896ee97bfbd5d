"""Who, besides root, may change the configuration of a gantry: the members of a group."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from motorctl.service import files

NOBODY_BUT_ROOT = "root"
"""The group that takes the right away again."""
_TMPFILES = Path("/etc/tmpfiles.d")
_NAME = "motorctl-{}.conf"


def tmpfiles_of(name: str) -> Path:
    """Return the place of the file that gives a gantry's configuration its group."""
    return _TMPFILES / _NAME.format(name)


def group_of_configurators(root: Path, name: str) -> str | None:
    """Return the group that may change a gantry's configuration; None: nobody has said."""
    place = root / tmpfiles_of(name).relative_to("/")
    if not files.is_ours(place):
        return None
    found = re.search(r"^z \S+ \d+ root (\S+)$", place.read_text(), re.MULTILINE)
    return found[1] if found else None


def files_of_configurators(name: str, group: str | None) -> Mapping[Path, str]:
    """Return the files that hand a gantry's configuration to a group, by their places.

    They make the group and, at every boot, set group and mode of the one file: the folder stays
    root's, so nothing beside it, as the list of the code that may run, can be changed or replaced.

    Parameters
    ----------
    name
        Of the gantry.
    group
        Whose members may change it, `NOBODY_BUT_ROOT`, or None: as it is.
    """
    if group is None:
        return {}
    mark, mode = f"{files.MARK}--configurators\n", "0664"
    sysusers = f"g {group} -\n"
    if group == NOBODY_BUT_ROOT:
        mode, sysusers = "0644", "# Nobody but root may change the configuration.\n"
    return {
        files.SYSUSERS.with_name(_NAME.format(name)): mark + sysusers,
        tmpfiles_of(name): f"{mark}z {files.configuration_of(name)} {mode} root {group}\n",
    }
