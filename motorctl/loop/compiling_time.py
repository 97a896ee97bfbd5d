"""How long compiling a machine's kernels takes, in words: for whoever waits for a start."""

from __future__ import annotations

COMPILED_S, AXIS_COMPILED_S = 7.0, 1.5
"""What compiling takes on a quiet virtual machine with two CPUs [s]: the common part, each axis'
own. Measured; a busy computer, or a slower one, takes longer."""


def compiling_words(axes: int) -> str:
    """Return how long compiling takes that nothing is kept of.

    Parameters
    ----------
    axes
        How many the machine has.
    """
    return f"about {COMPILED_S + axes * AXIS_COMPILED_S:.0f} s, more on a busy computer"
