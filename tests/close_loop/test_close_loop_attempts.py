"""In which order the additions of several axes are tried, and which of them are kept.

Errors follow from what is added, by factors that are given; nothing is refined or simulated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorctl.close_loop import attempts as attempts_module
from motorctl.close_loop.attempts import MOST_ATTEMPTS, Attempts, try_found
from motorctl.close_loop.judge import AxisJudgement

Additions = Mapping[str, Mapping[str, Mapping[str, float]]]
"""By axis and effect, weakest last: the factor of each axis' error; 1 where none is given."""
Errors = Callable[[Mapping[str, Collection[str]], int], Mapping[str, float]]
"""From what each axis has gained, and how many runs there were before, to each axis' error."""


def tried(
    found: Additions, folder: Path, *, errors: Errors | None = None, repeats_within: float = 0.0
) -> tuple[Attempts, Mapping[str, float]]:
    """Return what became of the additions, and the errors of what was kept (1 before)."""
    runs = 0

    def refine_config(_diagnosis: Any, _config: Any, out: Path, **chosen: Any) -> Any:
        axes = {}
        for name, effects in found.items():
            left = chosen["without"].get(name, ())
            added = () if name in chosen["kept"] else tuple(e for e in effects if e not in left)
            axes[name] = SimpleNamespace(changed=bool(added), added=added)
        return SimpleNamespace(out=out, axes=axes, write=lambda: written.update({out: axes}))

    def run(config: Path, _folder: Path) -> Any:
        nonlocal runs
        runs += 1
        gained = {name: axis.added for name, axis in written[config].items()}
        measured = (errors or errors_of(found))(gained, runs)
        return SimpleNamespace(errors=measured, repeats_within=repeats_within)

    def judge(before: Any, after: Any, _first: Any) -> dict[str, AxisJudgement]:
        judged = {}
        for name in found:
            old, new = before.errors[name], after.errors[name]
            against = () if new <= old * (1.0 + repeats_within) else (f"eF {old:g} -> {new:g}",)
            judged[name] = AxisJudgement(name, not against, against, {}, (0.0, 0.0))
        return judged

    written: dict[Path, Any] = {}
    scores = {
        name: SimpleNamespace(
            effects=[SimpleNamespace(name=e, score=-k) for k, e in enumerate(effects)], unknown=None
        )
        for name, effects in found.items()
    }
    before: Any = SimpleNamespace(
        config=Path("c.yaml"), errors=dict.fromkeys(found, 1.0), repeats_within=repeats_within
    )
    diagnosis: Any = SimpleNamespace(axes=scores)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(attempts_module, "refine_config", refine_config)
        patch.setattr(attempts_module, "judge", judge)
        done = try_found(diagnosis, before, before, folder, run)
    kept: Any = [attempt.trial for attempt in done.tried if attempt.accepted]
    return done, kept[-1].errors if kept else before.errors


def errors_of(found: Additions) -> Errors:
    def errors(gained: Mapping[str, Collection[str]], _runs: int) -> Mapping[str, float]:
        factors = [found[axis][name] for axis, names in gained.items() for name in names]
        return {axis: math.prod(f.get(axis, 1.0) for f in factors) for axis in found}

    return errors


def kept_of(done: Attempts) -> dict[str, tuple[str, ...]]:
    """Return what each axis has gained in the end."""
    last = next((a for a in reversed(done.tried) if a.accepted), None)
    return {} if last is None else {n: axis.added for n, axis in last.refinement.axes.items()}


def test_what_harms_nothing_is_tried_once_together(tmp_path: Path) -> None:
    done, errors = tried({"x": {"lag": {"x": 0.5}}, "y": {"cogging": {"y": 0.3}}}, tmp_path)
    assert [attempt.accepted for attempt in done.tried] == [True]
    assert errors == {"x": 0.5, "y": 0.3}
    assert done.shares == done.tried[0].judgements


def test_an_axis_that_another_ones_addition_drags_back_keeps_its_own(tmp_path: Path) -> None:
    shaking = {"x": {"lag": {"x": 2.0, "y": 9.0}}, "y": {"cogging": {"y": 0.3}}}
    done, errors = tried(shaking, tmp_path)
    assert kept_of(done) == {"x": (), "y": ("cogging",)}
    assert errors == {"x": 1.0, "y": 0.3}
    assert dict(done.dropped) == {"x": ("lag: eF 1 -> 2",)}
    assert set(done.shares) == {"x", "y"}


def test_what_did_well_is_kept_before_less_of_the_rest_is_tried(tmp_path: Path) -> None:
    found = {"x": {"cogging": {"x": 0.5}, "lag": {"x": 4.0}}, "y": {"cogging": {"y": 0.3}}}
    done, errors = tried(found, tmp_path)
    assert [a.accepted for a in done.tried] == [False, True, True]
    assert {n: a.added for n, a in done.tried[1].refinement.axes.items()}["x"] == ()
    assert kept_of(done) == {"x": ("cogging",), "y": ("cogging",)}
    assert errors == {"x": 0.5, "y": 0.3}


def test_on_a_machine_a_run_that_is_spoilt_costs_no_axis_what_did_it_good(tmp_path: Path) -> None:
    found = {"x": {"lag": {"x": 4.0}}, "y": {"cogging": {"y": 0.3}}}

    def errors(gained: Mapping[str, Collection[str]], runs: int) -> Mapping[str, float]:
        return {"x": 9.0, "y": 2.0} if runs == 2 else errors_of(found)(gained, runs)

    done, left = tried(found, tmp_path, errors=errors, repeats_within=0.2)
    assert [a.accepted for a in done.tried] == [False, False, True]
    assert left == {"x": 1.0, "y": 0.3}


def test_what_there_is_no_attempt_left_for_is_told(tmp_path: Path) -> None:
    effects = {f"e{k}": {"x": 2.0, "y": 2.0} for k in range(8)}
    done, errors = tried({"x": effects, "y": effects, "z": effects}, tmp_path)
    assert len(done.tried) == MOST_ATTEMPTS
    assert errors == dict.fromkeys("xyz", 1.0)
    assert all(any("not tried" in why for why in done.dropped[axis]) for axis in "xyz")


FACTORS = st.sampled_from([0.3, 0.8, 1.0, 1.5, 4.0])


@given(
    effects=st.lists(st.sampled_from("xz"), max_size=5),
    factors=st.data(),
)
@settings(max_examples=100, deadline=None)
def test_an_addition_that_harms_nobody_is_kept_whatever_others_add(
    tmp_path_factory: pytest.TempPathFactory, effects: list[str], factors: st.DataObject
) -> None:
    found: dict[str, dict[str, dict[str, float]]] = {"x": {}, "y": {"cogging": {"y": 0.5}}, "z": {}}
    for k, axis in enumerate(effects):
        found[axis][f"e{k}"] = {other: factors.draw(FACTORS) for other in "xyz"}
    done, errors = tried(found, tmp_path_factory.mktemp("round"))
    assert kept_of(done)["y"] == ("cogging",)
    assert max(errors.values()) <= 1.0
