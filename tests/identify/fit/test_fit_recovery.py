"""The identification against a plant that is simulated apart from the model's kernels."""

import numpy as np
import pytest
from fit_plant import C1, C2, X_THETA, input_map, simulate

from motorctl.errors import DataError
from motorctl.identify.fit.recording import fit_axis
from motorctl.identify.fit.settings import FitOptions

TRUTH = np.array(X_THETA)


@pytest.fixture(scope="module")
def run():
    return simulate(seed=1)


@pytest.fixture(scope="module")
def fitted(run):
    return fit_axis(run.measured(), C2)


def map_error(fit, run):
    """Return the largest error of the identified v(u), as a part of its greatest value."""
    u = np.linspace(0.0, np.abs(run.command).max(), 50)
    difference = input_map(fit.theta, u) - input_map(TRUTH, u)
    return np.abs(difference).max() / input_map(TRUTH, u[-1])


def test_inertia_and_input_map_are_recovered_from_quantised_positions(run, fitted):
    assert fitted.theta[0] == pytest.approx(TRUTH[0], rel=1e-3)
    assert map_error(fitted, run) < 0.01
    np.testing.assert_allclose(fitted.theta[:4], TRUTH[:4], rtol=0.01)


def test_the_residual_of_the_right_model_is_small(fitted):
    assert fitted.error.relative < 0.01
    assert fitted.error.rms == pytest.approx(np.sqrt(np.mean(fitted.residual**2)))


def test_a_clean_fit_carries_no_notes_and_instruments_agree(fitted):
    assert fitted.notes == ()
    assert fitted.instruments is not None
    assert not fitted.disagreement().any()
    np.testing.assert_allclose(fitted.least_squares.theta[:3], TRUTH[:3], rtol=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.0, 0.46, 7.25])
def test_the_input_delay_is_found_to_a_twentieth_of_a_sample(delay):
    run = simulate(seed=2, delay_samples=delay)
    fit = fit_axis(run.measured(), C2)
    assert fit.delay_s * run.rate_hz == pytest.approx(delay, abs=0.05)
    assert fit.estimate.delay_std_error_s * run.rate_hz < 0.05


def test_the_delay_is_positive_where_the_command_acts_later(run):
    early = run.measured(command=np.roll(run.command, -3))
    assert fit_axis(early, C2).delay_s * run.rate_hz == pytest.approx(3.46, abs=0.05)


def test_a_given_delay_is_taken_as_it_is(run):
    options = FitOptions(estimate_delay=False, input_delay_s=0.46 / run.rate_hz)
    fit = fit_axis(run.measured(), C2, options)
    assert fit.delay_s == pytest.approx(0.46 / run.rate_hz)
    assert fit.estimate.delay_std_error_s == 0.0
    assert fit.theta[0] == pytest.approx(TRUTH[0], rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate_hz", "resolution", "duration_s"),
    [
        (1000.0, 1e-6, 12.0),
        (20000.0, 0.5e-6, 4.0),
        pytest.param(2000.0, 1e-6, 12.0, marks=pytest.mark.long),
    ],
)
def test_other_sample_rates_need_no_options(rate_hz, resolution, duration_s):
    run = simulate(seed=3, rate_hz=rate_hz, resolution=resolution, duration_s=duration_s)
    fit = fit_axis(run.measured(), C2)
    assert fit.theta[0] == pytest.approx(TRUTH[0], rel=1e-3)
    assert map_error(fit, run) < 0.01


def test_slow_sampling_still_finds_the_moving_mass():
    run = simulate(
        seed=1, rate_hz=100.0, resolution=1e-6, duration_s=40.0, peak_acceleration=2.0,
        peak_velocity=0.5,
    )  # fmt: skip
    fit = fit_axis(run.measured(), C1)
    assert fit.theta[0] == pytest.approx(TRUTH[0], rel=0.02)


def test_a_coarse_encoder_narrows_the_band():
    coarse = simulate(seed=1, rate_hz=1000.0, resolution=20e-6)
    fit = fit_axis(coarse.measured(), C2)
    assert fit.options.filter_hz < 100.0
    assert fit.theta[0] == pytest.approx(TRUTH[0], rel=3e-3)


def test_a_wide_band_biases_the_command_side_and_not_the_acceleration_side():
    run = simulate(seed=0, resolution=2e-6, duration_s=8.0, delay_samples=0.5)
    found = {
        left: fit_axis(
            run.measured(), C2, FitOptions(left=left, filter_hz=200.0)
        ).least_squares.theta
        for left in ("acceleration", "command")
    }
    assert found["acceleration"][0] == pytest.approx(TRUTH[0], rel=1e-3)
    assert found["acceleration"][4] == pytest.approx(TRUTH[4], rel=0.02)
    assert abs(found["command"][4] / TRUTH[4] - 1.0) > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ["least_squares", "instruments"])
def test_standard_errors_cover_the_truth(estimator):
    scores = []
    for seed in range(6):
        run = simulate(seed=100 + seed, duration_s=5.0, force_noise=0.05)
        fit = fit_axis(run.measured(), C2, FitOptions(estimator=estimator))
        scores.append((fit.theta - TRUTH) / fit.std_error)
    well_modelled = np.array(scores)[:, [0, 3, 4, 5]]
    assert np.mean(np.abs(well_modelled) < 2.0) > 0.8
    assert np.sqrt(np.mean(well_modelled**2)) > 0.4  # nor are they absurdly wide


def test_held_out_segments_are_not_fitted(run):
    options = FitOptions(fit_segments=((0.0, 6.0),), held_out_segments=((6.0, 12.0),))
    spoiled = run.command.copy()
    spoiled[run.time_s > 6.1] *= 1.5
    clean = fit_axis(run.measured(), C2, options)
    fit = fit_axis(run.measured(command=spoiled), C2, options)
    assert fit.held_out.relative > 0.2
    assert clean.held_out.relative < 0.01
    assert fit.columns.time_s.max() < 6.0
    np.testing.assert_allclose(fit.theta, clean.theta, rtol=0.02, atol=1e-3)


@pytest.mark.slow
def test_another_recording_gives_the_held_out_error(run, fitted):
    other = fit_axis(run.measured(), C2, None, simulate(seed=9).measured())
    assert np.array_equal(other.theta, fitted.theta)
    assert other.held_out.relative < 0.01
    heavier = simulate(seed=9, theta=(0.25, *X_THETA[1:])).measured()
    assert fit_axis(run.measured(), C2, None, heavier).held_out.relative > 0.1


def test_gaps_and_disabled_rows_do_not_disturb(run):
    kept = np.ones(len(run.position), dtype=bool)
    kept[20000:20005] = False
    position = run.position.copy()
    position[40000:] += 0.1  # the coordinate was moved while the axis was off
    usable = np.ones(len(kept), dtype=bool)
    usable[39990:40010] = False
    fields = {
        "time_s": run.time_s[kept],
        "position": position[kept],
        "command": run.command[kept],
        "usable": usable[kept],
        "reference": run.reference[kept],
        "reference_velocity": run.reference_velocity[kept],
    }
    fit = fit_axis(run.measured(**fields), C2)
    assert fit.theta[0] == pytest.approx(TRUTH[0], rel=1e-3)
    assert fit.error.relative < 0.01


def test_very_long_runs_are_taken_in_pieces(run, fitted, monkeypatch):
    monkeypatch.setattr("motorctl.identify.columns.measured.LONGEST_STRETCH", 9000)
    fit = fit_axis(run.measured(), C2)
    assert len(list(run.measured().stretches(100))) == 7
    np.testing.assert_allclose(fit.theta, fitted.theta, rtol=0.02)


def test_a_parameter_that_would_be_unphysical_is_held_at_its_bound_and_said_so():
    run = simulate(theta=(0.2, -0.05, 0.139, 0.01), seed=3)
    fit = fit_axis(run.measured(), C1)
    assert fit.least_squares.at_bound == {"viscous_friction": "lower"}
    assert fit.estimator == "least_squares"
    assert fit.value("viscous_friction") == 0.0
    assert fit.std_error[1] == 0.0
    assert any("viscous_friction" in note and "bound" in note for note in fit.notes)


def test_in_other_units_only_the_signs_of_the_bounds_hold():
    # a heavy axis whose command is a force: 5000 N s^2/m is far above the bound in volts
    run = simulate(theta=(0.5, 0.4, 0.2, 0.0), seed=1)
    data = run.measured(command=1e4 * run.command, command_unit="N")
    fit = fit_axis(data, C1)
    assert fit.least_squares.at_bound == {}
    assert fit.value("inertia") == pytest.approx(5000.0, rel=1e-3)


def test_motion_in_one_direction_cannot_tell_offset_from_coulomb_friction():
    run = simulate(seed=1)
    forward = run.reference_velocity > 0.05
    fit = fit_axis(run.measured(usable=forward), C1)
    told = " ".join(fit.notes)
    assert "coulomb_friction" in told
    assert "offset" in told


def test_instruments_need_a_reference(run):
    data = run.measured(reference=None, reference_velocity=None)
    fit = fit_axis(data, C2)
    assert fit.instruments is None
    assert fit.theta[0] == pytest.approx(TRUTH[0], rel=1e-3)


@pytest.mark.slow
def test_an_undeclared_force_does_not_carry_the_values_away_where_the_reference_is_known():
    # cogging that the controller answers is an error in the command, correlated with the motion
    theta = (0.67, 0.296, 0.182, 0.004, -0.0168, -0.00058)
    run = simulate(seed=0, theta=theta, cogging=0.4, duration_s=16.0, peak_acceleration=10.0)
    fit = fit_axis(run.measured(), C2)
    assert fit.estimator == "instruments"
    assert fit.theta[0] == pytest.approx(theta[0], rel=0.03)
    naive = fit_axis(run.measured(), C2, FitOptions(left="command"))
    assert naive.estimator == "least_squares"
    assert abs(naive.theta[0] / theta[0] - 1.0) > 0.1
    assert naive.disagreement()[0]
    assert any("disagree on inertia" in note for note in naive.notes)


def test_instruments_can_be_insisted_on_only_with_a_reference(run):
    data = run.measured(reference=None, reference_velocity=None)
    with pytest.raises(DataError, match="reference"):
        fit_axis(data, C2, FitOptions(estimator="instruments"))


def test_a_reference_that_has_nothing_to_do_with_the_motion_is_not_used(run):
    other = np.roll(run.reference, 17000)
    fit = fit_axis(run.measured(reference=other, reference_velocity=None), C2)
    assert fit.estimator == "least_squares"
    assert fit.theta[0] == pytest.approx(TRUTH[0], rel=1e-3)
