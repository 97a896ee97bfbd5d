"""The machine behind a daemon, of which a control socket is all that there is."""

from __future__ import annotations

import asyncio
import signal
import threading
from pathlib import Path
from typing import Any

import pytest
from daemon_rig import bench_config
from served_socket import served

from motorctl.close_loop.machine_rig import MachineRig
from motorctl.config import load
from motorctl.daemon.access import Role
from motorctl.daemon.client import Client
from motorctl.daemon.protocol import ApplyCommand, AxisCommand, Request, StatusCommand


class Standing:
    """A daemon whose axes hold until they are stopped, and whose first `apply` is interrupted."""

    def __init__(self) -> None:
        self.state = {"x": "idle", "y": "idle"}
        self.applied: list[str] = []

    async def handle(self, request: Request) -> dict[str, Any]:
        match request:
            case StatusCommand():
                axes = {
                    name: {"state": state, "fault": None, "reference_m": 0.05, "homed": True}
                    for name, state in self.state.items()
                }
                return {"axes": axes}
            case AxisCommand(do="stop"):
                self.state[request.axis] = "off"
                return {}
            case ApplyCommand():
                self.applied.append(request.source)
                if len(self.applied) == 1:
                    signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
                    await asyncio.sleep(0.1)
                return {"axes": ["x"], "log": None, "trial": None}
            case _:
                raise AssertionError(request)


def test_ctrl_c_while_models_are_taken_on_leaves_the_ones_that_were_kept(tmp_path: Path) -> None:
    (tmp_path / "bench.yaml").write_text(bench_config("shuttle"))
    machine, tried = (load(tmp_path / "bench.yaml") for _ in range(2))
    daemon = Standing()
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with (
            served(tmp_path / "s", daemon.handle, lambda: Role.CONFIGURE) as path,
            Client(path) as client,
        ):
            rig = MachineRig(client, machine, lambda *_: None)
            with pytest.raises(KeyboardInterrupt):
                rig.run(tried, tmp_path / "run.parquet", None, lambda _: None)
            assert rig.stop() == ()
            assert rig.leave() == ("x",)
    finally:
        signal.signal(signal.SIGINT, before)
    assert daemon.state["x"] == "off"
    assert daemon.applied == [str(tried.source), "what ran when close-loop began"]
