"""Another simulated axis, by other formulas: frictions of several shapes, a joint under gravity.

It shares nothing with the model, with the simulated gantry, or with `fit_plant`: another controller
(PID with feedforward and a filtered velocity), another integrator (semi-implicit Euler), friction
turned over by formulas that the declared model may or may not have.
"""

from dataclasses import dataclass

import numpy as np

from motorctl.identify.columns.measured import Measured
from motorctl.kernels import kernels_cached

with kernels_cached():
    from plant_kernels.other import run_axis

RATE_HZ = 5000.0
SHAPES = ("tanh", "arctan", "algebraic", "clip", "rational")


@dataclass(frozen=True)
class OtherPlant:
    """What the axis is, in volts and metres (or radians)."""

    inertia: float = 0.25
    viscous: float = 0.3
    coulomb: float = 0.2
    shape: str = "tanh"
    width_m_s: float = 1e-3
    """Speed at which friction has turned over."""
    cogging: float = 0.0
    pitch_m: float = 0.06
    gravity: float = 0.0
    """Times sin x."""
    loss: float = 0.0
    """Part of the motor's force that its transmission turns into friction."""
    stop_m: float = np.inf
    """Where a stop begins."""
    stop_stiffness: float = 0.0
    stop_damping_s_m: float = 0.0
    """Of the stop, in parts of its force (Hunt and Crossley)."""
    load: float = 0.0
    """Part of the inertia that hangs on a spring, with the encoder on the motor's side."""
    load_hz: float = 20.0
    """Of the load, with the motor held still."""
    load_damping: float = 0.05
    load_coulomb: float = 0.0
    """Dry friction of the load on a guide of its own."""
    resolution: float = 0.5e-6
    command_noise: float = 0.0
    peak_velocity: float = 0.8
    peak_acceleration: float = 8.0
    travel: float = 0.3
    bandwidth_hz: float = 25.0

    def run(self, seed: int, duration_s: float = 24.0) -> Measured:
        """Move it to random places and return what is measured."""
        reference = _random_moves(self, seed, duration_s)
        position, command = run_axis(
            reference,
            1.0 / RATE_HZ,
            np.array(
                [
                    self.inertia, self.viscous, self.coulomb, self.width_m_s, self.cogging,
                    self.pitch_m, self.gravity, self.resolution, 2.0 * np.pi * self.bandwidth_hz,
                    self.loss, self.stop_m, self.stop_stiffness, self.stop_damping_s_m, self.load,
                    2.0 * np.pi * self.load_hz, self.load_damping, self.load_coulomb,
                ]
            ),
            SHAPES.index(self.shape),
            self.command_noise * np.random.default_rng(seed).standard_normal(len(reference)),
        )  # fmt: skip
        return Measured(
            source="other.csv",
            axis="x",
            sample_rate_hz=RATE_HZ,
            time_s=np.arange(len(position)) / RATE_HZ,
            position=position,
            command=command,
            reference=reference,
            reference_velocity=None,
            usable=np.ones(len(position), dtype=bool),
            saturated=None,
            resolution=self.resolution,
            position_unit="m",
            command_unit="V",
        )


def _random_moves(plant: OtherPlant, seed: int, duration_s: float) -> np.ndarray:
    random = np.random.default_rng(seed)
    place, t, parts = 0.1 * plant.travel, 0.0, []
    while t < duration_s:
        goal = random.uniform(0.0, plant.travel)
        way, speed = goal - place, random.uniform(0.06, 1.0) * plant.peak_velocity
        # A quintic's peak speed is 1.875 D/T, its peak acceleration 5.77 D/T^2.
        lasts = max(
            1.875 * abs(way) / speed, np.sqrt(5.78 * abs(way) / plant.peak_acceleration), 0.08
        )
        s = np.linspace(0.0, 1.0, int(lasts * RATE_HZ))
        parts.append(place + way * (10 * s**3 - 15 * s**4 + 6 * s**5))
        place, t = goal, t + lasts
        if random.random() < 0.5:
            rest = random.uniform(0.02, 0.25)
            parts.append(np.full(int(rest * RATE_HZ), goal))
            t += rest
    return np.concatenate(parts)[: int(duration_s * RATE_HZ)]
