"""What a configuration asks its drivers, and what becomes of drivers that answer wrongly."""

from __future__ import annotations

import copy

import config_bench
import pytest
from config_bench import BenchDriver, machine, problems

from motorctl.config import load, summarise
from motorctl.errors import UsageError
from motorctl.hal import RateBudget
from motorctl.hal.registry import driver_class


class Odd(BenchDriver):
    """Answers what the test says."""

    budget = RateBudget(1e4, "plenty")
    wrong = ()
    says = ()

    def rate_budget(self):
        return self.budget

    def problems(self):
        return self.wrong

    def advice(self):
        if isinstance(self.says, Exception):
            raise self.says
        return self.says


class OnALine(BenchDriver):
    """Has the line of its port for itself."""

    @property
    def medium(self):
        return f"line {self.options.port}"


@pytest.fixture
def odd(monkeypatch):
    monkeypatch.setattr(config_bench, "Odd", Odd, raising=False)

    def answering(name, answer):
        monkeypatch.setattr(Odd, name, answer)
        return machine(drivers__line__type="config_bench:Odd")

    return answering


@pytest.mark.parametrize(
    ("name", "answer"),
    [
        ("budget", None),
        ("budget", 5000.0),
        ("budget", RateBudget("5000", "words")),
        ("budget", RateBudget(float("nan"), "words")),
        ("wrong", ["wrong"]),
        ("wrong", [("port", "wrong")]),
        ("wrong", [(("port",), None)]),
        ("longest_wait_s", None),
        ("longest_wait_s", float("nan")),
        ("exchange_delay_periods", float("inf")),
        ("watchdog_s", 0.0),
        ("watchdog_s", "20 ms"),
        ("medium", 3),
    ],
)
def test_a_driver_that_answers_nonsense_is_named_with_what_it_said(tmp_path, odd, name, answer):
    (told,) = problems(tmp_path, odd(name, answer))
    assert told.key == "drivers.line"
    assert "should be" in told.message


@pytest.mark.parametrize(
    ("says", "told"),
    [
        ("arm its watchdog", ["arm its watchdog"]),
        (["one", "two"], ["one", "two"]),
        (None, None),
        (ValueError("nothing to say"), None),
    ],
)
def test_advice_is_never_a_reason_to_refuse(tmp_path, odd, says, told):
    path = config_bench.write(tmp_path, odd("says", says))
    advice = summarise(load(path))["drivers"]["line"]["advice"]
    if told is None:
        assert len(advice) == 1
        assert "failed" in advice[0]
    else:
        assert advice == told


@pytest.mark.parametrize(
    ("watchdog_s", "frozen_s"), [(None, 0.1), (float("inf"), 0.1), (0.5, 0.1), (0.02, 0.02)]
)
def test_a_computer_may_stand_still_for_as_long_as_the_device_goes_on_at_most(
    tmp_path, odd, watchdog_s, frozen_s
):
    path = config_bench.write(tmp_path, odd("watchdog_s", watchdog_s))
    told = summarise(load(path))
    assert told["axes"]["x"]["guards"]["host_frozen"]["time_s"] == frozen_s
    finite_s = None if watchdog_s == float("inf") else watchdog_s
    assert told["drivers"]["line"]["watchdog_s"] == finite_s


def test_a_driver_that_wants_to_end_the_program_does_not(tmp_path, odd):
    def leave(self):
        raise SystemExit(7)

    (told,) = problems(tmp_path, odd("rate_budget", leave))
    assert "SystemExit" in told.message


def on_two_lines(first: str, second: str):
    data = machine(drivers__line={"type": "config_bench:OnALine", "port": first})
    data["drivers"]["other"] = {"type": "config_bench:OnALine", "port": second}
    data["axes"]["y"] = copy.deepcopy(data["axes"]["x"]) | {"driver": "other"}
    del data["axes"]["y"]["program"]
    return data


def test_two_drivers_on_one_line_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(config_bench, "OnALine", OnALine, raising=False)
    assert problems(tmp_path, on_two_lines("/dev/a", "/dev/b")) == ()
    (told,) = problems(tmp_path, on_two_lines("/dev/a", "/dev/a"))
    assert told.key == "drivers.other"
    assert "'line'" in told.message
    assert "/dev/a" in told.message


def test_the_time_of_a_machine_of_metal_waits_for_no_computer(tmp_path):
    (problem,) = problems(tmp_path, machine(loop__without_realtime="wait"))
    assert problem.key == "loop.without_realtime"
    assert problem.message.startswith("found 'wait', should be degrade or refuse: driver 'line'")


def test_a_driver_is_found_in_a_folder_that_is_looked_in_later(tmp_path, monkeypatch):
    driver_class("sim")
    info = tmp_path / "late-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: late\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text(f"[motorctl.drivers]\nlate = {__name__}:Odd\n")
    with pytest.raises(UsageError, match="unknown driver 'late'"):
        driver_class("late")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert driver_class("late") is Odd
