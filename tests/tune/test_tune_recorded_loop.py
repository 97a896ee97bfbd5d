"""What a log tells of a loop where its commands are too alike to tell the motor's saturation."""

from pathlib import Path

import pytest

from motorctl.errors import DataError
from motorctl.identify.columns.measured import with_others
from motorctl.identify.fit.recording import fit_axis
from motorctl.response.measurement import measure_response
from motorctl.response.plan import plan_response
from motorctl.response.rigs import record_simulated
from motorctl.tune.recorded_loop import recorded_loop
from motorctl.tune.tuning import record_program
from motorctl_benchmarks.tuning.machines import drawn_machine


def _quiet(_what: str, _share: float) -> None:
    """Tell nobody."""


@pytest.mark.slow
def test_inertia_that_electromagnetic_effects_hide_is_fitted_without_them(tmp_path: Path) -> None:
    drawn = drawn_machine(tmp_path, 1370000)  # accelerates at one level, and has a part on a spring
    machine, axis = drawn.machine, drawn.axis
    log = record_program(machine, axis, tmp_path / "log.parquet", _quiet)
    with pytest.raises(DataError, match="cannot tell inertia from em_quadratic and em_cubic"):
        fit_axis(with_others(log, axis), machine.axes[axis].declared)
    loop = recorded_loop(log, machine, axis)
    assert loop.plant.theta1 == pytest.approx(drawn.plant["inertia_v_s2_m"], rel=0.1)
    assert any("fitted without them" in note for note in loop.notes)


@pytest.mark.slow
def test_an_inertia_that_instruments_deny_is_not_what_margins_are_kept_around(
    tmp_path: Path,
) -> None:
    drawn = drawn_machine(tmp_path, 1370019)  # presliding that nobody declared
    machine, axis = drawn.machine, drawn.axis
    true = drawn.plant["inertia_v_s2_m"]
    log = record_program(machine, axis, tmp_path / "log.parquet", _quiet)
    fit = fit_axis(with_others(log, axis), machine.axes[axis].declared)
    assert fit.theta[0] > 1.3 * true  # gains for it would be unstable
    assert recorded_loop(log, machine, axis).plant.theta1 == pytest.approx(true, rel=0.1)


@pytest.mark.slow
def test_a_response_that_cannot_tell_lag_from_delay_tells_both_together(tmp_path: Path) -> None:
    drawn = drawn_machine(tmp_path, 1370011)  # 0.64 ms of delay, and no lag
    machine, axis = drawn.machine, drawn.axis
    log = record_program(machine, axis, tmp_path / "log.parquet", _quiet)
    plan = plan_response(machine.axes[axis], machine.period_of(axis))
    record_simulated(machine, plan, tmp_path / "response.parquet", _quiet)
    response = measure_response([tmp_path / "response.parquet"], axis)
    assert response.fitted.errors[2] > response.fitted.delay_s  # of the delay alone
    plant = recorded_loop(log, machine, axis, response=response).plant
    assert plant.lag_s == 0.0  # what may be a lag counts as delay
    late_s = drawn.plant["input_delay"]["time_s"]
    assert late_s < plant.delay_s < 1.1 * late_s
