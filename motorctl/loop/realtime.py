"""Ask the machine for real time, and say what it did not give."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import mmap
import os
from collections.abc import Iterator
from pathlib import Path

from motorctl.config.keys import LoopSettings
from motorctl.errors import RunError
from motorctl.hal import Claim
from motorctl.loop.vocabulary import Degraded

MCL_CURRENT, MCL_FUTURE = 1, 2
M_TRIM_THRESHOLD, M_MMAP_MAX = -1, -4
PREFAULT_BYTES = 16 << 20
"""Of each thread. By hand: a change of models takes a megabyte or two of it for two axes."""

REASONS = {
    Degraded.NO_FIFO: "no SCHED_FIFO: the user lacks LimitRTPRIO or CAP_SYS_NICE",
    Degraded.NO_PINNING: "not pinned to a CPU: loop.cpu is not among those that it may use",
    Degraded.NO_LOCKED_MEMORY: "memory not locked: the user lacks LimitMEMLOCK=infinity",
    Degraded.NO_CPU_LATENCY: "/dev/cpu_dma_latency cannot be opened: deep idle states add latency",
    Degraded.KERNEL_NOT_RT: "the kernel is not PREEMPT_RT: wake-ups can be late",
    Degraded.CPU_NOT_ISOLATED: "no isolated CPU (kernel parameter isolcpus)",
    Degraded.CPU_SHARED: "the loop of another motorctl has the same CPU: each delays the other",
}

_taken: list[Claim] = []
"""Of this process' CPU; kept, as the kernel gives it back when the process ends."""

MOST_LOOPS = 16
"""On one CPU that are told apart, to spread them evenly. By hand: more than a CPU has time for."""

NEEDED = Degraded.NO_FIFO | Degraded.NO_PINNING | Degraded.NO_LOCKED_MEMORY
"""What `without_realtime: refuse` insists on; the rest is the kernel's set-up and only told."""


def reasons(degraded: int) -> list[str]:
    """Return the bits of Degraded in words.

    Parameters
    ----------
    degraded
        Bits of `Degraded`; 0: real time is complete.

    Returns
    -------
    list
        A sentence for each bit that is set.
    """
    return [text for bit, text in REASONS.items() if degraded & bit]


def isolated_cpus() -> list[int]:
    """Return the CPUs that the kernel keeps free of other work.

    Returns
    -------
    list
        Their numbers, rising; empty where there are none or the kernel does not tell.
    """
    try:
        text = Path("/sys/devices/system/cpu/isolated").read_text().strip()
    except OSError:
        return []
    cpus: list[int] = []
    for part in filter(None, text.split(",")):
        first, _, last = part.partition("-")
        cpus += range(int(first), int(last or first) + 1)
    return cpus


def enter_realtime(settings: LoopSettings) -> Degraded:
    """Take priority, CPU, locked memory and idle-state latency; return what was refused.

    Call it when everything is compiled, warmed up and allocated: the garbage collector is
    switched off for good.
    """
    degraded = Degraded(0)
    # Before the priority is taken: it lasts long enough to stop another loop on this CPU.
    gc.collect()
    gc.freeze()
    gc.disable()
    libc = ctypes.CDLL(None, use_errno=True)
    libc.mallopt(M_TRIM_THRESHOLD, -1)
    libc.mallopt(M_MMAP_MAX, 0)
    prefault()
    if libc.mlockall(MCL_CURRENT | MCL_FUTURE) != 0:
        degraded |= Degraded.NO_LOCKED_MEMORY
    degraded |= _pin(settings)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(settings.priority))
    except OSError:
        degraded |= Degraded.NO_FIFO
    try:
        hold_shallow_idle()
    except OSError:
        degraded |= Degraded.NO_CPU_LATENCY
    if not _kernel_is_rt():
        degraded |= Degraded.KERNEL_NOT_RT
    return degraded


def prefault() -> None:
    """Let the calling thread have memory at hand that the kernel need not find page by page.

    Each thread has its own. Where it has to be found, Python's lock is held meanwhile.
    """
    libc = ctypes.CDLL(None)
    libc.malloc.restype = ctypes.c_void_p
    libc.free.argtypes = (ctypes.c_void_p,)
    block = libc.malloc(ctypes.c_size_t(PREFAULT_BYTES))
    if block:
        for offset in range(0, PREFAULT_BYTES, mmap.PAGESIZE):
            ctypes.memset(block + offset, 0, 1)
        libc.free(block)


def enter_beside(thread_id: int, settings: LoopSettings) -> None:
    """Let another thread of this process run on the caller's CPU, where the loop does not.

    It shares Python's one lock with the ticks. Below the loop's priority it never takes it from a
    tick; above everybody else's nobody keeps it from giving it back.
    """
    with contextlib.suppress(OSError):
        os.sched_setaffinity(thread_id, os.sched_getaffinity(0))
    below = settings.priority - 1
    real_time = os.sched_getscheduler(0) == os.SCHED_FIFO and below > 0
    policy = os.SCHED_FIFO if real_time else os.SCHED_OTHER
    with contextlib.suppress(OSError):
        os.sched_setscheduler(thread_id, policy, os.sched_param(below if real_time else 0))


@contextlib.contextmanager
def usual_priority() -> Iterator[None]:
    """Do without the real-time priority meanwhile: what takes milliseconds stops no other loop."""
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, policy, parameters)


def leave_priority() -> None:
    """Give up priority and CPU: what is left may take its time, other loops may not."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.sched_setaffinity(0, range(os.cpu_count() or 1))


def hold_shallow_idle() -> int:
    """Keep every CPU from idle states that it leaves late, until the file is closed; return it.

    Raises OSError where that is not allowed.
    """
    fd = os.open("/dev/cpu_dma_latency", os.O_WRONLY)
    try:
        os.write(fd, (0).to_bytes(4, "little"))
    except OSError:
        os.close(fd)
        raise
    return fd


def chosen_cpu(settings: LoopSettings) -> int:
    """Return the CPU to pin to: the configured one, else the highest isolated, else the highest.

    A loop beside others gets the next lower one that none of them has; where each has one, that
    with the fewest.
    """
    return _cpus_in_order(settings)[0]


def _cpus_in_order(settings: LoopSettings) -> list[int]:
    if settings.cpu is not None:
        return [settings.cpu]
    return sorted(isolated_cpus() or os.sched_getaffinity(0), reverse=True)


def _pin(settings: LoopSettings) -> Degraded:
    cpu, has_another = _take_one(_cpus_in_order(settings))
    shared = Degraded.CPU_SHARED if has_another else Degraded(0)
    try:
        os.sched_setaffinity(0, {cpu})
    except OSError:
        return Degraded.NO_PINNING
    return shared | (Degraded(0) if cpu in isolated_cpus() else Degraded.CPU_NOT_ISOLATED)


def _take_one(cpus: list[int]) -> tuple[int, bool]:
    """Take the CPU with the fewest other loops of this computer; tell whether it has another."""
    for beside in range(MOST_LOOPS):
        for cpu in cpus:
            with contextlib.suppress(RunError):
                _taken.append(Claim(f"CPU {cpu}", [f"loop {beside}"]))
                return cpu, beside > 0
    return cpus[0], True


def _kernel_is_rt() -> bool:
    with contextlib.suppress(OSError):
        return Path("/sys/kernel/realtime").read_text().strip() == "1"
    return "PREEMPT_RT" in os.uname().version
