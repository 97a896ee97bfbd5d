"""The example of an own effect is one."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from effect_curves import curves_of

from motorctl.model import Spans, catalog, effects
from motorctl.model.catalog import sample_form
from motorctl.model.columns import state_columns

ROOT = Path(__file__).parents[2]
SPANS = Spans((0.0, 0.4), 1.2, 10.0, 8.0, (0.0, 24.0), 2e-4, 200.0, 0.5e-6)


@pytest.fixture
def eddy_brake() -> Iterator[type]:
    """Let the folder of effects hold the example."""
    folder = str(ROOT / "docs")
    effects.__path__.append(folder)
    catalog.built_in_entries.cache_clear()
    catalog.built_in_effects.cache_clear()
    catalog.known_effects.cache_clear()
    yield catalog.effect_class("eddy_brake")
    effects.__path__.remove(folder)
    catalog.built_in_entries.cache_clear()
    catalog.built_in_effects.cache_clear()
    catalog.known_effects.cache_clear()
    sys.modules.pop("motorctl.model.effects.eddy_brake", None)


def test_the_example_of_an_own_effect_brakes_most_at_its_velocity(eddy_brake) -> None:  # type: ignore[no-untyped-def]
    brake = eddy_brake(eddy_brake.Options(peak_velocity_m_s=0.3))
    v = np.linspace(0.0, 1.2, 1201)
    zero = np.zeros_like(v)
    (column,) = state_columns(brake, zero, v, zero, v, zero)
    assert v[np.argmax(column)] == pytest.approx(0.3, abs=1e-3)
    assert column.max() == pytest.approx(0.15)


def test_the_reference_draws_the_example_by_its_own_kernel(eddy_brake) -> None:  # type: ignore[no-untyped-def]
    (curve,) = curves_of(eddy_brake).curves
    part = curve.x / sample_form(eddy_brake).options.peak_velocity_m_s
    np.testing.assert_allclose(curve.y, 2.0 * part / (1.0 + part**2), atol=1e-3)


def test_the_example_gives_diagnosis_forms_below_and_above_the_top_speed(eddy_brake) -> None:  # type: ignore[no-untyped-def]
    tried = [form.options.peak_velocity_m_s for form in eddy_brake.trials(SPANS)]
    assert min(tried) < 0.1 * SPANS.speed_m_s < SPANS.speed_m_s < max(tried)
    assert set(eddy_brake.trials(SPANS)[0].steps(SPANS)) == {"peak_velocity_m_s"}
