"""`motorctl bench closing`: what is hidden behind the buses, and figures of what came of it."""

import pytest

from motorctl.config import load_resolved
from motorctl.errors import UsageError
from motorctl_benchmarks.closing.findings import ClosingOptions, found_of
from motorctl_benchmarks.closing.gantries import RATES_HZ, document_of, hidden_gantries
from motorctl_benchmarks.closing.run_bus import BusClosed, Closed, Gain, closed_of


def closed(left, questions=0):
    gain = Gain(10e-6, 10e-6 * left)
    errors = {"y": {"eF": gain, "L2[e]": gain}}
    return Closed(errors, {"y": ("cogging",)}, 2, "nothing more is found", 60.0, 5, 3.0, questions)


def bus(over, virtual, questions=0):
    hidden = {"y": ("cogging",)}
    return BusClosed("modbus tcp", 2000.0, hidden, closed(over, questions), closed(virtual))


def figure(findings, name):
    return next(each for each in findings.figures if each.name == name)


def test_each_bus_hides_so_many_effects_and_no_configuration_tells_them():
    gantries = hidden_gantries(3, 5)
    assert [g.hidden for g in gantries] == [g.hidden for g in hidden_gantries(3, 5)]
    assert {each.transport.name for each in gantries} == set(RATES_HZ)
    assert all(sum(map(len, each.hidden.values())) == 5 for each in gantries)
    machine = load_resolved(document_of(gantries[0].direct(0.5e-3)), "direct", hardware=True)
    plants = machine.drivers["gantry"].options.model_dump()["plants"]
    for plant, axis in zip(plants.values(), machine.axes.values(), strict=True):
        hidden = gantries[0].hidden[axis.name]
        assert not set(axis.declared.names) & set(hidden)
        assert all(plant[name] is not None for name in hidden)
        assert plant["input_delay"]["time_s"] == 0.5e-3
        assert axis.experiments is not None


def test_what_is_left_is_held_against_virtual_time():
    found = found_of([bus(0.12, 0.10)])
    assert figure(found, "modbus_tcp_y_eF").value == pytest.approx(1.2)
    assert found_of([bus(0.119, 0.10)]).figures[0].met
    assert not found_of([bus(0.13, 0.10)]).figures[0].met
    assert not figure(found_of([bus(0.1, 0.1, questions=1)]), "questions").met


def test_a_bus_that_failed_fails_the_bench():
    failed = BusClosed("serial poll", 1000.0, {}, failed="no port")
    found = found_of([bus(0.1, 0.1), failed])
    assert found.failed
    assert "serial poll: failed: no port" in found.notes


def test_the_document_of_close_loop_tells_errors_motions_minutes_and_questions():
    measures = {"eM": 5e-6, "eF": 4e-6, "L2[e]": 2e-6, "uM": 3.0}
    less = {key: value / 2 for key, value in measures.items()}
    document = {
        "axes": {
            "x": {
                "effects": ["cogging"],
                "tracking": {"unused": {"before": measures, "after": less}},
            }
        },
        "rounds": [{}, {}],
        "ended": "nothing more is found",
        "moved": {
            "motions": 7,
            "minutes": {"x": 3.5, "y": 4.0},
            "questions": 0,
            "disturbed_share": 0.2,
        },
    }
    read = closed_of(document, 100.0)
    assert read.errors["x"]["eF"].left == 0.5
    assert (read.rounds, read.motions, read.minutes, read.questions) == (2, 7, 4.0, 0)
    assert closed_of(document | {"moved": None}, 100.0).motions == 0


def test_a_bus_that_is_none_is_refused_with_those_that_are():
    with pytest.raises(UsageError, match="--only canopen: the loop is closed over modbus tcp"):
        ClosingOptions(only=("canopen",))
