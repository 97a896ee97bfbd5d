"""What an effect's compiled kernels compute."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from motorctl.model.conformance.driven import COMMAND, MOTION, PERIOD_S, Driven, strokes, wide
from motorctl.model.effect import Effect

often = settings(
    deadline=None,
    max_examples=60,
    suppress_health_check=[
        HealthCheck.function_scoped_fixture,  # an effect is frozen
        HealthCheck.differing_executors,  # the checks are inherited
    ],
)
TICKS = 2000
"""Ticks of a stroke to and fro, and rows of the columns that are told apart. More takes time, fewer
makes the stroke quicker and may pass by where two columns differ. Chosen by hand: 0.4 s."""
SCALES = (0.1, 1.0, 10.0)
"""Factors on the stroke of 0.7 m: 7 cm, 0.7 m and 7 m, for effects of a place. More takes time,
fewer may never reach the place where an effect of a short or of a long machine begins. Chosen by
hand."""
LONG_S = 60.0
"""Times at which effects without a memory are asked reach to here [s]: some begin late or last
long. Longer thins them out where an effect is quick, shorter ends before slow ones have begun.
Chosen by hand."""
INDEPENDENT = 1e-7
"""Smallest singular value of columns of length one; below it one of them is a combination of the
others. Larger refuses columns that differ in a small part of the motion, smaller takes rounding for
a difference. Chosen by hand: far above a double's rounding, 2e-16."""
NUDGE_V = 1e-6
"""Change of the command that tells a slope [V]; of commands beyond 1 V, a part of them. Larger
steps over what bends the column, smaller drowns in rounding. Chosen by hand."""
UNDONE = 1e-3
"""Part of an error of measurement that its correction may leave. Larger lets corrections pass that
hardly help, smaller refuses those that end after some steps. Chosen by hand."""


class FormulaChecks:
    """Columns, slopes and corrections."""

    @often
    @given(MOTION)
    def test_the_column_is_finite_for_any_motion(
        self, effect: Effect, motion: tuple[float, float, float, float, float]
    ) -> None:
        """What is not finite trips the axis."""
        _only(effect, "state")
        driven = Driven(effect)
        for dt in (0.0, PERIOD_S) if effect.remembers() else ():
            driven.advance(*motion[:3], dt)
        for j in driven.indices:
            found = driven.state(j, *motion)
            assert math.isfinite(found), f"column({j}) is {found} at {motion}"

    @often
    @given(COMMAND)
    def test_column_and_slope_are_finite_for_any_command(
        self, effect: Effect, command: tuple[float, float, float, float]
    ) -> None:
        """What is not finite trips the axis."""
        _only(effect, "input")
        driven = Driven(effect)
        for dt in (0.0, PERIOD_S) if effect.remembers() else ():
            driven.commit(command[0], dt)
        for j in driven.indices:
            for kernel in ("column", "slope"):
                found = driven.input(kernel, j, *command)
                assert math.isfinite(found), f"{kernel}({j}) is {found} at {command}"

    def test_kernels_raise_nothing_whatever_they_get(self, effect: Effect) -> None:
        """An exception would end the loop of every axis.

        Its own constants are among what it gets: a place where it begins divides by zero there.
        """
        driven = Driven(effect)
        own = [sign * float(c) for c in effect.constants for sign in (1.0, -1.0)]
        for bad in (math.nan, math.inf, -math.inf, 0.0, 5e-324, 1.8e308, *own):
            if effect.kind == "state":
                if effect.remembers():
                    driven.advance(bad, bad, bad, 0.0)
                for j in driven.indices:
                    driven.state(j, bad, bad, bad, bad, bad)
            elif effect.kind == "input":
                for j in driven.indices:
                    for kernel in ("column", "slope"):
                        driven.input(kernel, j, bad, bad, bad, bad)
                if effect.remembers():
                    driven.commit(bad, 0.0)
            elif effect.kind == "measurement":
                driven.correct(bad)

    @often
    @given(COMMAND, wide(10.0))
    def test_the_slope_is_the_derivative_of_the_column(
        self, effect: Effect, command: tuple[float, float, float, float], before: float
    ) -> None:
        """The inverse of the input map follows it; at a corner either side will do."""
        _only(effect, "input")
        driven = Driven(effect)
        if effect.remembers():
            driven.commit(before, PERIOD_S)
        u, *place = command
        u = math.fmod(u, 10.0)
        for j in driven.indices:
            slope = driven.input("slope", j, u, *place)
            here = driven.input("column", j, u, *place)
            step = NUDGE_V * max(1.0, abs(u))
            sides = [(driven.input("column", j, u + d, *place) - here) / d for d in (step, -step)]
            room = 1e-4 * (1.0 + max(map(abs, (*sides, here))))
            assert min(sides) - room <= slope <= max(sides) + room, (
                f"slope({j}) is {slope} at u = {u}; the column rises by {sides} there"
            )

    def test_no_command_adds_nothing(self, effect: Effect) -> None:
        """An axis that is started at rest begins without a bump."""
        _only(effect, "input")
        driven = Driven(effect)
        for j in driven.indices:
            found = driven.input("column", j, 0.0, 0.1, 0.2, 1.0)
            assert found == 0.0, f"column({j}) is {found} at u = 0"

    @often
    @given(COMMAND)
    def test_an_odd_effect_is_odd(
        self, effect: Effect, command: tuple[float, float, float, float]
    ) -> None:
        """Only one side of an odd input map is looked at."""
        _only(effect, "input")
        driven = Driven(effect)
        if not effect.odd or effect.remembers():
            pytest.skip("it is not odd from every memory")
        u, *place = command
        for j in driven.indices:
            there, back = (driven.input("column", j, value, *place) for value in (u, -u))
            assert there == pytest.approx(-back, rel=1e-9, abs=1e-12)

    def test_every_parameter_has_a_column_of_its_own(self, effect: Effect) -> None:
        """Two parameters of the same column, or one of none, cannot be identified."""
        if not effect.parameters:
            pytest.skip("it has no parameters")
        rows: list[list[float]] = []
        for scale in SCALES:
            rows += _columns_over(Driven(effect), scale)
        columns = np.array(rows)
        length = np.linalg.norm(columns, axis=0)
        assert length.all(), f"these columns are zero: {np.flatnonzero(length == 0.0).tolist()}"
        smallest = np.linalg.svd(columns / length, compute_uv=False)[-1]
        assert smallest > INDEPENDENT, "one column is a combination of the others"

    @often
    @given(wide(1.0))
    def test_the_correction_undoes_the_error(self, effect: Effect, x: float) -> None:
        """The law and the analysis see the position, not what the encoder makes of it."""
        _only(effect, "measurement")
        if not effect.amplitudes:
            pytest.skip("its error is not linear in options")
        driven = Driven(effect)
        sizes = [float(getattr(effect.options, name)) for name in effect.amplitudes]
        if not any(sizes):
            pytest.skip("this form has no error: give it amplitudes")
        error = sum(size * driven.error(j, x) for j, size in enumerate(sizes))
        left = driven.correct(x + error) - x
        assert abs(left) <= UNDONE * max(map(abs, sizes)) + 1e-15, (
            f"at x = {x} the error is {error}; {left} of it is left"
        )


def _columns_over(driven: Driven, scale: float) -> list[list[float]]:
    """Return the columns over a stroke to and fro, so many times as long as half a metre."""
    rows = []
    times = np.arange(TICKS) * PERIOD_S
    if not driven.effect.remembers():
        times = np.sort(np.random.default_rng(5).uniform(0.0, LONG_S, TICKS))
    for k, motion in enumerate(strokes(TICKS)):
        (x, v, a), u = (scale * part for part in motion[:3]), motion[3]
        t, dt = float(times[k]), PERIOD_S if k else 0.0
        if driven.effect.kind == "state":
            if driven.effect.remembers():
                driven.advance(x, v, a, dt)
            rows.append([driven.state(j, x, v, a, v, t) for j in driven.indices])
        else:
            rows.append([driven.input("column", j, u, x, v, t) for j in driven.indices])
            if driven.effect.remembers():
                driven.commit(u, dt)
    return rows


def _only(effect: Effect, kind: str) -> None:
    if effect.kind != kind:
        pytest.skip(f"for {kind} effects")
