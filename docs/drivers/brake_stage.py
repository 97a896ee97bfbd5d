"""A simulated axis of one's own: what the models know, and eddy currents that nobody declared."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from motorctl.hal import Driver, DriverOptions, RateBudget

SLOPE_S_M = 900.0  # how steeply Coulomb friction turns over at rest


class BrakeStage(Driver):
    """One axis in virtual time, its physics in volts of command."""

    class Options(DriverOptions):
        """What moves, and what brakes it."""

        inertia: float = Field(default=0.4, gt=0, description="V s^2/m")
        viscous: float = Field(default=0.3, description="V s/m")
        coulomb: float = Field(default=0.1, description="V")
        eddy: float = Field(default=2.0, description="V s/m, of the brake at slow speed")
        peak_velocity_m_s: float = Field(default=0.2, gt=0, description="where it brakes most")
        noise_v: float = Field(default=0.002, ge=0, description="white force noise, rms")
        seed: int = Field(default=1, description="of the noise")

    simulated = True
    supports_virtual_time = True

    def rate_budget(self):
        """No bus limits it: only the computer."""
        return RateBudget(20000.0, "simulated")

    def start_virtual_time(self):
        """Time passes by `advance` alone, here in any case."""

    def open(self):
        """Begin at rest at zero, with the same noise each time."""
        self._x = self._v = self._volts = 0.0
        self._random = np.random.default_rng(self.options.seed)

    def close(self):
        """Nothing to let go of."""

    def read(self, inputs):
        """Round the position to counts; there is nothing wrong to tell."""
        inputs.counts[0] = round(self._x / self.channels[0].resolution_m)
        inputs.status[0] = 0

    def write(self, outputs):
        """Keep the volts for the period that comes."""
        self._volts = float(outputs.volts[0]) if outputs.enable[0] else 0.0

    def safe(self):
        """Take the volts away."""
        self._volts = 0.0

    def advance(self):
        """Integrate one period of constant command by the midpoint rule."""
        force = self._volts + self.options.noise_v * self._random.standard_normal()
        dt, half = self.period_s, self._v + 0.5 * self.period_s * self._acceleration(force, self._v)
        self._x, self._v = self._x + dt * half, self._v + dt * self._acceleration(force, half)

    def _acceleration(self, force, v):
        o = self.options
        friction = o.viscous * v + o.coulomb * 2.0 / math.pi * math.atan(SLOPE_S_M * v)
        brake = o.eddy * v / (1.0 + (v / o.peak_velocity_m_s) ** 2)  # the undeclared force
        return (force - friction - brake) / o.inertia
