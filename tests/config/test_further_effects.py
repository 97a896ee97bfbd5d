"""Effects of one's own that a configuration asks diagnosis to try."""

from config_bench import line_of, machine, problems, write
from seventh_effect import SeventhEffect

from motorctl.config import load, load_resolved


def test_an_effect_that_is_named_for_diagnosis_is_tried_but_not_declared(tmp_path):
    named = {"seventh_effect": "seventh_effect:SeventhEffect"}
    loaded = load(write(tmp_path, machine(further_effects=named)))
    assert loaded.further_effects == {"seventh_effect": SeventhEffect}
    assert all("seventh_effect" not in axis.declared.names for axis in loaded.axes.values())


def test_a_log_remembers_which_effects_diagnosis_was_to_try(tmp_path):
    named = {"seventh_effect": "seventh_effect:SeventhEffect"}
    resolved = load(write(tmp_path, machine(further_effects=named))).resolved
    assert load_resolved(resolved).further_effects == {"seventh_effect": SeventhEffect}


def test_an_effect_that_cannot_be_loaded_is_a_problem_with_its_line(tmp_path):
    data = machine(further_effects={"gone": "no_such_module:Gone"})
    (problem,) = problems(tmp_path, data)
    assert problem.key == "further_effects.gone"
    assert "no_such_module" in problem.message
    assert problem.line == line_of(tmp_path / "machine.yaml", "gone")


def test_a_log_is_read_where_an_effect_that_was_to_be_tried_is_not_installed(tmp_path):
    resolved = dict(load(write(tmp_path, machine())).resolved)
    resolved["further_effects"] = {"gone": "no_such_module:Gone"}
    assert load_resolved(resolved).further_effects == {}
