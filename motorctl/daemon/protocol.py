"""The control socket's language: one JSON object a line, requests in, answers out. No I/O.

{"id": 1, "do": "start", "axis": "x"}
{"id": 1, "ok": true, ...}
{"id": 1, "ok": false, "error": {"code": "wrong_state", "message": "..."}}
"""

from __future__ import annotations

import json
from enum import StrEnum
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    FailFast,
    Field,
    FiniteFloat,
    TypeAdapter,
    ValidationError,
    model_validator,
)
from pydantic_core import from_json

MAX_LINE_BYTES = 4 << 20
"""Longest request: a program of as many points as the loop can follow still fits."""
SHORT_LINE_BYTES = 16 << 10
"""Longest request that is neither program nor excitation [bytes]. Larger: reading one takes longer
from the signs of life; smaller: a long name is refused. By hand: a hundred times what a command
needs."""
MAY_BE_LONG = ("program", "excite", "apply")
"""Requests that bring what they ask for with them: points, a period of an excitation, models."""
MOST_PARTS = 100_000
"""So many quotation marks, and so many values, a long request may have besides the text in it.
More: reading it keeps the supervisor from its signs of life, which every axis is stopped without.
Fewer: a list of as many moves as the loop can follow (8125, of ten marks each) does not fit. By
hand; then reading takes 0.07 s at most where it was measured."""
MOST_KEYS = 16
"""So many keys a request may have, and so many files: each one that is wrong costs time, too. A
program has six keys and one file."""

RequestId = Annotated[int, Field(ge=-(2**63), lt=2**63)] | str | None
PositiveFloat = Annotated[FiniteFloat, Field(gt=0)]


class Code(StrEnum):
    """Why a request was refused."""

    FORBIDDEN = "forbidden"
    BAD_REQUEST = "bad_request"
    TOO_LARGE = "too_large"
    UNKNOWN_AXIS = "unknown_axis"
    UNKNOWN_PROGRAM = "unknown_program"
    BAD_PROGRAM = "bad_program"
    WRONG_STATE = "wrong_state"
    NOT_HOMED = "not_homed"
    OUT_OF_LIMITS = "out_of_limits"
    STILL_FAULTY = "still_faulty"
    STILL_MOVING = "still_moving"
    NO_HOMING = "no_homing"
    NOT_READY = "not_ready"
    """What it waits for is about to come: the first tick, or the model that an axis had before."""
    STOPPING = "stopping"
    OVERTAKEN = "overtaken"
    """An emergency stop came in before the request had its turn."""
    LOOP_SILENT = "loop_silent"
    INTERNAL = "internal"


FAILURES = frozenset(
    {Code.NOT_READY, Code.STOPPING, Code.OVERTAKEN, Code.LOOP_SILENT, Code.INTERNAL}
)
"""Refusals that are no mistake of whoever asked."""


class RefusedError(Exception):
    """A request that the daemon does not carry out."""

    def __init__(self, code: Code, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.message = message


class _Request(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    id: RequestId = None


class AxisCommand(_Request):
    """A command that needs no more than the axis."""

    do: Literal["start", "stop", "home", "reset"]
    axis: str
    hold: bool = False
    """With `start`: hold, whatever program the axis has."""


class MoveCommand(_Request):
    """Go to a position, or by a way from where the axis holds.

    Velocity and acceleration are at most the axis' limits.
    """

    do: Literal["move"]
    axis: str
    position_m: FiniteFloat | None = None
    by_m: FiniteFloat | None = None
    velocity_m_s: PositiveFloat | None = None
    acceleration_m_s2: PositiveFloat | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if (self.position_m is None) == (self.by_m is None):
            raise ValueError("give either position_m or by_m")
        return self


class ProgramCommand(_Request):
    """Follow a program, by its name in the configuration or as a document of its own.

    `name` names either; `files` holds the text of the file that a document names, because the
    daemon reads no file on a client's behalf.
    """

    do: Literal["program"]
    axis: str
    name: str
    document: dict[str, Any] | None = None
    files: dict[str, str] = {}


class ExciteCommand(_Request):
    """Add an excitation to the command of an axis that holds or follows.

    It comes within `fade_periods`, stays for `periods`, goes within `fade_periods`, and ends. It
    lasts no longer than the connection over which it was asked for: then the axis is stopped.
    """

    do: Literal["excite"]
    axis: str
    volts: Annotated[list[FiniteFloat], FailFast()]
    """One period, a value a tick of the axis."""
    periods: Annotated[int, Field(ge=1, le=MOST_PARTS)]
    fade_periods: Annotated[int, Field(ge=1, le=MOST_PARTS)]
    state: Literal["idle", "running"] | None = None
    """In which the axis has to be; None: either."""


class ApplyCommand(_Request):
    """Let other models take axes over that hold or are off."""

    do: Literal["apply"]
    config: dict[str, Any]
    """The machine with its other models, every default filled in, as logs hold it."""
    source: Annotated[str, Field(max_length=4096)]
    """Names it in messages and in the history."""
    story: Annotated[list[Annotated[str, Field(max_length=400)]], Field(max_length=100)] = []
    """What it says of how it was found."""


class RevertCommand(_Request):
    """Let the models that ran before the last `apply` take over again."""

    do: Literal["revert"]


class ModelsCommand(_Request):
    """Tell which models an axis has run, and why."""

    do: Literal["models"]
    axis: str


class EmergencyStopCommand(_Request):
    """Zero and disable every axis at once."""

    do: Literal["estop"]


class StatusCommand(_Request):
    """Tell how machine and daemon are doing."""

    do: Literal["status"]
    axis: str | None = None


class SamplesCommand(_Request):
    """Hand over a descriptor of the memory that the samples stand in, which can be read only.

    It comes beside the first answer of a connection to this request (SCM_RIGHTS).
    """

    do: Literal["samples"]


Request = (
    AxisCommand
    | MoveCommand
    | ProgramCommand
    | ExciteCommand
    | ApplyCommand
    | RevertCommand
    | ModelsCommand
    | EmergencyStopCommand
    | StatusCommand
    | SamplesCommand
)
_REQUEST: TypeAdapter[Request] = TypeAdapter(Annotated[Request, Field(discriminator="do")])


class _IdOnly(BaseModel):
    model_config = ConfigDict(extra="ignore", strict=True)

    id: RequestId = None


_ID_ONLY = TypeAdapter(_IdOnly)


def request_id(line: bytes) -> RequestId:
    """Find the id of a request that is otherwise wrong; None where it has none, or is too long."""
    if len(line) > SHORT_LINE_BYTES:
        return None
    try:
        return _ID_ONLY.validate_python(_read(line)).id
    except (RefusedError, ValidationError):
        return None


def parse_request(line: bytes) -> Request:
    """Read one line; raises RefusedError(BAD_REQUEST) that names what is wrong with it.

    Whatever it holds, that takes little time: nobody gives a sign of life meanwhile.
    """
    given = _read(line)
    may_be_long = isinstance(given, dict) and given.get("do") in MAY_BE_LONG
    if len(line) > SHORT_LINE_BYTES and not may_be_long:
        raise RefusedError(
            Code.BAD_REQUEST,
            f"the request has {len(line)} bytes; {SHORT_LINE_BYTES} are allowed but for "
            f"{', '.join(MAY_BE_LONG)}",
        )
    if isinstance(given, dict):
        _must_be_few("keys", given)
        _must_be_few("files", given.get("files"))
    try:
        return _REQUEST.validate_python(given)
    except ValidationError as error:
        raise RefusedError(Code.BAD_REQUEST, _first_problem(error)) from None


def _read(line: bytes) -> Any:
    if len(line) > SHORT_LINE_BYTES:
        _must_be_text_for_the_most(line)
    try:
        return from_json(line)
    except ValueError as error:
        raise RefusedError(Code.BAD_REQUEST, f"Invalid JSON: {error}") from None


def _must_be_text_for_the_most(line: bytes) -> None:
    """Refuse a long line that is not a few long texts, or a list of moves: it takes too long."""
    # What is behind every second quotation mark is text, once those within texts are gone.
    pieces = line.replace(rb"\\", b"").replace(rb"\"", b"").split(b'"', MOST_PARTS)
    besides = b"".join(pieces[::2])
    values = sum(besides.count(mark) for mark in (b",", b"[", b"{"))
    if len(pieces) > MOST_PARTS or values > MOST_PARTS:
        message = (
            f"a request of {len(line)} bytes has at most {MOST_PARTS} quotation marks and "
            f"{MOST_PARTS} values; a long program is points in a CSV file"
        )
        raise RefusedError(Code.BAD_REQUEST, message)


def _must_be_few(what: str, given: object) -> None:
    if isinstance(given, dict) and len(given) > MOST_KEYS:
        message = f"the request has {len(given)} {what}; limit {MOST_KEYS}"
        raise RefusedError(Code.BAD_REQUEST, message)


def answer(to: RequestId, content: dict[str, Any]) -> bytes:
    """Write the line that says yes. `content` holds finite numbers only."""
    return _line({"id": to, "ok": True, **content})


def refusal(to: RequestId, code: Code, message: str) -> bytes:
    """Write the line that says no, and why."""
    return _line({"id": to, "ok": False, "error": {"code": str(code), "message": message}})


def _line(document: dict[str, Any]) -> bytes:
    return json.dumps(document, allow_nan=False, separators=(",", ":")).encode() + b"\n"


def _first_problem(error: ValidationError) -> str:
    first = error.errors(include_url=False, include_input=False)[0]
    if first["type"] == "union_tag_not_found":
        return 'the request has no "do", which names the command, as in {"do": "status"}'
    if first["type"] == "union_tag_invalid":
        context = first["ctx"]
        return f"unknown command '{context['tag']}'; known: {context['expected_tags']}"
    # The command stands first in a place; whoever wrote the line knows it.
    place = ".".join(str(part) for part in first["loc"][1:])
    message = first["msg"].removeprefix("Value error, ")
    return f"{place}: {message}" if place else message
