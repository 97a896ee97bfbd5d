"""The service in a virtual machine: builds it, runs it, prints a line a step, keeps what it left.

PYTHONPATH=tests/support .venv/bin/python -m service_machine --out out/service_machine
"""

from __future__ import annotations

import argparse
import ast
import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from virtual_machine.checkout import ROOT, add_checkout
from virtual_machine.machine import machine
from virtual_machine.recipe import UnavailableError

LIMIT_S = 4500
STORY = ROOT / "tests/system/service_machine"
SOCKETCAN = ROOT / "tests/drivers/can/socketcan"
"""Its machine, slow enough for an emulated processor, and how to compile for it outside."""
COMPILING = ". ./environment.sh && python3 warm.py"
BUILD = "import sys; from hatchling.build import build_wheel; build_wheel(sys.argv[1])"


def run(scratch: Path, out: Path, only: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Run the story and return its steps; raises UnavailableError where there is no machine.

    Parameters
    ----------
    scratch
        An empty folder for what is needed meanwhile.
    out
        Where the transcript, the journals and the rest of the result go.
    only
        Names of steps: these, and what they need, are all that is run.
    """
    began = time.monotonic()
    here = machine()
    built_s = time.monotonic() - began
    job = scratch / "job"
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(STORY, job, ignore=ignored)
    for name in ("warm.py", "loop_config.py", "page_layouts.py", "environment.sh"):
        shutil.copy(SOCKETCAN / name, job)
    for name in ("daemon_rig.py", "real_time.py"):
        shutil.copy(ROOT / "tests/support" / name, job)
    if only:
        (job / "only").write_text("\n".join(only))
    add_checkout(job)  # for compiling only
    for source in (ROOT, ROOT / "devices"):
        build = [sys.executable, "-c", BUILD, str(job / "wheels")]
        subprocess.run(build, cwd=source, check=True, capture_output=True)
    result = here.run(job, scratch, LIMIT_S, before=COMPILING, systemd=True, tell=_tell)
    shutil.copytree(result.folder, out, dirs_exist_ok=True)
    (out / "console.txt").write_text(result.console)
    lines = (out / "steps.jsonl").read_text().splitlines()
    steps = [json.loads(line) for line in lines]
    heading = f"machine built or found in {built_s:.0f} s, all in {time.monotonic() - began:.0f} s"
    (out / "transcript.txt").write_text("\n".join([heading, *map(_line, steps)]) + "\n")
    return steps


def names_of_steps() -> list[str]:
    """Return the names of all steps, in order, as the story lists them."""
    tree = ast.parse((STORY / "story.py").read_text())
    named = [node for node in tree.body if isinstance(node, ast.AnnAssign)]
    (steps,) = (node.value for node in named if ast.unparse(node.target) == "THE_STEPS")
    assert steps is not None
    return [node.id for node in ast.walk(steps) if isinstance(node, ast.Name)]


def _tell(line: str) -> None:
    print(line, flush=True)


def _line(step: dict[str, Any]) -> str:
    word = "ok    " if step["right"] else "FAILED"
    return (
        f"{step['at_s']:7.1f} s  {word}  {step['what']}\n"
        f"{'':12}{step['took_s']:5.1f} s  {step['saw']}"
    )


def main() -> int:
    """Run it and print the transcript; return 0 where every step was right."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/service_machine"))
    parser.add_argument("--only", nargs="+", default=(), choices=names_of_steps(), metavar="STEP")
    asked = parser.parse_args()
    out: Path = asked.out
    shutil.rmtree(out, ignore_errors=True)
    try:
        with tempfile.TemporaryDirectory() as scratch:
            steps = run(Path(scratch), out, asked.only)
    except UnavailableError as error:
        print(f"no virtual machine on this host: {error}", file=sys.stderr)
        return 2
    print((out / "transcript.txt").read_text())
    return 0 if all(step["right"] for step in steps) else 1


if __name__ == "__main__":
    sys.exit(main())
