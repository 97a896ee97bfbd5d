"""Before a machine moves somebody agrees, or its configuration allowed it before."""

from __future__ import annotations

import errno
from pathlib import Path
from typing import Any

import pytest
import yaml

from motorctl.cli.consent import Consents
from motorctl.close_loop.machine_rig import AskedMotion
from motorctl.config import Machine, load, shipped_config
from motorctl.errors import ConfigError, UsageError
from motorctl.loop.plan import plan_program


def machine(folder: Path, experiments: dict[str, Any] | None) -> Machine:
    """Return a gantry behind a bus, which no `--yes` may move but within its envelope."""
    document = yaml.safe_load(shipped_config("modbus_gantry").read_text())
    for axis in document["axes"].values():
        axis["experiments"] = experiments
    path = folder / "machine.yaml"
    path.write_text(yaml.safe_dump(document))
    return load(path)


def asked(of: Machine, tripped: str = "y") -> AskedMotion:
    name, program = next(iter(of.programs.items()))
    standing = {axis: sum(of.axes[axis].limits.travel_m) / 2 for axis in program.axes}
    plan = plan_program(of, program, standing)
    return AskedMotion({name: plan}, plan.duration_s, ("x",), {tripped: "following error 2 mm"})


WIDE = {
    "travel_m": None,
    "max_velocity_share": 1.0,
    "max_acceleration_share": 1.0,
    "max_minutes": 60.0,
}


def wide(of: Machine) -> dict[str, Any]:
    return WIDE | {"travel_m": list(of.axes["x"].limits.travel_m)}


def test_without_an_envelope_nobody_but_a_person_agrees(tmp_path: Path) -> None:
    of = machine(tmp_path, None)
    with pytest.raises(UsageError, match=r"axes\.x\.experiments is not in the configuration"):
        Consents(yes=True).ask(of, asked(of))


def test_within_the_envelope_nobody_is_asked(tmp_path: Path) -> None:
    of = machine(tmp_path, wide(machine(tmp_path, None)))
    Consents(yes=True).ask(of, asked(of))


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("travel_m", [0.19, 0.21], "travel_m: it goes from"),
        ("max_velocity_share", 0.01, "max_velocity_share: it reaches"),
        ("max_acceleration_share", 0.01, "max_acceleration_share: it reaches"),
        ("max_minutes", 0.01, "max_minutes: "),
    ],
)
def test_what_is_beyond_the_envelope_is_told_with_its_limit(
    tmp_path: Path, key: str, value: Any, told: str
) -> None:
    of = machine(tmp_path, wide(machine(tmp_path, None)) | {key: value})
    with pytest.raises(UsageError) as caught:
        Consents(yes=True).ask(of, asked(of))
    assert f"axes.x.experiments.{told}" in str(caught.value)
    assert "allowed are" in str(caught.value)


def test_the_minutes_of_a_session_add_up(tmp_path: Path) -> None:
    base = machine(tmp_path, None)
    minutes = asked(base).duration_s / 60.0
    of = machine(tmp_path, wide(base) | {"max_minutes": 2.5 * minutes})
    consents = Consents(yes=True)
    consents.ask(of, asked(of))
    consents.ask(of, asked(of))
    with pytest.raises(UsageError, match="max_minutes"):
        consents.ask(of, asked(of))


def test_an_axis_that_tripped_is_reset_by_a_person(tmp_path: Path) -> None:
    of = machine(tmp_path, wide(machine(tmp_path, None)))
    with pytest.raises(
        UsageError, match=r"following error 2 mm\. --yes resets no axis: .*reset x`"
    ):
        Consents(yes=True).ask(of, asked(of, tripped="x"))


def test_nothing_written_allows_the_middle_half(tmp_path: Path) -> None:
    of = machine(tmp_path, {})
    with pytest.raises(UsageError, match=r"experiments\."):
        Consents(yes=True).ask(of, asked(of))


def test_where_nobody_can_be_asked_nothing_moves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    of = machine(tmp_path, None)
    with pytest.raises(UsageError, match="nobody is there to say yes"):
        Consents(yes=False).ask(of, asked(of, tripped="x"))
    shown = capsys.readouterr().err
    assert "of limit" in shown
    assert "axis x tripped and is reset before: following error 2 mm" in shown
    assert "axis x: with other models" in shown


def test_an_envelope_outside_the_limits_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"experiments\.travel_m: found .*within limits\.travel"):
        machine(tmp_path, {"travel_m": [-1.0, 0.2]})


def test_the_minutes_of_a_loop_that_broke_off_count_when_it_goes_on(tmp_path: Path) -> None:
    lasts_min = asked(machine(tmp_path, None)).duration_s / 60.0
    of = machine(tmp_path, wide(machine(tmp_path, None)) | {"max_minutes": 1.5 * lasts_min})
    kept = tmp_path / "out" / "moved_minutes.json"
    motion = asked(of)
    Consents(yes=True, kept=kept).ask(of, motion)
    Consents(yes=True, kept=kept).ask(of, motion)  # one that begins anew
    with pytest.raises(UsageError, match="max_minutes"):
        Consents(yes=True, kept=kept, resume=True).ask(of, motion)


@pytest.mark.parametrize("text", ["", '{"x": 1', '{"x": "a"}', '{"x": NaN}', '{"x": -60}', "\xff"])
def test_minutes_that_cannot_be_read_are_not_taken_for_none(tmp_path: Path, text: str) -> None:
    kept = tmp_path / "moved_minutes.json"
    kept.write_text(text, encoding="latin-1")
    with pytest.raises(UsageError, match=r"moved_minutes\.json: is damaged"):
        Consents(yes=True, kept=kept, resume=True)


def test_minutes_are_noted_whole_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    of = machine(tmp_path, wide(machine(tmp_path, None)))
    kept = tmp_path / "moved_minutes.json"
    consents = Consents(yes=True, kept=kept)
    consents.ask(of, asked(of))
    before = kept.read_bytes()

    def cut_short(path: Path, text: str) -> None:
        path.write_bytes(text.encode()[:3])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_text", cut_short)
    with pytest.raises(UsageError, match=r"cannot be written: No space left"):
        consents.ask(of, asked(of))
    assert kept.read_bytes() == before
