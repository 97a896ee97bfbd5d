"""Times that others published: told, not measured here."""

from motorctl.config.machine import Controller

PUBLISHED = "published, dSPACE CLP1103"
PUBLISHED_TURNAROUND_US: dict[Controller, float] = {"C1": 10.0, "C2": 14.0}
"""Z. Chen, B. Yao, Q. Wang, IEEE/ASME Trans. Mechatronics 18(3), 2013, pp. 1122-1129."""
