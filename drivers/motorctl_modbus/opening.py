"""Connect by pymodbus, and ask the device what `open` has to know; each failure in one sentence."""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ConnectionException
from pymodbus.logging import Log
from pymodbus.pdu import ModbusPDU

from motorctl.hal import RunError
from motorctl_modbus.layout import InputBlock, OutputBlock
from motorctl_modbus.line import Line, RtuLine, TcpLine
from motorctl_modbus.options import ModbusOptions

Client = ModbusTcpClient | ModbusSerialClient

PSEUDO_TERMINALS = range(136, 144)
"""Their major numbers."""

EXCEPTIONS = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "device failure",
    6: "device busy",
    10: "gateway path unavailable",
    11: "no answer behind the gateway",
}


def in_words(code: int) -> str:
    """Return an exception code with its name."""
    return f"exception {code} ({EXCEPTIONS.get(code, 'unknown')})"


def connect(options: ModbusOptions, timeout_s: float) -> Client:
    """Open socket or port. Raises RunError naming key and device."""
    try:
        client = _client(options, timeout_s)
    except RuntimeError as error:  # pyserial is not installed
        raise RunError(f"rtu: {error}") from error
    with complaints() as heard:
        connected = client.connect()
    if not connected:
        raise RunError(_why_not_connected(options, heard))
    return client


def _client(options: ModbusOptions, timeout_s: float) -> Client:
    if options.tcp is not None:
        return ModbusTcpClient(
            options.tcp.host, port=options.tcp.port, timeout=timeout_s, retries=0
        )
    assert options.rtu is not None
    return ModbusSerialClient(
        options.rtu.port,
        baudrate=options.rtu.baud,
        parity=options.rtu.parity[0].upper(),
        stopbits=options.rtu.stop_bits,
        timeout=timeout_s,
        retries=0,
    )


def release(client: Client) -> None:
    """Close socket or port."""
    client.close()  # type: ignore[no-untyped-call]


def line_of(client: Client) -> Line:
    """Return the line that pymodbus opened, for use in the tick."""
    if isinstance(client, ModbusTcpClient):
        assert client.socket is not None
        return TcpLine(client.socket)
    assert client.socket is not None
    return RtuLine(client.socket.fileno())


def lower_latency(client: Client, options: ModbusOptions) -> tuple[str, ...]:
    """Ask a serial port for low latency; return a note where it is refused."""
    if isinstance(client, ModbusTcpClient) or options.rtu is None:
        return ()
    port = client.socket
    assert port is not None
    if os.major(os.fstat(port.fileno()).st_rdev) in PSEUDO_TERMINALS:
        return ()  # has no such mode and needs none
    try:
        port.set_low_latency_mode(True)
    except (ValueError, OSError, NotImplementedError) as error:
        return (
            f"rtu.port: {options.rtu.port} refuses low latency ({error}); a USB adapter with a "
            "latency timer may hold every reply back for up to 16 ms",
        )
    return ()


def ask(client: Client, what: str, question: Callable[[], ModbusPDU]) -> ModbusPDU:
    """Return the answer to a question, which may be an exception response.

    Parameters
    ----------
    client
        The open client, on which the question is asked.
    what
        Subject of the message where the answer does not come.
    question
        Sends the request and waits for its answer.

    Raises
    ------
    RunError
        No valid answer came.
    """
    with complaints():
        try:
            return question()
        except (ConnectionException, ConnectionError) as error:
            raise RunError(f"{what}: the device closed the connection") from error
        except Exception as error:  # what a library makes of foreign bytes may fail in any way
            hint = ""
            if isinstance(client, ModbusSerialClient):
                hint = "; check baud, parity, stop_bits and unit, and that local echo is off"
            within = f"within {client.comm_params.timeout_connect:g} s"
            raise RunError(f"{what}: no valid answer {within}{hint}") from error


def first_exchange(
    client: Client, options: ModbusOptions, outputs: OutputBlock, inputs: InputBlock, sequence: int
) -> tuple[int, ...]:
    """Exchange once with every axis at zero and disabled.

    Parameters
    ----------
    client
        The open client.
    options
        The driver's options.
    outputs, inputs
        The registers written and read.
    sequence
        Sequence number to send.

    Returns
    -------
    tuple of int
        The registers of the reply, `inputs.count` of them.

    Raises
    ------
    RunError
        The device does not answer as the tick needs it.
    """
    where = f"unit {options.unit} at {options.device}"
    answer = ask(
        client, f"unit: {where}", lambda: _exchange(client, options, outputs, inputs, sequence)
    )
    if answer.isError():
        raise RunError(_why_refused(options, where, answer.exception_code, outputs, inputs))
    registers = tuple(answer.registers)
    if answer.function_code != 23 or len(registers) != inputs.count:
        raise RunError(
            f"channels: {where} answered a read of {inputs.count} registers with "
            f"{len(registers)} by function code {answer.function_code}"
        )
    if not inputs.answers(registers, sequence):
        raise RunError(
            f"sequence.input: {where} was sent sequence number {sequence} and does not show it in "
            "its reply; leave `sequence` out where the device has none"
        )
    return registers


def switch_off(
    client: Client, options: ModbusOptions, outputs: OutputBlock, inputs: InputBlock
) -> None:
    """Write zero and disable once by function code 16; where that does nothing, by 23.

    Raises RunError where neither is answered, or both are refused.
    """
    with contextlib.suppress(RunError):
        answer = ask(
            client,
            "safe",
            lambda: client.write_registers(
                outputs.address, outputs.off_registers(0), device_id=options.unit
            ),
        )
        if not answer.isError():
            return
    answer = ask(client, "safe", lambda: _exchange(client, options, outputs, inputs, 0))
    if answer.isError():
        where = f"unit {options.unit} at {options.device}"
        raise RunError(_why_refused(options, where, answer.exception_code, outputs, inputs))


def _exchange(
    client: Client, options: ModbusOptions, outputs: OutputBlock, inputs: InputBlock, sequence: int
) -> ModbusPDU:
    return client.readwrite_registers(
        read_address=inputs.address,
        read_count=inputs.count,
        write_address=outputs.address,
        values=outputs.off_registers(sequence),
        device_id=options.unit,
    )


@contextlib.contextmanager
def complaints() -> Iterator[list[str]]:
    """Collect what pymodbus logs instead of raising, and keep it from the terminal.

    Of this thread alone: others may make other devices safe.
    """
    heard: list[str] = []
    here = threading.get_ident()

    class Ear(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if record.thread == here:
                heard.append(record.getMessage().partition("\n")[0])

    Log.last_log_text = ""  # else it says "Repeating....", and nothing the third time
    logger = logging.getLogger("pymodbus.logging")
    ear, propagates = Ear(logging.WARNING), logger.propagate
    logger.addHandler(ear)
    logger.propagate = False
    try:
        yield heard
    finally:
        logger.propagate = propagates
        logger.removeHandler(ear)


def _why_not_connected(options: ModbusOptions, heard: list[str]) -> str:
    reason = heard[-1].rpartition(" failed: ")[2] if heard else "no reason given"
    if options.tcp is not None:
        return f"tcp.host: cannot connect to {options.device}: {reason}"
    assert options.rtu is not None
    if not Path(options.rtu.port).exists():
        return f"rtu.port: there is no port {options.rtu.port}"
    if "exclusively lock" in reason:
        return f"rtu.port: {options.rtu.port} is in use by another program"
    if os.strerror(errno.ENOTTY) in reason:
        return f"rtu.port: {options.rtu.port} is no serial port"
    if "baud" in reason.lower():
        return f"rtu.baud: {options.rtu.port} refuses {options.rtu.baud} baud: {reason}"
    if "Invalid argument" in reason:
        return (
            f"rtu.baud: {options.rtu.port} refuses {options.rtu.baud} baud, parity "
            f"{options.rtu.parity} or {options.rtu.stop_bits} stop bits"
        )
    return f"rtu.port: cannot open {options.rtu.port}: {reason}"


def _why_refused(
    options: ModbusOptions, where: str, code: int, outputs: OutputBlock, inputs: InputBlock
) -> str:
    if code == 1:
        return (
            f"unit: {where} does not support function code 23 (read/write multiple registers): it "
            f"answered {in_words(code)}"
        )
    if code in (2, 3):
        read = f"{inputs.address:#06x} to {inputs.address + inputs.count - 1:#06x}"
        written = f"{outputs.address:#06x} to {outputs.address + outputs.count - 1:#06x}"
        return (
            f"channels: {where} answered {in_words(code)}: it does not have all of the registers "
            f"{read} to read (input_base, channels) and {written} to write (output_base, channels)"
        )
    meaning = ""
    if options.coupler != "generic" and code == 4:
        meaning = ": its watchdog ran out, or its terminal bus has an error"
    if options.coupler != "generic" and code == 6:
        meaning = ": its outputs belong to another master"
    return f"unit: {where} refuses the exchange with {in_words(code)}{meaning}"
