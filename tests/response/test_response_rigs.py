"""Through a daemon that others use, too: nothing of theirs is stopped or excited."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from motorctl.config import load, shipped_config
from motorctl.daemon.client import DaemonRefusedError
from motorctl.errors import UsageError
from motorctl.response import rigs
from motorctl.response.plan import ResponsePlan, plan_response


class Daemon:
    """Answers as a daemon does; another user's motion begins when `taken`."""

    path = Path("nowhere.sock")

    def __init__(self, refused: str = "", taken: bool = False) -> None:
        self.asked: list[str] = []
        self._refused = refused
        self._taken = taken

    def axis(self, name: str) -> dict[str, Any]:
        state = "running" if self._taken else "idle"
        return {"state": state, "homed": True, "excitation": None, "fault": None}

    def ask(self, do: str, **arguments: Any) -> dict[str, Any]:
        self.asked.append(do)
        if do == self._refused:
            raise DaemonRefusedError("wrong_state", "axis x is running")
        return {"loop": {"ticks": 1}, "recording": {"file": "run.parquet"}, "approach_s": 0.0}

    def __enter__(self) -> Daemon:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is open."""


def planned(*, moving: bool) -> ResponsePlan:
    machine = load(shipped_config("published_gantry"))
    return plan_response(machine.axes["x"], machine.period_s, moving=moving)


@pytest.mark.parametrize("standing", [False, True], ids=["moving", "standing"])
def test_a_motion_of_somebody_else_that_came_first_is_not_stopped(
    standing: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    plan = planned(moving=not standing)
    daemon = Daemon(refused="excite" if standing else "program")
    monkeypatch.setattr(rigs, "Client", lambda _: daemon)
    with pytest.raises(DaemonRefusedError, match="axis x is running"):
        rigs.record_through_daemon(daemon, plan, tmp_path / "x.parquet", lambda *_: None)  # type: ignore[arg-type]
    assert "stop" not in daemon.asked


def test_what_began_while_a_person_was_asked_is_seen(tmp_path: Path) -> None:
    plan = planned(moving=True)
    daemon = Daemon(taken=True)
    with pytest.raises(UsageError, match="axis x is running"):
        rigs.record_through_daemon(daemon, plan, tmp_path / "x.parquet", lambda *_: None)  # type: ignore[arg-type]
    assert not {"program", "excite", "stop"} & set(daemon.asked)
