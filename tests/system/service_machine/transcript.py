"""What was done, one line a step, with times; it goes on where the machine was started anew."""

from __future__ import annotations

import json
import subprocess
import time
import traceback
from collections.abc import Callable
from pathlib import Path

RESULT = Path("/job/result")
STEPS = RESULT / "steps.jsonl"
BEGAN = Path("/job/began")
Step = Callable[[], str]


def run_all(steps: list[Step]) -> bool:
    """Run the steps that have not been run; return whether all are done.

    A step is a function that returns what it saw, and raises where that is not as it should be;
    the others are run all the same.
    """
    if not BEGAN.exists():
        BEGAN.write_text(str(time.time()))
    began = float(BEGAN.read_text())
    done = len(STEPS.read_text().splitlines()) if STEPS.exists() else 0
    for step in steps[done:]:
        start = time.time()
        try:
            saw, right = step(), True
        except Exception as error:
            traceback.print_exc()
            saw, right = f"{type(error).__name__}: {error}\n{_journal()}", False
        line = {
            "step": step.__name__,
            "what": (step.__doc__ or "").rstrip("."),
            "at_s": round(start - began, 1),
            "took_s": round(time.time() - start, 1),
            "right": right,
            "saw": saw,
        }
        with STEPS.open("a") as file:
            file.write(json.dumps(line) + "\n")
        word = "ok" if right else "FAILED"
        Path("/dev/console").write_text(f"{line['at_s']} s {step.__name__}: {word}: {saw}\n")
    return all(json.loads(line)["right"] for line in STEPS.read_text().splitlines())


def _journal() -> str:
    """Return what the services said last."""
    words = ["journalctl", "-b", "-o", "cat", "-n", "25", "-u", "motorctl@*", "-u", "device@*"]
    return subprocess.run(words, capture_output=True, text=True, check=False).stdout
