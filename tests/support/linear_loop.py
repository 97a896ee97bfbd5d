"""A position loop written out by hand: a free mass, a delay of whole ticks, PI-PD feedback."""

import numpy as np

from motorctl.config.analysis import LoopGains
from motorctl.tune.recorded_loop import PlantEstimate, RecordedLoop

TS = 0.2e-3
MASS = 0.3
PERIOD = 2500
"""Rows of a period of the disturbance."""


def followed(gains, disturbance, *, mass=MASS, delay_ticks=2, periods=8, ahead=None):
    """Return error and d0_hat of the last three periods under a periodic disturbance [V].

    ahead: by how much the desired velocity is ahead of the measured one, over the same period.
    """
    ahead = np.zeros(len(disturbance)) if ahead is None else ahead
    x = v = before = d0 = 0.0
    late = [0.0] * delay_ticks
    errors, adapted = [], []
    for k in range(periods * len(disturbance)):
        p = (x - before) / TS + gains.k1_1_s * x - ahead[k % len(ahead)]
        late.append(-d0 - gains.ks_v_s_m * p)
        errors.append(x)
        adapted.append(d0)
        d0 += TS * gains.gamma_d * p
        before = x
        a = (late.pop(0) + disturbance[k % len(disturbance)]) / mass
        x, v = x + v * TS + 0.5 * a * TS * TS, v + a * TS
    rows = 3 * len(disturbance)
    return np.array(errors[-rows:]), np.array(adapted[-rows:])


def loop_of(
    gains, disturbance, *, bounds=(0.2, 0.5), noise_m=1e-7, delay_ticks=2, limit_v=1.0, ahead=None
):
    """Return what a log of such a loop tells."""
    error, d0_hat = followed(gains, disturbance, delay_ticks=delay_ticks, ahead=ahead)
    return RecordedLoop(
        axis="x",
        source="run.parquet",
        period_s=TS,
        gains=gains,
        d_hat_max_v=limit_v,
        max_voltage_v=10.0,
        error=error,
        d0_hat=d0_hat,
        ahead=np.zeros(len(error)) if ahead is None else np.tile(ahead, 3),
        goes_round=True,
        counted=2 * len(disturbance),
        plant=PlantEstimate(MASS, 0.0, bounds, (0.0, 0.0), delay_ticks * TS, 0.0),
        noise_rms_m=noise_m,
    )


def disturbance(rng):
    """Return a periodic disturbance [V] of tones from 2 to 120 Hz."""
    time_s = TS * np.arange(PERIOD)
    tones = 2.0 * np.arange(1, 61)
    sizes = rng.normal(size=60) / (1.0 + tones / 20.0)
    phases = rng.uniform(0.0, 2.0 * np.pi, 60)
    waves = sizes[:, None] * np.cos(2 * np.pi * tones[:, None] * time_s + phases[:, None])
    return 0.1 * waves.sum(axis=0)


GENTLE = LoopGains(100.0, 60.0, 400.0)
