"""What acts while an axis moves in one direction only is no force of magnets or teeth."""

from __future__ import annotations

from math import floor, tanh

import pytest
from foreign_axes import led, sines

from motorctl.identify.columns.measured import Measured
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.fit.declared_models import controller_list

pytestmark = pytest.mark.slow

PITCH_M = 0.013
MASS_KG = 2.0


def carriage(backwards: float) -> Measured:
    """Return a carriage with teeth that press on it, backwards by this part of what they do."""

    def teeth(x: float, v: float) -> float:
        part = x / PITCH_M - floor(x / PITCH_M)
        pressed = part / 0.85 if part < 0.85 else (1.0 - part) / 0.15
        forwards = 0.5 * (1.0 + tanh(v / 0.002))
        return 6.0 * (pressed - 0.5) * (forwards + backwards * (1.0 - forwards))

    def moved_by(x: float, v: float, u: float) -> float:
        return (u - 1.5 * tanh(v / 0.002) - 5.0 * v - teeth(x, v)) / MASS_KG

    motion = sines(14.0, 500.0, 0.1, (0.2, 2.0), seed=3)
    return led(
        moved_by, motion, 500.0, (4000.0, 100.0), lambda x, v, a: MASS_KG * a + 5.0 * v, 1e-6,
        ("m", "N"),
    )  # fmt: skip


def test_a_pawl_that_presses_on_its_teeth_forwards_only_is_no_cogging() -> None:
    found = diagnose_axis(carriage(backwards=0.0), controller_list(None, "C1"))
    assert found.verdict == "unknown_structure"
    assert not found.effects
    assert any("acts in one direction only, as a pawl does" in note for note in found.notes)


def test_the_same_teeth_are_cogging_where_they_press_both_ways() -> None:
    found = diagnose_axis(carriage(backwards=1.0), controller_list(None, "C1"))
    assert "cogging" in {each.effect.name for each in found.effects}
    assert not any("one direction" in note for note in found.notes)
