"""`check --compile` leaves in the cache all that a first start of the machine takes from it."""

import os
import subprocess
import sys

import pytest
from daemon_rig import bench_config

MAIN = "from motorctl.cli import main; main()"
STARTS = """
import sys
from motorctl.config import load
from motorctl.kernels import compiling_told
from motorctl.loop.tick import make_drivers
from motorctl.loop.warm_up import warm_up
machine = load(sys.argv[1])
with compiling_told("compiles"):
    warm_up(machine)
    for driver in make_drivers(machine).values():
        driver.prepare()
"""
"""What a start compiles: the loop's process and the drivers'."""


@pytest.mark.slow
def test_a_machine_that_was_checked_with_compile_compiles_nothing_at_its_start(tmp_path):
    config = tmp_path / "stage.yaml"
    config.write_text(bench_config())
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "cache")}

    def ran(*words):
        return subprocess.run(words, capture_output=True, text=True, env=environment, check=True)

    checked = ran(sys.executable, "-c", MAIN, "check", str(config), "--compile")
    assert "compiling the kernels of" in checked.stderr
    assert "compiled in " in checked.stderr
    assert f"`motorctl run {config}` finds it in the cache" in checked.stderr
    started = ran(sys.executable, "-c", STARTS, str(config))
    assert "compil" not in started.stderr
