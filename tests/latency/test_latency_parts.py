"""What a latency measurement is made of: durations, cyclictest's report, histograms, advice."""

from __future__ import annotations

import json
import os
import shutil
import stat
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorctl.errors import RunError
from motorctl.latency.advice import kernel_advice, spin_advice, theft_advice
from motorctl.latency.cyclictest import cyclictest_command, rival_of, run_cyclictest
from motorctl.latency.durations import Durations
from motorctl.latency.histogram import (
    EDGES_S,
    bin_names,
    histogram_document,
    histogram_lines,
)
from motorctl.latency.host import stolen_s
from motorctl.latency.verdict import judge

DURATIONS = st.lists(st.floats(2e-9, 1.0), min_size=1, max_size=200).map(np.array)


def _report(histogram: dict[int, int], cycles: int, longest: int) -> dict:
    thread = {"histogram": {str(k): v for k, v in histogram.items()}}
    thread |= {"cycles": cycles, "max": longest}
    return {"rt_test_version:": "2.40", "thread": {"0": thread}}


@given(DURATIONS, st.sampled_from([50.0, 99.0, 99.9]))
def test_percentiles_are_exact_to_a_bin(values, percentile):
    durations = Durations()
    durations.add(values)
    exact = np.percentile(values, percentile, method="inverted_cdf")
    assert exact * (1 - 1e-9) <= durations.percentile_s(percentile) <= exact * 1.0117
    assert durations.percentile_s(100.0) == values.max()


@given(DURATIONS, st.floats(1e-6, 0.9), st.integers(1, 199))
def test_batches_count_like_the_whole(values, limit, cut):
    whole, parts = Durations((limit,)), Durations((limit,))
    times = np.arange(len(values)) * 2e-4
    whole.add(values, time_s=times)
    parts.add(values[:cut], time_s=times[:cut])
    parts.add(values[cut:], time_s=times[cut:])
    assert parts.total == len(values)
    assert parts.share_beyond(limit) == whole.share_beyond(limit) == np.mean(values > limit)
    assert (parts.worst_s, parts.worst_at_s) == (whole.worst_s, times[np.argmax(values)])
    np.testing.assert_array_equal(parts.counts, whole.counts)


@given(DURATIONS)
def test_a_histogram_keeps_what_is_off_the_chart_in_its_end_bins(values):
    durations = Durations()
    durations.add(values)
    counts = np.array(histogram_document(durations)["counts"])
    assert counts.sum() == len(values)
    assert len(counts) == len(bin_names())
    # A fine bin's width of doubt at each edge.
    assert (values < EDGES_S[0]).sum() <= counts[0] <= (values < EDGES_S[0] * 1.012).sum()
    assert (values >= EDGES_S[-1] * 1.012).sum() <= counts[-1] <= (values >= EDGES_S[-1]).sum()


def test_histogram_bars_grow_with_the_logarithm():
    durations = Durations()
    durations.add(np.array([0.3e-6, 3e-6, 3000e-6]), counts=np.array([99_999, 99, 9]))
    lines = histogram_lines({"lateness": durations})
    bars = {line.strip().split("  ")[0]: line.count("█") for line in lines}
    assert bars["0.2 – 0.5"] == 20
    assert bars["2 – 5"] == 8
    assert bars["2 ms – 5 ms"] == 4
    assert bars["10 – 20"] == 0
    assert "99999" in lines[1]


def test_without_a_duration_nothing_is_claimed():
    assert Durations().document() == {
        "p50_us": None,
        "p99_us": None,
        "p999_us": None,
        "max_us": None,
        "max_at_s": None,
    }
    assert Durations((1e-6,)).share_beyond(1e-6) == 0.0


def test_runs_of_cyclictest_are_joined_with_what_lies_beyond_their_histogram():
    first = _report({20: 6, 60: 2}, 10, 400_000)
    second = _report({20: 5, 450: 4}, 9, 450)
    rival = rival_of(["cyclictest", "-m"], [first, second], (50e-6, 200e-6), 200)
    assert rival.latency.total == 19
    assert rival.latency.share_beyond(50e-6) == pytest.approx(8 / 19)
    assert rival.latency.share_beyond(200e-6) == pytest.approx(6 / 19)
    assert rival.latency.worst_s == pytest.approx(0.4, rel=1e-4)
    # 450 us late: two periods of 200 us passed; of the two off the chart one is known.
    assert rival.skipped == 4 * 2 + 100_000 // 200 + 400_000 // 200
    assert rival.skipped_share == pytest.approx(rival.skipped / (rival.skipped + 19))


def _instead_of_cyclictest(folder: Path, body: str) -> None:
    program = folder / "cyclictest"
    program.write_text(f"#!/bin/sh\n{body}\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)


def test_cyclictest_is_asked_for_the_loops_cpu_priority_and_period(tmp_path, monkeypatch):
    report = json.dumps(_report({20: 3}, 3, 20))
    _instead_of_cyclictest(
        tmp_path,
        f'echo "$@" > {tmp_path}/asked\n'
        f"for word; do case $word in --json=*) echo '{report}' > ${{word#--json=}};; esac; done",
    )
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    command = cyclictest_command(3, 80, 200)
    assert command is not None
    assert run_cyclictest(command, 1.2)["thread"]["0"]["cycles"] == 3
    asked = (tmp_path / "asked").read_text().split()
    assert {"-m", "-p80", "-a3", "-i200", "-q", "-D2"} <= set(asked)


def test_a_cyclictest_that_fails_is_told_with_its_own_words(tmp_path, monkeypatch):
    _instead_of_cyclictest(tmp_path, "echo 'Unable to change scheduling policy!' >&2; exit 1")
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    command = cyclictest_command(0, 80, 200)
    assert command is not None
    with pytest.raises(RunError, match="Unable to change scheduling policy!"):
        run_cyclictest(command, 1.0)


def test_a_missing_cyclictest_is_no_command(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert cyclictest_command(0, 80, 200) is None


@pytest.mark.skipif(shutil.which("cyclictest") is None, reason="rt-tests is not installed")
@pytest.mark.skipif(os.geteuid() != 0, reason="cyclictest needs real-time priority")
def test_the_installed_cyclictest_is_understood():
    command = cyclictest_command(0, 80, 1000)
    assert command is not None
    rival = rival_of(command, [run_cyclictest(command, 1.0)], (50e-6,), 1000)
    assert 0 < rival.latency.total <= 1001
    assert rival.latency.worst_s > 0.0
    assert rival.version != "?"


@pytest.mark.parametrize(
    ("worst_us", "grade"),
    [
        (19.9, "very good"),
        (20.0, "good"),
        (50.0, "only with a hardware card"),
        (499.9, "only with a hardware card"),
        (500.0, "unacceptable"),
    ],
)
def test_the_worst_lateness_is_graded_as_linuxcnc_does(worst_us, grade):
    verdict = judge(worst_us)
    assert verdict.grade == grade
    assert f"{worst_us:.1f} us" in verdict.sentence


def _machine_files(root: Path, **files: str) -> None:
    for name, text in files.items():
        path = root / name.replace("__", "/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n")


def test_advice_names_what_is_missing_for_this_cpu(tmp_path):
    _machine_files(
        tmp_path,
        sys__kernel__realtime="0",
        proc__version="Linux version 6.18 #1 SMP PREEMPT_DYNAMIC",
        proc__cmdline="quiet nohz_full=3",
        sys__devices__system__cpu__online="0-3",
        sys__devices__system__cpu__cpu3__cpufreq__scaling_governor="powersave",
        sys__devices__system__cpu__smt__active="1",
        sys__devices__virtual__workqueue__cpumask="f",
    )
    advice = "\n".join(kernel_advice(3, tmp_path))
    assert "echo 7 > /sys/devices/virtual/workqueue/cpumask" in advice
    assert "isolcpus=managed_irq,domain,3" in advice
    assert "rcu_nocbs=3" in advice
    assert "irqaffinity=0,1,2" in advice
    assert "instead of powersave" in advice
    assert "nosmt" in advice
    assert "preempt=full" in advice
    assert "nohz_full" not in advice


def test_the_mask_of_many_cpus_is_written_in_words_as_the_kernel_takes_it(tmp_path):
    _machine_files(
        tmp_path,
        sys__devices__system__cpu__online="0-47",
        sys__devices__virtual__workqueue__cpumask="ffff,ffffffff",
    )
    assert "echo ffff,fffffff7 > " in "\n".join(kernel_advice(3, tmp_path))


def test_a_machine_that_is_set_up_gets_no_advice(tmp_path):
    _machine_files(
        tmp_path,
        sys__kernel__realtime="1",
        proc__version="Linux version 6.12 #1 SMP PREEMPT_RT",
        proc__cmdline="isolcpus=1 nohz_full=1 rcu_nocbs=1 irqaffinity=0",
        sys__devices__system__cpu__online="0-1",
        sys__devices__system__cpu__cpu1__cpufreq__scaling_governor="performance",
        sys__devices__system__cpu__smt__active="0",
        sys__devices__virtual__workqueue__cpumask="00000000,00000001",
    )
    assert kernel_advice(1, tmp_path) == []


def test_a_longer_spin_is_advised_only_where_wake_ups_are_late():
    assert spin_advice(60e-6, 200e-6, 0.0) == []
    assert spin_advice(120e-6, 200e-6, 0.1) == []
    assert "loop.spin_s 0.00012 instead of 6e-05" in spin_advice(60e-6, 200e-6, 0.01)[0]


def test_time_that_a_hypervisor_took_is_found_and_told(tmp_path):
    _machine_files(tmp_path, proc__stat="cpu 9 9 9 9 9 9 9 900 0\ncpu1 1 2 3 4 5 6 7 250 0 0")
    assert stolen_s(1, tmp_path) == 250 / os.sysconf("SC_CLK_TCK")
    assert stolen_s(2, tmp_path) == 0.0
    assert theft_advice(0.0, 1) == []
    assert "took 1.50% of CPU 1" in theft_advice(0.015, 1)[0]
