"""Whatever stands in a configuration, the answer is a machine or problems with their places."""

import copy
import json
import math

import pytest
import yaml
from config_bench import MACHINE, put, write
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motorctl.config import Machine, load, load_resolved, summarise
from motorctl.errors import ConfigError
from motorctl.located_yaml import find

QUICK = settings(
    max_examples=40,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)


def places(part, path=()):
    """Yield the path of every value in plain data."""
    for key, value in part.items() if isinstance(part, dict) else enumerate(part):
        yield [*path, key]
        if isinstance(value, dict | list):
            yield from places(value, (*path, key))


PLACES = list(places(MACHINE))
# All but the one number that makes new compiled kernels.
NUMBERS = [
    p for p in PLACES if type(find(MACHINE, tuple(p))) in (int, float) and p[-1] != "slope_s_m"
]

scalars = (
    st.none()
    | st.booleans()
    | st.integers(-(10**40), 10**40)
    | st.floats(allow_nan=True)
    | st.text(max_size=8)
    | st.sampled_from(["yes", "60e-6", "C1", "x", "inertia", "config_bench:Spring", ".inf", "1_0"])
)
junk = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=4,
)


def answer(folder, data):
    """Load, and check that problems say where they are; None where the file is valid."""
    path = write(folder, data)
    parsed = yaml.safe_load(path.read_text())
    try:
        loaded = load(path)
    except ConfigError as error:
        told = error.problems
    else:
        assert isinstance(loaded, Machine)
        return loaded
    assert told
    for problem in told:
        assert problem.message
        assert problem.key or problem.line is not None
        top = problem.key.split(".")[0].split("[")[0]
        assert problem.line is not None or top not in parsed, problem
    return None


@QUICK
@given(st.lists(st.tuples(st.sampled_from(PLACES), junk), min_size=1, max_size=3))
def test_any_value_anywhere_is_a_machine_or_problems_with_places(tmp_path, changes):
    data = copy.deepcopy(MACHINE)
    for path, value in changes:
        try:
            put(data, path, value)
        except (KeyError, TypeError, IndexError):
            continue  # an earlier change took that place away
    answer(tmp_path, data)


@QUICK
@given(st.sampled_from(PLACES), st.sampled_from(PLACES))
def test_any_missing_or_misplaced_key_is_a_machine_or_problems_with_places(tmp_path, gone, moved):
    data = copy.deepcopy(MACHINE)
    value = find(data, tuple(moved))
    del find(data, tuple(gone[:-1]))[gone[-1]]
    home = find(data, tuple(moved[:-2]))
    if isinstance(home, dict):
        home[str(moved[-1])] = copy.deepcopy(value)
    answer(tmp_path, data)


@QUICK
@given(
    st.lists(
        st.tuples(
            st.sampled_from(NUMBERS),
            st.floats(1e-320, 1e308)
            | st.floats(-1e308, 1e308)
            | st.sampled_from([0.0, 1e-12, 1e12]),
        ),
        min_size=1,
        max_size=2,
    )
)
def test_any_number_in_a_number_s_place_is_judged(tmp_path, changes):
    data = copy.deepcopy(MACHINE)
    for path, value in changes:
        put(data, path, int(value) if abs(value) < 1e6 and value == int(value) else value)
    loaded = answer(tmp_path, data)
    if loaded is not None:
        json.dumps(summarise(loaded), allow_nan=False)


@pytest.mark.slow
@settings(QUICK, max_examples=15)
@given(
    rate=st.floats(1500, 7000),
    inertia=st.floats(0.12, 0.3),
    slope=st.sampled_from([900, 450.5, math.inf]),
    bits=st.integers(16, 64),
    limit=st.none() | st.floats(0.1, 100),
    controller=st.sampled_from(["C1", "C2"]),
)
def test_every_valid_machine_survives_its_own_plain_data(
    tmp_path, rate, inertia, slope, bits, limit, controller
):
    data = copy.deepcopy(MACHINE)
    axis = data["axes"]["x"]
    data["rate_hz"] = rate
    axis["model"]["inertia"]["initial"] = inertia
    axis["model"]["coulomb_friction"]["slope_s_m"] = slope
    axis["encoder"]["counter_bits"] = bits
    axis["adaptation"]["rate_limit_1_s"] = limit
    axis["controller"] = controller
    loaded = load(write(tmp_path, data))
    plain = json.loads(json.dumps(loaded.resolved, allow_nan=False))
    again = load_resolved(plain, hardware=True)
    assert again.resolved == loaded.resolved
    assert again.rate_hz == rate
    assert again.axes["x"].estimates == loaded.axes["x"].estimates
    assert again.axes["x"].adaptation == loaded.axes["x"].adaptation
    assert again.axes["x"].model.module_name == loaded.axes["x"].model.module_name


@pytest.mark.long
@pytest.mark.slow
@settings(QUICK, max_examples=500)
@given(st.lists(st.tuples(st.sampled_from(PLACES), junk), min_size=1, max_size=4))
def test_many_more_random_machines_are_judged(tmp_path, changes):
    test_any_value_anywhere_is_a_machine_or_problems_with_places.hypothesis.inner_test(
        tmp_path, changes
    )
