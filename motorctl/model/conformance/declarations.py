"""What an effect says of itself."""

from __future__ import annotations

import math
import re

from motorctl.model.catalog import known_effects, sample_form
from motorctl.model.contract import check_class, check_effect
from motorctl.model.effect import Effect
from motorctl.model.first_run import run_kernels

LONGEST_TITLE = 60
"""Longest title of an effect [characters]. Larger breaks the lines of tables in a terminal, smaller
forces abbreviations. Chosen by hand."""


class DeclarationChecks:
    """Words, names, parameters and options."""

    def test_it_is_not_refused_when_it_is_loaded(self, effect: Effect) -> None:
        """The class, and this form of it, keep the contract as far as loading looks at it."""
        check_class(type(effect), effect.name)
        check_effect(effect, effect.name)
        run_kernels(effect, effect.name)

    def test_its_texts_fit_into_a_line_of_a_report(self, effect: Effect) -> None:
        """Title and formula stand in tables."""
        for text in (effect.title, effect.formula):
            assert text == text.strip(), f"{text!r} begins or ends with a space"
            assert "\n" not in text, f"{text!r} has more than one line"
        assert len(effect.title) <= LONGEST_TITLE, "the title is longer than 60 characters"
        assert effect.picture.caption.strip(), "its picture has no caption"

    def test_its_name_fits_into_configurations_and_logs(self, effect: Effect) -> None:
        """Small letters, as every key; parameters are columns of the log that no other has."""
        assert re.fullmatch("[a-z][a-z0-9_]*", effect.name), effect.name
        own = {effect.full_name(parameter) for parameter in effect.parameters}
        for name, cls in known_effects().items():
            other = None if name == effect.name else sample_form(cls)
            taken = {other.full_name(p) for p in other.parameters} if other else set()
            assert not own & taken, f"'{name}' has these parameters as well: {own & taken}"

    def test_bounds_are_finite_and_hold_the_start_value(self, effect: Effect) -> None:
        """Where the configuration says nothing, these are the bounds of the adaptation."""
        for p in effect.parameters:
            assert -math.inf < p.lower <= p.initial <= p.upper < math.inf, p
            assert p.lower < p.upper, p
            assert 0.0 < p.covariance < math.inf, p
            assert p.symbol.strip(), p
            assert p.unit.strip(), f"{p}: the unit of a pure number is 1"

    def test_options_survive_a_configuration(self, effect: Effect) -> None:
        """What is written is read again as the same effect; unknown keys are refused."""
        text = effect.options.model_dump_json()
        again = type(effect)(type(effect.options).model_validate_json(text))
        assert again.options == effect.options
        assert again.constants == effect.constants
        assert effect.Options.model_config.get("extra") == "forbid", "unknown keys are taken"
        assert effect.Options.model_config.get("frozen"), "its options can be changed while running"
