"""The counts of the house say what is there."""

from pathlib import PurePosixPath

from counts import figures

CODE = '''"""What it is for.

Two lines more.
"""

# why
LIMITS = {"max_velocity_m_s": 1.0}


def told():
    """Give what is told."""
    return "cogging", LIMITS["max_velocity_m_s"]
'''


def counted(**files: str) -> dict[str, int]:
    sources = {PurePosixPath(path): text for path, text in files.items()}
    return figures(sources, key="max_velocity_m_s", column="lateness_s")


def test_words_are_no_code_and_an_effect_is_quoted_outside_its_folder_only() -> None:
    found = counted(
        **{
            "motorctl/room/one.py": CODE,
            "motorctl/model/effects/cogging.py": 'name = "cogging"\n',
            "motorctl/page.html": "<!DOCTYPE html>\n",
            "drivers/other.py": "a = 1\nb = 2\n",
            "tests/room/test_one.py": '"""No file of the wheel: "cogging"."""\n',
        }
    )
    assert list(found.values()) == [13, 4, 2, 1, 0, 1, 2, 1, 1, 1, 1, 2, 0, 0]


def test_a_file_of_more_than_500_lines_is_counted() -> None:
    found = counted(**{"motorctl/a.py": "a = 1\n" * 501, "motorctl/b.py": "b = 1\n" * 500})
    assert found["files of more than 500 lines in the wheel"] == 1
    assert found["files in its fullest folder"] == 2
