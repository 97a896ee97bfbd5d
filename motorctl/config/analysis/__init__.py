"""What can be said of a machine before it moves: pure functions of numbers and of the model."""

from motorctl.config.analysis.feedforward import CommandPeak, command_peak, required_command
from motorctl.config.analysis.input_map import (
    CornerSlope,
    corner_slopes,
    lowest_slope,
    smallest_slope,
)
from motorctl.config.analysis.loop_margins import LoopMargins, loop_margins
from motorctl.config.analysis.robust_gain import GainCondition, gain_condition, required_ks1
from motorctl.config.analysis.sampled_loop import (
    DelayedPlant,
    Frequencies,
    LoopGains,
    is_stable,
    open_loop,
)
from motorctl.config.analysis.sign_changes import sign_changes

__all__ = [
    "CommandPeak",
    "CornerSlope",
    "DelayedPlant",
    "Frequencies",
    "GainCondition",
    "LoopGains",
    "LoopMargins",
    "command_peak",
    "corner_slopes",
    "gain_condition",
    "is_stable",
    "loop_margins",
    "lowest_slope",
    "open_loop",
    "required_command",
    "required_ks1",
    "sign_changes",
    "smallest_slope",
]
