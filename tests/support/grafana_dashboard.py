"""What the Grafana dashboard in the documentation asks Prometheus for."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import promql_parser

DASHBOARD = Path(__file__).parents[2] / "docs" / "grafana_dashboard.json"
INTERVALS = {"$__rate_interval": "1m", "$__range": "1h"}
"""What Grafana puts in before Prometheus reads it."""


def dashboard() -> dict[str, Any]:
    return json.loads(DASHBOARD.read_text(encoding="utf-8"))  # type: ignore[no-any-return]


def expressions() -> list[str]:
    return [target["expr"] for panel in dashboard()["panels"] for target in panel["targets"]]


def selectors(expression: str) -> Iterator[promql_parser.VectorSelector]:
    """Yield what an expression asks of Prometheus, as its own grammar reads it."""
    for name, interval in INTERVALS.items():
        expression = expression.replace(name, interval)
    found: list[promql_parser.VectorSelector] = []

    def visit(part: object) -> None:
        if isinstance(part, promql_parser.VectorSelector):
            found.append(part)

    promql_parser.walk(promql_parser.parse(expression), visit)
    yield from found


def names() -> set[str]:
    """Return which metrics are asked for, in panels and by the variables."""
    asked = {str(part.name) for each in expressions() for part in selectors(each)}
    for variable in dashboard()["templating"]["list"]:
        if variable["type"] == "query":
            asked.update(re.findall(r"label_values\((\w+)", variable["query"]["query"]))
    return asked
