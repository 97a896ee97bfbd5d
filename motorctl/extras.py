"""What a part of motorctl needs that is installed with an extra of its own."""

from __future__ import annotations

from importlib.util import find_spec

from motorctl.errors import UsageError


def require(who: str, extra: str, *modules: str) -> None:
    """Insist that libraries are installed, without importing them.

    Parameters
    ----------
    who
        What needs them, as messages call it.
    extra
        The extra of motorctl that brings them.
    modules
        Their names as they are imported.

    Raises
    ------
    UsageError
        Where one of them is not there; it tells what to install.
    """
    missing = [module.replace("_", "-") for module in modules if find_spec(module) is None]
    if missing:
        verb = "is" if len(missing) == 1 else "are"
        raise UsageError(
            f"{who} needs {', '.join(missing)}, which {verb} not installed: "
            f"pip install 'motorctl[{extra}]'"
        )
