"""Which effects the models C1 and C2 have."""

from __future__ import annotations

import pytest
from seventh_effect import SeventhEffect

from motorctl.identify.fit import declared_models
from motorctl.identify.fit.declared_models import controller_list
from motorctl.model import EffectList, known_effects, make_effect
from motorctl.model.catalog import built_in_effects


class NewElectromagnetic(SeventhEffect):
    """An effect that somebody adds."""

    name = "new_electromagnetic"
    electromagnetic = True


@pytest.fixture
def one_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the catalog hold an electromagnetic effect more."""
    more = built_in_effects() | {NewElectromagnetic.name: NewElectromagnetic}
    monkeypatch.setattr(declared_models, "built_in_effects", lambda: more)


@pytest.mark.usefixtures("one_more")
def test_c2_has_every_electromagnetic_effect_that_the_catalog_holds():
    names = set(controller_list(None, "C2").names)
    assert {"em_quadratic", "em_cubic", "new_electromagnetic"} <= names
    assert names - set(controller_list(None, "C1").names) == {
        name for name in names if declared_models.built_in_effects()[name].electromagnetic
    }


def test_c2_keeps_what_an_axis_declares_and_adds_what_is_missing():
    declared = EffectList([make_effect(known_effects()[n]) for n in ("inertia", "em_cubic")])
    assert controller_list(declared, "C2").names == ("inertia", "em_cubic", "em_quadratic")
