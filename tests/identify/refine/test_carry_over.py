"""What a configuration keeps of a found effect: what it left behind, not the time of it."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from motorctl.identify.refine.carry_over import carry_over
from motorctl.model import EffectList, Spans, known_effects, make_effect

SPANS = Spans((0.0, 0.4), 1.0, 10.0, 9.0, (2.0, 26.0), 2e-4, 200.0, 5e-7)
INERTIA, VISCOUS, OFFSET = 0.4, 0.3, 0.02


def diagnosis(*found, declared=()):
    """Return a diagnosis of four basic effects and of others as (name, options, theta)."""
    basic = [make_effect(known_effects()[n]) for n in ("inertia", "viscous_friction", "offset")]
    stated = [make_effect(known_effects()[name], options) for name, options, _ in declared]
    new = [make_effect(known_effects()[name], options) for name, options, _ in found]
    theta = [
        INERTIA,
        VISCOUS,
        OFFSET,
        *(value for *_, values in (*declared, *found) for value in values),
    ]
    return SimpleNamespace(
        declared=EffectList([*basic, *stated]),
        model=EffectList([*basic, *stated, *new]),
        theta=np.array(theta),
        std_error=np.full(len(theta), 1e-3),
    )


def test_a_load_put_down_in_the_recording_is_another_inertia():
    carried = carry_over(diagnosis(("payload_change", {"time_s": 9.2}, [0.1])), SPANS)
    assert carried.model.names == ("inertia", "viscous_friction", "offset")
    assert carried.theta == pytest.approx([INERTIA + 0.1, VISCOUS, OFFSET])
    assert carried.left_behind == ("payload_change",)
    (note,) = carried.notes
    assert "7.2 s after the begin of this recording" in note


def test_a_motor_that_warmed_up_is_warm_in_the_configuration():
    drift = ("gain_drift", {"time_constant_s": 12.0, "begin_s": 2.0}, [0.1])
    carried = carry_over(diagnosis(drift), SPANS)
    gain = 1.0 - 0.1 * (1.0 - math.exp(-24.0 / 12.0))
    assert carried.theta == pytest.approx(np.array([INERTIA, VISCOUS, OFFSET]) / gain)
    assert carried.left_behind == ("gain_drift",)


def test_an_effect_without_a_time_of_its_own_is_kept_as_it_was_fitted():
    wave = ("cogging", {"pitch_m": 0.05}, [0.2, 0.1])
    carried = carry_over(diagnosis(wave), SPANS)
    assert carried.model.names[-1] == "cogging"
    assert carried.theta == pytest.approx([INERTIA, VISCOUS, OFFSET, 0.2, 0.1])
    assert carried.left_behind == carried.notes == ()


def test_what_is_left_out_leaves_nothing_behind():
    found = diagnosis(("payload_change", {"time_s": 9.2}, [0.1]))
    carried = carry_over(found, SPANS, without=("payload_change",))
    assert carried.theta == pytest.approx([INERTIA, VISCOUS, OFFSET])
    assert carried.left_behind == carried.notes == ()


def test_an_event_that_the_configuration_itself_declares_stays_and_is_told():
    found = diagnosis(declared=[("payload_change", {"time_s": 9.2}, [0.1])])
    carried = carry_over(found, SPANS)
    assert carried.model.names[-1] == "payload_change"
    (note,) = carried.notes
    assert "after every start of the daemon" in note
