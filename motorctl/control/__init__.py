"""The control law: DCDIARC over a list of effects, its adaptation, the inverse of the input map."""

from motorctl.control.assumption2 import monotonicity_half_planes
from motorctl.control.estimator import adapt
from motorctl.control.inverse import invert
from motorctl.control.law import law_step, start_law
from motorctl.control.projection import project, violates
from motorctl.control.records import LawFlag, law_settings, law_state
from motorctl.control.setup import fill_settings, fill_state, max_input_delay_s

__all__ = [
    "LawFlag",
    "adapt",
    "fill_settings",
    "fill_state",
    "invert",
    "law_settings",
    "law_state",
    "law_step",
    "max_input_delay_s",
    "monotonicity_half_planes",
    "project",
    "start_law",
    "violates",
]
