"""The suite for an effect that the command line names."""

from __future__ import annotations

import importlib
import json
from typing import Any

import pytest
from pydantic import ValidationError

from motorctl.errors import UsageError
from motorctl.model.catalog import effect_class
from motorctl.model.conformance import EffectConformance
from motorctl.model.effect import Effect
from motorctl.model.plain_options import make_effect


def named_effect(config: pytest.Config) -> Effect:
    """Return the effect that the options ask for.

    Raises pytest.UsageError where they are wrong, or where it would be refused when it is loaded.
    """
    target = config.getoption("effect", None)
    if target is None:
        raise pytest.UsageError(
            "give -p motorctl.model.conformance and --effect NAME or package.module:Class"
        )
    try:
        cls = effect_class(target) if ":" not in target else effect_class(_name(target), target)
        return make_effect(cls, _options(config.getoption("effect_options")))
    except UsageError as error:
        raise pytest.UsageError(f"--effect: {error}") from error
    except ValidationError as error:
        wrong = "; ".join(
            f"{'.'.join(map(str, detail['loc']))}: {detail['msg']}" for detail in error.errors()
        )
        raise pytest.UsageError(f"--effect-options: {wrong}") from error


def _name(target: str) -> str:
    """Return the name that a class gives itself; loading tells whatever is wrong with it."""
    module, _, attribute = target.partition(":")
    try:
        return str(getattr(getattr(importlib.import_module(module), attribute), "name", attribute))
    except Exception as error:  # a third party's module may fail in any way
        cause = f"{type(error).__name__}: {error}"
        raise pytest.UsageError(f"--effect {target}: {cause}") from error


def _options(text: str) -> dict[str, Any]:
    try:
        given = json.loads(text)
    except json.JSONDecodeError as error:
        raise pytest.UsageError(f"--effect-options: found {text}, no JSON: {error}") from error
    if not isinstance(given, dict):
        raise pytest.UsageError(f"--effect-options: found {text}, should be an object")
    return given


class TestEffect(EffectConformance):
    """The effect of the command line."""

    @pytest.fixture
    def effect(self, request: pytest.FixtureRequest) -> Effect:
        """Return the effect that the command line names."""
        return named_effect(request.config)
