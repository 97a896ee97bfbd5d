"""Models that have to prove themselves: axis by axis, in motions under a tightened limit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from motorctl.config.machine import Machine
from motorctl.config.model_keys import model_of
from motorctl.log.sample import AxisState, FaultCause

TRIAL_MOTIONS = 3
"""So many motions of an axis without a trip prove its model. More keep the limit tight for longer,
fewer prove less. By hand."""
TRIAL_WINDOW = 0.5
"""The part of the limits of following error that they have. Larger lets a bad model go further,
smaller trips good ones. By hand: an axis in order stays far below half of its limit."""
TRIPS = frozenset(
    {
        FaultCause.FOLLOWING_ERROR,
        FaultCause.SATURATION,
        FaultCause.OVERSPEED,
        FaultCause.NOT_A_NUMBER,
        FaultCause.SOFT_LIMIT,
        FaultCause.LIMIT_SWITCH,
        FaultCause.SKEW,
        FaultCause.THERMAL,
    }
)
"""Faults that a model may be the cause of."""


@dataclass
class _OnTrial:
    proven: Machine
    """With the axis' model that proved itself last: where a trip leads back to."""
    motions: int = 0
    moving: bool = False


class ModelTrials:
    """Which axes are on trial; changed at once, so that it can be looked at at any time.

    Parameters
    ----------
    names
        Of all axes, in the machine's order.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._names = tuple(names)
        self._axes: dict[str, _OnTrial] = {}

    def changed(self, before: Machine, after: Machine, axes: Iterable[str]) -> ModelTrials:
        """Return the trials once other models run: what is on trial already leads back as far.

        Parameters
        ----------
        before, after
            What ran, and what runs then.
        axes
            Those with another model; one that gets the model back that it proved is not on trial.
        """
        trials = ModelTrials(self._names)
        trials._axes = dict(self._axes)
        for name in axes:
            earlier = trials._axes.pop(name, None)
            proven = before if earlier is None else earlier.proven
            if model_of(proven, name) != model_of(after, name):
                trials._axes[name] = _OnTrial(proven)
        return trials

    def ended(self, axes: Iterable[str]) -> ModelTrials:
        """Return the trials without those of some axes."""
        return self.taken_back(ModelTrials(self._names), axes)

    def taken_back(self, earlier: ModelTrials, axes: Iterable[str]) -> ModelTrials:
        """Return the trials with those of some axes as they were earlier: what ran then runs again.

        Parameters
        ----------
        earlier
            Of what ran before.
        axes
            That run it again.
        """
        trials, back = ModelTrials(self._names), set(axes)
        trials._axes = {name: on for name, on in self._axes.items() if name not in back}
        trials._axes |= {n: _OnTrial(on.proven) for n, on in earlier._axes.items() if n in back}
        return trials

    def look(self, states: Mapping[str, AxisState], faults: Mapping[str, FaultCause]) -> list[str]:
        """Count the motions that ended by themselves; return the axes that tripped.

        Where one did, the axes on trial that stopped together with it are among them.

        Parameters
        ----------
        states
            Of every axis.
        faults
            What each axis has tripped on; NONE while it is in no fault.
        """
        for name, on in self._axes.items():
            if states[name] is AxisState.RUNNING:
                on.moving = True
            elif on.moving:
                on.moving = False
                # A motion that a stop, a fault or anything else ended has proved nothing.
                on.motions += states[name] is AxisState.IDLE
        if not any(faults[name] in TRIPS for name in self._axes):
            return []
        return [n for n in self._axes if faults[n] in TRIPS or faults[n] is FaultCause.PARTNER]

    @property
    def proved(self) -> list[str]:
        """Axes whose model has proved itself."""
        return [name for name, on in self._axes.items() if on.motions >= TRIAL_MOTIONS]

    @property
    def windows(self) -> tuple[float, ...]:
        """The part of its limits of following error that each axis of the machine has."""
        return tuple(TRIAL_WINDOW if name in self._axes else 1.0 for name in self._names)

    def motions_left(self, axis: str) -> int | None:
        """Return how many motions prove an axis' model from here on; None: it is not on trial."""
        on = self._axes.get(axis)
        return None if on is None else max(TRIAL_MOTIONS - on.motions, 1)

    def proven(self, axis: str) -> Machine | None:
        """Return a machine with the model that an axis proved last; None: it is not on trial."""
        on = self._axes.get(axis)
        return None if on is None else on.proven
