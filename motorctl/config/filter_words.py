"""A filter of the command in a few words."""


def filter_words(kind: str, frequency_hz: float, damping: float, depth: float) -> str:
    """Return what a filter is: notch to 0.1 at 300 Hz, damping 0.5."""
    to = f" to {depth:g}" if kind == "notch" else ""
    return f"{kind.replace('_', '-')}{to} at {frequency_hz:.4g} Hz, damping {damping:g}"
