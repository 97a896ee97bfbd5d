"""The compiled loop on an emulated 64-bit ARM processor: builds what it needs, and runs tests.

PYTHONPATH=tests/support .venv/bin/python -m arm_processor [TESTS or options of pytest...]
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from virtual_machine.checkout import ROOT, add_checkout
from virtual_machine.machine import kept_build
from virtual_machine.recipe import PYTHON, UnavailableError

from arm_processor import recipe

TESTS = (
    "tests/loop/test_loop_handover.py",
    "tests/loop/test_loop_tick.py",
    "tests/loop/test_loop_safety.py",
    "tests/control/test_control_law.py",
    "tests/control/test_control_inverse.py",
    "tests/motion/test_motion_kernels.py",
)
"""What is compiled for the processor: handing over, the tick with its guards, the law."""


def main() -> int:
    """Run the tests that are asked for, or the usual ones; return pytest's exit status."""
    try:
        recipe.check_host()
        print("Debian's Python, wheels and ruckig for ARM: minutes, the first time", flush=True)
        built = kept_build("arm", recipe.key(), recipe.build)
    except UnavailableError as error:
        print(f"no ARM processor can be emulated here: {error}", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory() as folder:
        job = Path(folder)
        add_checkout(job)
        sources = [job / "motorctl" / name for name in (".", "drivers", "devices")]
        packages = os.pathsep.join(map(str, [*sources, built / "site"]))
        root, program = built / "root", Path(__file__).with_name("inside.py")
        python = (recipe.EMULATOR, "-L", root, root / f"usr/bin/python{PYTHON}")
        tests = sys.argv[1:] or [str(ROOT / test) for test in TESTS]
        environment = {**os.environ, "XDG_CACHE_HOME": str(built / "cache")}
        run = [str(word) for word in (*python, program, packages, ROOT, *tests)]
        return subprocess.run(run, env=environment, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
