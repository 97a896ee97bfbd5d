"""JSON Schema of configuration files, for editors."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import TypeAdapter

from motorctl.config.axis_keys import ConfigurationKeys
from motorctl.hal import Driver
from motorctl.hal.registry import installed_drivers
from motorctl.model import Effect, basic_effects, known_effects
from motorctl.motion import AnyProgram

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def config_schema() -> dict[str, Any]:
    """Return the schema of the whole file, with the options of every driver that is installed.

    Those of a driver that is named as package.module:Class stay open.

    Returns
    -------
    dict
        JSON Schema of a configuration as YAML has it, by the dialect that its `$schema` names.
    """
    schema = ConfigurationKeys.model_json_schema()
    definitions: dict[str, Any] = schema["$defs"]
    programs = _programs(definitions)
    (pattern,) = schema["properties"]["programs"]["patternProperties"]
    schema["properties"]["programs"]["patternProperties"][pattern] = programs
    del definitions["ProgramKeys"]
    definitions["AxisKeys"]["properties"]["model"] = _model(definitions)
    definitions["DriverKeys"]["allOf"] = list(_drivers(definitions))
    return {"$schema": DIALECT, **schema, "title": "motorctl configuration"}


def _programs(definitions: dict[str, Any]) -> dict[str, Any]:
    """Add every kind of program to the definitions; a program is named by its key."""
    union = TypeAdapter[Any](AnyProgram).json_schema()
    kinds = {branch["$ref"].rpartition("/")[2] for branch in union["oneOf"]}
    for name, part in union.pop("$defs").items():
        if name in kinds:
            part["properties"].pop("name")
            required = [key for key in part.get("required", []) if key != "name"]
            part["required"] = ["kind", *required]
        definitions[name] = part
    branches: dict[str, Any] = {"oneOf": union["oneOf"]}
    return branches


def _drivers(definitions: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Add the options of every driver to the definitions; yield which `type` means which."""
    for entry in installed_drivers():
        if entry.driver is not None:
            key = f"driver_{entry.name}"
            definitions[key] = _driver(key, entry.driver, definitions)
            named = {"properties": {"type": {"const": entry.name}}, "required": ["type"]}
            yield {"if": named, "then": {"$ref": f"#/$defs/{key}"}}


def _driver(key: str, driver: type[Driver], definitions: dict[str, Any]) -> dict[str, Any]:
    """Describe a driver's options; parts of different drivers may have the same name."""
    options = driver.Options.model_json_schema(ref_template=f"#/$defs/{key}_{{model}}")
    for name, part in options.pop("$defs", {}).items():
        definitions[f"{key}_{name}"] = _on_one_line(part)
    own = definitions["DriverKeys"]["properties"]
    described: dict[str, Any] = _on_one_line(options)
    return described | {"properties": own | described.get("properties", {})}


def _on_one_line(part: Any) -> Any:
    """Return a part of a schema whose descriptions, which are docstrings, have no line breaks."""
    if isinstance(part, dict):
        return {
            key: " ".join(value.split())
            if key == "description" and isinstance(value, str)
            else _on_one_line(value)
            for key, value in part.items()
        }
    return [_on_one_line(item) for item in part] if isinstance(part, list) else part


def _model(definitions: dict[str, Any]) -> dict[str, Any]:
    """Describe the list of effects: every known one with its own options, others by `type`."""
    own = definitions["EffectKeys"]
    effects = {}
    for name, effect in sorted(known_effects().items()):
        key = f"effect_{name}"
        definitions[key] = _effect(effect, own, definitions)
        effects[name] = {
            "description": effect.title,
            "anyOf": [{"$ref": f"#/$defs/{key}"}, {"type": "null"}],
        }
    own["required"] = ["type"]
    return {
        "description": "effects, in the order of theta",
        "type": "object",
        "minProperties": 1,
        "required": [basic_effects()["acceleration"].name],
        "properties": effects,
        "additionalProperties": {"$ref": "#/$defs/EffectKeys"},
    }


def _effect(
    effect: type[Effect], own: dict[str, Any], definitions: dict[str, Any]
) -> dict[str, Any]:
    options = effect.Options.model_json_schema(ref_template="#/$defs/{model}")
    definitions |= options.pop("$defs", {})
    own_keys = {key: part for key, part in own["properties"].items() if key != "type"}
    described: dict[str, Any] = {
        "title": effect.title,
        "description": f"{effect.formula}. Visible in: {effect.visible_in}",
        "type": "object",
        "properties": own_keys | options["properties"],
        "additionalProperties": False,
    }
    if required := options.get("required"):
        described["required"] = required
    return described
