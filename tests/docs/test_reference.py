"""The reference tells every key and column, and cannot be behind the program."""

import re
from enum import IntEnum

import curve_picture
import numpy as np
import pytest
import reference
from curve_picture import picture, same_picture
from effect_curves import curves_of
from formula_tex import formula_tex
from latex2mathml.converter import convert
from reference import COLUMNS, COMMANDS, EFFECTS, KEYS, ROOT, described_members, main, pages

from motorctl.hal.registry import installed_drivers
from motorctl.log import LogAxis
from motorctl.log.columns import log_columns
from motorctl.log.sample import AxisState, FaultCause, SampleFlag
from motorctl.model.catalog import built_in_effects


def test_the_pages_are_up_to_date():
    assert main(["--check"]) == 0, "python tools/reference.py"


def test_a_page_that_is_behind_is_found_and_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(reference, "ROOT", tmp_path)
    (tmp_path / "docs").mkdir()
    assert main(["--check"]) == 1
    assert "docs/reference/keys.md and docs/reference/log_columns.md" in capsys.readouterr().out
    assert not (tmp_path / KEYS).exists()
    assert main([]) == 0
    assert main(["--check"]) == 0


def test_every_column_of_a_log_is_told_and_every_code():
    page = pages()[COLUMNS]
    for column in log_columns([LogAxis("AXIS", ("inertia",), dual_drive=True)]):
        assert f"| `{column.name.replace('hat_inertia', 'hat_…')}` |" in page
    for codes in (AxisState, FaultCause, SampleFlag):
        for code in codes:
            assert re.search(rf"\| {code.value}( \(bit \d+\))? \| `{code.name}` \| \S", page)


def test_every_option_of_every_driver_is_told_with_its_meaning():
    page = (ROOT / KEYS).read_text()
    for entry in installed_drivers():
        section = page.partition(f"\n## drivers.NAME, type {entry.name}\n")[2].partition("\n## ")[0]
        for option in entry.driver.Options.model_fields:
            assert re.search(rf"\| `{option}` \| \S", section), (entry.name, option)


def test_a_code_that_nothing_tells_is_refused():
    class Told(IntEnum):
        ONE = 1
        """First."""
        TWO = 2

    with pytest.raises(SystemExit, match=r"Told.TWO has no string"):
        described_members(Told)


def test_every_effect_is_told_in_its_own_words_with_its_formula():
    page = (ROOT / EFFECTS).read_text()
    for name, effect in built_in_effects().items():
        assert f"| [`{name}`](#{name}) | {effect.title} | {effect.compensated} |" in page
        assert f"\n## {name}\n" in page
        assert formula_tex(effect.formula) in page


@pytest.mark.parametrize("effect", built_in_effects().values(), ids=lambda effect: effect.name)
def test_every_formula_can_be_set(effect):
    shown = convert(formula_tex(effect.formula))
    assert "\\" not in shown  # nothing that the browser would show as TeX


@pytest.mark.parametrize(
    ("plain", "tex"),
    [
        ("theta5 * u|u|", r"\theta_{5} \, u|u|"),
        ("sum of S_k sin(2 pi k x/P)", r"\sum S_{k} \sin (2 \pi k x/P)"),
        ("tau di/dt = u - i, with i in the place of u",
         r"\tau \frac{di}{dt} = u - i, \text{ with } i \text{ in the place of } u"),
        ("m * a,  t >= t_0", r"m \, a,\quad t \ge t_{0}"),
        ("u with a play of k", r"u \text{ with a play of } k"),
    ],
)  # fmt: skip
def test_a_formula_of_plain_text_is_set_as_mathematics(plain, tex):
    assert formula_tex(plain) == tex


def test_every_command_is_told_with_its_options():
    page = (ROOT / COMMANDS).read_text()
    for command, option in (
        ("move", "--velocity"),
        ("log export", "--to"),
        ("service install", "--dry-run"),
        ("bench diagnosis", "--seed"),
        ("gantry-device", "--link"),
    ):
        section = page.partition(f"\n### motorctl {command}\n")[2].partition("\n### ")[0]
        assert f"| `{option}" in section, command


@pytest.mark.parametrize("effect", built_in_effects().values(), ids=lambda effect: effect.name)
def test_every_effect_has_a_curve_that_its_own_kernel_computed(effect):
    place = EFFECTS.with_suffix("") / f"{effect.name}.svg"
    assert f"(effects/{effect.name}.svg)" in (ROOT / EFFECTS).read_text()
    assert (ROOT / place).is_file()
    drawn = curves_of(effect)
    assert any(np.ptp(curve.y) > 0 for curve in drawn.curves) or effect.proportional_to == "one"
    for curve in drawn.curves:
        assert np.isfinite(curve.x).all()
        assert np.isfinite(curve.y).all()


def test_pictures_are_the_same_to_a_quarter_of_a_pixel_and_word_for_word():
    one = '<svg><text>at most 3 V</text><polyline points="1.0,2.0 3.0,4.0"/></svg>'
    assert same_picture(one, one.replace("4.0", "4.1"))
    assert not same_picture(one, one.replace("4.0", "4.5"))
    assert not same_picture(one, one.replace("at most", "at least"))
    assert not same_picture(one, one.replace(" 3.0,4.0", ""))
    assert not same_picture(one, one.replace("3 V", "3.1 V"))
    assert same_picture(
        one.replace("<text", '<text x="1.0"'), one.replace("<text", '<text x="1.1"')
    )


def test_a_number_that_was_read_wrongly_is_written_anew(tmp_path, monkeypatch):
    place = EFFECTS.with_suffix("") / "inertia.svg"
    monkeypatch.setattr(reference, "ROOT", tmp_path)
    monkeypatch.setattr(
        reference, "pages", lambda: {place: '<svg><path d="M1.0 2V3"/><text>3 V</text></svg>'}
    )
    assert main([]) == 0
    right = (tmp_path / place).read_text()
    (tmp_path / place).write_text(right.replace("3 V", "3.2 V"))
    assert main(["--check"]) == 1
    (tmp_path / place).write_text(right.replace("M1.0", "M1.1"))
    assert main(["--check"]) == 0
    assert main([]) == 0
    assert (tmp_path / place).read_text() == right


def test_the_last_digits_of_a_curve_add_no_point_to_its_picture(monkeypatch):
    effect = built_in_effects()["drive_hysteresis"]
    drawn = curves_of(effect)
    thinned, one = curve_picture._thinned, picture("", drawn)
    for seed in range(60):
        noise = np.random.default_rng(seed).standard_normal
        monkeypatch.setattr(
            curve_picture, "_thinned", lambda at, of=noise: thinned(at * (1 + 1e-15 * of(at.shape)))
        )
        assert same_picture(picture("", drawn), one)
