"""The model of an axis: a list of effects, and the compiled kernels made from it."""

from motorctl.model.catalog import basic_effects, effect_class, known_effects
from motorctl.model.effect import Effect, EffectOptions
from motorctl.model.knowledge import CarriedOver, Picture, Spans, wave_end
from motorctl.model.list import EffectList
from motorctl.model.parameter import Parameter
from motorctl.model.plain_options import make_effect

__all__ = [
    "CarriedOver",
    "Effect",
    "EffectList",
    "EffectOptions",
    "Parameter",
    "Picture",
    "Spans",
    "basic_effects",
    "effect_class",
    "known_effects",
    "make_effect",
    "wave_end",
]
