"""Limit switches and faults that no device tells of, in the words of a driver's advice."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping

UNTOLD_GUARDS: Mapping[str, str] = {
    "amplifier_fault": "amplifier",
    "encoder_lost": "encoder_lost",
    "estop": "estop",
}
"""What a device tells of itself by a bit, as the options of drivers name it, and which guard trips
on it."""
LIMIT_SWITCHES = ("limit_negative", "limit_positive")
"""The switches at both ends, as `Status` and the options of drivers name them."""


def untold_guard(flag: str, guard: str, axes: Iterable[str]) -> str:
    """Return what `Driver.advice` says of axes whose device has no bit for one of UNTOLD_GUARDS.

    Parameters
    ----------
    flag, guard
        A pair of UNTOLD_GUARDS.
    axes
        The axes that lack it.

    Returns
    -------
    str
        A sentence for all of them.
    """
    return (
        f"no {flag} for {', '.join(axes)}: the device has no way to tell of one, and "
        f"guards.{guard} never trips on it"
    )


def unseen_limit_switches(told: Mapping[str, Collection[str]]) -> Iterator[str]:
    """Yield what `Driver.advice` says of axes whose limit switches nobody tells; axes alike in one.

    Parameters
    ----------
    told
        Of each axis, what its device tells, by the names in LIMIT_SWITCHES; other names are left.

    Yields
    ------
    str
        A sentence for the axes that lack the same switches.

    Examples
    --------
    >>> list(unseen_limit_switches({"x": ["limit_negative", "limit_positive"]}))
    []
    """
    lacking: dict[tuple[str, ...], list[str]] = {}
    for axis, names in told.items():
        missing = tuple(name for name in LIMIT_SWITCHES if name not in names)
        if missing:
            lacking.setdefault(missing, []).append(axis)
    for missing, axes in lacking.items():
        yield (
            f"no {' and '.join(missing)} for {', '.join(axes)}: a limit switch there is not seen, "
            "and guards.limit_switch never trips on it"
        )
