"""Options as plain data, checked in one place."""

import math

import pytest
import yaml
from pydantic import ValidationError

from motorctl.errors import ConfigError, UsageError
from motorctl.identify.fit import settings
from motorctl.identify.fit.settings import FitOptions, load_settings, shipped_settings


def test_shipped_settings_are_nothing_but_options():
    for name in shipped_settings():
        assert isinstance(load_settings(name), FitOptions)
    published = load_settings("janot2019")
    assert (published.left, published.filter_hz, published.decimation) == ("command", 100.0, 10)
    assert published.coulomb_slope_s_m == math.inf


def test_the_default_settings_tell_every_key_and_change_nothing():
    assert load_settings("default") == FitOptions()
    told = yaml.safe_load((settings.SETTINGS_FOLDER / "default.yaml").read_text())
    assert set(told) == set(FitOptions.model_fields)


def test_settings_come_from_a_file_of_ones_own(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("filter_hz: 80\nestimate_delay: false\nfit_segments: [[0, 2], [4, 6]]\n")
    options = load_settings(str(file))
    assert options.filter_hz == 80.0
    assert options.fit_segments == ((0.0, 2.0), (4.0, 6.0))


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("filter_hz: -3\n", 1, "filter_hz: found -3, should be greater than 0"),
        (
            "left: command\nfilter_herz: 80\n",
            2,
            "filter_herz: unknown key; did you mean 'filter_hz'",
        ),
        ("left: right\n", 1, "left: found "),
        ("# mine\ndecimation: 0\n", 2, "decimation: found 0"),
        ("zero_phase: true\nfit_segments: [[4, 2]]\n", 2, "end must lie after"),
        ("filter_order: four\n", 1, "filter_order: found "),
    ],
)
def test_a_wrong_option_is_told_with_its_file_and_line(tmp_path, text, line, words):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError) as refused:
        load_settings(str(file))
    (problem,) = refused.value.problems
    assert (problem.file, problem.line) == (str(file), line)
    assert words in str(problem)


@pytest.mark.parametrize("text", ["[1, 2]", "a: [", "5"])
def test_a_file_that_is_no_table_of_options_is_refused(tmp_path, text):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=r"mine\.yaml"):
        load_settings(str(file))


def test_unknown_settings_name_those_that_exist():
    with pytest.raises(UsageError, match="janot2019"):
        load_settings("janot2091")


def test_options_cannot_be_changed_in_place_nor_to_nonsense():
    options = FitOptions()
    with pytest.raises(ValidationError, match="frozen"):
        options.left = "command"
    assert options.with_changes(left="command").left == "command"
    with pytest.raises(UsageError, match="filter_order"):
        options.with_changes(filter_order=99)
