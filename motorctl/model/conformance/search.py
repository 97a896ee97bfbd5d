"""What an effect tells those who look for it in a recording."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from motorctl.model.contract import LINE, ORDINARY, VARIABLES, WAVES
from motorctl.model.effect import Effect
from motorctl.model.knowledge import Spans

MOST_FORMS = 10_000
"""Forms that an effect may have tried. More are a scan that nobody waits for, fewer refuses effects
that need a fine one. Chosen by hand."""
RECORDINGS = (
    ORDINARY,
    replace(ORDINARY, position_m=(0.0, 3.0), speed_m_s=4.0, resolution_m=0.0),
    replace(ORDINARY, position_m=(-1e-3, 1e-3), speed_m_s=2e-2, command_v=0.5, band_hz=20.0),
    replace(ORDINARY, time_s=(1e4, 1e4 + 3600.0), period_s=1e-3, other_axes=()),
)
STANDSTILL = replace(
    ORDINARY, position_m=(0.1, 0.1), speed_m_s=0.0, acceleration_m_s2=0.0, command_v=0.0,
    time_s=(0.0, 0.0), resolution_m=0.0, other_axes=(),
)  # fmt: skip
"""A recording in which nothing happened."""


class SearchChecks:
    """Forms to try, steps, richer forms, what a configuration keeps."""

    @pytest.mark.parametrize("spans", [*RECORDINGS, STANDSTILL], ids=str)
    def test_forms_to_try_are_forms_of_it_within_the_bounds_of_its_options(
        self, effect: Effect, spans: Spans
    ) -> None:
        """For long and short travel, fast and slow machines, and one that stood still."""
        cls = type(effect)
        forms = list(cls.trials(spans))
        assert len(forms) <= MOST_FORMS, f"{len(forms)} forms; a scan has at most {MOST_FORMS}"
        for form in forms:
            assert type(form) is cls
            again = cls.Options.model_validate(form.options.model_dump())
            assert again == form.options
        told = [form.options.model_dump_json() for form in forms]
        assert len(set(told)) == len(told), "it gives a form twice"

    @pytest.mark.parametrize("spans", RECORDINGS, ids=str)
    def test_steps_lead_from_a_form_to_others(self, effect: Effect, spans: Spans) -> None:
        """Each step names a numeric option, and another value of it is another form."""
        for form in _some(type(effect), spans):
            for name, step in form.steps(spans).items():
                assert 0.0 < step < math.inf, f"the step of '{name}' is {step}"
                value = getattr(form.options, name)
                assert isinstance(value, float | int), f"'{name}' is {value!r}: no number"
                moved = form.options.model_copy(update={name: value + 0.5 * step})
                changed = type(effect)(moved)
                told = (changed.constants, changed.lag_s, changed.delay_s, changed.parameters)
                before = (form.constants, form.lag_s, form.delay_s, form.parameters)
                assert told != before, f"another '{name}' is the same form"

    @pytest.mark.parametrize("spans", RECORDINGS, ids=str)
    def test_a_richer_form_has_more_parameters(self, effect: Effect, spans: Spans) -> None:
        """Else it is another form, and belongs to those that are tried."""
        for form in _some(type(effect), spans):
            for richer in form.richer(spans):
                assert type(richer) is type(effect)
                assert len(richer.parameters) > len(form.parameters), richer.options

    @pytest.mark.parametrize("spans", RECORDINGS, ids=str)
    def test_a_typical_form_is_one_of_it(self, effect: Effect, spans: Spans) -> None:
        """It is asked whether a motion could show the effect at all."""
        typical = type(effect).typical(spans)
        assert typical is None or type(typical) is type(effect)
        if list(type(effect).trials(spans)):
            assert typical is not None, "there are forms to try, but none is typical"

    @pytest.mark.parametrize("spans", RECORDINGS, ids=str)
    def test_what_a_configuration_keeps_of_it_is_finite(self, effect: Effect, spans: Spans) -> None:
        """Whatever its parameters are within a tenth of their bounds."""
        for share in (-0.1, 0.0, 0.1):
            theta = [min(max(share, p.lower), p.upper) for p in effect.parameters]
            carried = effect.carry_over(theta, spans)
            assert math.isfinite(carried.scale), carried
            assert carried.scale != 0.0, carried
            assert all(math.isfinite(value) for value in carried.adds.values()), carried
            assert carried.kept or carried.note, "nothing of it is kept, and no note says why"

    def test_a_wave_shows_at_the_line_that_it_was_made_for(self, effect: Effect) -> None:
        """Diagnosis finds the line first and asks for the form that makes it."""
        if not effect.groups.intersection(WAVES):
            pytest.skip("it is no wave")
        wave = type(effect).at_line(LINE)
        assert any(line == pytest.approx(LINE) for line in wave.lines), wave.lines
        assert wave.repeats_every == pytest.approx(1.0 / LINE)

    def test_a_smooth_function_says_that_it_is_one(self, effect: Effect) -> None:
        """It competes with forms of a meaning, and is not taken for one."""
        for variable in VARIABLES:
            smooth = type(effect).smooth_function((variable,), ORDINARY)
            assert smooth is None or smooth.is_spline, f"of {variable}: {smooth}"


def _some(cls: type[Effect], spans: Spans) -> list[Effect]:
    """Return first, middle and last of the forms to try."""
    forms = list(cls.trials(spans))
    return [forms[k] for k in sorted({0, len(forms) // 2, len(forms) - 1})] if forms else []
