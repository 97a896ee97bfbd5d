"""Between two processes nothing is seen before it is whole: rows, status, commands, replies.

The stress tests run writer and reader once on the same processor, where each is interrupted
anywhere in its work and the other sees what stands there, and once on two.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import pytest
from loop_bench import gantry
from numba import njit

from motorctl.config.machine import MOST_PARAMETERS
from motorctl.control import law_state
from motorctl.errors import UsageError
from motorctl.hal import Outputs
from motorctl.kernels import specialise
from motorctl.log.sample import AxisState
from motorctl.loop import LoopMemory, Reply, Verb
from motorctl.loop.axis_records import AXIS_SETTINGS, AXIS_STATE
from motorctl.loop.commands import take_commands
from motorctl.loop.fences import require_known_processor
from motorctl.loop.guards.supervision import WATCH
from motorctl.loop.handover import announce, look_at
from motorctl.loop.layout import LOOP_STATUS
from motorctl.loop.publish import publish
from motorctl.loop.runner import VirtualRun
from motorctl.loop.sample_ring import SampleRing
from motorctl.loop.tick import Tick
from motorctl.loop.vocabulary import STATUS_ROWS
from motorctl.loop.warm_up import Unconnected

SMALL = {"axes": 1, "parameters": 6, "ring_rows": 64, "segments": 1}
"""A ring so small that the writer is always about to overwrite what is being read."""
SHORT_S, LONG_S = 1.5, 10.0
DURATIONS = [SHORT_S, pytest.param(LONG_S, marks=[pytest.mark.slow, pytest.mark.long])]
PROCESSORS = [1, 2]


# What the compiler made.


@cache
def _code_of(kernel: Any) -> str:
    """Return the optimised LLVM code of a kernel as the loop or the supervisor calls it."""
    memory = LoopMemory(os.memfd_create("bench"), {**SMALL})
    tick_arguments = (memory.ticks, np.zeros((64, 4)), 0, 0, 0, 0.0, False, 0, 0, 0, 0, 0)
    arguments = {
        publish: (memory.status, *tick_arguments),
        look_at: (memory.status, 0),
        announce: (memory.status, 0, 0),
        take_commands: (
            np.zeros(1, WATCH)[0], memory.status, memory.mailbox, memory.replies,
            np.zeros(1, AXIS_SETTINGS), np.zeros(1, AXIS_STATE), np.zeros(1, law_state(1)),
            memory.segments, memory.excitations, 0, 0.0,
        ),
    }[kernel]  # fmt: skip
    fresh = njit(kernel.py_func)
    specialise(fresh, *arguments)
    memory.close()
    (code,) = fresh.inspect_llvm().values()
    return str(code)


def _on_arm(code: str) -> str:
    """Return LLVM code as assembly of AArch64, a processor that orders nothing by itself."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    # The wrapper for calls from Python counts references with an instruction of x86.
    code = re.sub(r"tail call i8 @llvm\.x86\.atomic[^\n]*", "add i8 0, 0", code)
    code = re.sub(r"^(target|declare [^\n]*@llvm\.x86)[^\n]*$", "", code, flags=re.MULTILINE)
    code = re.sub(r'"target-(cpu|features)"="[^"]*"', "", code)
    module = llvm.parse_assembly(code)
    machine = llvm.Target.from_triple("aarch64-linux-gnu").create_target_machine(opt=3)
    module.triple, module.data_layout = "aarch64-linux-gnu", str(machine.target_data)
    return str(machine.emit_assembly(module))


def _body(code: str, kernel: Any) -> str:
    """Return the lines of the kernel itself, without its wrappers for Python."""
    own = rf"(_ZN(?!7cpython)\w*{kernel.__name__}\w*)"
    if llvm_code := re.search(rf"^define [^@\n]*@{own}\(.*?^}}", code, re.MULTILINE | re.DOTALL):
        return llvm_code[0]
    assembly = re.search(rf"^{own}:.*?^\.Lfunc_end", code, re.MULTILINE | re.DOTALL)
    assert assembly
    return assembly[0]


def test_a_row_is_announced_by_a_release_and_fenced_from_the_next():
    body = _body(_code_of(publish), publish)
    ordered = re.findall(r"store atomic i64 .* release|fence release", body)
    assert [line.split(" ")[0] for line in ordered] == ["store", "store", "fence"]
    after_head = body[body.index("store atomic") :]
    assert not re.search(r"store (double|i64) ", after_head), "data is written after its head"
    places = [
        int(re.search(rf"{re.escape(pointer)} = getelementptr [^\n]*, i64 (\d+)\n", body)[1])
        for pointer in re.findall(r"store atomic i64 [^\n]*, ptr (\S+) release", body)
    ]
    assert LOOP_STATUS.fields is not None
    names = {place: name for name, (_, place, *_) in LOOP_STATUS.fields.items()}
    assert [names[place] for place in places] == ["ring_head", "mail_tail"]


def test_a_look_is_an_acquire_behind_a_fence():
    body = _body(_code_of(look_at), look_at)
    assert body.index("fence acquire") < body.index("load atomic")
    assert re.search(r"load atomic i64, .* acquire", body)


def test_commands_are_read_behind_an_acquire():
    body = _body(_code_of(take_commands), take_commands)
    assert re.search(r"load atomic i64, .* acquire", body)
    # It must not tell that it took them: the status in which that shows is not published yet.
    assert "store atomic" not in body


def test_supervisor_and_loop_announce_by_a_release():
    body = _body(_code_of(announce), announce)
    assert re.search(r"store atomic i64 .* release", body)
    assert not re.search(r"store i64 ", body)


@pytest.mark.parametrize(
    ("kernel", "instructions"),
    [
        (publish, ["stlr", "stlr", "dmb"]),
        (look_at, ["dmb", "ldar"]),
        (announce, ["stlr"]),
        (take_commands, ["ldar"]),
    ],
)
def test_arm_code_has_the_instructions_that_order_memory(kernel, instructions):
    body = _body(_on_arm(_code_of(kernel)), kernel)
    found = re.findall(r"\b(stlr|ldar|ldapr|dmb)\b", body)
    assert [name.replace("ldapr", "ldar") for name in found][: len(instructions)] == instructions


# Two processes.


@njit
def _write_rows(status, ticks, samples, told, measured, first, count, pause):  # type: ignore[no-untyped-def]
    """Write rows as the tick does; every field of a row follows from the row's number."""
    for number in range(first, first + count):
        row = number % ticks.size
        sample, axis = samples[row, 0], told[row % STATUS_ROWS, 0]
        sample.reference_m = axis.reference_m = number
        sample.position_m = axis.position_m = number
        sample.velocity_m_s = axis.velocity_m_s = number
        sample.following_error_m = axis.following_error_m = number
        sample.command_v = axis.command_v = number
        for i in range(sample.theta_hat.size):
            sample.theta_hat[i] = axis.theta_hat[i] = number
        axis.fault_value, axis.fault_limit, axis.device_status = number, number, number
        sample.d0_hat_v = axis.d0_hat_v = number
        n = number
        publish(status, ticks, measured, row, n + 1, n, 1.0, False, 0, n, 2 * n, 3 * n, 4 * n)
        for _ in range(pause):
            look_at(status, 0)


NUMBERS = (
    "reference_m",
    "position_m",
    "velocity_m_s",
    "following_error_m",
    "command_v",
    "d0_hat_v",
)
TOLD = (*NUMBERS, "fault_value", "fault_limit", "device_status")


@contextmanager
def _beside(work: Callable[[], None], processors: int) -> Iterator[None]:
    """Run `work` over and over in another process, on this processor or on another one."""
    allowed = os.sched_getaffinity(0)
    if len(allowed) < processors:
        pytest.skip(f"{processors} processors are not there")
    here, there = sorted(allowed)[0], sorted(allowed)[processors - 1]

    def forever() -> None:
        os.sched_setaffinity(0, {there})
        parent = os.getppid()
        while os.getppid() == parent:
            work()

    process = multiprocessing.get_context("fork").Process(target=forever, daemon=True)
    os.sched_setaffinity(0, {here})
    process.start()
    try:
        yield
        assert process.is_alive()
    finally:
        process.kill()
        process.join()
        os.sched_setaffinity(0, allowed)


@contextmanager
def _rows_written(processors: int) -> Iterator[LoopMemory]:
    """Have another process write rows into a small ring as fast as a reader can follow."""
    memory = LoopMemory(os.memfd_create("bench"), {**SMALL})
    measured = np.zeros((SMALL["ring_rows"], 4))
    # Where both run at once the reader needs time to read a row; in turns it has all it wants.
    pause = 0 if processors == 1 else 400
    written = 0

    def work() -> None:
        nonlocal written
        _write_rows(
            memory.status, memory.ticks, memory.samples, memory.axis_status_rows, measured,
            written, 1000, pause,
        )  # fmt: skip
        written += 1000

    work()
    memory.drain()
    with _beside(work, processors):
        yield memory
    memory.close()


def _every_row_is_whole(ring: SampleRing, duration_s: float) -> None:
    """Read for so long, and insist on each row's numbers."""
    expected, read = ring.drained, 0
    deadline = time.monotonic() + duration_s
    while time.monotonic() < deadline:
        ticks, samples, lost = ring.drain()
        numbers = expected + lost + np.arange(len(ticks))
        assert (ticks["tick"] == numbers).all()
        assert (ticks["time_s"] == numbers).all()
        for name, factor in (
            ("lateness_s", 1), ("turnaround_s", 3),
            ("read_s", 1), ("compute_s", 1), ("write_s", 1),
        ):  # fmt: skip
            assert (ticks[name] == factor * numbers * 1e-9).all(), name
        for name in NUMBERS:
            assert (samples[name][:, 0] == numbers).all(), name
        assert (samples["theta_hat"][:, 0] == numbers[:, None]).all()
        expected += lost + len(ticks)
        read += len(ticks)
    assert read > SMALL["ring_rows"]


@pytest.mark.slow
@pytest.mark.parametrize("duration_s", DURATIONS)
@pytest.mark.parametrize("processors", PROCESSORS)
def test_no_row_is_read_torn_or_stale_and_every_one_is_read_or_counted(processors, duration_s):
    with _rows_written(processors) as memory:
        _every_row_is_whole(memory, duration_s)


@pytest.mark.slow
@pytest.mark.parametrize("duration_s", DURATIONS)
def test_nor_is_one_by_whoever_may_only_read(duration_s):
    with _rows_written(2) as memory:
        beside = SampleRing(memory.open_to_read(), SMALL)
        _every_row_is_whole(beside, duration_s)
        beside.close()


@pytest.mark.slow
@pytest.mark.parametrize("duration_s", DURATIONS)
@pytest.mark.parametrize("processors", PROCESSORS)
def test_an_axis_status_is_that_of_one_tick_and_never_goes_back(processors, duration_s):
    with _rows_written(processors) as memory:
        last, seen = 0.0, set()
        deadline = time.monotonic() + duration_s
        while time.monotonic() < deadline:
            announced = int(memory.status["tick"][0])
            (told,) = memory.axis_status
            number = float(told["position_m"])
            assert [float(told[name]) for name in TOLD] == [number] * len(TOLD)
            assert (told["theta_hat"] == number).all()
            assert number >= max(last, announced - 1)
            last = number
            seen.add(number)
        assert len(seen) > 3


EXPECTED = {
    Verb.STOP: Reply.OK,
    Verb.RESET: Reply.WRONG_STATE,
    Verb.HOME: Reply.NO_HOMING,
}
"""Answers of an absolute axis that is switched off: each asks for another one."""


@contextmanager
def _loop_running(processors: int) -> Iterator[LoopMemory]:
    """Have another process tick the shipped gantry in virtual time, as fast as it goes."""
    machine = gantry()
    memory = LoopMemory.create(list(machine.axes), MOST_PARAMETERS, machine.rate_hz)
    tick = Tick(machine, memory, virtual=True)
    tick.open(virtual=True)
    run = VirtualRun(tick)
    run.advance(2)
    with _beside(lambda: bool(run.advance(100)) and None, processors):
        yield memory
    tick.close()
    memory.close()


def _replies(memory: LoopMemory, numbers: list[int]) -> list[Reply]:
    deadline = time.monotonic() + 10.0
    while memory.reply(numbers[-1]) is None:
        assert time.monotonic() < deadline
        os.sched_yield()
    replies = [memory.reply(number) for number in numbers]
    assert None not in replies
    return [reply for reply in replies if reply is not None]


@pytest.mark.slow
@pytest.mark.parametrize("duration_s", DURATIONS)
@pytest.mark.parametrize("processors", PROCESSORS)
def test_every_command_gets_its_own_answer(processors, duration_s):
    draw = random.Random(1)
    with _loop_running(processors) as memory:
        asked = 0
        deadline = time.monotonic() + duration_s
        while time.monotonic() < deadline:
            verbs = draw.choices(list(EXPECTED), k=48)
            numbers = [memory.post(verb) for verb in verbs]
            assert _replies(memory, numbers) == [EXPECTED[verb] for verb in verbs]
            asked += len(verbs)
        assert asked >= 48


def test_an_answer_comes_after_the_status_that_shows_what_it_did():
    machine = gantry()
    memory = LoopMemory.create(list(machine.axes), MOST_PARAMETERS, machine.rate_hz)
    seen: list[tuple[Reply | None, bool]] = []

    class Asking(Unconnected):
        """Looks at answer and status after the laws' turn, before the tick is published."""

        def write(self, outputs: Outputs) -> None:
            seen.append((memory.reply(number), memory.axis_status["state"][0] == AxisState.IDLE))

    run = VirtualRun(Tick(machine, memory, virtual=True, driver_class=Asking))
    number = memory.post(Verb.START)
    run.advance(2)
    assert seen == [(None, False), (Reply.OK, True)]
    memory.close()


@pytest.mark.parametrize("machine", ["riscv64", "ppc64le", "armv7l"])
def test_other_processors_are_refused_with_their_name(machine):
    with pytest.raises(UsageError) as refused:
        require_known_processor(machine)
    assert machine in str(refused.value)
    assert "x86_64 and aarch64" in str(refused.value)
