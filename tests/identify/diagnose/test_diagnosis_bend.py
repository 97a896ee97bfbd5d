"""A bend of the input map that was left out comes back only where it shows."""

from __future__ import annotations

from dataclasses import replace

from other_plant import OtherPlant

from motorctl.identify.columns.signals import make_signals
from motorctl.identify.diagnose.search.undetermined import with_determined, without_undetermined
from motorctl.identify.fit.declared_models import controller_list
from motorctl.model import effect_class, make_effect


def test_what_stays_left_out_leaves_the_model_that_was_searched_with_as_it_is() -> None:
    data = replace(OtherPlant().run(seed=1, duration_s=4.0), command_unit="N")
    signals = make_signals(data, slope_s_m=900.0)
    declared = controller_list(None, "C2")
    kept, dropped = without_undetermined(signals, declared)
    assert {"em_quadratic", "em_cubic"} <= dropped.keys()
    found = make_effect(effect_class("stribeck"), {"velocity_m_s": 0.02})
    assert with_determined(signals, kept, declared, (found,)) is kept
