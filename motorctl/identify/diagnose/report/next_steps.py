"""What to do after a diagnosis: words for each axis, program files, and the commands."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

from motorctl.errors import UsageError
from motorctl.identify.diagnose.result import AxisDiagnosis, RecordingDiagnosis


@dataclass(frozen=True)
class Step:
    """One thing to do."""

    text: str
    command: str = ""


def next_steps(
    diagnosis: RecordingDiagnosis,
    config: str | None = None,
    programs: Mapping[str, tuple[Path | None, ...]] | None = None,
    *,
    refined: bool = False,
) -> dict[str, list[Step]]:
    """Return what to do by axis.

    `config` is the configuration to be refined, where it is known; `programs` names the files
    that `write_programs` has written. `refined`: what was found stands in a configuration already.
    """
    return {
        name: [
            *([] if refined else _model_steps(name, axis, diagnosis.source, config)),
            *_motion_steps(name, axis, (programs or {}).get(name, ())),
        ]
        for name, axis in diagnosis.axes.items()
    }


def write_programs(
    diagnosis: RecordingDiagnosis, folder: Path
) -> dict[str, tuple[Path | None, ...]]:
    """Write the motions that diagnosis asks for as program files and return them by axis.

    One for each of the axis' missing motions, None where it has no program. Raises UsageError
    where they cannot be written.
    """
    written: dict[str, tuple[Path | None, ...]] = {}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, axis in diagnosis.axes.items():
            paths = [folder / f"{name}_{stem}.yaml" for stem in _stems(axis)]
            for path, missing in zip(paths, axis.missing, strict=True):
                if missing.program:
                    keys = yaml.safe_dump(dict(missing.program), sort_keys=False)
                    words = f"{missing.motion}\nIt shows: {', '.join(missing.effects)}"
                    comment = "".join(f"# {line}\n" for line in words.splitlines())
                    path.write_text(comment + keys, encoding="utf-8")
            written[name] = tuple(
                path if missing.program else None
                for path, missing in zip(paths, axis.missing, strict=True)
            )
    except OSError as error:
        raise UsageError(f"{folder}: programs cannot be written: {error.strerror}") from error
    return written


def _stems(axis: AxisDiagnosis) -> list[str]:
    """Name the files after the first effect that each motion shows, told apart by a number."""
    stems: list[str] = []
    for missing in axis.missing:
        stem = f"motion_for_{missing.effects[0]}" if missing.effects else "motion"
        again = sum(1 for known in stems if known.split("-")[0] == stem)
        stems.append(f"{stem}-{again + 1}" if again else stem)
    return stems


def _model_steps(name: str, axis: AxisDiagnosis, source: str, config: str | None) -> list[Step]:
    """Return what to do with the model after the verdict."""
    refine = (
        f"motorctl refine {shlex.quote(source)} --config {shlex.quote(config or 'CONFIG.yaml')} "
        f"--out refined.yaml"
    )
    compensation = None if axis.unknown is None else axis.unknown.compensation
    match axis.verdict:
        case "effect":
            found = ", ".join(effect.name for effect in axis.effects)
            words = f"Add to the configuration of axis {name}, with values and bounds: {found}"
            return [Step(words, refine)]
        case "unknown_structure" if compensation is not None:
            words = (
                f"Compensate the unknown structure with a spline ({compensation.name}), and look "
            )
            return [Step(words + "for its cause in the pictures", refine)]
        case "unknown_structure":
            words = (
                "Look for the cause in the pictures; no spline that a controller could use fits it"
            )
            return [Step(words)]
        case "complete":
            return [
                Step(
                    f"Nothing to do: the declared model of axis {name} is complete for this motion"
                )
            ]
        case _:
            return []


def _motion_steps(name: str, axis: AxisDiagnosis, programs: tuple[Path | None, ...]) -> list[Step]:
    """Return the motions to run, which would show what this one does not."""
    steps = []
    for k, missing in enumerate(axis.missing):
        path = programs[k] if k < len(programs) else None
        shown = ", ".join(missing.effects) or "more"
        words, command = f"Run a motion that shows {shown}", ""
        if path is not None:
            command = f"motorctl program {shlex.quote(name)} {shlex.quote(str(path))} --wait"
        elif missing.program:
            words += " (diagnose --out DIR writes it as a program)"
        else:
            words += f": {missing.motion.rstrip('.')}"
        steps.append(Step(words, command))
    return steps
