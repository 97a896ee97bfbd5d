import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from motorctl.identify.refine.yaml_text import Item, YamlText

BLOCK = """\
# of the machine
axes:
  x: &x                          # the long one
    gains: {k1: 250}   # untouched
    model:
      inertia: {initial: 0.19, bounds: [0.05, 0.35]}      # V*s^2/m
      offset:                    # all defaults
      friction:
        initial: 0.1             # V
        parameters: {}
  # below x
  y:
    <<: *x
    model: {inertia: {initial: 0.5}, offset: , last: 3}  # one line
"""


def changed(text, *changes):
    made = YamlText(text)
    for name, *arguments in changes:
        getattr(made, name)(*arguments)
    return made.applied()


def test_nothing_to_change_leaves_every_character():
    assert changed(BLOCK) == BLOCK


def test_a_new_value_changes_its_own_characters_only():
    path = ("axes", "x", "model", "inertia", "initial")
    text = changed(BLOCK, ("replace", path, "0.1971"))
    assert text == BLOCK.replace(
        "{initial: 0.19, bounds: [0.05, 0.35]}      #",
        "{initial: 0.1971, bounds: [0.05, 0.35]}    #",
    )


def test_an_anchor_stays_where_its_value_changes():
    text = changed("a: &here 1\nb: *here\n", ("replace", ("a",), "22"))
    assert text == "a: &here 22\nb: *here\n"


def test_an_alias_is_replaced_where_it_stands_and_not_where_it_points():
    text = changed("a: &here 1\nb: *here  # of a\n", ("replace", ("b",), "22"))
    assert text == "a: &here 1\nb: 22  # of a\n"


def test_a_list_over_several_lines_becomes_one_line():
    text = changed("a:\n- 1\n- 2  # two\n\nb: 3\n", ("replace", ("a",), "[4, 5]"))
    assert text == "a: [4, 5]  # two\n\nb: 3\n"


def test_a_key_with_nothing_behind_it_gets_keys_and_keeps_its_comment():
    item = Item("offset", [Item("initial", "0.5", "V")])
    text = changed(BLOCK, ("replace_with_block", ("axes", "x", "model", "offset"), item))
    assert "      offset:  # all defaults\n        initial: 0.5  # V\n      friction:" in text
    assert yaml.safe_load(text)["axes"]["x"]["model"]["offset"] == {"initial": 0.5}


def test_an_item_that_is_added_stands_below_the_last_one_with_its_comments():
    item = Item("cogging", [Item("pitch_m", "0.05", "m")], "a wave", ("found here",))
    text = changed(BLOCK, ("append", ("axes", "x", "model"), [item]))
    added = (
        "        parameters: {}\n      # found here\n      cogging:  # a wave\n"
        "        pitch_m: 0.05  # m\n  # below x\n"
    )
    assert added in text


@pytest.mark.parametrize("comment", ["", "V"])
def test_items_are_added_to_a_mapping_on_one_line(comment):
    items = [Item("cogging", [Item("pitch_m", "0.05")], comment), Item("more", "1", comment)]
    text = changed(BLOCK, ("append", ("axes", "y", "model"), items))
    model = yaml.safe_load(text)["axes"]["y"]["model"]
    assert list(model) == ["inertia", "offset", "last", "cogging", "more"]
    assert model["cogging"] == {"pitch_m": 0.05}
    assert "# one line" in text


@pytest.mark.parametrize("text", ["a: {}\n", "a: {b: 1,}\n", "a: {\n  b: 1,  # note\n}\n"])
def test_a_mapping_in_braces_takes_items_whatever_it_ends_with(text):
    result = changed(text, ("append", ("a",), [Item("c", "2", "V"), Item("d", "3")]))
    assert {"c": 2, "d": 3}.items() <= yaml.safe_load(result)["a"].items()


def test_merged_keys_are_not_taken_for_the_mapping_s_own():
    text = YamlText(BLOCK)
    assert text.has(("axes", "y", "model"))
    assert not text.has(("axes", "y", "gains"))
    assert not text.mapping(("axes", "y", "gains"))


def test_what_does_not_stand_in_the_text_cannot_be_replaced():
    for path in (("axes", "y", "gains"), ("axes", "x", "model"), ("nothing",)):
        with pytest.raises(KeyError):
            YamlText(BLOCK).replace(path, "1")


def test_line_ends_stay_as_they_are():
    text = changed(BLOCK.replace("\n", "\r\n"), ("append", ("axes", "x"), [Item("new", "1")]))
    assert text.count("\n") == text.count("\r\n") == BLOCK.count("\n") + 1


KEYS = st.sampled_from(["a", "b", "c", "d"])
LEAVES = st.integers(-9, 9) | st.lists(st.integers(0, 9), min_size=1, max_size=2)
TREES = st.recursive(
    LEAVES, lambda inner: st.dictionaries(KEYS, inner, min_size=1, max_size=3), max_leaves=10
).filter(lambda tree: isinstance(tree, dict))


def paths_in(tree, path=()):
    for key, value in tree.items():
        yield (*path, key), value
        if isinstance(value, dict):
            yield from paths_in(value, (*path, key))


@settings(max_examples=60)
@given(tree=TREES, flow=st.sampled_from([None, True, False]), data=st.data())
def test_changes_mean_what_they_say_in_any_style(tree, flow, data):
    text = yaml.safe_dump(tree, default_flow_style=flow, sort_keys=False)
    places = list(paths_in(tree))
    leaves = [path for path, value in places if not isinstance(value, dict)]
    mappings = [(), *(path for path, value in places if isinstance(value, dict))]
    changes = YamlText(text)
    for path in data.draw(st.lists(st.sampled_from(leaves), unique=True)) if leaves else ():
        changes.replace(path, "[1, 2.5]")
        at = tree
        for key in path[:-1]:
            at = at[key]
        at[path[-1]] = [1, 2.5]
    for path in data.draw(st.lists(st.sampled_from(mappings), unique=True)):
        comment = data.draw(st.sampled_from(["", "V"]))
        changes.append(path, [Item("new", [Item("x", "1", comment)], comment), Item("n", "2")])
        at = tree
        for key in path:
            at = at[key]
        at |= {"new": {"x": 1}, "n": 2}
    assert yaml.safe_load(changes.applied()) == tree
