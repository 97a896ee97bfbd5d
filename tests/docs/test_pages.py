"""What pages point to is there, and what they tell of commands and hooks is what these do."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
FOLDERS = (
    "benchmarks",
    "configs",
    "devices",
    "docs",
    "drivers",
    "examples",
    "motorctl",
    "systemd",
    "tests",
)
PAGES = sorted(
    [*ROOT.glob("*.md"), *(page for name in FOLDERS for page in (ROOT / name).rglob("*.md"))]
)
DECISIONS = sorted((ROOT / "docs" / "decisions").glob("[0-9]*.md"))
LINK = re.compile(r"\]\(([^)\s]+)\)")
NAMED_PATH = re.compile(rf"`((?:{'|'.join(FOLDERS)}|tools|\.ci)/[\w./-]*)`")
CODE = re.compile(r"^ *```.*?^ *```", re.MULTILINE | re.DOTALL)
PARTS = ["Context", "Decision", "Consequences", "What would make us change it"]
LONGEST_LINES, LONGEST_WORDS = 45, 450
"""A page."""
LARGEST_PICTURE_BYTES = 300_000


def prose(page: Path) -> str:
    return CODE.sub("", page.read_text())


def anchors(page: Path) -> set[str]:
    """Return the names that GitHub gives the headings of a page."""
    headings = re.findall(r"^#+ (.+)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken_links(page: Path) -> list[str]:
    broken = []
    for link in LINK.findall(prose(page)):
        if re.match(r"https?://", link):
            continue
        name, _, anchor = link.partition("#")
        target = page.parent / name if name else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            broken.append(link)
    return broken


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_of_a_page_leads_somewhere(page: Path) -> None:
    assert not broken_links(page)


def test_a_link_to_a_file_or_heading_that_is_not_there_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# One more\n[a](b.md) [c](#one-more) [d](#two) [e](https://example.org)\n")
    assert broken_links(page) == ["b.md", "#two"]


def test_pictures_are_small_enough_for_a_slow_line() -> None:
    pictures = [*(ROOT / "docs").glob("*.png")]
    assert len(pictures) > 5
    assert not [picture for picture in pictures if picture.stat().st_size >= LARGEST_PICTURE_BYTES]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_files_and_folders_that_a_page_names_are_there(page: Path) -> None:
    # A changelog tells of what was, too.
    named = [] if page.name == "CHANGELOG.md" else NAMED_PATH.findall(prose(page))
    assert not [path for path in named if not (ROOT / path).exists()]


def test_make_knows_every_target_that_a_page_names() -> None:
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    named = {
        target
        for page in PAGES
        for target in re.findall(
            r"(?:^|`)make ([\w-]+)(?:`|\s+#|$)", page.read_text(), re.MULTILINE
        )
    }
    assert {"setup", "test", "test-slow", "lint"} <= named
    assert named <= targets


def test_the_guide_tells_every_marker_of_the_tests() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["pytest"]
    markers = [line.partition(":")[0] for line in settings["ini_options"]["markers"]]
    guide = (ROOT / "CONTRIBUTING.md").read_text()
    assert not [marker for marker in markers if f"`{marker}`" not in guide]


def test_hooks_before_a_commit_check_what_make_lint_checks() -> None:
    makefile = (ROOT / "Makefile").read_text()
    recipes = re.findall(r"^lint-\w+:.*\n((?:\t.+\n)+)", makefile, re.MULTILINE)
    lines = [line.strip() for recipe in recipes for line in recipe.splitlines()]
    linted = [line.replace("$(BIN)", ".venv/bin") for line in lines]
    (local,) = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
    assert local["repo"] == "local"  # nothing is downloaded
    hooks = [hook["entry"] for hook in local["hooks"]]
    assert sorted(line.removesuffix(" .") for line in linted) == sorted(hooks)


@pytest.mark.parametrize("record", DECISIONS, ids=lambda record: record.name)
def test_a_decision_record_has_its_parts_on_one_page_and_is_listed(record: Path) -> None:
    text = record.read_text()
    assert re.findall(r"^## (.+)$", text, re.MULTILINE) == PARTS
    assert re.match(rf"# {record.name[:4]} \S", text)
    assert len(text.splitlines()) <= LONGEST_LINES
    assert len(text.split()) <= LONGEST_WORDS
    index = (record.parent / "README.md").read_text()
    assert f"[{record.name[:4]}]({record.name})" in index


def test_no_two_decision_records_have_the_same_number() -> None:
    numbers = [record.name[:4] for record in DECISIONS]
    assert len(set(numbers)) == len(numbers) >= 10
