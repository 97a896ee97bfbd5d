"""Where the daemon's compiled kernels are kept: in one folder, as a service can write no other."""

from __future__ import annotations

import subprocess
import sys

import pytest

KEPT_ELSEWHERE = """
import importlib
import sys

from numba.core.dispatcher import Dispatcher

from motorctl.kernels.cache import ByDigest

importlib.import_module(sys.argv[1])
for name, module in list(sys.modules.items()):
    for value in list(vars(module).values()) if name.startswith("motorctl") else ():
        kept = getattr(getattr(value, "_cache", None), "_impl", None)
        if isinstance(value, Dispatcher) and kept and not isinstance(kept.locator, ByDigest):
            print(name, value.__name__)
"""


@pytest.mark.parametrize("process", ["motorctl.daemon.supervisor", "motorctl.loop.process"])
def test_every_kernel_that_a_process_keeps_is_kept_in_the_cache_folder(process: str) -> None:
    """Others would fall to a home or to the packages' folder, which systemd's unit closes."""
    command = [sys.executable, "-c", KEPT_ELSEWHERE, process]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == ""
