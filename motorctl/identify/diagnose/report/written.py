"""What `diagnose` writes into a folder, and what it says comes next."""

from __future__ import annotations

from pathlib import Path

from motorctl.identify.diagnose.report.next_steps import Step, next_steps, write_programs
from motorctl.identify.diagnose.report.page import write_report
from motorctl.identify.diagnose.result import RecordingDiagnosis


def write_diagnosis(
    diagnosis: RecordingDiagnosis, folder: Path | None, config: str | None = None
) -> tuple[dict[str, list[Step]], list[Path]]:
    """Write page, pictures and program files, and return the next steps by axis and the files.

    Without a folder nothing is written. `config` is the configuration to be refined, where it is
    known. Raises UsageError where the files cannot be written.
    """
    if folder is None:
        return next_steps(diagnosis, config), []
    programs = write_programs(diagnosis, folder)
    steps = next_steps(diagnosis, config, programs)
    files = write_report(folder, diagnosis, steps=steps)
    files += [path for paths in programs.values() for path in paths if path is not None]
    return steps, files
