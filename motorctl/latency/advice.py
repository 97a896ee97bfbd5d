"""What would make this machine a better one for real time: told, never applied."""

from __future__ import annotations

from pathlib import Path

ROOT = Path("/")
WORKERS = "sys/devices/virtual/workqueue/cpumask"
LONGEST_SPIN = 0.6
"""Of the period: sleeping the rest keeps clear of the kernel's real-time throttling (95 %)."""
LATE_ENOUGH = 1e-3
STOLEN_ENOUGH = 1e-4


def kernel_advice(cpu: int, root: Path = ROOT) -> list[str]:
    """Return what is missing for the loop on this CPU, a sentence each.

    root is where /proc and /sys are looked for.
    """
    advice = []
    words = _read(root / "proc/cmdline").split()
    given = {word.partition("=")[0] for word in words}
    version = _read(root / "proc/version")
    if _read(root / "sys/kernel/realtime") != "1" and "PREEMPT_RT" not in version:
        advice.append(
            "a PREEMPT_RT kernel (Debian: apt-get install linux-image-rt-amd64): bounds how long "
            "the kernel itself can keep the loop waiting"
        )
        if "PREEMPT_DYNAMIC" in version and "preempt=full" not in words:
            advice.append(
                "until then kernel parameter preempt=full, where that is not its default: the "
                "loop need not wait for another program's system call"
            )
    others = [k for k in _online(root) if k != cpu]
    if others:
        rest = ",".join(str(k) for k in others)
        parameters = {
            "isolcpus": (f"isolcpus=managed_irq,domain,{cpu}", "keeps other work off the CPU"),
            "nohz_full": (f"nohz_full={cpu}", "stops the timer tick there"),
            "rcu_nocbs": (f"rcu_nocbs={cpu}", "moves the kernel's own callbacks elsewhere"),
            "irqaffinity": (f"irqaffinity={rest}", "sends interrupts to the other CPUs"),
        }
        advice += [
            f"kernel parameter {text}: {why}"
            for name, (text, why) in parameters.items()
            if name not in given
        ]
        advice += _worker_advice(cpu, others, root)
    else:
        advice.append("a second CPU: with one, everything else competes with the loop")
    governor = _read(root / f"sys/devices/system/cpu/cpu{cpu}/cpufreq/scaling_governor")
    if governor and governor != "performance":
        advice.append(
            f"governor performance instead of {governor} (cpupower frequency-set -g performance): "
            "no waiting for the clock to rise"
        )
    if _read(root / "sys/devices/system/cpu/smt/active") == "1":
        advice.append("SMT off (kernel parameter nosmt): the sibling takes time from the loop")
    return advice


def _worker_advice(cpu: int, others: list[int], root: Path) -> list[str]:
    """Return how to keep the kernel's unbound workers off the CPU, where they may run on it.

    They finish what others wrote to a disk, up to a millisecond at a time, and a kernel without
    PREEMPT_RT does not put that aside for the loop. An isolated CPU has none.
    """
    if not kernel_workers_run_on(cpu, root):
        return []
    mask = sum(1 << k for k in others)
    words = range(max(others) // 32, -1, -1)  # the kernel takes 32 CPUs a word
    told = ",".join(f"{mask >> 32 * word & 0xFFFFFFFF:x}" for word in words)
    return [
        f"no unbound kernel workers there (echo {told} > /{WORKERS}, after each boot; an "
        "isolated CPU has none): they finish what is written to disks, logs too"
    ]


def kernel_workers_run_on(cpu: int, root: Path = ROOT) -> bool:
    """Tell whether the kernel may finish its deferred work on this CPU.

    root is where /sys is looked for.
    """
    allowed = _read(root / WORKERS).replace(",", "") or "0"
    return bool(int(allowed, 16) >> cpu & 1)


def spin_advice(spin_s: float, period_s: float, late_share: float) -> list[str]:
    """Return what a longer spin could do for a share of late wake-ups, 0 to 1."""
    longer_s = LONGEST_SPIN * period_s
    if late_share < LATE_ENOUGH or spin_s >= longer_s:
        return []
    return [
        f"loop.spin_s {longer_s:g} instead of {spin_s:g} in the configuration: wake-ups that are "
        f"late by up to {longer_s * 1e6:g} us then do no harm; it takes more of the CPU"
    ]


def theft_advice(stolen_share: float, cpu: int) -> list[str]:
    """Return what a share of time says that a hypervisor took, 0 to 1."""
    if stolen_share < STOLEN_ENOUGH:
        return []
    return [
        f"a machine of its own: a hypervisor took {stolen_share:.2%} of CPU {cpu} away while the "
        "loop ran, and nothing on this side can prevent that"
    ]


def _online(root: Path) -> list[int]:
    cpus: list[int] = []
    for part in _read(root / "sys/devices/system/cpu/online").split(","):
        first, _, last = part.partition("-")
        if first.isdecimal():
            cpus += range(int(first), int(last or first) + 1)
    return cpus


def _read(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:
        return ""
