"""Runs pytest on the emulated processor: `inside.py PATHS-OF-PACKAGES CHECKOUT ARGUMENTS...`."""

from __future__ import annotations

import os
import platform
import sys

paths, checkout, *arguments = sys.argv[1:]
sys.path[:0] = paths.split(os.pathsep)
sys.dont_write_bytecode = True

import pytest  # noqa: E402

print(f"Python {platform.python_version()} on {platform.machine()}", flush=True)
settings = ["-p", "no:cacheprovider", "-c", f"{checkout}/pyproject.toml", "--rootdir", checkout]
# An emulated processor compiles for minutes what others do in seconds.
sys.exit(pytest.main([*settings, "--timeout", "0", "--durations", "5", *arguments]))
