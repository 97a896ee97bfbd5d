"""The configurations that come with motorctl, found in a checkout and in an installed wheel."""

from __future__ import annotations

from pathlib import Path

from motorctl.config.validation import suggest
from motorctl.errors import UsageError

SUFFIX = ".yaml"


def shipped_configs() -> dict[str, Path]:
    """Give every shipped configuration by its name."""
    return {path.stem: path for path in sorted(_folder().glob(f"*{SUFFIX}"))}


def shipped_config(name: str) -> Path:
    """Give the file of a shipped configuration. Raises UsageError, naming those there are."""
    known = shipped_configs()
    if name not in known:
        raise UsageError(f"there is no shipped configuration '{name}'; {suggest(name, known)}")
    return known[name]


def locate(path: str | Path) -> Path:
    """Give the file that a user means: a path, or the bare name of a shipped configuration."""
    given = Path(path)
    if len(given.parts) == 1 and not given.exists():
        return shipped_configs().get(given.stem if given.suffix == SUFFIX else given.name, given)
    return given


def locate_device(path: str | Path) -> Path:
    """Give the file of a simulated device: a path, or the bare name of a shipped one."""
    given = Path(path)
    shipped = _folder() / "devices" / f"{given.stem}{SUFFIX}"
    bare = len(given.parts) == 1 and given.suffix in ("", SUFFIX)
    return shipped if bare and not given.exists() and shipped.exists() else given


def _folder() -> Path:
    package = Path(__file__).parent.parent
    installed = package / "configs"
    return installed if installed.is_dir() else package.parent / "configs"
