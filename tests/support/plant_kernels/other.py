"""The axis of `other_plant` under its controller, sample by sample."""

import numpy as np
from numba import njit


@njit
def _turned_over(shape: int, y: float) -> float:
    if shape == 0:
        return np.tanh(y)
    if shape == 1:
        return 2.0 / np.pi * np.arctan(y)
    if shape == 2:
        return y / np.sqrt(1.0 + y * y)
    if shape == 3:
        return min(1.0, max(-1.0, y))
    return y / (1.0 + abs(y))


@njit(cache=True)
def run_axis(
    reference: np.ndarray, dt: float, p: np.ndarray, shape: int, noise: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    inertia, viscous, coulomb, width, cogging, pitch, gravity, resolution, w = p[:9]
    loss, stop, stiffness, stop_damping, load, load_w, load_zeta, load_coulomb = p[9:]
    stretch, stretching = 0.0, 0.0  # of the spring to the load
    n, fine = len(reference), 4
    h = dt / fine
    x, v, integral, slow_v = reference[0], 0.0, 0.0, 0.0
    before = x
    position, command = np.empty(n), np.empty(n)
    for k in range(n):
        seen = np.round(x / resolution) * resolution
        slow_v += 0.3 * ((seen - before) / dt - slow_v)
        before = seen
        after, past = reference[min(k + 1, n - 1)], reference[max(k - 1, 0)]
        rv, ra = (after - past) / (2.0 * dt), (after - 2.0 * reference[k] + past) / dt**2
        e = reference[k] - seen
        integral += e * dt
        feedback = w * w * e + 1.4 * w * (rv - slow_v) + 0.2 * w**3 * integral
        u = min(10.0, max(-10.0, inertia * (ra + feedback) + viscous * rv))
        position[k], command[k] = seen, u
        applied = u + noise[k]
        for _ in range(fine):
            force = applied - viscous * v - coulomb * _turned_over(shape, v / width)
            force -= cogging * np.sin(2.0 * np.pi * x / pitch) + gravity * np.sin(x)
            force -= loss * abs(applied) * _turned_over(shape, v / width)
            deep = x - stop
            if deep > 0.0:
                force -= max(0.0, stiffness * deep * (1.0 + stop_damping * v))
            pull = load_w * load_w * stretch + 2.0 * load_zeta * load_w * stretching
            a = (force - load * inertia * pull) / ((1.0 - load) * inertia)
            stretching += h * (a - pull)
            slides, most = v + h * a - stretching, h * load_coulomb / max(load * inertia, 1e-12)
            stretching += min(most, max(-most, slides))
            stretch += h * stretching
            v += h * a
            x += h * v
    return position, command
