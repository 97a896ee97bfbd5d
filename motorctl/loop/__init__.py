"""The loop process: clock, tick, axis state machine, limits, timing, the shared memory."""

from motorctl.loop.excitation import Excitation
from motorctl.loop.process import EndNote, spawn
from motorctl.loop.realtime import isolated_cpus, reasons
from motorctl.loop.shared import LoopMemory
from motorctl.loop.virtual import VirtualMachine
from motorctl.loop.vocabulary import Degraded, Phase, Reply, Verb

__all__ = [
    "Degraded",
    "EndNote",
    "Excitation",
    "LoopMemory",
    "Phase",
    "Reply",
    "Verb",
    "VirtualMachine",
    "isolated_cpus",
    "reasons",
    "spawn",
]
