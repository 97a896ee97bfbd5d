"""Promise: one cause with many orders over the travel is one name."""

from __future__ import annotations

import pytest
from diagnosis_cases import diagnosed, names

from motorctl_benchmarks.diagnosis.cases import draw_case


@pytest.mark.slow
def test_orders_that_were_found_one_by_one_become_one_wave(tmp_path):
    case = draw_case(1351004, effects=("cogging",), motion="repeated")
    found = diagnosed(case, tmp_path)
    assert names(found) == ["cogging"]
    assert found.effects[0].effect.options.orders == (1, 3, 4, 6)
    # what was not yet explained answered to the command 15 ms before it was recorded, by chance
    assert not [note for note in found.notes if "late_s" in note]
