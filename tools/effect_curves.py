"""What an effect does, as its own kernels compute it: the curves on the reference page of effects.

What goes along the horizontal axis follows from how the effect says that it is drawn; the form is
the one that it calls typical of an ordinary recording. So a new effect has its curves by itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motorctl.model import Effect
from motorctl.model.catalog import sample_form
from motorctl.model.contract import ORDINARY, VARIABLES
from motorctl.model.parameter import Parameter

Array = NDArray[np.float64]

POINTS = 240
"""Of a curve. Only looks and the size of the files depend on it. Chosen by hand."""
FINE = 20 * POINTS
"""Points of a motion that an effect remembers, or that is searched for where the effect acts. Fewer
miss impacts. Chosen by hand."""
SHARE = 0.25
"""Of the command that an input effect takes or adds where it is drawn: its parameter is such that
this much is seen. Only looks depend on it. Chosen by hand."""
COMMAND_V = 10.0
"""Up to where commands are drawn [V]: what amplifiers usually take. Chosen by hand."""
TURNOVERS = 10.0
"""How many times the speed at which a smooth sign turns over is drawn to each side [1]. Larger
makes a step of it. Chosen by hand."""
SWING_M_S = 0.1
"""Top speed of the swing to and fro for what remembers the motion [m/s]: slower lies within the
turning over of a smooth sign. Chosen by hand."""
SWING_SCALES = 4.0
"""Reach of that swing, in the effect's own size [1]. Chosen by hand."""
MOST_LABELS = 4
"""Curves that are told one by one. Only looks depend on it. Chosen by hand."""


@dataclass(frozen=True)
class Curve:
    """One line of a picture, of points (N,)."""

    label: str
    """Empty: told by the line before it."""
    x: Array
    y: Array
    faint: bool = False
    """What it would be without the effect."""


@dataclass(frozen=True)
class Curves:
    """What an effect's picture shows."""

    x_label: str
    y_label: str
    curves: Sequence[Curve]


@dataclass(frozen=True)
class Way:
    """A motion and a command along which an effect is drawn: each is (N,), or a number that stays.

    Position, velocity, acceleration, time and command, in m, s and V.
    """

    along: str
    """Which of these goes to the right."""
    label: str
    x: Array | float = 0.0
    v: Array | float = 0.0
    a: Array | float = 0.0
    t: Array | float = 0.0
    u: Array | float = 0.0
    beside: tuple[Array, Array, Array] | None = None
    """Position, velocity and acceleration of another axis."""
    words: str = ""
    """What tells it from the other ways of the same picture."""
    drawn_from: int = 0
    """The first of its points that is drawn: before it the memory settles."""

    def rows(self) -> Iterator[list[float]]:
        """Yield x, v, a, t, u, and x, v, a of the other axis."""
        beside = self.beside or (0.0, 0.0, 0.0)
        every = np.broadcast_arrays(self.x, self.v, self.a, self.t, self.u, *beside)
        yield from np.atleast_2d(np.column_stack(every)).astype(float).tolist()

    @property
    def right(self) -> Array:
        """What goes to the right, where it is drawn."""
        return np.asarray(getattr(self, self.along), np.float64)[self.drawn_from :]


def form_drawn(cls: type[Effect]) -> Effect:
    """Return the form of an effect that is drawn: as an ordinary recording suggests it.

    Parameters
    ----------
    cls
        The effect. One that no recording suggests has to be a smooth function of something.
    """
    if (form := sample_form(cls)) is not None:
        return form
    smooth = (cls.smooth_function((name,), ORDINARY) for name in VARIABLES)
    return next(form for form in smooth if form is not None)


def curves_of(cls: type[Effect]) -> Curves:
    """Return what an effect's picture shows.

    Parameters
    ----------
    cls
        The effect.
    """
    form = form_drawn(cls)
    drawn = {"state": _state, "input": _input, "command": _command, "measurement": _measurement}
    return drawn[form.kind](form)


# What each kind does.


def _state(form: Effect) -> Curves:
    """Return what an effect asks of the command, each of its parameters to the same height."""
    if form.over_acceleration(np.ones(1)) is not None:
        return _resonance(form)
    ways = _ways(form)
    columns = [_columns(form, way)[way.drawn_from :] for way in ways]
    heights = np.max(np.abs(np.concatenate(columns)), axis=0)
    many = len(form.parameters) > MOST_LABELS
    curves = []
    for j, parameter in enumerate(form.parameters):
        told = f"{parameter.symbol} = {_with_unit(1.0, parameter)}: at most {heights[j]:.3g} V"
        if many:
            every = f"each of {parameter.symbol} to {form.parameters[-1].symbol}"
            told = "" if j else f"{every} = {_with_unit(1.0, parameter)}"
        for way, found in zip(ways, columns, strict=True):
            label = f"{told}{way.words}" if told else ""
            curves.append(Curve(label, way.right, found[:, j] / (heights[j] or 1.0)))
    return Curves(ways[0].label, "command, of its most", curves)


def _input(form: Effect) -> Curves:
    """Return what of a command acts, beside the command."""
    way = _way_of_command(form)
    sent = np.broadcast_to(np.asarray(way.u, np.float64), (len(list(way.rows())),))
    added = _added(form, way)
    first = way.drawn_from
    curves = [Curve("the command u", way.right, sent[first:], faint=True)]
    for j, parameter in enumerate(form.parameters):
        part = SHARE * float(np.max(np.abs(sent))) / (float(np.max(np.abs(added[:, j]))) or 1.0)
        theta = form.usual.get(parameter.name, float(f"{part:.2g}"))
        acts = (sent + theta * added[:, j])[first:]
        curves.append(
            Curve(f"v(u) with {parameter.symbol} = {_with_unit(theta, parameter)}", way.right, acts)
        )
    return Curves(way.label, "command that acts [V]", curves)


def _command(form: Effect) -> Curves:
    """Return what of a step of the command acts: it comes late, then follows by a first order."""
    time_s = np.linspace(-1.0, 6.0, POINTS) * (form.lag_s + form.delay_s)
    late_s = time_s - form.delay_s
    acts = np.where(late_s >= 0.0, 1.0, 0.0)
    if form.lag_s:
        acts *= -np.expm1(-np.maximum(late_s, 0.0) / form.lag_s)
    told = {"lag": form.lag_s, "delay": form.delay_s}
    words = ", ".join(f"{name} {1e3 * value:.3g} ms" for name, value in told.items() if value)
    step = np.where(time_s >= 0.0, 1.0, 0.0)
    return Curves(
        "time [ms]", "of a step of 1 V [V]",
        [Curve("the command", 1e3 * time_s, step, faint=True),
         Curve(f"what acts: {words}", 1e3 * time_s, acts)],
    )  # fmt: skip


def _measurement(form: Effect) -> Curves:
    """Return the error of the measured position for each amplitude of one."""
    column = _plain(form.column)
    places = np.linspace(0.0, 2.0 * form.picture.scale, POINTS)
    curves = [
        Curve(
            f"{name.removesuffix('_m')} = 1 µm",
            1e6 * places,
            np.array([column(j, x, form.constants) for x in places.tolist()]),
        )
        for j, name in enumerate(form.amplitudes)
    ]
    return Curves("position [µm]", "error of the position [µm]", curves)


def _resonance(form: Effect) -> Curves:
    line = form.picture.scale
    frequency_hz = np.geomspace(line / 10.0, line * 10.0, POINTS)
    found = form.over_acceleration(2.0 * math.pi * frequency_hz)
    assert found is not None
    told = f"over that of the mass alone, resonance at {line:.3g} Hz"
    decades = np.log10(frequency_hz / line)
    return Curves(
        "frequency over the resonance's, in powers of ten",
        "force [dB]",
        [Curve(told, decades, 20.0 * np.log10(np.abs(found)))],
    )


# Along what they are drawn.


def _ways(form: Effect) -> list[Way]:
    kind, scale = form.picture.kind, form.picture.scale
    around = np.linspace(-1.0, 1.0, POINTS)
    if form.proportional_to == "acceleration":
        return [Way("a", "acceleration [m/s²]", a=ORDINARY.acceleration_m_s2 * around)]
    if form.other_axes:
        x, v, a, t = _swing(0.1, 2.0 * math.pi)
        return [Way("t", "time [s]; the other axis swings by ±0.1 m", t=t, beside=(x, v, a))]
    if form.memory_size:
        reach = SWING_SCALES * scale
        x, v, a, t = _swing(reach, SWING_M_S / reach)
        along, label = ("t", "time [s]") if form.leaves_bursts else ("x", "position [m]")
        label += f"; it swings by ±{reach:.2g} m"
        return [Way(along, label, x=x, v=v, a=a, t=t, drawn_from=len(t) // 2)]
    if kind in ("mass_over_time", "folded_over_time"):
        label = "time [s]" + ("; at 1 m/s²" if kind == "mass_over_time" else "")
        return [Way("t", label, t=np.linspace(0.0, 2.0 * scale, POINTS), a=1.0)]
    if kind == "friction_over_position":
        places, fast = np.linspace(*ORDINARY.position_m, POINTS), ORDINARY.speed_m_s
        sides = (("to the right", fast), ("to the left", -fast))
        return [Way("x", "position [m]", x=places, v=v, words=f", {way}") for way, v in sides]
    if kind in ("folded_over_pitch", "force_over_position") or form.smooth_function(
        ("position",), ORDINARY
    ):
        return [_where_it_acts(form, *((-scale, scale) if scale else ORDINARY.position_m))]
    return [Way("v", "velocity [m/s]", v=_top_speed(form) * around)]


def _way_of_command(form: Effect) -> Way:
    kind, scale = form.picture.kind, form.picture.scale
    around = np.linspace(-1.0, 1.0, POINTS)
    if kind == "gain_over_time":
        time_s = np.linspace(*ORDINARY.time_s, POINTS)
        return Way("t", "time [s]", t=time_s, u=COMMAND_V)
    if kind == "thrust_over_position":
        return Way("x", "position [m]", x=scale * around, u=COMMAND_V)
    if kind == "limit_over_speed":
        return Way("v", "velocity [m/s]", v=2.0 * ORDINARY.speed_m_s * around, u=COMMAND_V)
    if form.varies_with_velocity:
        return Way("v", "velocity [m/s]", v=_top_speed(form) * around, u=COMMAND_V)
    swing = np.concatenate([around, -around, around])
    u = (SWING_SCALES * scale or COMMAND_V) * swing
    t = np.arange(len(swing), dtype=np.float64) * ORDINARY.period_s
    return Way("u", "command u [V]", u=u, t=t, drawn_from=POINTS)


def _top_speed(form: Effect) -> float:
    """Return up to which speed a friction is drawn: some of its own, or of its smooth sign."""
    slope_s_m = getattr(form.options, "slope_s_m", None)
    turnover = TURNOVERS / slope_s_m if slope_s_m else ORDINARY.speed_m_s
    return SWING_SCALES * form.picture.scale or turnover


def _swing(reach_m: float, angular_frequency: float) -> tuple[Array, Array, Array, Array]:
    """Return x, v, a and t of two periods of a sine."""
    angle = np.linspace(0.0, 4.0 * math.pi, FINE)
    x = reach_m * np.sin(angle)
    v = reach_m * angular_frequency * np.cos(angle)
    return x, v, -(angular_frequency**2) * x, angle / angular_frequency


def _where_it_acts(form: Effect, low: float, high: float) -> Way:
    """Return the way along which a force of position is not nothing, and as much beside it."""
    x = np.linspace(low, high, FINE)
    acts = x[np.abs(_columns(form, Way("x", "", x=x))).max(axis=1) > 0.0]
    if len(acts) and np.ptp(acts) < 0.2 * (high - low):
        low, high = max(low, acts[0] - np.ptp(acts)), min(high, acts[-1] + np.ptp(acts))
    return Way("x", "position [m]", x=np.linspace(low, high, POINTS))


# The kernels, before they are compiled: a few hundred points are not worth the seconds.


def _plain(kernel: Callable[..., float]) -> Callable[..., float]:
    plain: Callable[..., float] = getattr(kernel, "py_func", kernel)
    return plain


def _columns(form: Effect, way: Way) -> Array:
    """Return a state effect's columns along a way, (N, n)."""
    column, memory, before = _plain(form.column), np.zeros(form.memory_size), 0.0
    others, found = np.zeros((len(form.other_axes), 3)), []
    for x, v, a, t, _, *beside in way.rows():
        held: tuple[Array, ...] = ()
        if form.remembers():
            others[:], held = beside, (memory,)
            _plain(form.kernel("advance"))(memory, x, v, a, t - before, others, form.constants)
        before = t
        found.append(
            [column(j, x, v, a, v, t, *held, form.constants) for j in range(len(form.parameters))]
        )
    return np.array(found)


def _added(form: Effect, way: Way) -> Array:
    """Return what an input effect adds to the command along a way, (N, n)."""
    column, memory, before, found = _plain(form.column), np.zeros(form.memory_size), 0.0, []
    for x, v, _, t, u, *_ in way.rows():
        held = (memory,) if form.remembers() else ()
        where = (*form.place(x, v, t), *held)
        found.append([column(j, u, *where, form.constants) for j in range(len(form.parameters))])
        if form.remembers():
            _plain(form.kernel("advance"))(memory, u, t - before, form.constants)
        before = t
    return np.array(found)


def _with_unit(value: float, parameter: Parameter) -> str:
    return f"{value:g}" + ("" if parameter.unit == "1" else f" {parameter.unit}")
