"""From a diagnosis and a configuration to a refined configuration."""

from __future__ import annotations

import difflib
import os
import shlex
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motorctl.config import Machine, load
from motorctl.config.freeze import decode
from motorctl.config.shipped import locate
from motorctl.errors import ConfigError, UsageError
from motorctl.identify.diagnose.result import RecordingDiagnosis
from motorctl.identify.refine.axis import AxisRefinement, current_model, keep_axis, refine_axis
from motorctl.identify.refine.header import error_words, header_lines, with_header
from motorctl.identify.refine.model_text import text_of, write_model
from motorctl.identify.refine.written_beside import put_in_place, written_beside
from motorctl.identify.refine.yaml_text import YamlText
from motorctl.located_yaml import read_document
from motorctl.notebook import html_code, html_lines

PASSES = 3
"""Times that the models are written, at most: a change of what an alias names changes other axes
too, and the next pass writes theirs out. Fewer refuses files whose axes share, more helps only
where aliases stand within aliases. Chosen by hand."""


@dataclass(frozen=True)
class Refinement:
    """A refined configuration, checked but not yet in place."""

    diagnosis: RecordingDiagnosis
    """On what it rests."""
    before: Machine
    """The machine as it was configured."""
    source: Path
    """The configuration that was refined."""
    out: Path
    """Where it goes; files that it names relative to itself are found from there."""
    text: str
    machine: Machine
    """What the text means."""
    diff: str
    """From the old text to the new one."""
    axes: Mapping[str, AxisRefinement]

    @property
    def changed(self) -> bool:
        """Return whether any axis' model was changed."""
        return any(axis.changed for axis in self.axes.values())

    def write(self) -> Path:
        """Put the configuration in place, whole or not at all. Raises UsageError where it can't."""
        return put_in_place(written_beside(self.out, self.text), self.out)

    def next_commands(self, config: str | None = None) -> list[str]:
        """Return what to run next: before and after on the same motion, simulated where possible.

        `config` is what the configuration was called, where that is not its path.
        """
        out, before = shlex.quote(str(self.out)), shlex.quote(config or str(self.source))
        drivers = self.machine.drivers.values()
        if not drivers or not all(driver.cls.supports_virtual_time for driver in drivers):
            return [f"motorctl check {out}", f"motorctl run {out}"]
        logs = [shlex.quote(f"{self.out.stem}_{when}.parquet") for when in ("before", "after")]
        return [
            f"motorctl check {out}",
            *([f"motorctl simulate {before} --log {logs[0]}"] if before != out else []),
            f"motorctl simulate {out} --log {logs[1]}",
            f"motorctl compare {' '.join(logs)}",
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return the document of ``refine --json``, without the files of a report."""
        from motorctl.identify.refine.json_document import refinement_document

        return refinement_document(self)

    def __repr__(self) -> str:
        done = [f"{name}: {'; '.join(axis.done)}" for name, axis in self.axes.items()]
        return f"<Refinement {self.out}: {' '.join(done)}>"

    def _repr_html_(self) -> str:
        parts = [
            html_lines((*axis.done, *error_words(self.diagnosis.axes[name])), f"axis {name}")
            for name, axis in self.axes.items()
        ]
        return "".join((*parts, html_code(self.diff), html_lines((str(self.out),))))


def refine_config(
    diagnosis: RecordingDiagnosis,
    config: str | Path,
    out: Path,
    *,
    without: Mapping[str, Collection[str]] | None = None,
    kept: Mapping[str, str] | None = None,
) -> Refinement:
    """Return `config` with the model of each diagnosed axis as the diagnosis found it.

    The result is loaded before it is returned, so it is valid and means what was intended.

    Parameters
    ----------
    diagnosis
        What was found on a recording of the machine.
    config
        A configuration's file, or a shipped one's name.
    out
        Where the result shall stand; nothing is written yet.
    without
        Found effects that are left out, by axis. The values of the rest are those of the whole
        model all the same: a fit without an effect that is there would bend them to make up.
    kept
        Axes that stay as they are, each with the reason.

    Returns
    -------
    Refinement
        The new text, its difference from the old one, and what was done with each axis.

    Raises
    ------
    ConfigError
        No valid configuration can be made.
    UsageError
        The text of the configuration cannot be changed in place.
    """
    source = locate(config)
    machine, hardware = load_machine(source)
    axes = {
        name: keep_axis(diagnosis, machine, name, kept[name])
        if kept and name in kept
        else refine_axis(diagnosis, machine, name, (without or {}).get(name, ()))
        for name in diagnosis.axes
    }
    old = source.read_bytes().decode("utf-8-sig")
    text = _with_models(moved_text(machine, out), machine, axes, out)
    told = [(name, axis.done) for name, axis in axes.items()]
    text = with_header(text, header_lines(diagnosis, told))
    refined = _checked(text, source, out, hardware)
    _require_intended(machine, refined, axes)
    diff = difflib.unified_diff(
        old.splitlines(keepends=True), text.splitlines(keepends=True), source.name, out.name
    )
    return Refinement(diagnosis, machine, source, out, text, refined, "".join(diff), axes)


def _with_models(text: str, machine: Machine, axes: Mapping[str, AxisRefinement], out: Path) -> str:
    """Write the changed models; what others share with them is written out for these."""
    wanted = {name: axis.wanted for name, axis in axes.items() if axis.changed}
    resolved: Mapping[str, Any] = decode(machine.resolved)["axes"]
    before = _models_in(text, out)
    for _ in range(PASSES):
        edited = text
        for name, effects in wanted.items():
            changes = YamlText(edited)
            try:
                write_model(changes, name, effects, resolved[name]["model"])
                if name in axes and axes[name].old_delay_s:
                    changes.replace(("axes", name, "adaptation", "input_delay_s"), "0")
            except KeyError as error:
                raise _not_in_place(machine.source, name) from error
            edited = changes.applied()
        after = _models_in(edited, out)
        shared = [
            name for name in machine.axes if name not in wanted and after[name] != before[name]
        ]
        if not shared:
            return edited
        wanted |= {name: current_model(machine, name) for name in shared}
    raise _not_in_place(machine.source, ", ".join(shared))


def _models_in(text: str, out: Path) -> dict[str, Any]:
    """Return what stands in the text as the model of each axis."""
    written = written_beside(out, text)
    try:
        axes = read_document(written).at(("axes",))
    finally:
        written.unlink()
    return {name: axis.get("model") for name, axis in axes.items()}


def load_machine(path: str | Path) -> tuple[Machine, bool]:
    """Return a configuration, without drivers that are not installed, and whether with drivers.

    Raises ConfigError where it is not valid even so.
    """
    try:
        return load(path), True
    except ConfigError:
        return load(path, hardware=False), False


def moved_text(machine: Machine, out: Path) -> str:
    """Return a machine's configuration so that its files of points are found from `out` too."""
    source = machine.source
    text = source.read_bytes().decode("utf-8-sig")
    old, new = source.parent.resolve(), out.parent.resolve()
    if old == new:
        return text
    changes = YamlText(text)
    for name in machine.programs:
        path = ("programs", name, "file")
        file = read_document(source).at(path)
        if isinstance(file, str) and not Path(file).is_absolute() and changes.has(path):
            changes.replace(path, text_of(os.path.relpath(old / file, new)))
    return changes.applied()


def meaning_of(machine: Machine) -> dict[str, Any]:
    """Return what a configuration means, wherever it stands: without where files of points are."""
    meaning: dict[str, Any] = decode(machine.resolved)
    for program in meaning["programs"].values():
        program.pop("file", None)
    return meaning


def _require_intended(before: Machine, after: Machine, axes: Mapping[str, AxisRefinement]) -> None:
    """Raise UsageError where the new text means anything else than what was intended."""
    old, new = meaning_of(before), meaning_of(after)
    for name in before.axes:
        model = old["axes"][name].pop("model")
        refined = axes.get(name)
        if refined is not None and refined.changed:
            model = {part.effect.name: part.data() for part in refined.wanted}
            if refined.old_delay_s:
                old["axes"][name]["adaptation"]["input_delay_s"] = 0.0
        if _without_nulls(new["axes"][name].pop("model")) != _without_nulls(model):
            raise _not_in_place(before.source, name)
    if old != new:
        raise _not_in_place(before.source, ", ".join(before.axes))


def _without_nulls(model: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: {key: value for key, value in part.items() if value is not None}
        for name, part in model.items()
    }


def _checked(text: str, source: Path, out: Path, hardware: bool) -> Machine:
    """Load a text as if it stood at `out`; its problems are told as those of what is written."""
    written = written_beside(out, text)
    try:
        return load(written, hardware=hardware)
    except ConfigError as error:
        told = "\n".join(f"  {problem.key}: {problem.message}" for problem in error.problems)
        raise UsageError(
            f"{source}: the configuration would not be valid with the model that was found:\n{told}"
        ) from error
    finally:
        written.unlink()


def _not_in_place(source: Path, axis: str) -> UsageError:
    return UsageError(
        f"{source}: the model of axis {axis} is written in a way that cannot be changed in place; "
        "write it out without anchors, aliases and merged keys"
    )
