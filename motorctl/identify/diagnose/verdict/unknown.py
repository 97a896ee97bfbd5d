"""Structure without a name: what it depends on, its kind, and a spline that compensates it."""

from __future__ import annotations

import numpy as np

from motorctl.identify.diagnose.result import UnknownStructure
from motorctl.identify.diagnose.search.parameters import Compensation, FittedModel, theta_of
from motorctl.identify.diagnose.search.search import Found
from motorctl.identify.diagnose.verdict.confidence import DoubtedMember
from motorctl.identify.diagnose.verdict.verdict import (
    BURSTS,
    COLOURED,
    USUAL_POWER,
    Judged,
    burst_hz,
    depends_on,
    low_hz,
)
from motorctl.model.knowledge import Family

FAMILY_SHARE = 0.5
"""Part of the explainable error that a smooth function must take for the kind of physics to be
told. Larger tells it less often, smaller tells wrong ones. Chosen by hand: more than all else."""
MOST_TIMES = 1000.0
"""Power over that of the noise, beyond which no number is told. Larger tells millions of columns
that were smoothed before, smaller hides what a fine encoder shows. Convention."""


def compensation(found: Found, judged: Judged) -> Compensation | None:
    """Offer a spline in the variables that unknown structure depends on, where one can be used."""
    if judged.verdict != "unknown_structure" or judged.rival is None:
        return None
    variables = depends_on(judged.rival)
    if _may_be_time(variables, found):
        return None
    every = found.final.regressors.catalogue.values()
    forms = (cls.smooth_function(variables, found.spans) for cls in every)
    effect = next((form for form in forms if form is not None), None)
    present = {e.name for e in (*found.final.regressors.declared.effects, *found.final.added)}
    if effect is None or effect.name in present:
        return None
    return effect, found.final.extended(effect)


def unknown_structure(
    judged: Judged,
    found: Found,
    extra: Compensation | None,
    values: FittedModel,
    kin: DoubtedMember | None = None,
    impossible: str | None = None,
) -> UnknownStructure:
    """Say what unknown structure depends on, and of which kind it is.

    Parameters
    ----------
    judged
        What the verdict rests on.
    found
        The outcome of the search.
    extra
        A spline that compensates it.
    values
        The parameters of the whole model, the spline's last.
    kin
        An effect that takes most of the error and is too unsure to be named.
    impossible
        The smooth function that would explain it if physics allowed that.
    """
    variables = depends_on(judged.rival)
    share = min(judged.rival_share, 1.0)
    family: Family | None = None
    if extra is not None and share > FAMILY_SHARE:
        family = extra[0].family()
    if kin is not None and family is None and kin.family is not None:
        family = kin.family
        share = max(share, kin.share)
        sentence = (
            f"{family.replace('_', ' ')} (confidence {kin.sure:.2f}): {kin.member} takes "
            f"{100 * kin.share:.0f} % of the squared error away, but is not sure enough to be "
            "named"
        )
    elif variables:
        kind = "no known effect" if family is None else f"no known {family.replace('_', ' ')}"
        either = ""
        if _may_be_time(variables, found):
            either = " or time, which are not told apart as the axis never turns round"
        sentence = (
            f"the residual depends on {' and '.join(variables)}{either}: a smooth function of "
            f"{'it' if len(variables) == 1 else 'them'} explains {100 * share:.0f} % of the "
            "explainable error, and "
            + (f"{kind} surely has this form" if kin is None else _unsure(kin, family is None))
        )
    elif kin is not None:
        sentence = _unsure(kin, True)
    elif impossible is not None:
        needed = " and ".join(depends_on(impossible))
        sentence = (
            f"a smooth function of {needed} would explain the residual, but only beside a negative "
            "inertia or with forces far beyond the largest command: this motion passes each place "
            "at about one acceleration. Record moves that pass it at two"
        )
    elif judged.bursts > BURSTS:
        sentence = (
            f"the residual comes in bursts: {100 * judged.bursts:.0f} % of its energy below "
            f"{burst_hz(found):.3g} Hz exceeds {USUAL_POWER:g} times the usual power (limit "
            f"{100 * BURSTS:.0f} %), and no function of position, velocity or command "
            "explains them"
        )
    elif judged.coloured < COLOURED:
        sentence = "the residual is more than noise, and no smooth function explains it"
    else:
        sentence = (
            f"the residual has {_times(judged.coloured)} times the power of the noise below "
            f"{low_hz(found):.3g} Hz (limit {COLOURED:g}), and no function of position, velocity "
            "or command explains it"
        )
    if extra is None:
        nothing = np.zeros(0)
        return UnknownStructure(variables, sentence, None, family, nothing, nothing, share)
    theta, std_error = theta_of(values, extra[0])
    return UnknownStructure(variables, sentence, extra[0], family, theta, std_error, share)


def _may_be_time(variables: tuple[str, ...], found: Found) -> bool:
    """Return whether what depends on the place may depend on time as well."""
    return variables == ("position",) and found.spans.one_way


def _times(ratio: float) -> str:
    """Return how often, where it can mean that: the noise of a smoothed column is no measure."""
    return f"over {MOST_TIMES:,.0f}" if ratio > MOST_TIMES else f"{ratio:.0f}"


def _unsure(kin: DoubtedMember, kind_too: bool) -> str:
    """Say what a doubted effect takes, and that it is not named."""
    takes = f"{kin.member} takes {100 * kin.share:.0f} % of the squared error away, but "
    if kind_too:
        return (
            f"{takes}neither it nor its kind (confidence {kin.sure:.2f}) is sure enough to be named"
        )
    return f"{takes}is not sure enough to be named (its kind has confidence {kin.sure:.2f})"
