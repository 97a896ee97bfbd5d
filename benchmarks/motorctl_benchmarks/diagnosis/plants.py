"""The machines of the campaign, before any effect is put in: what is drawn for one axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from motorctl_benchmarks.diagnosis.draw import Draw

Options = dict[str, Any]

MAX_VOLTAGE_V = 10.0
FULL_USE = 0.85
"""Share of the voltage that the fastest motion may need, everything in the plant included."""
SHORTEST_JERK_TIME_S = 0.008
END_CLEARANCE_M = 0.02


@dataclass(frozen=True)
class AxisPlant:
    """One axis with nothing in it but what the declared model describes; volts as in the model."""

    inertia: float
    viscous: float
    coulomb: float
    offset: float
    quadratic: float
    cubic: float
    low_m: float
    high_m: float
    max_velocity_m_s: float
    resolution_m: float
    encoder_noise_m: float
    force_noise_v: float
    converter_bits: int | None
    declares_saturation: bool
    """C2's six effects are declared, else C1's four; then the motor does not saturate."""

    @property
    def travel_m(self) -> float:
        """Length of the way between the soft limits."""
        return self.high_m - self.low_m

    @property
    def middle_m(self) -> float:
        """Middle of the travel."""
        return 0.5 * (self.low_m + self.high_m)

    def thrust_v(self, command_v: float) -> float:
        """Return the thrust that a positive command makes [V]."""
        return command_v + self.quadratic * command_v**2 + self.cubic * command_v**3

    def acceleration_within(self, reserve_v: float, added_inertia: float, gain: float) -> float:
        """Return the acceleration that `FULL_USE` of the voltage makes at full speed.

        Parameters
        ----------
        reserve_v
            Voltage kept for further forces [V].
        added_inertia
            Beyond the carriage's own [V s^2/m].
        gain
            Share of the thrust that is left.

        Returns
        -------
        float
            Acceleration [m/s^2].
        """
        thrust = gain * self.thrust_v(FULL_USE * MAX_VOLTAGE_V) - reserve_v
        against = self.viscous * self.max_velocity_m_s + self.coulomb + abs(self.offset)
        return (thrust - against) / (self.inertia + max(added_inertia, 0.0))

    def options(self) -> Options:
        """Write the axis as the simulator's options of one plant."""
        return {
            "inertia_v_s2_m": self.inertia,
            "viscous_friction_v_s_m": self.viscous,
            "coulomb_friction_v": self.coulomb,
            "offset_v": self.offset,
            "em_quadratic_1_v": self.quadratic,
            "em_cubic_1_v2": self.cubic,
            "force_noise_rms_v": self.force_noise_v,
            "travel_m": [self.low_m - END_CLEARANCE_M, self.high_m + END_CLEARANCE_M],
            "limit_switches_m": [
                self.low_m - END_CLEARANCE_M / 2,
                self.high_m + END_CLEARANCE_M / 2,
            ],
            "home_switch": None,
            "end_stop": {
                "stiffness_v_m": 2e6 * self.inertia,
                "damping_v_s_m": 750.0 * self.inertia,
            },
            "amplifier": {"max_voltage_v": MAX_VOLTAGE_V, "resolution_bits": self.converter_bits},
            "encoder": {"noise_rms_m": self.encoder_noise_m, "index_marks_m": []},
        }


def draw_axis(draw: Draw) -> AxisPlant:
    """Draw an axis between a light, fast one and a heavy, slow one of a gantry.

    Light: theta1 0.15 to 0.3 V s^2/m; heavy: 0.4 to 0.8. Both: viscous friction 0.15 to 0.35 V s/m,
    Coulomb friction 0.1 to 0.25 V, offset up to 0.05 V, a motor that loses a tenth to a quarter of
    its thrust at 10 V (a fifth of the axes: none), travel 0.3 to 0.8 m from its end or its middle,
    0.8 to 1.4 m/s, an encoder of 0.1 to 1 um (mostly 0.5), noise of force, encoder or both, a D/A
    converter of 14 or 16 bits or none.
    """
    light = draw.chance(0.5)
    saturates = draw.chance(0.8)
    travel = draw.uniform(0.3, 0.8)
    low = draw.pick((0.0, -0.5)) * travel
    resolution = draw.pick((0.1e-6, 0.2e-6, 0.5e-6, 1e-6), (1, 1, 7, 1))
    noisy_force, noisy_encoder = draw.pick(((1, 0), (0, 1), (1, 1)), (5, 2, 3))
    quadratic = draw.uniform(0.008, 0.014) if light else draw.uniform(0.011, 0.018)
    cubic = draw.uniform(5e-4, 11e-4) if light else draw.uniform(2.5e-4, 6e-4)
    return AxisPlant(
        inertia=draw.log_uniform(0.15, 0.3) if light else draw.log_uniform(0.4, 0.8),
        viscous=draw.uniform(0.15, 0.35),
        coulomb=draw.uniform(0.1, 0.25),
        offset=draw.uniform(-0.05, 0.05),
        quadratic=-quadratic if saturates else 0.0,
        cubic=-cubic if saturates else 0.0,
        low_m=low,
        high_m=low + travel,
        max_velocity_m_s=draw.uniform(0.8, 1.4) * min(1.0, travel / 0.4),
        resolution_m=resolution,
        encoder_noise_m=noisy_encoder * draw.uniform(0.05, 0.3) * resolution,
        force_noise_v=noisy_force * draw.log_uniform(0.3e-3, 2e-3),
        converter_bits=draw.pick((16, 14, None), (7, 1, 2)),
        declares_saturation=saturates,
    )
