"""In which order the additions of several axes are tried, and which of them are kept.

Errors follow from what is added, by factors that are given; nothing is refined or simulated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorctl.close_loop import attempts as attempts_module
from motorctl.close_loop.attempts import Attempts, try_found
from motorctl.close_loop.judge import AxisJudgement
from motorctl.close_loop.tables import attempt_words
from motorctl.close_loop.trial import Trial

Additions = Mapping[str, Mapping[str, Mapping[str, float]]]
"""By axis and effect, weakest last: the factor of each axis' error; 1 where none is given."""
Errors = Callable[[Mapping[str, Collection[str]], int], Mapping[str, float]]
"""From what each axis has gained, and how many runs there were before, to each axis' error."""


@dataclass(frozen=True)
class Measured(Trial):
    """A trial of which the errors are given."""

    errors: Mapping[str, float] = field(default_factory=dict)


ANY: Any = None
RECORDINGS: Any = {"unused": "rows"}


def tried(
    found: Additions,
    folder: Path,
    *,
    errors: Errors | None = None,
    repeats_within: float = 0.0,
    trips: Collection[int] = (),
    after: Attempts | None = None,
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
        tripped = "own motion: axis x tripped" if runs in trips else ""
        return Measured(config, ANY, RECORDINGS, {}, tripped, repeats_within, errors=measured)

    def judge(before: Any, after: Any, _first: Any) -> dict[str, AxisJudgement]:
        judged = {}
        for name in found:
            old, new = before.errors[name], after.errors[name]
            against = () if new <= old * (1.0 + repeats_within) else (f"eF {old:g} -> {new:g}",)
            against += (f"tripped on {after.tripped}",) if after.tripped else ()
            judged[name] = AxisJudgement(name, not against, against, {}, (old, new))
        return judged

    written: dict[Path, Any] = {}
    scores = {
        name: SimpleNamespace(
            effects=[SimpleNamespace(name=e, score=-k) for k, e in enumerate(effects)], unknown=None
        )
        for name, effects in found.items()
    }
    start = Path("c.yaml")
    ones = dict.fromkeys(found, 1.0)
    before = Measured(start, ANY, RECORDINGS, {}, repeats_within=repeats_within, errors=ones)
    diagnosis: Any = SimpleNamespace(axes=scores)
    more = {} if after is None else {"after": after}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(attempts_module, "refine_config", refine_config)
        patch.setattr(attempts_module, "judge", judge)
        done = try_found(diagnosis, before, before, folder, run, **more)
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
    assert [a.accepted for a in done.tried] == [False, False, True, False]  # x once more, too
    assert left == {"x": 1.0, "y": 0.3}


def test_on_a_machine_what_a_first_run_that_is_spoilt_turned_down_is_run_once_more(
    tmp_path: Path,
) -> None:
    found = {"x": {"cogging": {"x": 0.3}}, "y": {"cogging": {"y": 0.3}}}

    def errors(gained: Mapping[str, Collection[str]], runs: int) -> Mapping[str, float]:
        return {"x": 9.0, "y": 1.0} if runs == 1 else errors_of(found)(gained, runs)

    done, left = tried(found, tmp_path, errors=errors, repeats_within=0.2)
    assert left == {"x": 0.3, "y": 0.3}
    assert not done.dropped


def test_what_tripped_is_not_run_again(tmp_path: Path) -> None:
    found = {"x": {"lag": {"x": 4.0}}, "y": {"cogging": {"y": 0.3}}}
    done, left = tried(found, tmp_path, repeats_within=0.2, trips=(2,))
    ran = [{n: axis.added for n, axis in a.refinement.axes.items()} for a in done.tried]
    assert done.tried[1].trial.tripped
    assert ran.count(ran[1]) == 1
    assert left == {"x": 1.0, "y": 1.0}


def test_small_steps_that_each_count_as_equal_do_not_add_up(tmp_path: Path) -> None:
    found: Additions = {n: {"lag": {n: 0.5, "z": 1.2}} for n in "xyw"} | {"z": {}}
    done, errors = tried(found, tmp_path, repeats_within=0.2)
    assert errors["z"] <= 1.2
    assert kept_of(done)["x"] == ("lag",)  # one of them is worth it
    assert "since the round began, eF 1 -> 1.44" in done.dropped["y"][0]
    assert all(judgement.accepted for judgement in done.shares.values())


def needing(gained: Mapping[str, Collection[str]], _runs: int) -> Mapping[str, float]:
    """Return errors where y's addition does good beside cogging of x alone."""
    x = math.prod({"cogging": 0.5, "lag": 4.0}[name] for name in gained["x"])
    y = {"y": 0.3 if "cogging" in gained["x"] else 1.5} if gained["y"] else {"y": 1.0}
    return {"x": x, **y, **({"z": 2.0 if gained["z"] else 1.0} if "z" in gained else {})}


@pytest.mark.parametrize("beside", [{}, {"z": {"stribeck": {}}}])
def test_what_does_well_beside_another_axis_is_kept_with_what_that_axis_keeps(
    tmp_path: Path, beside: Additions
) -> None:
    found = {"x": {"cogging": {}, "lag": {}}, "y": {"cross_axis": {}}, **beside}
    done, errors = tried(found, tmp_path, errors=needing)
    kept = kept_of(done)
    assert (kept["x"], kept["y"]) == (("cogging",), ("cross_axis",))
    assert errors == {"x": 0.5, "y": 0.3, **dict.fromkeys(beside, 1.0)}
    assert dict(done.dropped).keys() == {"x", *beside}  # y was turned down, and came back


def test_what_failed_by_itself_is_tried_once_more_when_another_axis_is_kept(
    tmp_path: Path,
) -> None:
    def errors(gained: Mapping[str, Collection[str]], _runs: int) -> Mapping[str, float]:
        beside = "lag" in gained["x"]
        z = 2.0 if gained["z"] and gained["y"] and beside else 1.0
        y = {True: 0.3, False: 1.5}[beside] if gained["y"] else 1.0
        x = 0.5 if beside else 1.0
        return {"x": x * (3.0 if gained["z"] else 1.0), "y": y, "z": z}

    found: Additions = {"x": {"lag": {}}, "y": {"cross_axis": {}}, "z": {"drag": {}}}
    done, left = tried(found, tmp_path, errors=errors)
    assert kept_of(done) == {"x": ("lag",), "y": ("cross_axis",), "z": ()}
    assert left == {"x": 0.5, "y": 0.3, "z": 1.0}


def test_of_many_axes_the_one_that_harms_nobody_keeps_its_own(tmp_path: Path) -> None:
    found: Additions = {f"a{k}": {"lag": {f"a{k}": 2.0, "z": 2.0}} for k in range(5)}
    done, errors = tried({**found, "z": {"cogging": {"z": 0.5}}}, tmp_path)
    assert kept_of(done)["z"] == ("cogging",)
    assert errors["z"] == 0.5


def test_a_further_round_tries_what_there_was_no_attempt_left_for(tmp_path: Path) -> None:
    found: Additions = {
        "x": {"cogging": {"x": 0.5}, **{f"e{k}": {"x": 4.0, "y": 2.0} for k in range(7)}},
        "y": {f"e{k}": {"y": 2.0, "x": 2.0} for k in range(8)},
    }
    done, errors = tried(found, tmp_path)
    assert errors == {"x": 1.0, "y": 1.0}
    assert done.waiting
    more, errors = tried(found, tmp_path, after=done)
    assert errors == {"x": 0.5, "y": 1.0}
    assert kept_of(more)["x"] == ("cogging",)


def test_only_what_is_kept_holds_its_rows(tmp_path: Path) -> None:
    found = {"x": {"cogging": {"x": 0.5}, "lag": {"x": 4.0}}, "y": {"cogging": {"y": 0.3}}}
    done, _ = tried(found, tmp_path)
    assert [a.accepted for a in done.tried] == [False, True, True]
    assert [dict(a.trial.recordings) for a in done.tried] == [{}, {}, RECORDINGS]


def test_an_attempt_is_told_beside_what_was_before_the_round(tmp_path: Path) -> None:
    found = {"x": {"cogging": {"x": 0.5}, "lag": {"x": 4.0}}, "y": {"cogging": {"y": 0.3}}}
    done, _ = tried(found, tmp_path)
    first, good, last = done.tried
    assert (first.tried, first.beside) == (("x", "y"), None)
    assert (good.tried, good.beside) == (("y",), None)
    assert (last.tried, last.beside) == (("x",), good.trial.config)
    assert {n: j.model_error_v for n, j in last.judgements.items()} == {
        "x": (1.0, 0.5),
        "y": (1.0, 0.3),
    }
    words = "x with cogging (beside y with cogging, kept): no error became larger"
    assert attempt_words(last) == words


def test_what_there_is_no_attempt_left_for_is_told(tmp_path: Path) -> None:
    effects = {f"e{k}": {"x": 2.0, "y": 2.0} for k in range(8)}
    done, errors = tried({"x": effects, "y": effects, "z": effects}, tmp_path)
    assert len(done.tried) == 8
    assert errors == dict.fromkeys("xyz", 1.0)
    assert all(any("not tried" in why for why in done.dropped[axis]) for axis in "xyz")


def test_what_was_tried_only_with_others_is_not_said_to_be_untried(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(attempts_module, "ATTEMPTS_OF_TWO", 2)
    found: Additions = {n: {"lag": {n: 2.0}} for n in "xy"}
    done, _ = tried(found, tmp_path)
    assert done.dropped["y"] == (
        "lag: tried only together with the others (eF 1 -> 2); not apart, as a round makes 2 "
        "attempts",
    )


FACTORS = st.sampled_from([0.3, 0.8, 1.0, 1.1, 1.5, 4.0])


@given(
    effects=st.lists(st.sampled_from("xzwvu"), max_size=7),
    factors=st.data(),
    repeats_within=st.sampled_from([0.0, 0.2]),
)
@settings(max_examples=100, deadline=None)
def test_an_addition_that_harms_nobody_is_kept_whatever_others_add(
    tmp_path_factory: pytest.TempPathFactory,
    effects: list[str],
    factors: st.DataObject,
    repeats_within: float,
) -> None:
    axes = sorted({"x", "y", "z", *effects})
    found: dict[str, dict[str, dict[str, float]]] = {axis: {} for axis in axes}
    found["y"]["cogging"] = {"y": 0.5}
    for k, axis in enumerate(effects):
        found[axis][f"e{k}"] = {other: factors.draw(FACTORS) for other in axes}
    folder = tmp_path_factory.mktemp("round")
    done, errors = tried(found, folder, repeats_within=repeats_within)
    assert kept_of(done)["y"] == ("cogging",)
    assert max(errors.values()) <= 1.0 + repeats_within
