"""What another process has compiled of a machine, the loop's process finds."""

import json
import os
import shutil
import subprocess
import sys

import pytest

LOAD = """
import json, sys
from numba.core import event
from motorctl.config import load
machine = load("published_gantry")
analysed = []

class Listener(event.Listener):
    def on_start(self, event):
        function = event.data["dispatcher"].py_func
        if not function.__module__.startswith("numba."):
            types = [hash(str(argument)) for argument in event.data["args"]]
            analysed.append([f"{function.__module__}.{function.__name__}", types])
    def on_end(self, event):
        pass

with event.install_listener("numba:compile", Listener()):
"""
COMPILE = """
    from motorctl.loop.compiled_beside import compile_beside
    compile_beside(machine)
"""
WARM_UP = """
    from motorctl.loop.tick import make_drivers
    from motorctl.loop.warm_up import warm_up
    warm_up(machine)
    for driver in make_drivers(machine).values():
        driver.prepare()
"""
TELL = "print(json.dumps(analysed))\n"


@pytest.mark.slow
@pytest.mark.long
def test_laws_and_drivers_that_were_compiled_beside_are_not_compiled_again(tmp_path):
    def analysed(part):
        done = subprocess.run(
            [sys.executable, "-c", LOAD + part + TELL],
            env={**os.environ, "XDG_CACHE_HOME": str(tmp_path), "PYTHONHASHSEED": "0"},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        return {(name, *types) for name, types in json.loads(done.stdout)}

    beside = analysed(COMPILE)
    names = {name for name, *_ in beside}
    assert {"motorctl.loop.axis.axis_step", "motorctl.control.law.law_step"} <= names
    own = analysed(WARM_UP)
    assert "motorctl.loop.commands.take_commands" in {name for name, *_ in own}
    assert own & beside == set()
    # What was analysed may be gone after a month; with the tick there nobody needs it.
    for kept in (tmp_path / "motorctl" / "compiled").glob("motorctl.control.*"):
        shutil.rmtree(kept)
    for kept in (tmp_path / "motorctl" / "compiled").rglob("*.steps-*"):
        kept.unlink()
    assert not {name for name, *_ in analysed(COMPILE)} & names
