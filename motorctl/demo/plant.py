"""What the simulated plant contains beyond the declared model, read from the driver's options."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from motorctl.config.freeze import decode
from motorctl.config.machine import Machine
from motorctl.identify.diagnose.report.parameter_text import Value
from motorctl.model.catalog import known_effects

UNITS = {"_m_s": "m/s", "_v_s_m": "V s/m", "_m": "m", "_s": "s", "_v": "V", "_hz": "Hz"}
"""By the end of an option's name; the first that fits."""


def undeclared_effects(machine: Machine, axis: str) -> dict[str, str]:
    """Return the effects of a simulated axis that its configuration does not declare, in words."""
    place = machine.axes[axis]
    drivers = decode(machine.resolved)["drivers"]
    plants: Mapping[str, Any] = drivers[place.driver].get("plants", {})
    plant: Mapping[str, Any] = plants.get(str(place.channel), {})
    declared = place.declared.names
    return {
        name: _told(plant[name])
        for name in known_effects()
        if isinstance(plant.get(name), Mapping) and name not in declared
    }


def _told(options: Mapping[str, Any]) -> str:
    """Put an effect's options into words; what is zero or absent is left out."""
    words = []
    for name, value in options.items():
        if isinstance(value, float) and value:
            end = next((end for end in UNITS if name.endswith(end)), "")
            amount = Value(value, math.nan, UNITS.get(end, "")).told()
            words.append(f"{name.removesuffix(end).replace('_', ' ')} {amount}")
    for part in options.get("harmonics", ()):
        words.append(f"order {part['order']}: {Value(part['amplitude_v'], math.nan, 'V').told()}")
    return ", ".join(words)
