"""The law in closed loop with a plant that is written apart from the model's kernels."""

import math

from numba import njit

from motorctl.control import law_step, project, start_law, violates
from motorctl.control.projection import form_covariance


@njit
def _acceleration(v, u, push, plant):
    """theta1 a = u + theta5 u|u| + theta6 u^3 - theta2 v - theta3 (2/pi) atan(slope v) + theta4."""
    thrust = u + plant.quadratic * u * abs(u) + plant.cubic * u**3
    friction = plant.viscous * v + plant.coulomb * (2.0 / math.pi) * math.atan(plant.slope * v)
    return (thrust - friction + plant.offset + push) / plant.inertia


@njit
def run_law(
    state_columns,
    input_columns,
    feedforward,
    input_map,
    input_slope,
    advance_context,
    advance_inputs,
    settings,
    state,
    plants,
    reference,
    push,
    rows,
    theta,
    gamma,
):
    """Track reference (N, 3) from the plant's start; fill rows (N,), theta (N, n), gamma (N, n, n).

    The command is held over a period; classical Runge-Kutta in between. push (N,) [V] disturbs.
    """
    law, plant, n = settings[0], plants[0], settings[0].n
    x, v = plant.start_m, plant.start_m_s
    h = law.period_s / plant.substeps
    for k in range(len(reference)):
        y = x
        if plant.resolution_m > 0.0:
            y = plant.resolution_m * math.floor(x / plant.resolution_m + 0.5)
        if k == 0:
            before = y - plant.start_m_s * law.period_s
            start_law(feedforward, advance_context, law, state[0], 0.0, before)
        xd, vd, ad = reference[k, 0], reference[k, 1], reference[k, 2]
        u = law_step(
            state_columns, input_columns, feedforward, input_map, input_slope, advance_context,
            advance_inputs, law, state[0], k * law.period_s, y, xd, vd, ad,
        )  # fmt: skip
        row = rows[k]
        row.x, row.v, row.y, row.u = x, v, y, u
        row.virtual, row.d0, row.flags = state[0].v, state[0].d0, state[0].flags
        if len(theta):
            for i in range(n):
                theta[k, i] = state[0].theta[i]
        if len(gamma):
            form_covariance(law, state[0])
            for i in range(n):
                for j in range(n):
                    gamma[k, i, j] = state[0].gamma[i, j]
        for _ in range(plant.substeps):
            a1 = _acceleration(v, u, push[k], plant)
            a2 = _acceleration(v + 0.5 * h * a1, u, push[k], plant)
            a3 = _acceleration(v + 0.5 * h * a2, u, push[k], plant)
            a4 = _acceleration(v + h * a3, u, push[k], plant)
            x += h * v + h * h * (a1 + a2 + a3) / 6.0
            v += h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0


@njit(cache=True)
def project_all(settings, states):
    """Project the estimate of every pair of records."""
    for k in range(len(settings)):
        project(settings[k], states[k])


@njit(cache=True)
def violating(settings, states):
    """Count the records whose estimate lies outside."""
    count = 0
    for k in range(len(settings)):
        count += violates(settings[k], states[k].theta)
    return count
