"""What speaks against a register map: within itself, for its axes, in its times; all at once."""

from __future__ import annotations

from collections.abc import Mapping

from motorctl.hal import Channel
from motorctl_modbus import budget
from motorctl_modbus.options import ModbusOptions
from motorctl_modbus.registers import (
    MOST_READ,
    MOST_WRITTEN,
    ChannelMap,
    Claim,
    block,
    input_claims,
    output_claims,
)

Problem = tuple[tuple[str | int, ...], str]
"""A key within the options, as the file has it, and what is wrong there."""

LEAST_STEPS = 50
"""From zero to max_voltage_v. A word with fewer is none: most often V and mV were mixed up."""
PAST_THE_LAST = 0x10000


def map_problems(options: ModbusOptions, used: Mapping[int, ChannelMap]) -> list[Problem]:
    """Tell what cannot be on the device together, and in one request for the channels in use."""
    found: list[Problem] = []
    for number, part in options.channels.items():
        found += _index_problems(("channels", str(number)), part)
    sequence, boot_id = options.sequence, options.boot_id
    outputs, inputs = options.output_base or 0, options.input_base or 0
    found += _claim_problems(output_claims(options.channels, sequence), outputs, "output")
    found += _claim_problems(input_claims(options.channels, sequence, boot_id), inputs, "input")
    found += _length_problems(output_claims(used, sequence), MOST_WRITTEN, "output")
    found += _length_problems(input_claims(used, sequence, boot_id), MOST_READ, "input")
    return found


def axis_problems(options: ModbusOptions, channel: Channel) -> list[Problem]:
    """Tell what does not fit the axis on this channel."""
    part = options.channels.get(channel.number)
    axis = f"axis '{channel.axis}'"
    if part is None:
        return [(("channels",), f"has no entry {channel.number}, which {axis} uses")]
    key = ("channels", str(channel.number))
    found: list[Problem] = []
    if part.counts.bits != channel.counter_bits:
        message = (
            f"found {part.counts.bits}, but {axis} has encoder.counter_bits {channel.counter_bits}"
        )
        found.append(((*key, "counts", "bits"), message))
    volts, most_v = part.volts, channel.max_voltage_v
    limit = f"{axis} has limits.max_voltage_v {most_v:g}"
    step_v = volts.volts_per_count
    if step_v > most_v / LEAST_STEPS:
        message = (
            f"found {step_v:g}, expected at most {most_v / LEAST_STEPS:g}, as {limit} and that "
            f"should be {LEAST_STEPS} counts or more"
        )
        found.append(((*key, "volts", "volts_per_count"), message))
    lowest_v = (volts.lowest - volts.zero_count) * step_v
    highest_v = (volts.highest - volts.zero_count) * step_v
    # The usual two's complement has one count less above zero than below it.
    if min(-lowest_v, highest_v) + 1.001 * step_v < most_v:
        message = f"carries {lowest_v:.12g} to {highest_v:.12g} V, but {limit}"
        found.append(((*key, "volts"), message))
    return found


def time_problems(
    options: ModbusOptions, period_s: float, sizes: tuple[int, int] | None
) -> list[Problem]:
    """Tell which times do not fit the period; `sizes` of the exchange, None: unknown as yet."""
    found: list[Problem] = []
    rtu = options.rtu
    if rtu is not None and rtu.timeout_s is not None:
        key, limit_s = ("rtu", "timeout_s"), rtu.timeout_s
        if limit_s >= period_s:
            message = f"found {limit_s:g} s, expected less than the period, {period_s:g}"
            found.append((key, message))
        elif sizes is not None:
            exchange_s = budget.rtu_exchange_s(rtu, *sizes, options.device_turnaround_s)
            needed_s = exchange_s - rtu.t35_s
            if limit_s < needed_s:
                message = (
                    f"found {limit_s:g} s, but a reply takes {needed_s:.3g} s from the start of "
                    "its request"
                )
                found.append((key, message))
    if options.watchdog_s is not None and options.watchdog_s <= 2 * period_s:
        message = (
            f"found {options.watchdog_s:g} s, expected more than two periods, "
            f"{2 * period_s:g} s: every late reply would trip it"
        )
        found.append((("watchdog_s",), message))
    return found


def _index_problems(key: tuple[str, str], part: ChannelMap) -> list[Problem]:
    index = part.index_counts
    if index is None and part.status.index_latched is not None:
        return [((*key, "status", "index_latched"), "needs index_counts, the count of the mark")]
    found: list[Problem] = []
    if index is not None and part.status.index_latched is None:
        message = (
            "needs status.index_latched: a mark that is passed twice in a row leaves the count of "
            "the mark as it was"
        )
        found.append(((*key, "index_counts"), message))
    if index is not None and index.bits != part.counts.bits:
        message = f"found {index.bits}, expected {part.counts.bits}, as counts.bits"
        found.append(((*key, "index_counts", "bits"), message))
    return found


def _claim_problems(claims: list[Claim], base: int, kind: str) -> list[Problem]:
    """Tell which claims are on one another's registers, or on none that there is."""
    found: list[Problem] = []
    words: dict[int, Claim] = {}
    bits: dict[int, dict[int, Claim]] = {}
    for claim in claims:
        for address in range(claim.address, claim.address + claim.registers):
            held = _holder(claim, address, words, bits)
            if held is not None:
                one_bit = claim.bit is not None and held.bit is not None
                where = f"register {address}" + (f" bit {claim.bit}" if one_bit else "")
                message = f"is on {kind} {where}, which {held.key} uses already"
                found.append((claim.path, message))
                break  # where it moves to is another matter for all of its registers
        for address in range(claim.address, claim.address + claim.registers):
            if claim.bit is None:
                words.setdefault(address, claim)
            else:
                bits.setdefault(address, {}).setdefault(claim.bit, claim)
        end = base + claim.address + claim.registers
        if end > PAST_THE_LAST:
            message = f"ends at {kind} register {end - 1:#x} with {kind}_base, past 0xffff"
            found.append((claim.path, message))
    return found


def _length_problems(claims: list[Claim], most: int, kind: str) -> list[Problem]:
    """Tell what keeps these claims from being one block of at most `most` registers."""
    if not claims:
        return []
    _, count = block(claims)
    if count > most:
        ends = sorted(claims, key=lambda claim: claim.address)
        message = (
            f"the {kind} registers from {ends[0].key} to here are {count} in a row, and one "
            f"request carries at most {most}"
        )
        return [(ends[-1].path, message)]
    return []


def _holder(
    claim: Claim, address: int, words: dict[int, Claim], bits: dict[int, dict[int, Claim]]
) -> Claim | None:
    """Return the claim that already has this register or bit and does not share it."""
    held = words.get(address)
    if held is not None or address not in bits:
        return held
    if claim.bit is None:
        return next(iter(bits[address].values()))
    held = bits[address].get(claim.bit)
    shared = held is not None and claim.shared is not None and held.shared == claim.shared
    return None if shared else held
