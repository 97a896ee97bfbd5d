"""Whatever sensible machine is told to `motorctl init`, `check` accepts what it writes."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from motorctl.config import load, summarise
from motorctl.errors import UsageError
from motorctl.init import AxisKnown, MachineKnown, write_configuration
from motorctl.init.axis_numbers import axis_numbers
from motorctl.init.write import stand_in

pytestmark = pytest.mark.slow

BESIDES = ("canopen", "serial")
STAGE = AxisKnown("x", "sim", 0, 0.5e-6, 12.0, 30.0, (-0.2, 0.3), 0.8)


def written(folder, *axes, **known):
    machine = MachineKnown("machine", axes or (STAGE,), **known)
    return write_configuration(machine, folder / "machine.yaml", replace_file=True, delays_s=None)


@st.composite
def machines(draw):
    """Draw an axis that somebody could build: its speed can be reached on its travel."""
    mass_kg = draw(st.floats(0.05, 500.0))
    strongest_m_s2 = draw(st.floats(0.5, 200.0))
    travel_m = draw(st.floats(0.005, 5.0))
    low_m = draw(st.floats(-2.0, 2.0))
    share = draw(st.floats(0.01, 0.5))
    full_v = draw(st.sampled_from([5.0, 10.0, 48.0]))
    return AxisKnown(
        name="x",
        driver="sim",
        channel=0,
        resolution_m=draw(st.sampled_from([1e-9, 0.1e-6, 0.5e-6, 1e-6, 5e-6])),
        mass_kg=mass_kg,
        force_constant_n_v=mass_kg * strongest_m_s2 / full_v,
        travel_m=(low_m, low_m + travel_m),
        max_velocity_m_s=share * math.sqrt(strongest_m_s2 * travel_m),
        max_voltage_v=full_v,
        counter_bits=48,
        homing=draw(st.sampled_from(["absolute", "switch", "switch_index", "index"])),
    )


def random_machines(examples):
    return settings(
        max_examples=examples,
        deadline=None,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
    )


SHORT_AND_FAR = AxisKnown(
    name="x", driver="sim", channel=0, resolution_m=1e-9, mass_kg=1.0, force_constant_n_v=0.2,
    travel_m=(1.3852251608512702, 1.3902251608512701), max_velocity_m_s=0.0353553,
    max_voltage_v=5.0, counter_bits=48, homing="switch",
)  # fmt: skip
"""The switch that is guessed has to lie within its travel of 5 mm."""


@random_machines(6)
@example(SHORT_AND_FAR)
@given(machines())
def test_what_is_written_passes_check(tmp_path, axis):
    insist_on_check(tmp_path, axis)


@pytest.mark.slow
@random_machines(60)
@given(machines())
def test_what_is_written_of_many_machines_passes_check(tmp_path, axis):
    insist_on_check(tmp_path, axis)


def refusal(tmp_path, axis):
    """Return why nothing is written of an axis, empty where something is."""
    try:
        written(tmp_path, axis)
    except UsageError as error:
        return str(error)
    return ""


def insist_on_check(tmp_path, axis):
    """Accept a refusal only of encoders whose counts are coarse for the travel, in words."""
    if axis.resolution_m > 5e-6 * (axis.travel_m[1] - axis.travel_m[0]):
        told = refusal(tmp_path, axis)
        assert not told or "too short for this loop" in told
        if told:
            return
    machine = load(written(tmp_path, axis).path)
    own = machine.axes["x"]
    assert own.limits.travel_m == pytest.approx(axis.travel_m)
    assert own.estimates[0].initial == pytest.approx(axis.inertia_v_s2_m, rel=6e-3)
    summary = summarise(machine)
    margins = summary["axes"]["x"]["margins"][0]
    assert margins["stable"]
    assert margins["phase_margin_deg"] >= 44.9
    assert "thin margins" not in str(summary)  # nor at the bounds of the inertia, a period later


@pytest.mark.parametrize(
    "driver",
    ["can", "modbus", *(pytest.param(name, marks=pytest.mark.slow) for name in BESIDES)],
)
def test_a_machine_on_a_bus_gets_the_rate_that_the_bus_carries_and_its_delay(tmp_path, driver):
    axes = [replace(STAGE, name=name, driver=driver, channel=k) for k, name in enumerate("xy")]
    first = written(tmp_path, *axes)
    machine = load(first.path)
    assert 100 <= first.rate_hz <= 2500
    assert first.to_be_set  # nobody has told where the devices are
    directions = [words for words in first.to_be_set if ".encoder.direction: 1 where" in words]
    assert [words.split(".")[1] for words in directions] == ["x", "y"]
    notes = summarise(machine)["notes"]
    assert not [note for note in notes if "unstable" in note or "late" in note], notes
    known, delays_s = stand_in(MachineKnown("machine", tuple(axes)), first)
    other = write_configuration(
        known, tmp_path / "simulated.yaml", replace_file=False, delays_s=delays_s
    )
    assert not [words for words in other.to_be_set if "direction" in words]
    simulated = load(other.path)
    assert {d.cls.simulated for d in simulated.drivers.values()} == {True}
    for name, axis in machine.axes.items():
        assert simulated.axes[name].model.delay_s == axis.model.delay_s


def test_three_axes_of_which_one_is_on_modbus_run_in_one_loop_at_two_rates(tmp_path):
    slow = replace(STAGE, name="z", driver="modbus", max_velocity_m_s=0.1, homing="switch")
    first = written(tmp_path, STAGE, replace(STAGE, name="y", channel=1, mass_kg=40.0), slow)
    machine = load(first.path)
    assert first.rate_hz == 5000
    assert machine.period_of("z") == pytest.approx(1e-3)
    assert machine.axes["z"].model.delay_s == pytest.approx(1e-3)
    text = first.path.read_text()
    assert "# - drivers.modbus.tcp.host: the address of the coupler" in text
    assert "# V*s^2/m: 40 kg / 30 N/V" in text


def test_what_is_told_of_a_driver_goes_before_its_guess(tmp_path):
    axis = replace(STAGE, driver="modbus")
    told = {"modbus": {"tcp": {"host": "10.0.0.7"}, "device_turnaround_s": 0.001}}
    first = written(tmp_path, axis, driver_options=told)
    options = load(first.path).drivers["modbus"].options
    assert (options.tcp.host, options.tcp.port) == ("10.0.0.7", 502)
    assert not [told for told in first.to_be_set if "host" in told or "turnaround" in told]
    with pytest.raises(UsageError, match=r"--driver-option modbus\.tcp\.prot"):
        written(tmp_path, axis, driver_options={"modbus": {"tcp": {"prot": 1}}})


@pytest.mark.parametrize(
    ("axis", "words"),
    [
        (
            replace(STAGE, max_velocity_m_s=20.0),
            r"--max-velocity 20m/s: to stop .* at most 3\.4m/s",
        ),
        (replace(STAGE, max_acceleration_m_s2=30.0), r"--max-acceleration 30m/s\^2 needs .* at mo"),
        (replace(STAGE, friction_n=290.0), r"--friction 290N takes 9\.67 V of 10 V"),
        (replace(STAGE, mass_kg=12e6), r"12000000|1\.2e\+07 kg .* are the units"),
        (replace(STAGE, resolution_m=1e-3, travel_m=(0.0, 0.05)), "finer --encoder"),
        (replace(STAGE, max_voltage_v=10.0, counter_bits=8), "counter_bits"),
    ],
)
def test_what_does_not_fit_together_is_told_with_its_option_and_nothing_is_left(
    tmp_path, axis, words
):
    with pytest.raises(UsageError, match=words):
        written(tmp_path, axis)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_there_stays(tmp_path):
    path = tmp_path / "machine.yaml"
    path.write_text("mine")
    with pytest.raises(UsageError, match="is there already; --force replaces it"):
        write_configuration(
            MachineKnown("machine", (STAGE,)), path, replace_file=False, delays_s=None
        )
    assert path.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [path]


def test_the_arithmetic_of_the_published_gantry_comes_out_near_its_own_numbers():
    """Its axis x: 0.19 V*s^2/m, 10 V, 0.5 um, 5 kHz, and k1 250, ks 95, gamma_d 500."""
    known = replace(STAGE, mass_kg=0.19 * 30.0, max_velocity_m_s=1.5, travel_m=(-0.05, 0.45))
    numbers = axis_numbers(known, 1.0 / 5000.0, 0.0)
    gains = numbers.gains
    assert (gains.k1_1_s, gains.ks_v_s_m, gains.gamma_d) == pytest.approx((250, 95, 475))
    assert numbers.acceleration_m_s2 == pytest.approx(25.0, rel=0.05)  # half of the full command
    assert numbers.d_hat_max_v == 1.0
