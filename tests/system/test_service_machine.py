"""The service in a virtual machine with systemd and PREEMPT_RT: the story, step by step."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import service_machine
from virtual_machine.recipe import UnavailableError

BUILD_S = 900

pytestmark = [
    pytest.mark.wall_clock,
    pytest.mark.slow,
    pytest.mark.long,
    pytest.mark.timeout(BUILD_S + service_machine.LIMIT_S + 120),
]


@pytest.fixture(scope="module")
def steps(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """Run it once; the transcript stays in the folder that is named."""
    scratch = tmp_path_factory.mktemp("machine")
    out = Path("out/service_machine")
    try:
        told = service_machine.run(scratch, out)
    except UnavailableError as error:
        pytest.skip(f"no virtual machine with systemd on this host: {error}")
    print((out / "transcript.txt").read_text())
    return told


def test_every_step_of_a_day_of_the_service_goes_as_its_words_say(
    steps: list[dict[str, Any]],
) -> None:
    assert [step["step"] for step in steps if not step["right"]] == []
    assert [step["step"] for step in steps] == service_machine.names_of_steps()
