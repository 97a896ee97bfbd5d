"""Effects made of plain options, as a configuration or a log tells them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from motorctl.errors import UsageError
from motorctl.model.effect import Effect


def make_effect(cls: type[Effect], options: Mapping[str, Any] | None = None) -> Effect:
    """Return an effect with plain options.

    Parameters
    ----------
    cls
        The effect's class.
    options
        Values by the options' names; what is left out has its default.

    Returns
    -------
    Effect
        The effect.

    Raises
    ------
    pydantic.ValidationError
        An option is unknown or its value is not allowed.
    UsageError
        The class has no name.
    """
    if not getattr(cls, "name", ""):
        raise UsageError(f"effect class {cls.__module__}:{cls.__qualname__} has no name")
    return cls(cls.Options.model_validate(dict(options or {})))
