"""Hours without a fault: machines that move, stop, start and home, and must not trip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from motorctl.errors import RunError
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import Reply, Verb
from motorctl.motion import Trajectory, point_to_point
from motorctl_benchmarks.safety.machines import KINDS, machine_of, resolved
from motorctl_benchmarks.safety.stand import Stand

Size = Literal["small", "full"]

SPELL_S = 300.0
"""Virtual time of one spell, begun with the machine's power."""
ROUND_S = 20.0
"""Of motion between a start and the next stop."""
SPELLS: dict[Size, dict[str, int]] = {
    "small": {"gantry": 1, "serial": 2, "modbus": 1, "stage": 1},
    "full": {"gantry": 8, "serial": 96, "modbus": 12, "can": 12, "stage": 6, "dual": 4},
}
"""With C1 and with C2 in turn. Slow machines have more of them, as their hours cost less."""
HOMING_S = 60.0


@dataclass(frozen=True)
class Spell:
    """Some minutes of one machine, drawn by a seed."""

    machine: str
    controller: str
    seed: int

    def __str__(self) -> str:
        return f"free:{self.machine}:{self.controller}:{self.seed}"


@dataclass(frozen=True)
class Quiet:
    """What became of a spell."""

    spell: Spell
    hours: float
    moves: int
    starts: int
    trip: str
    """What an axis tripped on; empty, as it should be."""

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "case": str(self.spell),
            "hours": self.hours,
            "moves": self.moves,
            "starts": self.starts,
            "trip": self.trip,
        }


def spells(size: Size, seed: int) -> list[Spell]:
    """Return the spells of a size; the ones of different machines mixed."""
    wanted = [
        Spell(machine, ("C2", "C1")[k % 2], seed + k)
        for machine, count in SPELLS[size].items()
        for k in range(count)
    ]
    return sorted(wanted, key=lambda spell: (spell.seed, spell.machine))


def run_spell(spell: Spell, duration_s: float = SPELL_S) -> Quiet:
    """Move every axis at random within its limits; each round begins with a start.

    Every guard is on, those too that a configuration has to ask for.
    """
    rng = np.random.default_rng([spell.seed, KINDS[spell.machine].number])
    guards = {"guards": guards_of(spell.machine)}
    names = resolved(KINDS[spell.machine].config, spell.controller)["axes"]
    machine = machine_of(
        spell.machine,
        spell.controller,
        seed=spell.seed,
        sim={},
        axes=dict.fromkeys(names, guards),
        top={"loop": {"overrun_policy": "leaky_bucket"}},
    )
    moves = starts = 0
    trip = ""
    with Stand(machine) as stand:
        stand.keeps_rows = False
        end = round(duration_s * machine.rate_hz)
        stand.advance(10)
        try:
            while stand.number < end:
                _start(stand)
                starts += len(stand.names)
                moves += _round(stand, rng)
                for name in stand.names:
                    stand.order(Verb.STOP, name)
                for name in stand.names:
                    stand.leave(name, AxisState.STOPPING)
                _look(stand)
                stand.advance(round(0.1 * machine.rate_hz))
        except RunError as error:
            trip = str(error)
        hours = stand.number * machine.period_s / 3600.0
    return Quiet(spell, hours, moves, starts, trip)


def guards_of(machine: str) -> dict[str, Any]:
    """Return guards that have to be asked for, as tight as the machine's motion allows."""
    noise_m = {
        "gantry": 5e-6,
        "stage": 16e-6,
        "serial": 80e-6,
        "modbus": 25e-6,
        "can": 80e-6,
        "dual": 8e-6,
    }[machine]
    return {
        "encoder_noise": {"rms_m": noise_m},
        "thermal": {"continuous_voltage_v": 4.0, "time_constant_s": 30.0},
        "saturation": {"time_s": 0.1},
    }


def _look(stand: Stand) -> None:
    """Raise RunError where an axis has tripped."""
    for name in stand.names:
        status = stand.status(name)
        cause = FaultCause(int(status["fault"]))
        if cause is not FaultCause.NONE:
            raise RunError(
                f"axis {name}: {cause.name.lower()}, {float(status['fault_value']):g} where "
                f"{float(status['fault_limit']):g} is allowed, "
                f"at {float(status['fault_time_s']):.4f} s"
            )


def _start(stand: Stand) -> None:
    for name in stand.names:
        for _ in range(round(2.0 * stand.machine.rate_hz)):
            reply = stand.ask(Verb.START, name)
            if reply is not Reply.STILL_MOVING:
                break
        if reply is not Reply.OK:
            raise RunError(f"axis {name}: start: {reply.name.lower()}")
        if not stand.status(name)["homed"]:
            stand.order(Verb.HOME, name)
            stand.leave(name, AxisState.HOMING, HOMING_S)
            _look(stand)


def _round(stand: Stand, rng: np.random.Generator) -> int:
    plans, moves = {}, 0
    for name in stand.names:
        plans[name], count = random_moves(stand, name, rng)
        moves += count
    stand.follow(plans)
    longest = max(plan.duration_s for plan in plans.values())
    # Where the round ends in the middle of a move, the stop has something to ramp down.
    left = round(rng.uniform(0.85, 1.02) * longest * stand.machine.rate_hz)
    while left > 0:
        stand.advance(min(left, 1000))
        left -= 1000
        _look(stand)
    return moves


def random_moves(stand: Stand, name: str, rng: np.random.Generator) -> tuple[Trajectory, int]:
    """Return moves between random places, as fast as limits and plant allow, with rests."""
    limits = stand.machine.axes[name].limits
    low, high = limits.travel_m
    margin = 0.002
    here = float(stand.status(name)["reference_m"])
    whole, moves = Trajectory.at_rest(here, 0.02), 0
    fastest = 0.75 * limits.max_velocity_m_s
    hardest = 0.55 * limits.max_acceleration_m_s2
    jerk = 0.5 * limits.max_jerk_m_s3
    while whole.duration_s < ROUND_S:
        there = rng.uniform(low + margin, high - margin)
        v, a = fastest * rng.uniform(0.05, 1.0), hardest * rng.uniform(0.1, 1.0)
        whole = whole.then(point_to_point(here, there, v, a, jerk)).hold(rng.uniform(0.0, 0.6))
        here, moves = there, moves + 1
    return whole, moves
