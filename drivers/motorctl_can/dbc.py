"""A layout from a DBC file, whose signals the configuration gives a meaning."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, ConfigDict, Discriminator, RootModel, Tag

from motorctl_can.checks import Wrong
from motorctl_can.layout import (
    COMMAND_MEANINGS,
    SCALED,
    Frame,
    Key,
    Layout,
    Means,
    Place,
    Signal,
)

if TYPE_CHECKING:
    from cantools.database.can.message import Message as DbcMessage
    from cantools.database.can.signal import Signal as DbcSignal


class Pointer(BaseModel):
    """A signal of the DBC file, where 0 may mean yes."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)

    signal: str
    """`Frame.Signal` of the DBC file."""
    inverted: bool = False
    """0 on the wire means yes."""


def _kind(given: Any) -> str | None:
    if isinstance(given, str):
        return "one"
    if isinstance(given, Mapping | Pointer):
        return "pointer"
    return "several" if isinstance(given, Sequence) else None


# A plain union would tell of what is none of the three once for each.
Target = Annotated[
    Annotated[str, Tag("one")]
    | Annotated[Pointer, Tag("pointer")]
    | Annotated[tuple[str, ...], Tag("several")],
    Discriminator(
        _kind,
        custom_error_type="can_target",
        custom_error_message="should be Frame.Signal, {signal: Frame.Signal, inverted: true}, "
        "or a list of Frame.Signal",
    ),
]


class DbcSignals(RootModel[dict[Means, Target]]):
    """What signals mean for one axis, or for all: meaning to ``Frame.Signal``."""

    model_config = ConfigDict(frozen=True)


class _Refused(Exception):  # noqa: N818 (never leaves this module)
    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.message = message


def layout_of_dbc(path: Path, given: Mapping[str, DbcSignals]) -> tuple[Layout, list[Wrong]]:
    """Read a DBC file; what is wrong comes beside the layout, which then has gaps."""
    try:
        messages = _messages_of(path)
    except _Refused as error:
        return Layout(()), [Wrong(("dbc",), str(path), error.message)]
    wrong: list[Wrong] = []
    taken: dict[str, Key] = {}
    chosen: dict[str, list[Signal]] = {}
    for key, axis, means, name, inverted in _pointers(given):
        try:
            message, signal = _look_up(messages, name)
        except _Refused as error:
            wrong.append(Wrong(key, name, error.message))
            continue
        first = taken.setdefault(name, key)
        if first != key:
            text = f"is {'.'.join(map(str, first))} already; a signal has one meaning"
            wrong.append(Wrong(key, name, text))
            continue
        chosen.setdefault(message.name, []).append(_signal(key, axis, means, signal, inverted))
    frames: list[Frame] = []
    for name, signals in chosen.items():
        message = messages[name]
        kinds = {s.means in COMMAND_MEANINGS for s in signals if s.means is not Means.SEQUENCE}
        if len(kinds) != 1:
            why = "both command and state signals" if kinds else "nothing but a sequence"
            text = f"frame '{name}' has {why}"
            wrong.append(Wrong(signals[-1].key, str(signals[-1].means), text))
            continue
        frames.append(
            Frame(
                key=("dbc", name),
                name=name,
                identifier=message.frame_id,
                extended=message.is_extended_frame,
                command=kinds.pop(),
                length=message.length,
                signals=tuple(signals),
            )
        )
    return Layout(tuple(frames)), wrong


def _messages_of(path: Path) -> dict[str, DbcMessage]:
    import cantools

    try:
        database: Any = cantools.database.load_file(path, database_format="dbc", strict=True)
    except OSError as error:
        raise _Refused(f"cannot be read: {error.strerror}") from error
    except Exception as error:  # a parser's own errors, of several kinds
        text = " ".join(str(error).split())
        raise _Refused(f"is no DBC file that can be used: {text}") from error
    return {message.name: message for message in database.messages}


def _pointers(
    given: Mapping[str, DbcSignals],
) -> Iterator[tuple[Key, str | None, Means, str, bool]]:
    """Yield every signal that is named: key, axis, meaning, name, inverted."""
    for axis, meanings in given.items():
        whose = None if axis == "all" else axis
        for means, target in meanings.root.items():
            key: Key = ("signals", axis, str(means))
            if isinstance(target, Pointer):
                yield key, whose, means, target.signal, target.inverted
            elif isinstance(target, str):
                yield key, whose, means, target, False
            else:
                for i, name in enumerate(target):
                    yield (*key, i), whose, means, name, False


def _look_up(messages: Mapping[str, DbcMessage], name: str) -> tuple[DbcMessage, DbcSignal]:
    known = {f"{m.name}.{s.name}": (m, s) for m in messages.values() for s in m.signals}
    if name not in known:
        near = difflib.get_close_matches(name, known, 3, 0.5)
        if near:
            hint = f"did you mean {' or '.join(repr(n) for n in near)}?"
        else:
            hint = f"it has: {', '.join(sorted(known)[:20]) or 'no signals'}"
        raise _Refused(f"is no signal (Frame.Signal) of the DBC file; {hint}")
    message, signal = known[name]
    if message.is_multiplexed():
        raise _Refused(f"is in the multiplexed frame '{message.name}'; those cannot be used")
    if message.is_container:
        raise _Refused(f"is in the container frame '{message.name}'; those cannot be used")
    if signal.is_float:
        raise _Refused("is a floating-point signal; those cannot be used")
    return message, signal


def _signal(key: Key, axis: str | None, means: Means, signal: DbcSignal, inverted: bool) -> Signal:
    scaled = means in SCALED
    return Signal(
        key=key,
        means=means,
        axis=axis,
        place=Place(signal.start, signal.length, signal.byte_order == "big_endian"),
        signed=signal.is_signed,
        scale=float(signal.scale) if scaled else 1.0,
        offset=float(signal.offset) if scaled else 0.0,
        inverted=inverted,
        minimum=_number(signal.minimum) if scaled else None,
        maximum=_number(signal.maximum) if scaled else None,
    )


def _number(value: Any) -> float | None:
    return None if value is None else float(value)
