"""What pages show of commands and configurations is what these take."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import typer
import yaml

from motorctl.cli import make_app
from motorctl.config import config_schema
from motorctl.located_yaml import CoreLoader
from motorctl.log.sample import FaultCause
from motorctl.loop.faults import fault_message
from motorctl.loop.realtime import REASONS

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
LONGEST_README_WORDS = 900
STOPS = re.compile(r"\s(?:\||>|&&|;)\s.*$")
PROGRAM: Any = typer.main.get_command(make_app())


def blocks(page: Path, language: str) -> list[str]:
    found = re.findall(rf"^( *)```{language}\n(.*?)^ *```", page.read_text(), re.M | re.S)
    return [re.sub(rf"^{indent}", "", text, flags=re.M) for indent, text in found]


def shown_commands(page: Path) -> Iterator[list[str]]:
    """Yield the words after `motorctl` of every line that a page shows for a shell."""
    for block in blocks(page, "sh"):
        for line in block.replace("\\\n", " ").splitlines():
            for part in line.split(" && "):
                found = re.match(r"\s*(?:\S*/)?motorctl\s+(.*)", part)
                if found:
                    yield shlex.split(STOPS.sub("", found[1]), comments=True)


def refusal(words: list[str]) -> str:
    """Return why the command line would not take these words; empty where it would."""
    command, context = PROGRAM, PROGRAM.make_context("motorctl", [], resilient_parsing=True)
    name = ""
    while hasattr(command, "list_commands"):
        name, *words = words or [""]
        command = command.get_command(context, name)
        if command is None:
            return f"no command {name}"
    try:
        command.make_context(name, words, parent=context)
    except Exception as error:
        return f"{name}: {getattr(error, 'message', '') or error}"
    return ""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_command_that_a_page_shows_is_taken_with_its_options(page: Path) -> None:
    refused = {" ".join(words): refusal(words) for words in shown_commands(page)}
    assert not {words: why for words, why in refused.items() if why}


def test_a_command_or_an_option_that_is_not_there_is_found() -> None:
    assert refusal(["fly", "x"]) == "no command fly"
    assert "--fast" in refusal(["home", "x", "--fast"])
    assert refusal(["home"])  # what axis?
    assert not refusal(["log", "info", "before.parquet"])


def without_required(schema: Any) -> Any:
    if isinstance(schema, dict):
        kept = {key: value for key, value in schema.items() if key != "required"}
        return {key: without_required(value) for key, value in kept.items()}
    return [without_required(part) for part in schema] if isinstance(schema, list) else schema


SCHEMA = config_schema()
PART = jsonschema.Draft202012Validator(without_required(SCHEMA))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_part_of_a_configuration_that_a_page_shows_has_keys_that_there_are(
    page: Path,
) -> None:
    for block in blocks(page, "yaml"):
        part = yaml.load(block, CoreLoader)  # numbers as motorctl reads them: 5e-6 is one
        if not isinstance(part, dict) or not set(part) <= set(SCHEMA["properties"]):
            continue  # a device, a recording, or a part of a part
        problems = [f"{list(e.absolute_path)}: {e.message}" for e in PART.iter_errors(part)]
        assert not problems, block


def test_a_key_that_there_is_not_is_found() -> None:
    assert list(PART.iter_errors({"axes": {"x": {"limits": {"max_speed": 1.0}}}}))
    assert not list(PART.iter_errors({"axes": {"x": {"limits": {"max_velocity_m_s": 1.0}}}}))


def test_the_readme_is_read_in_a_few_minutes() -> None:
    assert len((ROOT / "README.md").read_text().split()) < LONGEST_README_WORDS


TROUBLE = (ROOT / "docs" / "troubleshooting.md").read_text()
EXAMPLES = {
    FaultCause.FOLLOWING_ERROR: (2.5e-3, 1e-3, 0),
    FaultCause.SOFT_LIMIT: (0.452, 0.45, 0),
    FaultCause.OVERSPEED: (1.9, 1.8, 0),
    FaultCause.NOT_A_NUMBER: (0.0, 0.0, 0),
    FaultCause.ENCODER_LOST: (0.0, 0.0, 0),
    FaultCause.ENCODER_JUMP: (12e-3, 8e-3, 0),
    FaultCause.AMPLIFIER: (0.0, 0.0, 0),
    FaultCause.COMMUNICATION: (0.0, 0.0, 0),
    FaultCause.ESTOP: (0.0, 0.0, 0),
    FaultCause.LIMIT_SWITCH: (0.46, 0.0, 16),
    FaultCause.HOMING_FAILED: (30.0, 30.0, 0),
    FaultCause.OVERRUN: (0.0, 10.0, 0),
    FaultCause.HOST_FROZEN: (75.0, 48.0, 0),
    FaultCause.SUPERVISOR_LOST: (0.5, 0.5, 0),
    FaultCause.NO_NEW_SAMPLE: (4.0, 3.0, 0),
    FaultCause.PARTNER: (0.0, 0.0, 0),
    FaultCause.ENCODER_STUCK: (0.6e-3, 0.5e-3, 0),
    FaultCause.ENCODER_NOISE: (7e-6, 5e-6, 0),
    FaultCause.SATURATION: (0.5, 0.5, 0),
    FaultCause.THERMAL: (3.6, 3.5, 0),
    FaultCause.SKEW: (0.3e-3, 0.2e-3, 0),
    FaultCause.NOT_SQUARE: (-2.5e-3, 2e-3, 0),
}
"""Value, limit and the device's word, as the page has them."""


@pytest.mark.parametrize("cause", [c for c in FaultCause if c is not FaultCause.NONE])
def test_every_fault_has_its_next_step_beside_the_words_that_the_program_says(
    cause: FaultCause,
) -> None:
    value, limit, status = EXAMPLES[cause]
    said = fault_message(cause, value, limit, 1.0, period_s=2e-4, status=status)
    words = said.removesuffix(", at 1.000 s").partition(". `motorctl latency`")[0]
    (row,) = re.findall(rf"^\| `{cause.name.lower()}`: (.+)$", TROUBLE, re.M)
    assert words in row
    assert len(row.rpartition('" |')[2]) > 20  # what to do


def test_every_reason_for_which_real_time_is_missing_has_its_remedy() -> None:
    assert not [words for words in REASONS.values() if f'| "{words}" | ' not in TROUBLE]
