"""YAML as people write it: numbers are numbers, text is text, and every fault has its line."""

import math

import pytest
import yaml
from config_bench import MACHINE, machine, problems, write
from hypothesis import given, settings
from hypothesis import strategies as st

from motorctl.config import load
from motorctl.config.shipped import shipped_config, shipped_configs
from motorctl.errors import ConfigError
from motorctl.located_yaml import read_document


def data_of(tmp_path, text):
    document = read_document(write(tmp_path, text))
    document.refuse(())
    return document.data


def only_problem(tmp_path, text):
    with pytest.raises(ConfigError) as raised:
        data_of(tmp_path, text)
    (problem,) = raised.value.problems
    return problem


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("60e-6", 60e-6),
        ("1e-3", 1e-3),
        ("1E+3", 1000.0),
        ("-.5", -0.5),
        ("5.", 5.0),
        ("+0.25", 0.25),
        (".inf", math.inf),
        ("-.inf", -math.inf),
        ("010", 10),
        ("0x1F", 31),
        ("0o17", 15),
        ("true", True),
        ("False", False),
        ("yes", "yes"),
        ("off", "off"),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("2020-01-01", "2020-01-01"),
        (".nan", ".nan"),
        ("'5'", "5"),
        ("~", None),
        ("null", None),
        ("", None),
        ("123456789012345678901234567890", 123456789012345678901234567890.0),
    ],
)
def test_scalars_mean_what_a_reader_expects(tmp_path, written, value):
    found = data_of(tmp_path, f"key: {written}\n")["key"]
    assert found == value
    assert type(found) is type(value)


@given(st.floats(allow_nan=False, allow_infinity=False), st.sampled_from("gef"))
def test_every_spelling_of_a_float_is_that_float(tmp_path_factory, value, style):
    text = format(value, f".17{style}") if style != "f" else repr(value)
    folder = tmp_path_factory.mktemp("yaml")
    found = data_of(folder, f"key: {text}\n")["key"]
    assert float(found) == float(text)
    assert not isinstance(found, str)


def test_a_key_that_stands_twice_is_an_error_on_its_second_line(tmp_path):
    problem = only_problem(tmp_path, "a: 1\nb:\n  c: 1\n  d: 2\n  c: 3\n")
    assert (problem.line, problem.key) == (5, "b.c")
    assert "first on line 3" in problem.message


def test_a_double_key_is_told_together_with_other_problems(tmp_path):
    text = write(tmp_path, machine(rate_hz=-1)).read_text() + "name: again\n"
    found = problems(tmp_path, text)
    assert {problem.key for problem in found} == {"rate_hz", "name"}


def test_merged_keys_give_way_to_own_ones(tmp_path):
    text = "base: &base {a: 1, b: 2}\nown:\n  <<: *base\n  b: 3\n"
    assert data_of(tmp_path, text)["own"] == {"a": 1, "b": 3}


def test_an_alias_of_itself_is_a_problem_not_a_recursion(tmp_path):
    assert "contains itself" in only_problem(tmp_path, "a: &a\n  b: *a\n").message


def test_aliases_that_multiply_are_stopped(tmp_path):
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)]
    problem = only_problem(tmp_path, "\n".join(lines) + "\n")
    assert "more than" in problem.message


@pytest.mark.parametrize(
    ("text", "line", "part"),
    [
        ("", None, "empty"),
        ("# only a comment\n", None, "empty"),
        ("a: 1\nb: [1, 2\nc: 3\n", 3, "not valid YAML"),
        ("a: 1\n\tb: 2\n", 2, "not valid YAML"),
        ("a: 1\nb: {unit: %}\n", 2, 'YAML has % in quotes: "%"'),
        ("a: 1\n---\nb: 2\n", 2, "not valid YAML"),
        ("a: *nowhere\n", 1, "not valid YAML"),
        ("- 1\n- 2\n", 1, "mapping"),
        ("just words\n", 1, "mapping"),
        ("a: !!python/object:os.system {}\n", 1, "tag"),
        ("a: !!int word\n", 1, "number"),
        ("? [1, 2]\n: 3\n", 1, "key should be a word"),
        ("[" * 2000, None, "nested too deeply"),
        ("a: " + "[" * 40 + "]" * 40, 1, "nested too deeply"),
        ("a: \x07\n", None, "not valid YAML"),
    ],
)
def test_what_is_no_configuration_is_one_message_with_its_line(tmp_path, text, line, part):
    problem = only_problem(tmp_path, text)
    assert part in problem.message
    assert problem.line == line


@pytest.mark.parametrize(
    ("content", "part"),
    [
        (b"\x93NUMPY\x01\x00v\x00", "not UTF-8"),
        (b"PAR1\x00\x00abc", "binary"),
        (b"a: 1\n" * 1_000_000, "larger"),
    ],
)
def test_other_files_are_refused_by_what_they_are(tmp_path, content, part):
    path = tmp_path / "machine.yaml"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=part):
        load(path)


def test_a_directory_and_a_missing_file_are_named(tmp_path):
    with pytest.raises(ConfigError, match=f"{tmp_path}: is a directory"):
        load(tmp_path)
    with pytest.raises(ConfigError, match="there is no such file"):
        load(tmp_path / "none.yaml")


@settings(max_examples=60)
@given(st.data())
def test_random_damage_to_the_text_never_gives_a_traceback(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("damage")
    raw = bytearray(write(folder, MACHINE).read_bytes()[:600])
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(raw) - 1))
        with_what = data.draw(
            st.sampled_from([b"", b":", b"\n", b"&", b"*", b"{", b"[", b"'", b"-"])
        )
        raw[place : place + 1] = with_what
    path = folder / "machine.yaml"
    path.write_bytes(raw)
    with pytest.raises(ConfigError) as raised:  # what is left lacks the end of the machine
        load(path)
    assert raised.value.problems


def read_or_refused(path):
    """Return what a file holds and where, or what is told of it."""
    try:
        document = read_document(path)
    except ConfigError as error:
        return error.problems
    return document.data, document.lines, document.problems


@settings(max_examples=60)
@given(st.sampled_from(sorted(shipped_configs())), st.data())
def test_libyaml_reads_what_pyyaml_reads(tmp_path_factory, name, data):
    path = tmp_path_factory.mktemp("readers") / "machine.yaml"
    text = shipped_config(name).read_text()
    for _ in range(data.draw(st.integers(0, 3))):
        place = data.draw(st.integers(0, len(text) - 1))
        new = data.draw(st.text(":\n&*{[]},'\"#-?|>! \tä", max_size=4))
        text = text[:place] + new + text[place + 1 :]
    path.write_text(text)
    quick = read_or_refused(path)
    with pytest.MonkeyPatch.context() as without:
        without.setattr(yaml, "__with_libyaml__", False)
        assert read_or_refused(path) == quick
