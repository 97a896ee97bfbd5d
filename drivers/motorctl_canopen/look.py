"""Which drives answer on a bus, and what they tell of themselves; nothing is changed in them."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

from pydantic import ValidationError

from motorctl.hal import FoundAxis, FoundDevice, RunError
from motorctl_can.bus import BusOptions
from motorctl_can.link import Link
from motorctl_canopen import objects
from motorctl_canopen.objects import MODES, PROFILE_402, SDO_ANSWER_ID, TORQUE_MODE_BIT, Object
from motorctl_canopen.sdo import SdoClient, SdoError, put_request, request_message

UPLOAD = 0x40
NODES = range(1, 128)
PAUSE_S = 1e-3
"""Between two requests, so that no adapter's queue overflows."""
ANSWER_S = 0.3
"""How long a drive has for an answer: many times what any needs."""
COUNTER_BITS = 32
RATED_TORQUE = Object(0x6076, 0, 4, "motor rated torque")
INCREMENTS = Object(0x608F, 1, 4, "encoder increments")
TURNS = Object(0x608F, 2, 4, "motor revolutions")


def look(options: Mapping[str, Any]) -> FoundDevice:
    """Return the drives that answer on a bus. Raises RunError where none does."""
    bus = _bus(options)
    link = Link(bus, [(SDO_ANSWER_ID + number, False) for number in NODES], bus.settle_s)
    try:
        kinds = _kinds(link)
        axes = tuple(_found(link, number, kind) for number, kind in sorted(kinds.items()))
    finally:
        link.close()
    if not axes:
        why = f"; the bus says: {link.complaint}" if link.complaint else ""
        raise RunError(
            f"CANopen: {bus.medium}: no node from 1 to 127 answered within {ANSWER_S:g} s{why}; "
            f"are the drives on, at {bus.bitrate} bit/s?"
        )
    return FoundDevice(axes)


def _bus(options: Mapping[str, Any]) -> BusOptions:
    known = {key: options[key] for key in BusOptions.model_fields if key in options}
    try:
        return BusOptions.model_validate({"interface": "socketcan", "channel": "can0"} | known)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise RunError(f"CANopen: {where}: {first['msg']}") from error


def _kinds(link: Link) -> dict[int, int]:
    """Ask every node for its device type at once, and return what was answered by its number."""
    found: dict[int, int] = {}
    for number in NODES:
        request = request_message(number)
        put_request(request, UPLOAD, objects.DEVICE_TYPE, 0)
        link.send(request)
        found |= _answers(link, time.monotonic() + PAUSE_S)
    return found | dict(_answers(link, time.monotonic() + ANSWER_S))


def _answers(link: Link, deadline: float) -> dict[int, int]:
    return dict(_listen(link, deadline))


def _listen(link: Link, deadline: float) -> Iterator[tuple[int, int]]:
    index = objects.DEVICE_TYPE.index.to_bytes(2, "little")
    while (left := deadline - time.monotonic()) > 0.0:
        message = link.receive(left)
        if message is None:
            if link.lost:
                return
            continue
        number, data = message.arbitration_id - SDO_ANSWER_ID, bytes(message.data)
        if number in NODES and len(data) == 8 and data[1:3] == index and data[0] & 0xE0 == UPLOAD:
            yield number, int.from_bytes(data[4:], "little")


def _found(link: Link, number: int, kind: int) -> FoundAxis:
    sdo = SdoClient(link, number, ANSWER_S, lambda _: None)
    remarks = [f"node {number}, profile {kind & 0xFFFF}"]
    if kind & 0xFFFF != PROFILE_402:
        remarks.append(f"is no drive: motorctl moves profile {PROFILE_402} alone")
    with suppress(SdoError):
        modes = sdo.read(objects.SUPPORTED_MODES)
        if not modes >> TORQUE_MODE_BIT & 1:
            remarks.append(f"has no {MODES[TORQUE_MODE_BIT]}, which motorctl needs")
    with suppress(SdoError):
        remarks.append(f"rated torque {sdo.read(RATED_TORQUE) / 1000.0:g} N*m (6076h)")
    with suppress(SdoError):
        counts, turns = sdo.read(INCREMENTS), sdo.read(TURNS)
        if counts and turns:
            remarks.append(f"--encoder {counts / turns:g}/turn (608Fh)")
    return FoundAxis(channel=number - 1, counter_bits=COUNTER_BITS, remarks=tuple(remarks))
