"""Times and sizes in the unit that a person would choose."""

from __future__ import annotations

from datetime import datetime


def short_time(seconds: float) -> str:
    """Return a time as 3.2 µs, 8.03 ms or 1.25 s."""
    if seconds < 1e-3:
        return f"{seconds * 1e6:.1f} µs"
    return f"{seconds * 1e3:.2f} ms" if seconds < 1.0 else f"{seconds:.2f} s"


def long_time(seconds: float) -> str:
    """Return a time as 42.0 s, 1:07 min or 10:00:00 h."""
    if seconds < 60.0:
        return f"{seconds:.4g} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02} h" if hours else f"{minutes}:{rest:02} min"


def size(bytes_: float) -> str:
    """Return a size as 900 bytes, 13.5 MB or 2.1 GB."""
    for factor, unit in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if bytes_ >= factor:
            return f"{bytes_ / factor:.3g} {unit}"
    return f"{bytes_:.0f} bytes"


def moment(iso: str) -> str:
    """Return a moment to the second, as 2026-11-27 08:28:07 UTC; what is none stays as it is."""
    try:
        when = datetime.fromisoformat(iso)
    except ValueError:
        return iso
    return f"{when:%Y-%m-%d %H:%M:%S} {when.tzname() or ''}".rstrip()
