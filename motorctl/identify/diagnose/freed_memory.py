"""Memory that was freed and that the C library keeps for later."""

from __future__ import annotations

import ctypes


def give_freed_memory_back() -> None:
    """Give freed memory back to the system, where the C library can.

    What one axis needed lies between what is still needed, so glibc keeps it: of ten minutes at
    5 kHz that is most of a gigabyte while the next axis is diagnosed, or once all is done.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
