"""How much better a model explains rows that it was not fitted to: blocks left out in turn."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCK_S = 2.0
"""Length of the blocks that are held out in turn [s]. Shorter ones are correlated with their
neighbours and overrate a model, longer ones hold out whole places. Chosen by hand."""
FEWEST_BLOCKS = 6
"""Fewest blocks of a short recording: two a fold. Fewer leaves a fold one block, more makes them
correlated. Chosen by hand."""
LEAST_ROWS = 30
"""Fewest rows of a block, where rows come slowly. Fewer leaves blocks that say nothing alone,
more holds out whole places. Chosen by hand."""
FOLDS = 3
"""Groups of blocks that are held out in turn. More takes time, fewer fits each with less. Chosen by
hand."""
IN_STEP = 0.9
"""Correlation of the motion with itself, from one block to the next that is held out with it, at
which the two hold the same part of a motion that repeats. Larger judges a model on parts of the
motion that it was never fitted to, smaller changes blocks that do no harm. Chosen by hand: a real
arm whose motion repeats after 12 s, and turns round after 6, has -0.96."""
LONGER = (1.0, 1.25, 1.5)
"""Lengths of blocks that are tried where a motion repeats in step with them, over the usual one.
Further apart hold out whole places, closer together stay in step. Chosen by hand."""
NOTHING = 1e-200
"""Sum of squares of a column that is nothing but rounding, as a spline's where no row comes. Larger
drops true columns, smaller lets their coefficients overflow. Convention: far below any signal's,
far above the smallest double, 2e-308."""
RIDGE = 1e-13
"""Added to the diagonal of the normal equations once the columns have length one: keeps what is
collinear solvable. Larger pulls estimates to zero, smaller is lost in rounding (2e-16 times the
condition). Chosen by hand."""
SMOOTHING = 1e-5
"""The same for the columns of a spline, many of whose knots few rows may show. Larger flattens the
spline, smaller lets such knots run wild. Chosen by hand."""

TIED = 1e-2
"""The same for a parameter whose usual value is known, which draws it there: where the rest of a
recording has less than a hundredth of what shows it, it says less of it than is known anyway.
Larger hides that a value is another one, smaller lets a fold without the rare event run wild.
Chosen by hand: filters smear some thousandths of an event into the blocks beside it."""
AGREES = 0.25
"""Part by which all rows together may find another value than the usual one, for it to be used.
Larger lets a form that only happens to fit one event pass, smaller misses a true one beside a wrong
friction. Chosen by hand: limits of supplies came out 0 to 3 % off."""


@dataclass(frozen=True)
class Blocks:
    """Consecutive rows in blocks; b blocks of at most q rows."""

    count: int
    length: int

    def split(self, *parts: Array) -> Array:
        """Return columns, (p_i, m) each, as (b, p, q), zero where the last block is short."""
        m, p = parts[0].shape[1], 0
        blocks = np.zeros((self.count, sum(map(len, parts)), self.length))
        whole = m // self.length
        for part in parts:
            here = slice(p, p := p + len(part))
            full = part[:, : whole * self.length].reshape(len(part), whole, self.length)
            blocks[:whole, here] = full.swapaxes(0, 1)
            if whole < self.count:
                blocks[whole, here, : m - whole * self.length] = part[:, whole * self.length :]
        return blocks


def make_blocks(rows: int, row_period_s: float, block_s: float = BLOCK_S) -> Blocks:
    """Choose blocks of about two seconds, but not fewer than six."""
    count = max(FEWEST_BLOCKS, min(round(rows * row_period_s / block_s), rows // LEAST_ROWS))
    length = -(-rows // count)
    return Blocks(-(-rows // length), length)


def blocks_out_of_step(motion: Array, row_period_s: float) -> Blocks:
    """Choose blocks of which those that are held out together hold different parts of a motion.

    Every third block is held out at a time. Where the motion repeats after three blocks, or turns
    round by then, whole parts of it are in no block that is left, and what is fitted there says
    nothing of them.

    Parameters
    ----------
    motion
        The velocity at the rows, (m,).
    row_period_s
        From one row to the next.
    """
    tried = [make_blocks(len(motion), row_period_s, BLOCK_S * longer) for longer in LONGER]
    return next((blocks for blocks in tried if _step(motion, blocks) < IN_STEP), tried[0])


def _step(motion: Array, blocks: Blocks) -> float:
    """Return how alike the motion is in blocks that are held out together, 0 to 1."""
    later, earlier = motion[FOLDS * blocks.length :], motion[: -FOLDS * blocks.length]
    size = float(np.linalg.norm(later) * np.linalg.norm(earlier))
    return abs(float(later @ earlier)) / size if size > 0.0 else 0.0


@dataclass(frozen=True)
class BlockedRegression:
    """Products of the columns [X, y] in each block: all that least squares needs."""

    blocks: Blocks
    parts: tuple[Array, ...]
    """The columns in order, (b, p_i, q) each: the left side last."""
    gram: Array
    """(b, p + 1, p + 1)"""
    soft: NDArray[np.bool_]
    """(p,) columns of splines, which are held near zero where rows say little of them."""
    tied: Array
    """(p,) what a coefficient is over the first one where rows say little of it; NaN: unknown."""

    @cached_property
    def columns(self) -> Array:
        """The columns together, (b, p + 1, q): most forms are judged by their products alone."""
        return self.parts[0] if len(self.parts) == 1 else np.concatenate(self.parts, axis=1)

    @cached_property
    def total(self) -> Array:
        """The products over all blocks, (p + 1, p + 1)."""
        return np.asarray(self.gram.sum(axis=0))

    @property
    def size(self) -> int:
        """Number of columns on the right side."""
        return int(self.gram.shape[1]) - 1

    def joined(self, rows: int) -> Array:
        """Return the columns without their blocks, (p + 1, m), the left side last."""
        return np.asarray(self.columns.swapaxes(0, 1).reshape(self.size + 1, -1)[:, :rows])


def make_problem(
    blocks: Blocks,
    X: Array,
    y: Array,
    soft: NDArray[np.bool_] | None = None,
    tied: Array | None = None,
) -> BlockedRegression:
    """Form the products of X (p, m) and y (m,); all coefficients are free by default."""
    columns = blocks.split(X, y[None])
    held = np.zeros(len(X), dtype=np.bool_) if soft is None else soft
    ratios = np.full(len(X), np.nan) if tied is None else tied
    return BlockedRegression(blocks, (columns,), columns @ columns.swapaxes(1, 2), held, ratios)


def with_columns(
    problem: BlockedRegression, added: Array, soft: bool = False, tied: Array | None = None
) -> BlockedRegression:
    """Add columns (p2, m) to the right side, before the left one; `tied` is (p2,)."""
    extra = problem.blocks.split(added)
    gram = _gram_with(problem.gram, problem.columns, extra)
    n, p2 = problem.size, len(added)
    parts = (problem.columns[:, :n], extra, problem.columns[:, n:])
    held = np.concatenate([problem.soft, np.full(p2, soft)])
    ratios = np.concatenate([problem.tied, np.full(p2, np.nan) if tied is None else tied])
    return BlockedRegression(problem.blocks, parts, gram, held, ratios)


def total_with(problem: BlockedRegression, added: Iterable[Array]) -> Array:
    """Return the products over all blocks with columns added as by `with_columns`, (q, q).

    Parameters
    ----------
    problem
        To whose right side they are added.
    added
        The columns of the first rows, (p2, m_1), of those after them, (p2, m_2), and so on: of a
        long recording many columns need not be there at once.
    """
    length, grams, first = problem.blocks.length, [], 0

    def multiplied(rows: Array) -> int:
        blocks = Blocks(-(-rows.shape[1] // length), length)
        here = slice(first, first + blocks.count)
        grams.append(_gram_with(problem.gram[here], problem.columns[here], blocks.split(rows)))
        return blocks.count

    waiting = np.zeros((0, 0))
    for part in added:
        waiting = np.concatenate([waiting, part], axis=1) if waiting.size else part
        whole = waiting.shape[1] // length * length
        if whole:
            first += multiplied(waiting[:, :whole])
            waiting = waiting[:, whole:].copy()
    if waiting.size:
        multiplied(waiting)
    return np.asarray(np.concatenate(grams).sum(axis=0))


def _gram_with(gram: Array, columns: Array, extra: Array) -> Array:
    """Return the products of columns (b, n + 1, q) and of extra ones (b, p2, q) before the last."""
    cross, own = columns @ extra.swapaxes(1, 2), extra @ extra.swapaxes(1, 2)
    n, p2 = gram.shape[1] - 1, extra.shape[1]
    old, new = slice(n), slice(n, n + p2)
    every = np.empty((len(own), n + p2 + 1, n + p2 + 1))
    every[:, old, old] = gram[:, :n, :n]
    every[:, old, -1] = every[:, -1, old] = gram[:, :n, n]
    every[:, -1, -1] = gram[:, n, n]
    every[:, old, new], every[:, -1, new] = cross[:, :n], cross[:, n]
    every[:, new, old], every[:, new, -1] = cross[:, :n].swapaxes(1, 2), cross[:, n]
    every[:, new, new] = own
    return every


@dataclass(frozen=True)
class BlockedFit:
    """Least squares over all rows."""

    b: Array
    """(p,)"""
    covariance: Array
    """(p, p) for rows of variance one."""
    sse: float
    """Sum of squared residuals."""


def solve(problem: BlockedRegression, whole: BlockedRegression | None = None) -> BlockedFit:
    """Fit all rows.

    `whole` is the problem of which these rows are a part: what is near zero in them alone, as
    knots where they hardly come, is then held near zero and not blown up, and a parameter whose
    usual value is known near that.
    """
    total = problem.total
    A, g, scale = _scaled(total, None if whole is None else whole.total)
    ridge = np.diag(np.where(problem.soft, SMOOTHING, RIDGE))
    ridge = ridge if whole is None else ridge + _ties(whole, scale)
    inverse = np.linalg.inv(A + ridge)
    b = inverse @ g
    sse = float(total[-1, -1] - 2.0 * b @ g + b @ A @ b)
    return BlockedFit(b / scale, inverse / np.outer(scale, scale), max(sse, 0.0))


def held_out_sse(problem: BlockedRegression) -> Array:
    """Return each fold's squared residuals under the fit to all others, (folds,).

    A fold is every third block, so that what only one block shows is not taken for knowledge.
    """
    unit = np.append(_lengths(problem.total), 1.0)
    folds = [problem.gram[k::FOLDS].sum(axis=0) for k in range(FOLDS)]
    gram = np.stack(folds) / np.outer(unit, unit)
    rest = gram.sum(axis=0) - gram
    ridge = np.diag(np.where(problem.soft, SMOOTHING, RIDGE)) + _ties(problem, unit[:-1])
    A = rest[:, :-1, :-1] + ridge
    b = np.linalg.solve(A, rest[:, :-1, -1:])
    own = gram[:, :-1, :-1]
    fitted = (b.swapaxes(1, 2) @ own @ b)[:, 0, 0]
    cross = (b.swapaxes(1, 2) @ gram[:, :-1, -1:])[:, 0, 0]
    return np.maximum(gram[:, -1, -1] - 2.0 * cross + fitted, 0.0)  # rounding


def rests_of_folds(problem: BlockedRegression) -> Array:
    """Return the products over what each fold is fitted to: the rows outside it, (folds, p, p)."""
    folds = [problem.gram[k::FOLDS].sum(axis=0) for k in range(FOLDS)]
    return np.asarray(problem.total - np.stack(folds))


def fit_of_fold(problem: BlockedRegression, fold: int) -> BlockedFit:
    """Fit the blocks of one fold alone."""
    parts = tuple(part[fold::FOLDS] for part in problem.parts)
    gram = problem.gram[fold::FOLDS]
    alone = BlockedRegression(problem.blocks, parts, gram, problem.soft, problem.tied)
    return solve(alone, problem)


def _ties(problem: BlockedRegression, scale: Array) -> Array:
    """Return what draws coefficients of scaled columns to what they usually are, (p, p).

    Only where all rows together agree with that: the form of a rare effect is chosen by the very
    rows that show it, and only a true one has the usual value there without being told.
    """
    ties = np.zeros((problem.size, problem.size))
    known = np.flatnonzero(np.isfinite(problem.tied))
    if not known.size:
        return ties
    b = solve(problem).b
    for j in known:
        if not abs(b[j] - problem.tied[j] * b[0]) < AGREES * abs(problem.tied[j] * b[0]):
            continue  # the recording as a whole says otherwise
        away = np.zeros(problem.size)
        away[j], away[0] = 1.0, -problem.tied[j] * scale[j] / scale[0]
        ties += TIED * np.outer(away, away)
    return ties


def _scaled(gram: Array, by: Array | None = None) -> tuple[Array, Array, Array]:
    scale = _lengths(gram if by is None else by)
    return gram[:-1, :-1] / np.outer(scale, scale), gram[:-1, -1] / scale, scale


def _lengths(gram: Array) -> Array:
    """Return the lengths of the columns on the right side, (p,)."""
    squares = gram.diagonal()[:-1]
    return np.asarray(np.sqrt(np.where(squares > NOTHING, squares, 1.0)))


def residual(problem: BlockedRegression, b: Array) -> Array:
    """Return y - X b at every row, (m',), zeros after the last."""
    left = problem.columns[:, -1]
    return np.asarray((left - np.einsum("bpq,p->bq", problem.columns[:, :-1], b)).ravel())
