"""The weights of a confidence are learned from what the benchmarks write."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from learn_confidence import MAY_BE, Name, learned, names_of, sure

from motorctl.identify.diagnose.verdict.evidence import features
from motorctl_benchmarks.diagnosis.score import reliability


def figures(random: np.random.Generator) -> dict[str, float]:
    rival, stranger, unexplained = random.random(3)
    return {
        "gain": math.exp(random.uniform(0.0, 6.0)),
        "rival_share": rival,
        "stranger_share": stranger * rival,
        "unexplained": unexplained,
        "over_noise": math.exp(random.uniform(0.0, 1.6)),
        "reduction": math.exp(random.uniform(0.0, 2.0)),
        "unsteady": random.random(),
    }


def drawn(count: int, seed: int) -> list[Name]:
    """Draw names that are right by a known law of their figures."""
    random = np.random.default_rng(seed)
    names = []
    for _ in range(count):
        own = figures(random)
        score = -2.0 + 1.2 * math.log(own["gain"]) - 1.5 * math.log(own["over_noise"])
        right = bool(random.random() < 1.0 / (1.0 + math.exp(-score)))
        names.append(Name("drawn", own, right, right, 0))
    return names


def test_a_known_law_is_learned_and_holds_on_names_that_were_not_seen():
    weights = learned(drawn(3000, 1), of_family=False)
    assert weights["strength"] == pytest.approx(1.2, abs=0.15)
    assert weights["over_noise"] == pytest.approx(-1.5, abs=0.2)
    assert abs(weights["unexplained"]) < 0.4
    others = drawn(3000, 2)
    _, error = reliability(list(sure(others, weights, False)), [name.right for name in others])
    assert error < 0.03


@pytest.mark.parametrize("of_family", [False, True])
def test_no_weight_has_a_sign_against_reason(of_family):
    random = np.random.default_rng(3)
    names = [Name("any", figures(random), bool(random.random() < 0.5), True, 0) for _ in range(200)]
    weights = learned(names, of_family)
    assert set(weights) == {"intercept", *features(names[0].figures)} == {"intercept", *MAY_BE}
    for key, (low, high) in MAY_BE.items():
        assert low is None or weights[key] >= low
        assert high is None or weights[key] <= high


def test_names_are_read_with_their_truth_from_both_benchmarks(tmp_path):
    own = figures(np.random.default_rng(4))
    named = [{"name": "cogging", "grounds": own, "indistinguishable_from": ["position_force"]}]
    machine = {
        "generator": "energy",
        "kind": "cogging",
        "answer": {"named": named, "doubted": {"presliding": own}},
    }
    campaign = {"case": {"truth": {"stribeck": {}}}, "answer": {"named": named, "doubted": {}}}
    path = tmp_path / "told.jsonl"
    path.write_text("\n".join(json.dumps(record) for record in (machine, campaign)) + "\n")
    first, doubted, other = names_of(path)
    assert (first.author, first.right, first.right_family, first.alike) == ("energy", True, True, 1)
    assert (doubted.right, doubted.right_family) == (False, False)
    assert (other.author, other.right, other.right_family) == ("simulated gantry", False, False)
