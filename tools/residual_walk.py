"""Count what a sample passes through on its way from a log to a refined configuration.

    python tools/residual_walk.py LOG CONFIG [--list]

Fits, then diagnoses and refines the first axis of CONFIG, and counts the functions of `log`,
`model` and `identify` that return arrays of samples or rows, or a record that holds such, and the
files in which they stand. No effect is tried beside the declared ones: what is counted is the way
of one model, not the search.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np

import motorctl
from motorctl.config import load
from motorctl.identify.columns.measured import with_others
from motorctl.identify.diagnose.recording import diagnose_axis
from motorctl.identify.diagnose.result import RecordingDiagnosis
from motorctl.identify.fit.recording import fit_recording
from motorctl.identify.refine.refinement import refine_config
from motorctl.log import read_recording

PACKAGE = Path(motorctl.__file__).parent
COUNTED = tuple(str(PACKAGE / room) for room in ("log", "identify", "model"))
FEWEST = 200
"""Entries of an array of samples or rows, at least: parameters and spectra of filters are fewer."""
DEPTH = 4
"""Records within records that are looked into."""


class Walk:
    """The functions that returned samples or rows."""

    def __init__(self) -> None:
        self.seen: dict[str, set[CodeType]] = {}

    def __call__(self, frame: FrameType, event: str, value: Any) -> None:
        """Note the function whose call ends, where it returns samples or rows."""
        code = frame.f_code
        if event != "return" or not code.co_filename.startswith(COUNTED):
            return
        of_file = self.seen.setdefault(code.co_filename, set())
        if code not in of_file and code.co_name[0] != "<" and holds_rows(value):
            of_file.add(code)

    def told(self) -> dict[str, list[str]]:
        """Return the names of the functions by their file."""
        return {
            str(Path(file).relative_to(PACKAGE)): sorted(code.co_qualname for code in found)
            for file, found in sorted(self.seen.items())
            if found
        }


def holds_rows(value: Any, depth: int = DEPTH) -> bool:
    """Return whether a value is an array of samples or rows, or holds one."""
    if isinstance(value, np.ndarray):
        return max(value.shape, default=0) >= FEWEST
    if depth == 0:
        return False
    if isinstance(value, dict):
        return any(holds_rows(each, depth - 1) for each in value.values())
    if isinstance(value, tuple | list):
        return any(holds_rows(each, depth - 1) for each in value[:4])
    if is_dataclass(value) and not isinstance(value, type):
        return any(holds_rows(getattr(value, f.name), depth - 1) for f in fields(value))
    return False


def walk(log: str, config: str, *, steps: str) -> Walk:
    """Fit, or diagnose and refine, the first axis of a log, and note the way."""
    found = Walk()
    machine = load(config)
    name = next(iter(machine.axes))
    declared = machine.axes[name].declared
    sys.setprofile(found)
    try:
        recording = read_recording(log, gaps="keep")
        if steps == "fit":
            fit_recording(recording, {name: declared})
        else:
            axis = diagnose_axis(with_others(recording, name), declared, catalogue={})
            diagnosis = RecordingDiagnosis(
                recording.source, recording.sample_rate_hz, recording.duration_s, {name: axis}
            )
            with tempfile.TemporaryDirectory() as folder:
                refine_config(diagnosis, config, Path(folder) / "refined.yaml")
    finally:
        sys.setprofile(None)
    return found


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("log")
    parser.add_argument("config")
    parser.add_argument("--list", action="store_true")
    options = parser.parse_args()
    for steps in ("fit", "refine"):
        told = walk(options.log, options.config, steps=steps).told()
        print(f"{steps}: {len(told)} files, {sum(map(len, told.values()))} returns")
        if options.list:
            for file, names in told.items():
                print(f"  {file}: {', '.join(names)}")


if __name__ == "__main__":
    main()
