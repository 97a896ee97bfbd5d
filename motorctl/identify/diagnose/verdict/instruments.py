"""Parameters of the final model once more, with the reference as instrument.

With the recorded command on the left, the acceleration on the right carries the encoder's noise:
least squares makes inertia too small by the part that noise has in it. Columns formed from the
reference know nothing of that noise. So the right side is replaced by what of it follows from them
(two-stage least squares; P. C. Young, "Recursive Estimation and Time-Series Analysis", 2011,
chapter 6). With the acceleration on the left that noise stands where it biases nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.filters import second_difference
from motorctl.identify.columns.stretches import Stretch, command_for, smoothed
from motorctl.identify.diagnose.search.held_out_blocks import make_problem, solve
from motorctl.identify.diagnose.search.hypothesis import Hypothesis, Regressors
from motorctl.identify.diagnose.search.parameters import values_of
from motorctl.identify.diagnose.search.physics import beyond_physics

Array = NDArray[np.float64]

STRONG = 0.5
"""Part of each column that must follow from the reference. Larger uses instruments seldom, smaller
lets parameters run away that the reference says little of. Convention: more than half."""
SMALLEST_SINGULAR_VALUE = 1e-7
"""Singular value of the normalised instruments, relative to the largest, below which they repeat
each other. Larger drops instruments that tell parameters apart, smaller inverts rounding. Chosen by
hand: its square, which stands in the normal equations, is 1e-14, still above a double's 2e-16."""
LARGEST_COMMAND = 2.0
"""Command that the model may ask for along the reference, over the largest recorded one. Larger
lets a poor model's command run away, smaller clips peaks. Chosen by hand."""


def with_instruments(model: Hypothesis) -> Hypothesis | None:
    """Return a model whose parameters are estimated with the reference as instrument.

    None where nothing is gained by it (the acceleration stands on the left), where no reference was
    recorded, where it says too little of a column, and where physics forbids what comes out.
    """
    if model.regressors.side != "command" or not _has_reference(model):
        return None
    rows = model.regressors.signals.rows
    every = model.problem.joined(rows)
    X, y = every[:-1], every[-1]
    Z = _along_reference(model).problem.joined(rows)[:-1]
    lengths = np.linalg.norm(Z, axis=1, keepdims=True)
    _, s, basis = np.linalg.svd(Z / np.where(lengths > 0.0, lengths, 1.0), full_matrices=False)
    basis = basis[s > SMALLEST_SINGULAR_VALUE * s[0]]
    if len(basis) < len(X):
        return None
    told = (X @ basis.T) @ basis
    if np.any(np.sum(told**2, axis=1) < STRONG * np.sum(X**2, axis=1)):
        return None
    old, blocks = model.problem, model.regressors.blocks
    b = solve(make_problem(blocks, told, y, old.soft, old.tied)).b
    # The same parameters, and what they really leave: the standard errors come from it.
    problem = make_problem(blocks, told, b @ told + (y - b @ X), old.soft, old.tied)
    other = Hypothesis(model.regressors, model.added, model.acceleration)
    other.__dict__["problem"] = problem
    impossible = other.b[0] <= 0.0 or (other.added and beyond_physics(other))
    return None if impossible else other


def _has_reference(model: Hypothesis) -> bool:
    """Return whether there is a reference that is not the measured position once more."""
    data = model.regressors.signals.data
    if data.reference is None:
        return False
    reference, position = data.reference[data.usable], data.position[data.usable]
    return bool(np.all(np.isfinite(reference))) and not np.array_equal(reference, position)


def _along_reference(model: Hypothesis) -> Hypothesis:
    """Return the model along the reference, with the command that it asks for there."""
    signals, old, values = model.regressors.signals, model.regressors, values_of(model)
    data = signals.data
    assert data.reference is not None
    limit = LARGEST_COMMAND * signals.largest_command
    band_hz = min(2.0 * signals.band_hz, 0.45 * data.sample_rate_hz)
    stretches: list[Stretch] = []
    accelerations: list[Array] = []
    for s in signals.stretches:
        first = int(np.argmin(np.abs(data.time_s - s.time_s[0])))
        reference = data.reference[first : first + len(s.x)]
        x = smoothed(reference, band_hz, signals.period_s)
        v, a = np.gradient(x, signals.period_s), second_difference(x, signals.period_s)
        motion = replace(s, position=reference, x=x, v=v, quiet=v)
        command = command_for(motion, values.model, values.theta, a, limit)
        stretches.append(replace(motion, command=command))
        accelerations.append(a)
    regressors = Regressors(
        signals.with_stretches(tuple(stretches)), old.declared, old.blocks, old.side, old.catalogue
    )
    return Hypothesis(regressors, model.added, tuple(accelerations))
