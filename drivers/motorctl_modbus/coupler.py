"""The watchdog of Beckhoff's couplers: reset if it ran out, set to its time, read back."""

from __future__ import annotations

from typing import Final

from motorctl.hal import RunError
from motorctl_modbus.opening import Client, ask, in_words
from motorctl_modbus.options import ModbusOptions

STATUS: Final = 0x100C
RAN_OUT: Final = 0x8000
WATCHDOG_MS: Final = 0x1120
WATCHDOG_RESET: Final = 0x1121
RESET_WORDS: Final = (0xBECF, 0xAFFE)
DEVICE_FAILURE: Final = 4
"""The exception by which a coupler whose watchdog ran out answers: see docs/drivers/modbus.md."""


def arm_watchdog(client: Client, options: ModbusOptions) -> None:
    """Make sure that the watchdog has not run out and has the time of the options.

    Raises RunError where the coupler does not take it.
    """
    if options.watchdog_s is None:
        return
    if _read(client, options, STATUS) & RAN_OUT:
        _reset(client, options)
        if _read(client, options, STATUS) & RAN_OUT:
            raise RunError(
                f"watchdog_s: the watchdog of {options.device} ran out and stays so after the "
                f"reset words in register {WATCHDOG_RESET:#x}; switch the coupler off and on"
            )
    wanted = round(options.watchdog_s * 1e3)
    if _read(client, options, WATCHDOG_MS) == wanted:
        return
    refusal = _write(client, options, WATCHDOG_MS, wanted)
    if refusal is not None:
        # The register is closed while the watchdog is active, as after an earlier run.
        _reset(client, options)
        refusal = _write(client, options, WATCHDOG_MS, wanted)
    if refusal is not None:
        raise RunError(
            f"watchdog_s: {options.device} refuses {wanted} ms in its watchdog register "
            f"{WATCHDOG_MS:#x} with {in_words(refusal)}; it can only be written while the watchdog "
            "is not active: switch the coupler off and on"
        )
    found = _read(client, options, WATCHDOG_MS)
    if found != wanted:
        raise RunError(
            f"watchdog_s: {options.device} was given {wanted} ms in its watchdog register "
            f"{WATCHDOG_MS:#x} and shows {found} ms"
        )


def _reset(client: Client, options: ModbusOptions) -> None:
    # A refusal shows in what is read or written next.
    for word in RESET_WORDS:
        _write(client, options, WATCHDOG_RESET, word)


def _read(client: Client, options: ModbusOptions, address: int) -> int:
    answer = ask(
        client,
        f"watchdog_s: register {address:#x} of {options.device}",
        lambda: client.read_holding_registers(address, count=1, device_id=options.unit),
    )
    if answer.isError() or len(answer.registers) != 1:
        raise RunError(
            f"watchdog_s: register {address:#x} of {options.device} cannot be read: "
            f"{in_words(answer.exception_code)}; is it a {options.coupler}?"
        )
    return int(answer.registers[0])


def _write(client: Client, options: ModbusOptions, address: int, value: int) -> int | None:
    answer = ask(
        client,
        f"watchdog_s: register {address:#x} of {options.device}",
        lambda: client.write_register(address, value, device_id=options.unit),
    )
    return int(answer.exception_code) if answer.isError() else None
