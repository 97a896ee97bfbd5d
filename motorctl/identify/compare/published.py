"""What the paper published: figures to set beside measured ones, told and not measured here."""

from __future__ import annotations

from motorctl.identify.compare.measures import Measures

PAPER = (
    "Z. Chen, B. Yao, Q. Wang, IEEE/ASME Transactions on Mechatronics 18(3), 2013, pp. 1122-1129"
)
DEVICE = "dSPACE CLP1103"
TURNAROUND_S: dict[str, float] = {"C1": 10e-6, "C2": 14e-6}
"""Turnaround of the two controllers on that device [s]. Published in that paper; told beside
measured ones, nothing is decided by it."""

TABLES: dict[str, dict[str, Measures]] = {
    "x": {
        "C1": Measures(65.5e-6, 44.4e-6, 4.54e-6, 9.55),
        "C2": Measures(37.6e-6, 28.1e-6, 3.40e-6, 9.85),
    },
    "y": {
        "C1": Measures(75.4e-6, 66.1e-6, 9.14e-6, 9.32),
        "C2": Measures(39.1e-6, 35.0e-6, 5.90e-6, 9.60),
    },
}
"""Measured on the authors' gantry: eM, eF, L2[e], uM, by axis and controller."""
