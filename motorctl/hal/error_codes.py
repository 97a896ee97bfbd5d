"""Error codes of amplifiers, in the status word and in words.

The numbers are those of CiA 301's emergency messages, which drives on other buses use as well
(603Fh of CiA 402). 00xxh means no error there; what a driver itself finds wrong with a drive's
state stands in that range.
"""

from __future__ import annotations

CODE_SHIFT = 12
CODE_MASK = 0xFFFF << CODE_SHIFT
"""The bits of a status word that hold an error code, beside `Status.AMPLIFIER_FAULT`."""

LEFT_OPERATION = 0x0010
"""And the number of a drive's state: it went there from Operation Enabled by itself."""
ENABLE_LATE = 0x0020
"""And the number of a drive's state: it is still there, though it was enabled long ago."""
DISABLE_LATE = 0x0030
"""And the number of a drive's state: it is still there, though it was disabled long ago."""
DRIVE_STATES = (
    "Not Ready to Switch On",
    "Switch On Disabled",
    "Ready to Switch On",
    "Switched On",
    "Operation Enabled",
    "Quick Stop Active",
    "Fault Reaction Active",
    "Fault",
)
"""The states of CiA 402, by the numbers used here."""

_KINDS = {
    0x10: "generic error",
    0x20: "current",
    0x21: "current, input side",
    0x22: "current inside the drive",
    0x23: "current, output side",
    0x30: "voltage",
    0x31: "mains voltage",
    0x32: "voltage inside the drive (DC link)",
    0x33: "output voltage",
    0x40: "temperature",
    0x41: "ambient temperature",
    0x42: "temperature of the drive",
    0x43: "temperature of the motor or of what is fed",
    0x44: "temperature of the supply",
    0x50: "hardware of the drive",
    0x51: "supply of the drive's electronics",
    0x52: "measuring or control circuit",
    0x53: "operating unit",
    0x54: "power section",
    0x55: "memory of the drive",
    0x60: "software of the drive",
    0x61: "firmware of the drive",
    0x62: "user's software in the drive",
    0x63: "data set of the drive",
    0x70: "additional module",
    0x71: "power of an additional module (brake chopper, motor)",
    0x72: "measuring by an additional module",
    0x73: "sensor (encoder, resolver)",
    0x74: "computing by an additional module",
    0x75: "communication of an additional module",
    0x80: "monitoring",
    0x81: "communication",
    0x82: "protocol: PDOs or lengths",
    0x83: "torque control",
    0x84: "speed control",
    0x85: "position control",
    0x86: "positioning",
    0x87: "synchronisation",
    0x90: "external error",
    0xF0: "additional functions",
    0xFF: "of the maker's own",
}
_EXACT = {
    0x2310: "continuous over current at the output",
    0x2320: "short circuit or earth leakage at the output",
    0x2330: "earth leakage at the output",
    0x3210: "over voltage of the DC link",
    0x3220: "under voltage of the DC link",
    0x4210: "the drive is too hot",
    0x4310: "the motor or what is fed is too hot",
    0x7122: "the motor, or its commutation",
    0x7305: "the incremental encoder",
    0x8110: "CAN overrun: messages were lost",
    0x8120: "CAN controller error passive",
    0x8130: "life guard or heartbeat: motorctl was not heard for longer than watchdog_s",
    0x8140: "it recovered from bus-off",
    0x8210: "a PDO was not processed for its length",
    0x8611: "following error",
}


def error_bits(code: int) -> int:
    """Return the bits of a status word that tell an error code of 16 bits.

    Parameters
    ----------
    code
        The code; 0 where there is none.

    Returns
    -------
    int
        Bits within `CODE_MASK`, to be joined with those of `Status`.
    """
    return (code & 0xFFFF) << CODE_SHIFT


def error_code(status: int) -> int:
    """Return the error code that a status word tells, 0 where there is none.

    Parameters
    ----------
    status
        Bits of `Status`, with those of `error_bits`.

    Returns
    -------
    int
        The code, 16 bits.
    """
    return (status & CODE_MASK) >> CODE_SHIFT


def error_words(code: int) -> str:
    """Return in words what an error code says.

    Parameters
    ----------
    code
        Of `error_code`, not 0.

    Returns
    -------
    str
        The code in hexadecimal with what it is about; or what is wrong with the drive's state.

    Examples
    --------
    >>> error_words(0x2310)
    'error 2310h: continuous over current at the output'
    >>> error_words(LEFT_OPERATION + 5)
    'it left Operation Enabled by itself and is in Quick Stop Active'
    """
    kind, state = code & ~0xF, code & 0xF
    if state < len(DRIVE_STATES) and kind == LEFT_OPERATION:
        return f"it left {DRIVE_STATES[4]} by itself and is in {DRIVE_STATES[state]}"
    if state < len(DRIVE_STATES) and kind == ENABLE_LATE:
        return f"it was not enabled in time and is in {DRIVE_STATES[state]}"
    if state < len(DRIVE_STATES) and kind == DISABLE_LATE:
        return f"it was not disabled in time and is in {DRIVE_STATES[state]}"
    words = _EXACT.get(code) or _KINDS.get(code >> 8) or _KINDS.get(code >> 8 & 0xF0)
    return f"error {code:04X}h" + (f": {words}" if words else "")
