"""JSON Schema of configuration files, for editors."""

from __future__ import annotations

from typing import Any

from pydantic import TypeAdapter

from motorctl.config.axis_keys import ConfigurationKeys
from motorctl.model import Effect, basic_effects, known_effects
from motorctl.motion import AnyProgram

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def config_schema() -> dict[str, Any]:
    """Return the schema of the whole file; drivers' own options stay open, they vary by machine.

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
