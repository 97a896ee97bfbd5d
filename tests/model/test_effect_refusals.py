"""An effect that does not keep the contract is refused when it is loaded, and told why."""

import re

import pytest
import yaml
from changed_toys import OPTIONS, changed
from config_bench import machine

from motorctl.config import load
from motorctl.errors import ConfigError, UsageError
from motorctl.model import effect_class

PROPERTY = "    @property\n    def picture"
CLASSMETHOD = "    @classmethod\n    def trials"
STATE = "j: int, x: float, v: float, a: float, vs: float, t: float, c: tuple[float, ...]"


def member(name, says, kind="property"):
    """Write one more member of a class."""
    arguments = {"property": "self", "classmethod": "cls, *given", "": "self, *given"}[kind]
    decorator = f"    @{kind}\n" if kind else ""
    return f"{decorator}    def {name}({arguments}):\n        {says}\n\n"


def with_property(name, says):
    return PROPERTY, member(name, says) + PROPERTY


def with_method(name, says, kind="classmethod"):
    return PROPERTY, member(name, says, kind) + PROPERTY


def with_attribute(text):
    return PROPERTY, f"    {text}\n\n{PROPERTY}"


CASES = [
    ("brake_zone", 'name = "brake_zone"', "pass", "the class has no name; expected name = "),
    ("brake_zone", 'kind = "state"', 'kind = "sideways"',
     "kind is 'sideways'; expected one of: state, input, command, measurement"),
    ("brake_zone", 'kind = "state"', "pass", "kind is None; expected one of: state, input"),
    ("brake_zone", 'formula = "c * v,  |x - x_0| < l"', "pass", "formula is None; expected a text"),
    ("brake_zone", "Options = BrakeZoneOptions", "Options = dict", "Options is no class derived"),
    ("brake_zone", "@njit(inline=\"always\")\ndef column", "def column",
     "column is missing: expected column(j, x, v, a, vs, t, c) decorated with numba's njit"),
    ("brake_zone", STATE, STATE.replace("a: float, ", ""),
     "column is column(j, x, v, vs, t, c); expected column(j, x, v, a, vs, t, c)"),
    ("brake_zone", 'kind = "state"', 'kind = "state"\n    memory = 1',
     "column is column(j, x, v, a, vs, t, c); expected column(j, x, v, a, vs, t, w, c)"),
    ("cable_creep", "def advance(", "def _advance(",
     "advance is missing: expected advance(w, x, v, a, dt, others, c)"),
    ("slow_core", "def advance(w: Array, u: float, dt: float,", "def advance(w: Array, u,",
     "advance is advance(w, u, c); expected advance(w, u, dt, c)"),
    ("slow_core", "def slope(", "def _slope(",
     "slope is missing: expected slope(j, u, w, c)"),
    ("slow_core", "memory = 1", "memory = -1", "memory is -1; expected how many numbers"),
    ("slow_core", "[(float(place),) for place in np.linspace(-10.0, 10.0, 9)]",
     "[(0.0, 1.0)]", "memories gives [(0.0, 1.0)]; expected memories of 1 numbers each"),
    ("current_loop", 'kind = "command"', 'kind = "command"\n    memory = 1',
     "memory is for state and input effects; its kind is 'command'"),
    ("weak_magnet", "def column(j: int, u: float, x: float, t: float,", "def column(j: int, u,",
     "column is column(j, u, c); expected column(j, u, x, t, c)"),
    ("brake_zone", *with_attribute("varies = True"), "varies is for input effects"),
    ("push_pull", *with_attribute("odd = 1"), "odd is 1; expected True or False"),
    ("scale_joint", "def correct(", "def _correct(", "correct is missing: expected correct(y, c)"),
    ("scale_joint", '("shift_m",)', '("step_m",)',
     "amplitudes names 'step_m'; expected one of: place_m, width_m, shift_m"),
    ("push_pull", *with_attribute('amplitudes = ("d",)'), "amplitudes is for measurement effects"),
    ("brake_zone", '{"friction"}', '{"frictoin"}',
     "groups names 'frictoin'; expected one of: friction, friction_of_position"),
    ("brake_zone", '("two_speeds",)', '("three_speeds",)',
     "revealed_by names 'three_speeds'; expected one of: two_speeds"),
    ("brake_zone", 'Picture("friction_over_position"', 'Picture("friction_over_lunch"',
     "picture names 'friction_over_lunch'; expected one of: over_time"),
    ("weak_magnet", 'Picture("over_time",', 'Picture("acting_command",',
     "picture acting_command has a scale of 0.0; expected above 0"),
    ("weak_magnet", '"over_time", "What', '"thrust_over_position", scale=0.1, caption="',
     "picture thrust_over_position is of a wave; expected lines and repeats_every with it"),
    ("brake_zone", *with_attribute('refuted_at_end = {"center_m": "upper"}'),
     "refuted_at_end names 'center_m'; expected one of: middle_m, half_length_m"),
    ("brake_zone", *with_attribute('valleys_along = "center_m"'),
     "valleys_along names 'center_m'; expected one of: middle_m, half_length_m"),
    ("brake_zone", *with_attribute('may_lack = ("drag_m",)'),
     "may_lack names 'drag_m'; expected one of: middle_m, half_length_m"),
    ("brake_zone", *with_attribute('refuted_at_end = {"middle_m": "left"}'),
     "refuted_at_end names 'left'; expected one of: either, upper, neither"),
    ("brake_zone", *with_attribute('usual = {"share": 1.0}'),
     "usual is for input effects; its kind is 'state'"),
    ("brake_zone", *with_attribute('proportional_to = "jerk"'),
     "proportional_to names 'jerk'; expected one of: acceleration"),
    ("brake_zone", *with_attribute('proportional_to = "velocity"'),
     "proportional_to is 'velocity', which is that of 'viscous_friction' alone"),
    ("brake_zone", '{"friction"}', '{"wave_over_position"}',
     "Options is no PitchOptions, which an effect of the group wave_over_position has"),
    ("push_pull", *with_attribute('groups = frozenset({"wave_over_time"})'),
     "at_line is missing; a wave_over_time has it"),
    ("push_pull", *with_method("typical", "raise KeyError('middle')"),
     "typical raises KeyError: 'middle'"),
    ("push_pull", *with_method("typical", "return 7"),
     "typical returns 7; expected a form of the effect, or None"),
    ("push_pull", *with_method("trials", "return 1 / 0"), "trials raises ZeroDivisionError"),
    ("push_pull", *with_method("ringing_at", "return [7]"),
     "ringing_at returns [7]; expected forms of the effect"),
    ("push_pull", *with_method("smooth_function", "return 1 / 0"),
     "smooth_function raises ZeroDivisionError"),
    ("push_pull", *with_method("carry_over", "return 1 / 0", ""),
     "carry_over raises ZeroDivisionError"),
    ("push_pull", *with_method("carry_over", "return None", ""),
     "carry_over returns None; expected a motorctl.model.CarriedOver"),
    ("push_pull", *with_property("lines", "return [0.0]"), "lines gives [0.0]; expected"),
    ("push_pull", *with_property("delay_s", "return 1e-3"),
     "delay_s gives 0.001; expected 0, for its kind is 'input'"),
    ("push_pull", *with_property("repeats_every", "return self.pitch"),
     "repeats_every raises AttributeError"),
    ("push_pull", *with_property("constants", "return ()"), "constants gives []; expected at"),
    ("push_pull", *with_property("constants", "return (float('nan'),)"), "constants gives [nan]"),
    ("push_pull", *with_property("other_axes", "return ('y',)"),
     "other_axes is for a state effect with a memory"),
    ("push_pull", "-0.5, 0.5, 0.0, 0.1", "0.5, -0.5, 0.0, 0.1", "gives 'd' 0.5 to -0.5"),
    ("push_pull", "-0.5, 0.5, 0.0, 0.1", "-0.5, 0.5, 0.0, 0.0", "gives 'd' a covariance"),
    ("iron_knee", '"pull", "q"', '"push", "q"', "parameters names 'push' twice"),
    ("iron_knee", '"pull", "q"', '"", "q"', "parameters names ''; expected letters"),
    ("current_loop", "return ()", 'return (Parameter("", "f", "Hz", 0.0, 1.0, 0.5, 1.0),)',
     "parameters gives some; expected none, for its kind is 'command'"),
    ("brake_zone", '"middle_m": 0.03 *', '"center_m": 0.03 *',
     "steps names 'center_m'; expected one of: middle_m"),
    ("brake_zone", "return v * min(", "return math.sqrt(v) * min(",
     "column cannot run in the compiled tick: TypingError"),
    ("brake_zone", "return v * min(", "return np.log(abs(v)) * min(", "column gives -inf at (0"),
    ("brake_zone", "return v * min(", "return v / v * min(", "column divides by zero and raises"),
    ("brake_zone", "return v * min(", "raise ValueError\n    return v * min(",
     "column cannot run in the compiled tick: ValueError"),
    ("cable_creep", "math.exp(-dt * c[0])", "math.exp(dt * 1e9)", "advance leaves the memory ["),
]  # fmt: skip


@pytest.mark.parametrize(("toy", "before", "after", "said"), CASES, ids=[c[3][:50] for c in CASES])
def test_an_effect_that_breaks_the_contract_is_refused_with_member_and_reason(
    toy, before, after, said, tmp_path
):
    target = changed(toy, tmp_path, before, after)
    with pytest.raises(UsageError, match=re.escape(said)) as refused:
        effect_class(toy, target)
    assert str(refused.value).startswith(f"effect '{toy}' ({target})")


def test_the_name_of_an_effect_that_motorctl_has_is_refused(tmp_path):
    target = changed("brake_zone", tmp_path, '"brake_zone"', '"quadratic_drag"')
    with pytest.raises(UsageError, match="is that of a built-in effect; choose another"):
        effect_class("quadratic_drag", target)


@pytest.mark.parametrize("toy", ["push_pull", "slow_core"])
def test_a_good_effect_is_taken(toy, tmp_path):
    assert effect_class(toy, changed(toy, tmp_path)).name == toy


def test_a_configuration_tells_the_line_of_an_effect_that_is_refused(tmp_path):
    data = machine()
    target = changed("iron_knee", tmp_path, "def slope(", "def _slope(")
    axis = next(iter(data["axes"].values()))
    axis["model"]["iron_knee"] = {"type": target, **OPTIONS["iron_knee"]}
    path = tmp_path / "machine.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    with pytest.raises(
        ConfigError, match=r"slope is missing: expected slope\(j, u, c\)"
    ) as refused:
        load(path)
    line = path.read_text().splitlines().index(f"        type: {target}") + 1
    assert f":{line}" in str(refused.value)


def test_options_with_which_an_effect_breaks_the_contract_are_told_with_their_line(tmp_path):
    data = machine()
    target = changed(
        "iron_knee", tmp_path, "return (self.options.knee_v,)",
        "return (float('nan') if self.options.knee_v > 5.0 else self.options.knee_v,)",
    )  # fmt: skip
    axis = next(iter(data["axes"].values()))
    axis["model"]["iron_knee"] = {"type": target, "knee_v": 7.0}
    path = tmp_path / "machine.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    with pytest.raises(ConfigError, match=r"constants gives \[nan\]; expected at least one"):
        load(path)
