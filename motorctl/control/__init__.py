"""The control law: DCDIARC over a list of effects, its adaptation, the inverse of the input map."""

from motorctl.control.assumption2 import monotonicity_half_planes
from motorctl.control.command_filter import CommandFilter, command_filter
from motorctl.control.estimator import adapt
from motorctl.control.input_slopes import fixed_slopes, input_indices, worst_varying
from motorctl.control.inverse import invert
from motorctl.control.law import carry_over_gap, law_step, shift_law, start_law
from motorctl.control.law_records import LawFlag, law_settings, law_state
from motorctl.control.projection import project, violates
from motorctl.control.setup import fill_by_name, fill_settings, fill_state, max_input_delay_s

__all__ = [
    "CommandFilter",
    "LawFlag",
    "adapt",
    "carry_over_gap",
    "command_filter",
    "fill_by_name",
    "fill_settings",
    "fill_state",
    "fixed_slopes",
    "input_indices",
    "invert",
    "law_settings",
    "law_state",
    "law_step",
    "max_input_delay_s",
    "monotonicity_half_planes",
    "project",
    "shift_law",
    "start_law",
    "violates",
    "worst_varying",
]
