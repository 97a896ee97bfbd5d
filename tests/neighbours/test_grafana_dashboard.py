"""The dashboard and the rules in the documentation ask for what is really exported."""

from __future__ import annotations

import itertools
import re

import pytest
import yaml
from grafana_dashboard import DASHBOARD, dashboard, expressions, names, selectors
from prometheus_client.core import Metric
from told_status import document_of, reported

from motorctl.api.status import MachineStatus
from motorctl.neighbours.metrics import metrics_of

COLUMNS = 24
OF_PROMETHEUS = {"up"}
"""What it has of every target: whether it answered."""

PAGE = DASHBOARD.with_name("neighbours.md")


def rules() -> list[str]:
    """Return the expressions of the alerts that the page suggests."""
    (block,) = re.findall(r"```yaml\n# rules.yml\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    return [rule["expr"] for rule in yaml.safe_load(block)["groups"][0]["rules"]]


@pytest.fixture(scope="module")
def families(tmp_path_factory: pytest.TempPathFactory) -> list[Metric]:
    """Return what is exported of two axes."""
    with reported(tmp_path_factory.mktemp("m")) as (rig, report):
        return list(metrics_of(MachineStatus.of(document_of(rig, report))))


@pytest.fixture(scope="module")
def exported(families: list[Metric]) -> set[str]:
    """Return the names as Prometheus knows them."""
    ends = {"counter": "_total", "info": "_info"}
    return {family.name + ends.get(family.type, "") for family in families}


def test_every_metric_that_the_page_names_or_warns_by_is_exported(exported: set[str]) -> None:
    expressions = rules()
    assert len(expressions) == 6
    asked = {str(part.name) for each in expressions for part in selectors(each)} - OF_PROMETHEUS
    text = PAGE.read_text("utf-8")
    assert asked | set(re.findall(r"`(motorctl_[a-z_]+)`", text)) <= exported


def test_the_page_s_alerts_tell_of_an_exporter_that_is_gone_and_of_a_recorder_in_trouble() -> None:
    away, recorder = (
        next(each for each in rules() if name in each)
        for name in ("motorctl_up", "motorctl_recorder_trouble")
    )
    assert {str(part.name) for part in selectors(away)} == {"motorctl_up", "up"}
    assert {str(part.name) for part in selectors(recorder)} == {
        "motorctl_recorder_trouble",
        "motorctl_recorder_failed",
    }


def test_every_metric_and_label_of_the_dashboard_is_one_that_is_exported(
    families: list[Metric], exported: set[str]
) -> None:
    assert len(names()) > 20
    assert names() <= exported
    labels = {
        sample.name: set(sample.labels) | {"instance"}
        for family in families
        for sample in family.samples
    }
    for expression in expressions():
        for selector in selectors(expression):
            if known := labels.get(str(selector.name)):
                assert {matcher.name for matcher in selector.matchers.matchers} <= known


def test_the_dashboard_is_one_that_grafana_can_import() -> None:
    told = dashboard()
    assert {"title", "uid", "schemaVersion", "panels", "templating", "time"} <= told.keys()
    ids = [panel["id"] for panel in told["panels"]]
    assert len(set(ids)) == len(ids)
    variables = {variable["name"] for variable in told["templating"]["list"]}
    cells: set[tuple[int, int]] = set()
    for panel in told["panels"]:
        place = panel["gridPos"]
        assert place["x"] + place["w"] <= COLUMNS
        covered = set(
            itertools.product(
                range(place["x"], place["x"] + place["w"]),
                range(place["y"], place["y"] + place["h"]),
            )
        )
        assert not cells & covered  # no panel lies on another
        cells |= covered
        assert panel["datasource"] == {"type": "prometheus", "uid": "${datasource}"}
        letters = [target["refId"] for target in panel["targets"]]
        assert len(set(letters)) == len(letters) > 0
    used = set(re.findall(r"\$\{?(?!__)([a-z]+)", DASHBOARD.read_text(encoding="utf-8")))
    assert used == variables
