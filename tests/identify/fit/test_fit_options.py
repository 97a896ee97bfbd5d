"""Options as plain data, checked in one place."""

import math

import pytest

from motorctl.errors import DataError, UsageError
from motorctl.identify.fit.settings import FitOptions, load_settings, shipped_settings


def test_shipped_settings_are_nothing_but_options():
    for name in shipped_settings():
        assert isinstance(load_settings(name), FitOptions)
    published = load_settings("janot2019")
    assert (published.left, published.filter_hz, published.decimation) == ("command", 100.0, 10)
    assert published.coulomb_slope_s_m == math.inf


def test_settings_come_from_a_file_of_ones_own(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("filter_hz: 80\nestimate_delay: false\nfit_segments: [[0, 2], [4, 6]]\n")
    options = load_settings(str(file))
    assert options.filter_hz == 80.0
    assert options.fit_segments == ((0.0, 2.0), (4.0, 6.0))


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("filter_hz: -3\n", "filter_hz"),
        ("filter_herz: 80\n", "filter_herz"),
        ("left: right\n", "left"),
        ("decimation: 0\n", "decimation"),
        ("fit_segments: [[4, 2]]\n", "end must lie after"),
    ],
)
def test_a_wrong_option_is_named_with_its_file(tmp_path, text, key):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(UsageError, match=rf"mine\.yaml: .*{key}"):
        load_settings(str(file))


@pytest.mark.parametrize("text", ["[1, 2]", "a: [", "5"])
def test_a_file_that_is_no_table_of_options_is_refused(tmp_path, text):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(DataError, match=r"mine\.yaml"):
        load_settings(str(file))


def test_unknown_settings_name_those_that_exist():
    with pytest.raises(UsageError, match="janot2019"):
        load_settings("janot2091")


def test_options_cannot_be_changed_in_place_nor_to_nonsense():
    options = FitOptions()
    with pytest.raises(AttributeError):
        options.left = "command"
    assert options.with_changes(left="command").left == "command"
    with pytest.raises(UsageError, match="filter_order"):
        options.with_changes(filter_order=99)
