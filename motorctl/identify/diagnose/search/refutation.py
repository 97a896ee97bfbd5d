"""What physics and a simulation refute: effects that lower an error and still cannot be there.

An effect may fit the rows it was chosen on and be impossible: friction that gives energy, a
negative inertia, an option at an end of its range, a model whose motion runs further from the
recorded one than that of the declared model. Such an effect is taken out, and it is told why.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.stats import gmean

from motorctl.identify.diagnose.search.acts_one_way import acts_one_way
from motorctl.identify.diagnose.search.friction_corner import corner_of_friction
from motorctl.identify.diagnose.search.gap_in_ripple import gap_in_ripple
from motorctl.identify.diagnose.search.hypothesis import Hypothesis
from motorctl.identify.diagnose.search.late_column import as_late_column
from motorctl.identify.diagnose.search.motions_own_waves import motions_own_wave
from motorctl.identify.diagnose.search.option_ranges import ends_reached
from motorctl.identify.diagnose.search.other_direction import worse_in_other_direction
from motorctl.identify.diagnose.search.physics import beyond_physics, inertia_is_seen, physical
from motorctl.identify.diagnose.search.search import Found, declared_alone, with_final
from motorctl.identify.diagnose.search.simulated_position import (
    Missed,
    Rows,
    delays_instead,
    judge_by_simulation,
    position_of_declared,
    ratios_of,
    simulated_motion,
    simulated_position,
)
from motorctl.identify.diagnose.search.speed_instead import speed_instead
from motorctl.identify.diagnose.search.turning_places import shown_by_turning
from motorctl.identify.diagnose.search.uncommanded import uncommanded
from motorctl.identify.diagnose.search.whole_model import (
    FAR_OFF,
    GIVES,
    OF_INERTIA,
    TELLS,
    FrictionPower,
    InertiaRange,
    beside_what_hides_it,
    can_move,
    friction_power,
    inertia_of,
    inertia_off,
    known_inertias,
    left_with,
)
from motorctl.model import Effect, Spans

WORSE = 1.02
"""Simulated position over that of the declared model, from which a model is refuted. Larger lets
impossible models pass, smaller refutes by chance. Chosen by hand."""
CERTAIN = 1e-9
"""Size, relative to the travel, below which a simulation that is worse means nothing. Larger lets
impossible models of fine motion pass, smaller refutes by rounding. Convention: far below any
encoder, far above a double's rounding, 2e-16."""
NO_NEARER = 1.003
"""Simulated motion over that without an effect, beside all others, from which it is no nearer.
Smaller refutes what leaves the motion as it is, as a resonance far above it does; larger lets
effects pass that take the motion further away. Chosen by hand: a true resonance of a simulated
machine has 1.001."""


def without_refuted(found: Found, held_out: Rows | None = None) -> tuple[Found, tuple[str, ...]]:
    """Return a search's outcome without effects that are refuted, and for each of them why.

    Simulated positions are compared over all rows and, where they are told, over those held out,
    (m,): a model must be further from the recording on neither.
    """
    notes: list[str] = []
    final = found.final
    asked = (None,) if held_out is None else (None, held_out)
    known = known_inertias(found.base) if final.added else ()
    yardstick, name = _yardstick(found, known)
    hides = [by for by in known if by.hides]
    others = [(rows, position_of_declared(yardstick, rows, hides)) for rows in asked if final.added]
    while final.added:
        forbidden = beyond_physics(final)
        allowed = forbidden and physical(final, forbidden[0].name)
        if allowed:
            final = allowed.refreshed()
            continue
        worse = (_worse_when_simulated(name, missed, final, rows) for rows, missed in others)
        refuted = forbidden or at_its_end(final, found.spans) or shown_by_turning(final)
        refuted = refuted or acts_one_way(final) or corner_of_friction(final)
        refuted = refuted or uncommanded(final) or as_late_column(final)
        refuted = refuted or worse_in_other_direction(final)
        refuted = refuted or motions_own_wave(final) or gap_in_ripple(final)
        refuted = refuted or speed_instead(final)
        beside = known_inertias(beside_what_hides_it(found.base, final))
        refuted = refuted or drives_itself(final) or of_impossible_inertia(final, beside)
        refuted = refuted or next(filter(None, worse), None)
        if held_out is not None:
            refuted = refuted or moves_no_nearer(final, held_out, known)
        if refuted is None:
            break
        effect, why = refuted
        notes.append(f"{why}{_late_all_the_same(final, effect)}")
        final = final.without(effect.name).refreshed()
    if final is found.final:
        return found, ()
    left = found.refuted_left * found.final.held_out / max(final.held_out, 1e-300)
    return replace(with_final(found, final), refuted_left=left), tuple(notes)


def at_its_end(final: Hypothesis, spans: Spans) -> tuple[Effect, str] | None:
    """Return an effect of which an option ended where it means another one, and what to say.

    Or where the recording contradicts what the option says.
    """
    for effect in final.added:
        contradiction = effect.contradicted_by(spans)
        if contradiction is not None:
            return effect, f"{effect.name} is refuted: {contradiction}"
        reached = next((r for r in ends_reached(effect, spans) if r.refutes), None)
        if reached is not None:
            told = reached.told(final.regressors.signals.data)
            return effect, f"{effect.name} is refuted: {told}"
    return None


def moves_no_nearer(
    final: Hypothesis, held_out: Rows, known: Sequence[InertiaRange] = ()
) -> tuple[Effect, str] | None:
    """Return the effect that brings the simulated motion no nearer to the recorded one, and why.

    Of each effect that moves the axis, beside all others: of position and velocity on rows held
    out, over windows of all lengths. Where the model without it cannot move, or is too heavy to,
    nothing is asked.
    """
    after = simulated_motion(final, held_out)
    found: dict[str, float] = {}
    for effect in final.added:
        rest = final.without(effect.name).refreshed()
        if effect.kind == "measurement" or not can_move(rest, known):
            continue
        pairs = zip(simulated_motion(rest, held_out), after, strict=True)
        ratios = [ratio for pair in pairs for ratio in ratios_of(*pair).values()]
        if ratios:
            found[effect.name] = float(gmean(ratios))
    name = max(found, key=lambda each: found[each], default="")
    if not name or found[name] < NO_NEARER:
        return None
    return next(effect for effect in final.added if effect.name == name), (
        f"{name} is refuted: with it the position and the velocity simulated on rows held out miss "
        f"the recorded ones by {found[name]:.4g} times as much as without it, over windows of all "
        f"lengths; a name must not raise that (limit {NO_NEARER:g})"
    )


def drives_itself(final: Hypothesis) -> tuple[Effect, str] | None:
    """Return the effect with which the friction of the whole model gives energy at some speed.

    Of several frictions, without any one of which the others still drive, that which takes least.
    Friction that gives without any of them is no fault of theirs.
    """
    power = friction_power(final)
    if power.given <= GIVES:
        return None
    effect = _blamed(final, lambda rest: friction_power(rest).given <= GIVES)
    if effect is None:
        frictions = [each for each in final.added if "friction" in each.groups]
        rest = final
        for each in frictions:
            rest = rest.without(each.name)
        if not frictions or friction_power(rest.refreshed()).given > GIVES:
            return None
        effect = min(frictions, key=lambda each: final.without(each.name).refreshed().held_out)
    return effect, (
        f"{effect.name} is refuted: with it {_drives(final, power)}; without the friction that was "
        f"added, it gives no more than {100.0 * GIVES:g} %"
    )


def beside_driving_friction(found: Found) -> tuple[Found, tuple[str, ...]]:
    """Return a search's outcome without any name where friction drives the axis anyway, and why.

    No machine moves as such a model does: what it lacks is not known, and a name beside that says
    nothing sure. It does not speak against the effects themselves.
    """
    final = found.final
    power = friction_power(final)
    if not final.added or power.given <= GIVES:
        return found, ()
    names = " and ".join(effect.name for effect in final.added)
    return declared_alone(found), (
        f"{names}: not named, for with it and without it {_drives(final, power)} (limit "
        f"{100.0 * GIVES:g} %): something else is missing, or a column is not what it is said to "
        "be",
    )


def _drives(final: Hypothesis, power: FrictionPower) -> str:
    unit = final.regressors.signals.data.position_unit
    return (
        f"the friction of the whole model drives the axis at {power.speed:.3g} {unit}/s, and gives "
        f"{100.0 * power.given:.3g} % of the energy that passes between command and motion"
    )


def of_impossible_inertia(
    final: Hypothesis, known: Sequence[InertiaRange]
) -> tuple[Effect, str] | None:
    """Return the effect with which a model's inertia is far from what is known of it."""
    for by in known:
        if by.hides:
            continue
        off = inertia_off(final, by)
        if off <= FAR_OFF:
            continue
        effect = _blamed(final, partial(_near, by))
        if effect is None:
            continue
        data = final.regressors.signals.data
        unit = data.unit(OF_INERTIA)
        told = "declared" if by.declared else "seen beside any function of place and of speed"
        return effect, (
            f"{effect.name} is refuted: with it the inertia would be "
            f"{inertia_of(final):.3g} {unit}, and {by.low:.3g} to {by.high:.3g} is {told}: "
            f"{off:.3g} times off, limit {FAR_OFF:g}; without it the two agree"
        )
    return None


def _near(known: InertiaRange, model: Hypothesis) -> bool:
    return inertia_off(model, known) <= FAR_OFF


def _blamed(final: Hypothesis, is_cured: Callable[[Hypothesis], bool]) -> Effect | None:
    """Return the effect without which a model is cured, by that which then misses least."""
    rest = [(effect, final.without(effect.name).refreshed()) for effect in final.added]
    cured = [(effect, model) for effect, model in rest if is_cured(model)]
    return min(cured, key=lambda each: each[1].held_out)[0] if cured else None


def led_at_its_end(found: Found) -> tuple[str, ...]:
    """Return what would have been taken next, had not an option of it come to an end."""
    last = next(iter(found.steps[-1:]), None)
    if last is None or last.taken is not None or last.ended is None:
        return ()
    data = found.final.regressors.signals.data
    effect = last.ended.effect
    part = 100.0 * (1.0 - last.ended.held_out / last.before.held_out)
    told = next(r.told(data) for r in ends_reached(effect, found.spans) if r.refutes)
    return (
        f"{effect.name} would take {part:.0f} % of the squared error that is left, but is refuted: "
        f"{told}",
    )


def _yardstick(found: Found, known: Sequence[InertiaRange]) -> tuple[Hypothesis, str]:
    """Return the model whose own motion no other may be further from, the declared one, and a name.

    Where its inertia is negative it cannot be simulated, and where it is far heavier than what is
    seen it does not move: then that with the one effect which takes most away and lets it move, as
    a weight does. What was found beside that one is measured by it.
    """
    base, added = found.base, found.final.added
    if not added or can_move(base, known):
        return base, "the declared one"
    alone = [base.plus(effect).refreshed() for effect in added if effect.kind == "state"]
    able = [each for each in alone if can_move(each, known) and beyond_physics(each) is None]
    best = min(able, key=lambda each: each.held_out, default=base)
    return best, "the one with " + " and ".join(effect.name for effect in best.added) + " alone"


def _worse_when_simulated(
    name: str, yardstick: Missed, final: Hypothesis, rows: Rows | None
) -> tuple[Effect, str] | None:
    """Find the effect that takes a model's own motion too far from the recorded one.

    `yardstick` is what the model called `name` misses: it must come as near as that. Errors of the
    measurement change no motion and are not asked.
    """
    signals = final.regressors.signals
    suspects = [effect for effect in final.added if effect.kind != "measurement"]
    if not suspects:
        return None
    whole = simulated_position(final, rows)
    instead = delays_instead(yardstick, whole)
    simulated = judge_by_simulation(signals, yardstick, whole)
    rounding = CERTAIN * float(np.ptp(signals.stretches[0].x))
    if simulated is None or simulated.worse <= WORSE or simulated.after_rms < rounding:
        return None

    rest = {effect.name: final.without(effect.name).refreshed() for effect in suspects}

    def left(effect: Effect) -> float:
        missed = simulated_position(rest[effect.name], rows)
        again = judge_by_simulation(signals, yardstick, missed, instead)
        return np.inf if again is None else again.worse

    # what takes least goes first: a side effect may spoil the motion of the right main one
    worse = {effect.name: left(effect) for effect in suspects}
    alone = [effect for effect in suspects if worse[effect.name] <= WORSE]
    part = [effect for effect in suspects if worse[effect.name] < simulated.worse]
    effect = min(alone or part or suspects, key=lambda e: rest[e.name].held_out)
    return effect, (
        f"{effect.name} is refuted: with it the position simulated over {simulated.window_s:.3g} s "
        f"misses the recorded one by {simulated.after_rms:.3g} rms, with {name} by "
        f"{simulated.before_rms:.3g}; over windows of all lengths {simulated.ratio:.3g} times as "
        f"much, limit {WORSE:g}"
    )


def _late_all_the_same(final: Hypothesis, effect: Effect) -> str:
    """Return what to add where a lag or delay that is refuted explains the command."""
    if effect.kind != "command" or (left := left_with(final, effect.name)) > TELLS:
        return ""
    acts = f"acts {1e3 * effect.delay_s:.3g} ms late"
    if effect.lag_s > 0.0:
        acts = f"is smoothed over {1e3 * effect.lag_s:.3g} ms"
    unseen = "" if inertia_is_seen(final) else " (no inertia is seen beside it)"
    return (
        f". Yet a command that {acts}{unseen} explains {100.0 * (1.0 - left):.0f} % of the squared "
        "error: the position may be recorded late, or the axis follow a command that is rather a "
        "speed"
    )
