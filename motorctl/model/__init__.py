"""The model of an axis: a list of effects, and the compiled kernels made from it."""

from motorctl.model.catalog import effect_class, known_effects
from motorctl.model.effect import Effect, EffectOptions, Parameter, Spans, make_effect
from motorctl.model.list import EffectList

__all__ = [
    "Effect",
    "EffectList",
    "EffectOptions",
    "Parameter",
    "Spans",
    "effect_class",
    "known_effects",
    "make_effect",
]
