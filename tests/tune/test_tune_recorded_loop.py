"""What a log tells of a loop where its commands are too alike to tell the motor's saturation."""

from pathlib import Path

import pytest

from motorctl.errors import DataError
from motorctl.identify.columns.measured import with_others
from motorctl.identify.fit.recording import fit_axis
from motorctl.tune.recorded_loop import recorded_loop
from motorctl.tune.tuning import record_program
from motorctl_benchmarks.tuning.machines import drawn_machine


@pytest.mark.slow
def test_inertia_that_electromagnetic_effects_hide_is_fitted_without_them(tmp_path: Path) -> None:
    drawn = drawn_machine(tmp_path, 1370000)  # accelerates at one level, and has a part on a spring
    machine, axis = drawn.machine, drawn.axis
    log = record_program(machine, axis, tmp_path / "log.parquet", lambda _what, _share: None)
    with pytest.raises(DataError, match="cannot tell inertia from em_quadratic and em_cubic"):
        fit_axis(with_others(log, axis), machine.axes[axis].declared)
    loop = recorded_loop(log, machine, axis)
    assert loop.plant.theta1 == pytest.approx(drawn.plant["inertia_v_s2_m"], rel=0.1)
    assert any("fitted without them" in note for note in loop.notes)
