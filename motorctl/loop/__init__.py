"""The loop process: clock, tick, axis state machine, limits, timing, the shared memory."""

from motorctl.loop.process import spawn
from motorctl.loop.realtime import isolated_cpus, reasons
from motorctl.loop.shared import Degraded, LoopMemory, Phase, Reply, Verb
from motorctl.loop.virtual import VirtualMachine

__all__ = [
    "Degraded",
    "LoopMemory",
    "Phase",
    "Reply",
    "Verb",
    "VirtualMachine",
    "isolated_cpus",
    "reasons",
    "spawn",
]
