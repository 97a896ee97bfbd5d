"""A model on trial: the declared effects and those that were added, as columns of rows."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.command_timing import AT_ONCE, CommandPath, held_parts
from motorctl.identify.columns.kept_spectra import Spectra
from motorctl.identify.columns.left_side import Side, acceleration_form
from motorctl.identify.columns.signals import Signals
from motorctl.identify.columns.stretches import Stretch, smoothed
from motorctl.identify.diagnose.search.held_out_blocks import (
    BlockedFit,
    BlockedRegression,
    Blocks,
    held_out_sse,
    make_blocks,
    make_problem,
    solve,
    with_columns,
)
from motorctl.model import Effect, EffectList, basic_effects, known_effects
from motorctl.model.columns import form_key, uses_acceleration
from motorctl.model.sign_function import slope_of

Array = NDArray[np.float64]


MOST_PHYSICAL = 3
"""Parameters that a spline may have and still be as stiff as a formula: a single cubic polynomial
needs no holding. Larger lets knots that few rows show take up noise, smaller holds polynomials
back. Arithmetic: a cubic without its constant has three."""
PREDICTED_BAND = 1.5
"""Band of the predicted acceleration, in multiples of the rows' band. Smaller distorts what acts on
the acceleration, larger adds the measurement's noise. Chosen by hand."""


Catalogue = Mapping[str, type[Effect]]
"""Effects that may be tried, by name."""


_OF_DECLARED = ("command_energy", "declared_held_out")
"""What regressors keep that depends on the declared model."""


class Regressors:
    """Columns of effects over the rows of one signals; those of a hypothesis are formed once."""

    def __init__(
        self,
        signals: Signals,
        declared: EffectList,
        blocks: Blocks,
        left: Side = "acceleration",
        catalogue: Catalogue | None = None,
    ) -> None:
        self.signals = signals
        self.side = left
        self.catalogue = known_effects() if catalogue is None else catalogue
        self.declared = declared
        self.blocks = blocks
        self.left = signals.acceleration()
        self.offset: Array | None = None
        """(m,) added to the left side: for twins of the recording."""
        self._columns: dict[object, Array] = {}
        self._spectra: dict[object, Spectra] = {}

    def with_offset(self, offset: Array) -> Regressors:
        """Return regressors with the same columns and another left side."""
        other = copy.copy(self)
        other.offset = offset
        return other

    def with_declared(self, declared: EffectList) -> Regressors:
        """Return regressors of another declared model; columns that both have are formed once."""
        other = copy.copy(self)
        other.declared = declared
        other.signals = self.signals.turning_over(slope_of(declared.effects))
        for name in _OF_DECLARED:
            other.__dict__.pop(name, None)
        return other

    @property
    def command_column(self) -> int:
        """Which column of a problem is the command: the last one is what stands on the left."""
        return -1 if self.side == "command" else 0

    @cached_property
    def command_energy(self) -> float:
        """Sum of squares of the command in the rows, in the units of what is left over."""
        whole = Hypothesis(self).refreshed()
        command = whole.problem.columns[:, self.command_column]
        scale = 1.0 if self.side == "command" else float(whole.b[0]) ** 2
        return float(np.sum(command**2)) * scale

    @cached_property
    def declared_held_out(self) -> float:
        """Squared residuals that the declared model alone leaves of rows held out."""
        return Hypothesis(self).refreshed().held_out

    def inputs(self, effects: Sequence[Effect], path: CommandPath) -> Array:
        """Return the command and the columns of input effects, (1 + p, m)."""
        key = (path, tuple(map(form_key, effects)))
        if key not in self._columns:
            self._columns[key] = self.signals.inputs(effects, path, keep=True)
        return self._columns[key]

    def measured_acceleration(self, undo: CommandPath) -> Array:
        """Return the acceleration behind a path of the command that is taken back, (m,)."""
        if undo == AT_ONCE:
            return self.left
        return np.asarray(self._undone("left", self.signals.acceleration_spectra, undo)[0])

    def state(
        self, effect: Effect, acceleration: Sequence[Array] | None, undo: CommandPath
    ) -> Array:
        """Return the columns of a state effect, (p, m); the acceleration only where it acts."""
        signals = self.signals
        if uses_acceleration(effect):
            return signals.rows_of(signals.state_spectra(effect, acceleration), undo)
        return self._undone(form_key(effect), lambda: signals.state_spectra(effect), undo)

    def measurement(self, effect: Effect, undo: CommandPath) -> Array:
        """Return the columns of an error of the measured position, (q, m)."""
        spectra = self.signals.measurement_spectra
        return self._undone(form_key(effect), lambda: spectra(effect), undo)

    def _undone(self, key: object, spectra: Callable[[], Spectra], undo: CommandPath) -> Array:
        """Return columns behind a path that is taken back, formed anew only where they must be.

        Many paths are tried with the command on the left: there the spectra are kept.
        """
        if (key, undo) not in self._columns:
            if self.side == "command" and key not in self._spectra:
                self._spectra[key] = spectra()
            kept = self._spectra[key] if self.side == "command" else spectra()
            if undo != AT_ONCE:
                return self.signals.rows_of(kept, undo)
            self._columns[key, undo] = self.signals.rows_of(kept)
        return self._columns[key, undo]


@dataclass(frozen=True)
class Hypothesis:
    """The declared effects and `added` ones."""

    regressors: Regressors
    added: tuple[Effect, ...] = ()
    acceleration: tuple[Array, ...] | None = field(default=None, repr=False)
    """What an earlier hypothesis predicts, (N,) for each stretch: for effects that act on it."""

    @property
    def path(self) -> CommandPath:
        """What the hypothesis says happens to the command."""
        every = (*self.regressors.declared.effects, *self.added)
        return CommandPath(sum(e.delay_s for e in every), sum(e.lag_s for e in every))

    @property
    def undone(self) -> CommandPath:
        """What of the path is taken back on the right: with the command on the left, all of it.

        There the recorded command is what every hypothesis has to give; one that could delay or
        smooth it would choose its own target.
        """
        return self.path if self.regressors.side == "command" else AT_ONCE

    @property
    def applied(self) -> CommandPath:
        """What of the path the command's own columns go through: all that is not undone."""
        return AT_ONCE if self.regressors.side == "command" else self.path

    def of_kind(self, kind: str) -> list[Effect]:
        """Return declared effects of a kind, then the added ones; without inertia.

        Declared errors of the measurement have been corrected before the position was recorded.
        """
        declared = () if kind == "measurement" else self.regressors.declared.effects
        every = [*declared, *self.added]
        return [e for e in every if e.kind == kind and e.proportional_to != "acceleration"]

    @cached_property
    def places(self) -> tuple[tuple[Effect, int], ...]:
        """Return effect and parameter of each column but the first, which is the command."""
        found = [
            (e, j)
            for kind in ("input", "state")
            for e in self.of_kind(kind)
            for j in range(len(e.parameters))
        ]
        found += [(e, j) for e in self.of_kind("measurement") for j in range(len(e.amplitudes))]
        return tuple(found)

    @property
    def names(self) -> tuple[str, ...]:
        """Return the effect that each column belongs to; the first, the command, is inertia's."""
        inertia = basic_effects()["acceleration"].name
        return (inertia, *(effect.name for effect, _ in self.places))

    @cached_property
    def problem(self) -> BlockedRegression:
        """The regression of the acceleration, or of the recorded command, on all columns."""
        regressors, undo = self.regressors, self.undone
        command_is_left = regressors.side == "command"
        columns = [regressors.inputs(self.of_kind("input"), self.applied)]
        columns += [regressors.state(e, self.acceleration, undo) for e in self.of_kind("state")]
        columns += [regressors.measurement(e, undo) for e in self.of_kind("measurement")]
        X, y = np.vstack(columns), regressors.left
        held = [i for i, (e, j) in enumerate(self.places, 1) if j in held_columns(e)]
        X[held] = 0.0
        if command_is_left:
            y, X = X[0].copy(), np.vstack([regressors.measured_acceleration(undo)[None], X[1:]])
        if self.regressors.offset is not None:
            y = y + self.regressors.offset
        return make_problem(self.regressors.blocks, X, y, self._soft(), self._tied())

    def _soft(self) -> NDArray[np.bool_]:
        return np.array([False, *(is_loose(effect) for effect, _ in self.places)])

    def _tied(self) -> Array:
        """Return what coefficients usually are over the command's; unknown where that is left."""
        ratios = np.array([math.nan, *(usual_ratios(effect)[j] for effect, j in self.places)])
        if self.regressors.side == "command":
            ratios[:] = math.nan
        return ratios

    @cached_property
    def solution(self) -> BlockedFit:
        """The fit to all rows."""
        return solve(self.problem)

    @cached_property
    def b(self) -> Array:
        """Coefficients with the acceleration on the left, whichever side was fitted."""
        return acceleration_form(self.solution.b, self.regressors.side)

    def noise_sse(self, force_noise: float) -> float:
        """Return the squared residual that noise alone would leave."""
        signals = self.regressors.signals
        if self.regressors.side == "acceleration":
            return signals.row_variance(force_noise) * signals.rows
        return signals.noise_variance(force_noise) * signals.rows / float(self.b[0]) ** 2

    @cached_property
    def held_out(self) -> float:
        """Sum of squared residuals of blocks that were left out of the fit."""
        return float(held_out_sse(self.problem).sum())

    def plus(self, effect: Effect) -> Hypothesis:
        """Add an effect."""
        return Hypothesis(self.regressors, (*self.added, effect), self.acceleration)

    def without(self, name: str) -> Hypothesis:
        """Take an added effect away."""
        kept = tuple(effect for effect in self.added if effect.name != name)
        return Hypothesis(self.regressors, kept, self.acceleration)

    def exchanged(self, effect: Effect) -> Hypothesis:
        """Put another form of an added effect in its place."""
        forms = tuple(effect if old.name == effect.name else old for old in self.added)
        return Hypothesis(self.regressors, forms, self.acceleration)

    def extended(
        self, effect: Effect, scan: bool = False, coarse: bool = False
    ) -> BlockedRegression:
        """Return the regression with an effect added, formed from that without it where possible.

        coarse forms the columns of a state effect at the rate of the rows. scan does, too, and is
        for a form that each round tries anew: its columns are kept.
        """
        if effect.kind == "command":
            return self.plus(effect).problem
        signals, undo = self.regressors.signals, self.undone
        if effect.kind == "measurement":
            spectra = signals.measurement_spectra(effect, keep=scan)
            return with_columns(self.problem, signals.rows_of(spectra, undo))
        if effect.kind == "input":
            columns = signals.input(effect, self.applied, keep=scan)
        else:
            step = signals.decimation if scan or coarse else None
            spectra = signals.state_spectra(effect, self.acceleration, step, keep=scan)
            columns = signals.rows_of(spectra, undo)
        held = held_columns(effect)
        if held:
            columns = columns.copy()
            columns[held] = 0.0
        return with_columns(self.problem, columns, is_loose(effect), usual_ratios(effect))

    def refreshed(self) -> Hypothesis:
        """Let effects that act on the acceleration see the one that this hypothesis predicts.

        With the command on the left it is the measured one, as for inertia itself: what is
        predicted from the command would explain the command by itself.
        """
        if self.regressors.side == "command":
            acceleration = self.regressors.signals.smoothed_acceleration(PREDICTED_BAND)
        else:
            acceleration = self.predicted_acceleration(rigid=True)
        return Hypothesis(self.regressors, self.added, tuple(acceleration))

    def on(self, signals: Signals) -> Hypothesis:
        """Return the hypothesis on other signals, with the parameters that were fitted here."""
        old, blocks = self.regressors, make_blocks(signals.rows, signals.row_period_s)
        regressors = Regressors(signals, old.declared, blocks, old.side, old.catalogue)
        moved = Hypothesis(regressors, self.added)
        moved.__dict__["solution"] = self.solution
        moved = moved.refreshed()
        moved.__dict__["solution"] = self.solution
        return moved

    def predicted_acceleration(self, *, rigid: bool = False) -> list[Array]:
        """Return the acceleration that the model gives the recorded command.

        A mode's columns are formed on what the machine would do without it (`rigid`): on the
        machine's own acceleration a sharp mode would be found by a fixed point that diverges.
        `parameters` turns what is found into the mode itself.
        """
        signals, b = self.regressors.signals, self.b
        predictions = []
        inputs, states = self.of_kind("input"), self.of_kind("state")
        for k, s in enumerate(signals.stretches):
            n = 1 + sum(len(e.parameters) for e in inputs)
            total = np.zeros_like(s.x)
            for weight, u in held_parts(s.command, self.path, signals.period_s):
                held = [u[None], *(s.columns(e, None, u) for e in inputs)]
                total += weight * (b[:n] @ np.concatenate(held))
            i = n
            for e in states:
                a = None if self.acceleration is None else self.acceleration[k]
                columns = s.columns(e, a)
                if "resonance" not in e.groups:
                    total = total + b[i : i + len(columns)] @ columns
                i += len(columns)
            # what is beyond the band would be folded into it where columns are formed more coarsely
            total = smoothed(total, PREDICTED_BAND * signals.band_hz, signals.period_s)
            predictions.append(total if rigid else total + self._of_resonances(s, total))
        return predictions

    def _of_resonances(self, s: Stretch, rigid: Array) -> Array:
        """Return what resonances add to the acceleration of a rigid machine."""
        added = np.zeros_like(rigid)
        for e in self.of_kind("state"):
            if "resonance" not in e.groups:
                continue
            mode = e
            shares = tuple(-b for b, name in zip(self.b, self.names, strict=True) if name == e.name)
            if self.regressors.side == "command":  # there it was fitted on the machine's own
                mode, shares = e.on_rigid_acceleration(shares)
            added -= np.asarray(shares) @ s.columns(mode, rigid)
        return added


def held_columns(effect: Effect) -> list[int]:
    """Return which columns of an effect belong to parameters that are held at zero."""
    if not effect.held or effect.kind == "measurement":
        return []
    return [j for j, p in enumerate(effect.parameters) if p.name in effect.held]


def usual_ratios(effect: Effect) -> Array:
    """Return what the coefficients of an effect's columns usually are over the command's.

    (p,); NaN where that is not known before a recording. An input effect's column is -h(u), so that
    all of h(u) is lost where its coefficient is minus the command's.
    """
    if effect.kind == "measurement":
        return np.full(len(effect.amplitudes), np.nan)
    return np.array([-effect.usual.get(p.name, math.nan) for p in effect.parameters])


def is_loose(effect: Effect) -> bool:
    """Return whether an effect is a spline of so many parts that rows may say little of some."""
    return effect.is_spline and len(effect.parameters) > MOST_PHYSICAL
