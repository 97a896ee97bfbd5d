"""Limit switches that no device tells of, in the words of a driver's advice."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

LIMIT_SWITCHES = ("limit_negative", "limit_positive")
"""The switches at both ends, as `Status` and the options of drivers name them."""


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
