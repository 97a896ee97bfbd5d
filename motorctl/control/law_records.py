"""Records that the compiled law works on: its settings and its state, with named fields."""

from __future__ import annotations

from enum import IntFlag
from functools import cache

import numpy as np

HISTORY = 64
"""Ticks of past commands that the estimator can reach back; bounds the input delay."""
MAX_HALF_PLANES = 64


class LawFlag(IntFlag):
    """What the law did in a step."""

    SATURATED = 1
    ADAPTED = 2
    PROJECTED = 4


LAW_GIVEN = (
    ("k1_1_s", "f8"),
    ("ks_v_s_m", "f8"),
    ("gamma_d", "f8"),
    ("d_hat_max_v", "f8"),
    ("max_voltage_v", "f8"),
    ("enabled", "i8"),  # whether theta is adapted
    ("normalisation", "f8"),  # nu
    ("gate_velocity_m_s", "f8"),
    ("gate_acceleration_m_s2", "f8"),
    ("rate_limit_1_s", "f8"),
)
"""Settings that the law takes as they are given, by these names; the configuration's keys have
the same ones. Whatever is added here has to be given to `fill_settings`."""


@cache  # one for all: a running loop need not put it together, nor look through it
def law_settings(parameters: int) -> np.dtype[np.void]:
    """Return the layout of the settings record of the law.

    Parameters
    ----------
    parameters
        Entries of the longest theta that it holds.

    Returns
    -------
    dtype
        A structured numpy type, aligned as C has it.
    """
    p = parameters
    return np.dtype(
        [
            *LAW_GIVEN,
            ("n", "i8"),  # entries of theta in use
            ("motion_memory", "i8"),  # entries of the context that follow the motion; they lead
            ("period_s", "f8"),
            ("matched", "i8"),  # de/dt is the difference of two errors
            ("forgetting", "f8"),  # lambda = exp(-alpha Ts)
            ("filter_pole", "f8"),  # exp(-omega Ts), twice
            ("delay_ticks", "i8"),  # whole part of the delay from the command to what acts
            ("delay_fraction", "f8"),
            ("previews", "i8"),  # the list declares a lag or a delay
            ("preview_s", "f8"),  # how far ahead `far` is: a period and the declared delay
            ("act_delay_s", "f8"),  # the declared delay alone
            ("lag_s", "f8"),
            ("lag_decay", "f8"),  # exp(-Ts / lag)
            ("filters", "i8"),  # the feedback's part of the command goes through a filter
            ("filter_b", "f8", (3,)),
            ("filter_a", "f8", (2,)),
            ("lag_mean", "f8"),  # mean of exp(-t / lag) over a period
            ("lower", "f8", (p,)),
            ("upper", "f8", (p,)),
            ("covariance", "f8", (p,)),  # Gamma(0)
            ("covariance_limit", "f8", (p,)),  # on the diagonal of Gamma
            ("planes", "i8"),
            ("plane_normal", "f8", (MAX_HALF_PLANES, p)),  # normal . theta >= offset
            ("plane_offset", "f8", (MAX_HALF_PLANES,)),
        ],
        align=True,
    )


@cache
def law_state(parameters: int, context_size: int = 0, other_axes: int = 0) -> np.dtype[np.void]:
    """Return the layout of the state record of the law.

    Parameters
    ----------
    parameters
        Entries of the longest theta that it holds.
    context_size
        Numbers that the effects of the list remember, at most.
    other_axes
        Axes on whose motion the effects depend, at most.

    Returns
    -------
    dtype
        A structured numpy type, aligned as C has it.
    """
    p, c, m = parameters, max(1, context_size), max(1, other_axes)
    return np.dtype(
        [
            ("theta", "f8", (p,)),
            ("U", "f8", (p, p)),  # Gamma = U diag(D) U^T, U unit upper triangular
            ("D", "f8", (p,)),
            ("d0", "f8"),
            ("learned_v", "f8"),  # that its owner adds to the command in this step
            ("filter", "f8", (2,)),  # memory of the filter of the feedback's part of v
            ("feedback", "f8"),  # that part before and behind the filter, in the last step
            ("filtered", "f8"),
            ("u", "f8"),  # the command of the last step
            ("v", "f8"),  # its virtual command
            ("flags", "i8"),
            ("steps", "i8"),  # since the law was started
            ("blind", "i8"),  # the position is not known yet: nothing is learned
            ("y1", "f8"),  # position one tick ago
            ("y2", "f8"),
            ("xd1", "f8"),  # desired position and velocity one tick ago, and its time
            ("vd1", "f8"),
            ("t1", "f8"),
            ("near", "f8", (3,)),  # desired x, v, a when this tick's command begins to act
            ("far", "f8", (3,)),  # and a period later
            ("others", "f8", (m, 3)),  # desired x, v, a of the axes that effects depend on
            ("others_far", "f8", (m, 3)),
            # the effects' memories at the desired motion, for va1, and after the last command
            ("context", "f8", (c,)),
            # and at the motion of one tick ago, and after what acted last, for the adaptation
            ("context1", "f8", (c,)),
            ("lagged", "f8"),  # what acts at the end of the last command's period
            ("history", "f8", (HISTORY, p + 1)),  # input columns and u, a ring
            ("stage1", "f8", (p + 1,)),  # the filter on every column and u
            ("stage2", "f8", (p + 1,)),
            ("stage1_v", "f8"),  # and on velocity and acceleration, for the gate
            ("stage2_v", "f8"),
            ("stage1_a", "f8"),
            ("stage2_a", "f8"),
            ("row", "f8", (p + 1,)),  # work space
            ("gain", "f8", (p,)),
            ("f", "f8", (p,)),
            ("g", "f8", (p,)),
            ("gamma", "f8", (p, p)),
            ("active", "i8", (p + 1,)),  # the projection's active constraints
            ("multiplier", "f8", (p + 1,)),
            ("coupling", "f8", (p + 1,)),  # of the active constraints with a new one
            ("response", "f8", (p + 1,)),  # of their multipliers to its multiplier
            ("dual", "f8", (p + 1, p + 2)),
            ("lever", "f8", (p + 1, p)),  # Gamma times each active normal
            ("normal", "f8", (p,)),
            ("z", "f8", (p,)),
        ],
        align=True,
    )
