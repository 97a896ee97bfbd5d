"""Every guard stands in one room: no other module of the loop trips an axis."""

import ast
from pathlib import Path

import motorctl.loop

LOOP = Path(motorctl.loop.__file__).parent
TRIPS = {"trip", "react", "quick_stop", "react_to_others"}
EVENTS = {"TRIP", "QUICK_STOP"}


def trips_in(path):
    """Return how a module trips axes: calls of the guards' reactions, and events that do."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name)):
            continue
        events = {given.attr for given in node.args if isinstance(given, ast.Attribute)}
        if node.func.id in TRIPS or (node.func.id == "take" and events & EVENTS):
            yield node.func.id


def test_no_module_of_the_loop_trips_an_axis_but_the_guards():
    modules = {path.relative_to(LOOP): set(trips_in(path)) for path in LOOP.rglob("*.py")}
    guards = {name: found for name, found in modules.items() if name.parts[0] == "guards"}
    assert set().union(*guards.values()) == TRIPS | {"take"}
    assert {name for name, found in modules.items() if found} == {
        name for name, found in guards.items() if found
    }
