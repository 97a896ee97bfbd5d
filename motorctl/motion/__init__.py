"""References: programs of motion as tables of polynomial segments, and the jerk-limited ramp."""

from motorctl.motion.back_and_forth import BackAndForth
from motorctl.motion.check import AxisLimits, RequiredVoltage, Violation, check_program
from motorctl.motion.circle import Circle
from motorctl.motion.evaluate import advance, evaluate
from motorctl.motion.files import AnyProgram, load_program_file, parse_program
from motorctl.motion.move import PointToPoint, point_to_point
from motorctl.motion.moves import Move, Moves
from motorctl.motion.points import Points
from motorctl.motion.program import Program
from motorctl.motion.ramp import velocity_ramp_distance, velocity_ramp_step
from motorctl.motion.segments import MOST_SEGMENTS, SEGMENT
from motorctl.motion.trajectory import Peaks, Trajectory

__all__ = [
    "MOST_SEGMENTS",
    "SEGMENT",
    "AnyProgram",
    "AxisLimits",
    "BackAndForth",
    "Circle",
    "Move",
    "Moves",
    "Peaks",
    "PointToPoint",
    "Points",
    "Program",
    "RequiredVoltage",
    "Trajectory",
    "Violation",
    "advance",
    "check_program",
    "evaluate",
    "load_program_file",
    "parse_program",
    "point_to_point",
    "velocity_ramp_distance",
    "velocity_ramp_step",
]
