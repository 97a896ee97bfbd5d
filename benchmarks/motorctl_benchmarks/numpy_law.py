"""The same control law in plain numpy: the peer that the compiled one is measured beside.

Written apart from motorctl.control, from the same equations: Z. Chen, B. Yao, Q. Wang, IEEE/ASME
Trans. Mechatronics 18(3), 2013, pp. 1122-1129. Vectors are numpy arrays; scalars are Python
floats, which are faster than numpy's, as `dot` is than `@` for so few numbers. The least squares
have the covariance form, which needs fewer numpy calls than UD and agrees with it in double
precision.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from motorctl.control.law_records import HISTORY

Array = NDArray[np.float64]

NEWTON_STEPS = 50
CLOSE = 1e-13
"""Violation, in standard deviations of the estimate, that counts as none."""


class NumpyLaw:
    """DCDIARC for psi = [a, v, Sf(v), -1] (C1) or with [-u|u|, -u^3] as well (C2)."""

    def __init__(self, settings: np.void, state: np.void, slope_s_m: float) -> None:
        """Begin where records of motorctl.control.law_records stand; they are not changed."""
        n = int(settings["n"])
        self._n = n
        self._period = float(settings["period_s"])
        self._k1, self._ks = float(settings["k1_1_s"]), float(settings["ks_v_s_m"])
        self._gamma_d, self._d_max = float(settings["gamma_d"]), float(settings["d_hat_max_v"])
        self._u_max = float(settings["max_voltage_v"])
        self._slope = slope_s_m
        self._forgetting, self._nu = float(settings["forgetting"]), float(settings["normalisation"])
        self._blend = 1.0 - float(settings["filter_pole"])
        self._gate_v = float(settings["gate_velocity_m_s"])
        self._gate_a = float(settings["gate_acceleration_m_s2"])
        self._rate_limit = float(settings["rate_limit_1_s"])
        self._delay, self._part = int(settings["delay_ticks"]), float(settings["delay_fraction"])
        self._lower, self._upper = settings["lower"][:n].copy(), settings["upper"][:n].copy()
        self._weight = 1.0 / settings["covariance"][:n]
        self._limit = settings["covariance_limit"][:n].copy()
        planes = int(settings["planes"])
        # The box and Assumption 2's half-planes, read as normals @ theta <= bounds.
        self._normals = np.vstack([np.eye(n), -np.eye(n), -settings["plane_normal"][:planes, :n]])
        self._bounds = np.concatenate(
            [self._upper, -self._lower, -settings["plane_offset"][:planes]]
        )

        self.theta: Array = state["theta"][:n].copy()
        U = state["U"][:n, :n]
        self._covariance: Array = (U * state["D"][:n]) @ U.T
        self.d0 = float(state["d0"])
        self._y1, self._y2 = float(state["y1"]), float(state["y2"])
        self._vd1 = float(state["vd1"])
        self._steps = int(state["steps"])
        # Columns of the last commands that depend on u, and u itself; the record keeps a ring.
        kept = np.roll(state["history"], -(self._steps % HISTORY), axis=0)[:, 4 : n + 1]
        self._past = deque(kept.tolist(), maxlen=HISTORY)
        self._stage1 = np.array([*state["stage1"][: n + 1], state["stage1_v"], state["stage1_a"]])
        self._stage2 = np.array([*state["stage2"][: n + 1], state["stage2_v"], state["stage2_a"]])
        self.adapted = False

    def step(self, y: float, xd: float, vd: float, ad: float) -> float:
        """Compute the command and learn, Eqs 9-19.

        Parameters
        ----------
        y
            Measured position [m].
        xd, vd, ad
            Desired position [m], velocity [m/s] and acceleration [m/s^2].

        Returns
        -------
        float
            The command u [V].
        """
        theta = self.theta.tolist()
        p = (y - self._y1) / self._period - vd + self._k1 * (y - xd)
        va1 = theta[0] * ad + theta[1] * vd + theta[2] * self._direction(vd) - theta[3]
        u = self._invert(va1 - self.d0 - self._ks * p, theta)
        push = self._gamma_d * p
        if abs(u) < self._u_max or push * u >= 0.0:
            d0 = self.d0 + self._period * push
            self.d0 = min(max(d0, -self._d_max), self._d_max)
        self._adapt(y)
        self._past.append([-u * abs(u), -u * u * u, u] if self._n == 6 else [u])
        self._y2, self._y1, self._vd1 = self._y1, y, vd
        self._steps += 1
        return u

    def _direction(self, v: float) -> float:
        return 2.0 / math.pi * math.atan(self._slope * v)

    def _invert(self, v: float, theta: list[float]) -> float:
        """Solve v = u + theta5 u|u| + theta6 u^3 by Newton from u = v, eq. 9."""
        top = self._u_max
        if self._n == 4:
            return min(max(v, -top), top)
        t5, t6 = theta[4], theta[5]
        if abs(v) >= top + t5 * top * top + t6 * top**3:
            return math.copysign(top, v)
        u = v
        for _ in range(NEWTON_STEPS):
            size = abs(u)
            step = (u + t5 * u * size + t6 * u**3 - v) / (1.0 + 2.0 * t5 * size + 3.0 * t6 * u * u)
            u -= step
            if abs(step) <= 4e-16 * (1.0 + size):
                break
        return u

    def _adapt(self, y: float) -> None:
        """Least squares with forgetting, eqs 25-28 exactly discretised, then the projection."""
        self.adapted = False
        if self._steps < 3 + self._delay:
            return
        ts, n, past, part = self._period, self._n, self._past, self._part
        velocity = (y - self._y2) / (2.0 * ts)
        acceleration = (y - 2.0 * self._y1 + self._y2) / (ts * ts)
        newest = -1 - self._delay
        inputs = [
            0.5 * ((1.0 - part) * now + before + part * oldest)
            for now, before, oldest in zip(
                past[newest], past[newest - 1], past[newest - 2], strict=True
            )
        ]
        moving = self._direction(self._vd1)
        signals = np.array([acceleration, velocity, moving, -1.0, *inputs, velocity, acceleration])
        self._stage1 += self._blend * (signals - self._stage1)
        self._stage2 += self._blend * (self._stage1 - self._stage2)
        filtered = self._stage2
        if abs(filtered[-2]) <= self._gate_v and abs(filtered[-1]) <= self._gate_a:
            return
        psi = filtered[:n]
        residual = float(filtered[n] - psi.dot(self.theta))
        lever = self._covariance.dot(psi)
        spread = float(psi.dot(lever))
        wound_up = (self._covariance.diagonal() > self._limit).any()
        forgetting = 1.0 if wound_up else self._forgetting
        gain = lever / (forgetting * (1.0 + self._nu * spread) / ts + spread)
        change = gain * residual
        rate = math.sqrt(change.dot(change * self._weight)) / ts
        if not math.isfinite(rate):
            return
        if rate > self._rate_limit:
            self.theta = self.theta + change * (self._rate_limit / rate)
        else:
            self.theta = self.theta + change
            self._covariance = (self._covariance - gain[:, None] * lever) / forgetting
        self.adapted = True
        if (self._normals.dot(self.theta) > self._bounds).any():
            self._project()

    def _project(self) -> None:
        """Move theta to the nearest point of box and half-planes in the metric of the covariance.

        The dual is a non-negative least-squares problem: the active-set method of Lawson and
        Hanson (Solving Least Squares Problems, 1974, ch. 23).
        """
        theta, covariance = self.theta, self._covariance
        normals, bounds = self._normals, self._bounds
        spreads = np.sqrt(((normals @ covariance) * normals).sum(axis=1))
        active: list[int] = []
        known = np.zeros(0)
        nearest = theta
        while len(active) < self._n:
            excess = (normals @ nearest - bounds) / spreads
            excess[active] = 0.0
            worst = int(excess.argmax())
            if excess[worst] <= CLOSE:
                break
            active.append(worst)
            known = np.append(known, 0.0)
            while True:
                chosen = normals[active]
                wanted = np.linalg.solve(
                    chosen @ covariance @ chosen.T, chosen @ theta - bounds[active]
                )
                if (wanted > 0.0).all():
                    known = wanted
                    break
                falling = wanted <= 0.0
                way = np.min(known[falling] / (known[falling] - wanted[falling]))
                known = known + way * (wanted - known)
                kept = known > 1e-15 * np.abs(wanted).max()
                active = [index for index, keep in zip(active, kept, strict=True) if keep]
                known = known[kept]
            nearest = theta - covariance @ (normals[active].T @ known)
        self.theta = np.clip(nearest, self._lower, self._upper)
