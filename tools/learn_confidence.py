"""Learn the weights of a name's confidence from what the benchmarks have written.

    motorctl bench machines --cases 2 --seed 701 --out machines.jsonl
    motorctl bench diagnosis --cases 8 --seed 940000 --out campaign.jsonl
    motorctl bench recordings --recordings recordings --out recordings.jsonl
    python tools/learn_confidence.py *.jsonl            # tells
    python tools/learn_confidence.py *.jsonl --write    # and writes the table

The score is logistic, held near zero by a ridge. How well it holds is told for each author of
machines with the weights that were learned on all the others; the table is learned on all.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from motorctl.identify.diagnose.verdict import confidence as shipped
from motorctl.identify.diagnose.verdict.evidence import features
from motorctl.model.catalog import built_in_effects
from motorctl_benchmarks.diagnosis.score import also_right, reliability
from motorctl_benchmarks.other_machines.truth import families_of, truth_of

Array = NDArray[np.float64]

TABLE = Path(shipped.__file__).with_name(shipped.WEIGHTS)
RIDGE = 0.3
"""Weight of the squared weights, of features scaled to unit spread: some names' worth of doubt."""
CAMPAIGN = "simulated gantry"
RECORDED = "real machines"
FOR, AGAINST = (0.0, None), (None, 0.0)
MAY_BE = {
    "lead": FOR,
    "strength": FOR,
    "unexplained": AGAINST,
    "over_noise": AGAINST,
    "unsteady": AGAINST,
}
"""Signs that a weight may have: what speaks for a name never makes it less sure."""


@dataclass(frozen=True)
class Name:
    """A name that was given or doubted, and whether it was right."""

    author: str
    """Of the machines."""
    figures: Mapping[str, float]
    right: bool
    right_family: bool
    alike: int
    """Effects that it cannot be told from."""


def names_of(path: Path) -> Iterator[Name]:
    """Yield every name that a benchmark's file tells of."""
    for line in path.read_text().splitlines():
        record = json.loads(line)
        author, right, family = _truth(record)
        answer = record["answer"]
        if answer is None:  # a recording that was refused
            continue
        given = [(n["name"], n["grounds"], n["indistinguishable_from"]) for n in answer["named"]]
        given += [(name, figures, ()) for name, figures in answer["doubted"].items()]
        for name, figures, alike in given:
            yield Name(author, figures, name in right, name in right | family, len(alike))


def _truth(record: Mapping[str, Any]) -> tuple[str, frozenset[str], frozenset[str]]:
    """Return the author of a machine, the right names, and those of their families."""
    if "generator" in record:
        kind = truth_of(record["kind"])
        return record["generator"], kind.names, kind.family
    effects = built_in_effects()
    if "axis" in record:
        author, right = RECORDED, frozenset(record["may_name"])
    else:
        truth = record["case"]["truth"]
        author, right = CAMPAIGN, frozenset(truth) | also_right(truth)
    families = families_of(right)
    return author, right, frozenset(n for n, e in effects.items() if e.family() in families)


def learned(names: Sequence[Name], of_family: bool) -> dict[str, float]:
    """Return the intercept and the weight of each feature."""
    every = [features(name.figures, of_family) for name in names]
    keys = list(every[0])
    X = np.array([[row[key] for key in keys] for row in every])
    right = np.array([n.right_family if of_family else n.right for n in names], dtype=np.float64)
    middle, spread = X.mean(axis=0), np.maximum(X.std(axis=0), 1e-9)
    Z = np.column_stack([np.ones(len(X)), (X - middle) / spread])

    def cost(w: Array) -> tuple[float, Array]:
        score = Z @ w
        loss = float(np.sum(np.logaddexp(0.0, score) - right * score))
        held = np.append(0.0, w[1:])
        return loss + RIDGE * float(held @ held), Z.T @ (expit(score) - right) + 2.0 * RIDGE * held

    bounds = [(None, None), *(MAY_BE[key] for key in keys)]
    w = minimize(cost, np.zeros(Z.shape[1]), jac=True, method="L-BFGS-B", bounds=bounds).x
    weights = w[1:] / spread
    return {"intercept": float(w[0] - weights @ middle)} | dict(
        zip(keys, map(float, weights), strict=True)
    )


def sure(names: Sequence[Name], weights: Mapping[str, float], of_family: bool) -> list[float]:
    """Return the confidence of each name, by the formula that is shipped."""
    return [
        shipped.sure_by(weights, features(name.figures, of_family), name.alike) for name in names
    ]


def main() -> int:
    """Learn, tell, and write the table where asked to."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--write", action="store_true", help="write the table that is shipped")
    asked = parser.parse_args()
    names = [name for path in asked.files for name in names_of(path)]
    authors = sorted({name.author for name in names})
    table: dict[str, Any] = {
        "learned_on": {author: sum(n.author == author for n in names) for author in authors},
        "left_out_calibration_error": {},
        "weights": {},
    }
    for what, of_family in (("name", False), ("family", True)):
        given: list[float] = []
        right: list[bool] = []
        for author in authors:
            apart = [n for n in names if n.author == author]
            weights = learned([n for n in names if n.author != author], of_family)
            stated = sure(apart, weights, of_family)
            hits = [n.right_family if of_family else n.right for n in apart]
            print(f"{what}, {author} left out: error {reliability(stated, hits)[1]:.3f}")
            given += stated
            right += hits
        bins, error = reliability(given, right)
        print(f"{what}, each author left out in turn: error {error:.3f}")
        for b in bins:
            print(
                f"  {b.low:.2f} to {b.high:.2f}: {b.count:4d} names, {b.mean_confidence:.2f} "
                f"stated, {b.share_right:.2f} right"
            )
        table["left_out_calibration_error"][what] = round(error, 4)
        weights = learned(names, of_family)
        table["weights"][what] = {key: round(value, 4) for key, value in weights.items()}
    if asked.write:
        TABLE.write_text(json.dumps(table, indent=2) + "\n")
        print(f"written: {TABLE}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
