"""Units of effects' options: the end of an option's name tells it."""

from __future__ import annotations

OPTION_UNITS = {
    "_m_s2": "m/s^2",
    "_m_s": "m/s",
    "_s_m": "s/m",
    "_hz": "Hz",
    "_1_s": "1/s",
    "_v": "V",
    "_m": "m",
    "_s": "s",
}
"""By the end of an option's name; the first that fits."""


def option_unit(name: str) -> str:
    """Return the unit that the name of an option ends with; empty for a pure number."""
    return next((unit for end, unit in OPTION_UNITS.items() if name.endswith(end)), "")
