"""All checks together."""

from __future__ import annotations

import pytest

from motorctl.model.conformance.declarations import DeclarationChecks
from motorctl.model.conformance.formulas import FormulaChecks
from motorctl.model.conformance.memory import MemoryChecks
from motorctl.model.conformance.search import SearchChecks
from motorctl.model.effect import Effect


class EffectConformance(DeclarationChecks, FormulaChecks, MemoryChecks, SearchChecks):
    """Inherit it, and give the fixture `effect`."""

    @pytest.fixture
    def effect(self) -> Effect:
        """Override it: return one form of the effect."""
        pytest.fail(f"{type(self).__name__} needs a fixture `effect` that returns an Effect")
