"""Commands show what others wrote, and no terminal obeys it."""

from __future__ import annotations

import io
from pathlib import Path

import typer
from hypothesis import given
from hypothesis import strategies as st
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text
from typer.testing import CliRunner

from motorctl.cli import check
from motorctl.cli.terminal import Terminal
from motorctl.config import shipped_config

UP_AND_ERASE = "\x1b[1A\x1b[2K"
"""Goes to the line above and rubs it out."""


def run(*arguments: object) -> str:
    app = typer.Typer()
    check.register(app)
    app.command("other")(lambda: None)
    result = CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def harmless(shown: str) -> bool:
    return all(c.isprintable() or c == "\n" for c in shown)


def code_of(target: str, folder: Path) -> str:
    """Return what `check --code` shows of a file whose driver's type is `target` in YAML."""
    path = folder / "strange.yaml"
    text = shipped_config("small_stage").read_text()
    assert "type: sim" in text
    path.write_text(text.replace("type: sim", f'type: "{target}"'))
    return run("check", path, "--code")


def test_a_strangers_configuration_cannot_rub_out_that_its_code_is_not_allowed(
    tmp_path: Path,
) -> None:
    shown = code_of(r"x:\e[1A\e[2Kallowed", tmp_path)
    assert harmless(shown)
    assert r"x:\x1b[1A\x1b[2Kallowed, not allowed" in shown


def test_a_strangers_configuration_cannot_add_lines_to_what_is_told_of_it(tmp_path: Path) -> None:
    honest = code_of("x:Y", tmp_path)
    shown = code_of(r"x:Y, allowed\n  drivers.other.type: a:B", tmp_path)
    assert len(shown.splitlines()) == len(honest.splitlines())
    assert r"x:Y, allowed\n  drivers.other.type: a:B, not allowed" in shown


@given(st.text(max_size=40))
def test_no_text_moves_a_terminal_whatever_it_stands_in(text: str) -> None:
    table = Table(title=Text(text))
    table.add_column(Text(text))
    table.add_row(Text(text))
    file = io.StringIO()
    console = Terminal(file=file, width=60, color_system=None)
    for shown in (Text(text), table, Panel(Text(text), title=Text(text))):
        console.print(shown)
    console.print(text, markup=False, soft_wrap=True)
    assert harmless(file.getvalue())


def test_a_live_picture_moves_the_cursor_by_itself_alone() -> None:
    file = io.StringIO()
    console = Terminal(file=file, width=60, force_terminal=True, color_system=None)
    with Live(Text(f"a{UP_AND_ERASE}"), console=console, auto_refresh=False) as live:
        live.update(Text(f"b{UP_AND_ERASE}\nc"), refresh=True)
    written = file.getvalue()
    assert r"b\x1b[1A\x1b[2K" in written
    assert f"a{UP_AND_ERASE}" not in written
    assert f"b{UP_AND_ERASE}" not in written
    assert "\x1b[?25l" in written  # its own: hides the cursor
