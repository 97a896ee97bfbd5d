"""Projection of the estimate onto its box and half-planes, in the metric of the covariance."""

from __future__ import annotations

import math
from typing import Any

from motorctl.kernels import inner_kernel

TOLERANCE = 1e-13
"""Violation, in standard deviations of the estimate, that counts as none."""
DEPENDENT = 1e-11
"""Share of a normal's length, squared, outside the active normals' span that counts as none."""


@inner_kernel
def form_covariance(settings: Any, state: Any) -> None:
    """Form state.gamma = U diag(D) U^T."""
    U, D, gamma = state.U, state.D, state.gamma
    for i in range(settings.n):
        for j in range(i, settings.n):
            total = 0.0
            for k in range(j, settings.n):
                total += U[i, k] * D[k] * U[j, k]
            gamma[i, j] = total
            gamma[j, i] = total


@inner_kernel
def violates(settings: Any, theta: Any) -> bool:
    """Return whether theta lies outside the box or a half-plane."""
    n = settings.n
    for i in range(n):
        if theta[i] > settings.upper[i] or theta[i] < settings.lower[i]:
            return True
    for k in range(settings.planes):
        total = 0.0
        for i in range(n):
            total += settings.plane_normal[k, i] * theta[i]
        if total < settings.plane_offset[k]:
            return True
    return False


@inner_kernel
def _load_constraint(settings: Any, index: int, normal: Any) -> float:
    """Fill `normal` and return the bound of constraint `index`, read as normal . theta <= bound."""
    n = settings.n
    for i in range(n):
        normal[i] = 0.0
    if index < n:
        normal[index] = 1.0
        return settings.upper[index]  # type: ignore[no-any-return]
    if index < 2 * n:
        normal[index - n] = -1.0
        return -settings.lower[index - n]  # type: ignore[no-any-return]
    plane = index - 2 * n
    for i in range(n):
        normal[i] = -settings.plane_normal[plane, i]
    return -settings.plane_offset[plane]  # type: ignore[no-any-return]


@inner_kernel(error_model="numpy")
def _solve(matrix: Any, m: int, out: Any) -> None:
    """Solve the positive definite m x m system whose right side is column m of `matrix`."""
    for k in range(m):
        pivot = matrix[k, k]
        for i in range(k + 1, m):
            factor = matrix[i, k] / pivot
            for j in range(k, m + 1):
                matrix[i, j] -= factor * matrix[k, j]
    for k in range(m - 1, -1, -1):
        total = matrix[k, m]
        for j in range(k + 1, m):
            total -= matrix[k, j] * out[j]
        out[k] = total / matrix[k, k]


@inner_kernel(error_model="numpy")
def _most_violated(settings: Any, state: Any, m: int) -> int:
    """Return the constraint that state.z violates by most standard deviations, or -1."""
    n, gamma, z = settings.n, state.gamma, state.z
    worst, chosen = TOLERANCE, -1
    for index in range(2 * n + settings.planes):
        if index < 2 * n:
            i = index % n
            spread = gamma[i, i]
            excess = z[i] - settings.upper[i] if index < n else settings.lower[i] - z[i]
        else:
            plane = settings.plane_normal[index - 2 * n]
            excess, spread = settings.plane_offset[index - 2 * n], 0.0
            for i in range(n):
                excess -= plane[i] * z[i]
                for j in range(n):
                    spread += plane[i] * gamma[i, j] * plane[j]
        # What has no spread cannot be moved.
        if spread > 0.0 and excess > worst * math.sqrt(spread):
            active = False
            for k in range(m):
                active = active or state.active[k] == index
            if not active:
                worst, chosen = excess / math.sqrt(spread), index
    return chosen


@inner_kernel(error_model="numpy")
def _take_in(settings: Any, state: Any, m: int, chosen: int) -> int:
    """Make constraint `chosen` tight, dropping active ones that push the wrong way.

    m constraints are active before. Returns how many are afterwards, or -1 where nothing more can
    be done.
    """
    n = settings.n
    normal, lever, multiplier = state.normal, state.lever, state.multiplier
    coupling, response = state.coupling, state.response
    bound = _load_constraint(settings, chosen, normal)
    spread = 0.0
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += state.gamma[i, j] * normal[j]
        lever[m, i] = total
        spread += normal[i] * total
    multiplier[m] = 0.0
    while True:
        # How the multipliers of the active constraints answer to the new one's.
        for row in range(m):
            _load_constraint(settings, state.active[row], normal)
            for column in range(m + 1):
                total = 0.0
                for i in range(n):
                    total += normal[i] * lever[column, i]
                state.dual[row, column] = total
        for row in range(m):
            coupling[row] = state.dual[row, m]
        _solve(state.dual, m, response)
        free = spread
        for row in range(m):
            free -= coupling[row] * response[row]
        _load_constraint(settings, chosen, normal)
        excess = -bound
        for i in range(n):
            excess += normal[i] * state.z[i]
        reachable = free > DEPENDENT * spread
        step = excess / free if reachable else math.inf
        blocking = -1
        for k in range(m):
            if response[k] > 0.0 and multiplier[k] < step * response[k]:
                step, blocking = multiplier[k] / response[k], k
        if blocking < 0 and not reachable:
            return -1
        for k in range(m):
            multiplier[k] -= step * response[k]
        multiplier[m] += step
        for i in range(n):
            total = state.theta[i]
            for k in range(m + 1):
                total -= multiplier[k] * lever[k, i]
            state.z[i] = total
        if blocking < 0:
            state.active[m] = chosen
            return m + 1
        for k in range(blocking, m):
            if k < m - 1:
                state.active[k] = state.active[k + 1]
            multiplier[k] = multiplier[k + 1]
            for i in range(n):
                lever[k, i] = lever[k + 1, i]
        m -= 1


@inner_kernel
def project(settings: Any, state: Any) -> None:
    """Move state.theta to argmin (z - theta)^T Gamma^-1 (z - theta) over box and half-planes.

    The discrete counterpart of Yao's Proj (Chen, Yao, Wang 2013, eqs 7-8): it never increases
    the parameter error in the metric of Gamma^-1. Solved exactly by the dual active-set method
    (Goldfarb and Idnani, Mathematical Programming 27, 1983), which begins at theta and takes in
    one violated constraint after the other; it also copes with constraints whose normals depend
    on each other, such as a half-plane that cuts off a corner of the box.
    """
    n = settings.n
    form_covariance(settings, state)
    for i in range(n):
        state.z[i] = state.theta[i]
    m = 0
    for _ in range(8 * n + 8 * settings.planes):
        chosen = _most_violated(settings, state, m)
        if chosen < 0:
            break
        m = _take_in(settings, state, m, chosen)
        if m < 0:
            break
    # Rounding may leave the point outside by the last digit; the limits are limits.
    for i in range(n):
        state.theta[i] = min(max(state.z[i], settings.lower[i]), settings.upper[i])
