"""Numbers of a document as JSON can hold them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from motorctl.json_values import finite, plain


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -np.inf, np.float64("nan"), None])
def test_what_is_no_finite_number_becomes_none(value: float | None) -> None:
    assert finite(value) is None


def test_a_numpy_number_becomes_one_of_python() -> None:
    assert type(finite(np.float32(0.5))) is float


def test_json_takes_a_document_of_arrays_and_infinities() -> None:
    document = {
        "rows": np.array([1.0, np.nan]),
        "limits": (np.inf, {"deep": [np.float32(0.5), -np.inf]}),
        "count": np.int64(3),
        "on": True,
        "name": "x",
        7: None,
    }
    assert json.loads(json.dumps(plain(document), allow_nan=False)) == {
        "rows": [1.0, None],
        "limits": [None, {"deep": [0.5, None]}],
        "count": 3,
        "on": True,
        "name": "x",
        "7": None,
    }
