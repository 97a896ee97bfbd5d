"""How much a motion tells, beside least squares on all rows."""

import numpy as np
import pytest

from motorctl.experiment.information import Products, parted_by

RANDOM = np.random.default_rng(5)


def products(columns, left):
    every = np.vstack([columns, left[None]])
    return Products(every @ every.T, len(left), ())


def left_over(columns, left):
    b = np.linalg.lstsq(columns.T, left, rcond=None)[0]
    return float(np.sum((left - b @ columns) ** 2))


def test_what_parts_two_hypotheses_is_what_the_rival_leaves_of_both_recordings_after_its_refit():
    old, new = RANDOM.standard_normal((2, 2, 40))
    truth_b, variance = np.array([1.5, -0.7]), 0.3
    rival_old, rival_new = RANDOM.standard_normal((2, 3, 40))
    y_old = truth_b @ old + 0.1 * RANDOM.standard_normal(40)
    y_new = truth_b @ new
    told = parted_by(
        (products(rival_old, y_old), products(rival_new, y_new)),
        (products(old, y_old), products(new, y_new)),
        variance,
    )
    y = np.append(y_old, y_new)
    rival = left_over(np.hstack([rival_old, rival_new]), y) - left_over(rival_old, y_old)
    true = left_over(np.hstack([old, new]), y) - left_over(old, y_old)
    assert told == pytest.approx(0.5 * (rival - true) / variance, rel=1e-6)


def test_a_rival_that_can_draw_the_same_is_not_parted_whatever_the_motion():
    old, new = RANDOM.standard_normal((2, 2, 40))
    mixed = np.array([[2.0, 1.0], [0.5, -1.0]])
    y_old, y_new = np.array([1.0, 2.0]) @ old, np.array([1.0, 2.0]) @ new
    told = parted_by(
        (products(mixed @ old, y_old), products(mixed @ new, y_new)),
        (products(old, y_old), products(new, y_new)),
        1e-6,
    )
    assert told == pytest.approx(0.0, abs=1e-2)


def test_standard_errors_fall_as_more_rows_are_added():
    old, new = RANDOM.standard_normal((2, 2, 40))
    y = np.zeros(40)
    first, both = products(old, y), products(old, y).plus(products(new, y))
    inverse = np.linalg.inv(old @ old.T + new @ new.T)
    assert both.errors == pytest.approx(np.sqrt(np.diag(inverse)), rel=1e-6)
    assert np.all(both.errors < first.errors)
