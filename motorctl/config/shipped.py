"""The configurations that come with motorctl, found in a checkout and in an installed wheel."""

from __future__ import annotations

from pathlib import Path

from motorctl.config.validation import suggest
from motorctl.errors import UsageError

SUFFIX = ".yaml"


def shipped_configs() -> dict[str, Path]:
    """Return every shipped configuration by its name.

    Returns
    -------
    dict
        The YAML file of each name, in the checkout or the installed package.
    """
    return _by_name(_folder())


def shipped_config(name: str) -> Path:
    """Return the file of a shipped configuration.

    Parameters
    ----------
    name
        What it is called: its file's name without the suffix.

    Returns
    -------
    Path
        The YAML file, in the checkout or the installed package.

    Raises
    ------
    UsageError
        Where there is none of that name; it names those there are.
    """
    known = shipped_configs()
    if name not in known:
        raise UsageError(f"there is no shipped configuration '{name}'; {suggest(name, known)}")
    return known[name]


def locate(path: str | Path, folder: Path | None = None) -> Path:
    """Return the file that a user means: a path, or the bare name of a file that is shipped.

    `folder` holds what is shipped; by default the configurations.
    """
    given = Path(path)
    if len(given.parts) == 1 and not given.exists():
        known = _by_name(folder or _folder())
        return known.get(given.stem if given.suffix == SUFFIX else given.name, given)
    return given


def _by_name(folder: Path) -> dict[str, Path]:
    return {path.stem: path for path in sorted(folder.glob(f"*{SUFFIX}"))}


def _folder() -> Path:
    package = Path(__file__).parent.parent
    installed = package / "configs"
    return installed if installed.is_dir() else package.parent / "configs"
