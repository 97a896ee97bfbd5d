"""A log as MCAP, read back by MCAP's own library: rows, times, and a schema that tells of them."""

from __future__ import annotations

import json
import sys
import tracemalloc
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from mcap.reader import NonSeekingReader, make_reader
from recorded_rows import AXES, make_rows, write_log

from motorctl.errors import DataError, UsageError
from motorctl.log import export_mcap
from motorctl.log.export import export
from motorctl.log.sample import FaultCause

METADATA = {"rate_hz": 1000.0, "machine": "bench"}


def exported(path: Path, **options: Any) -> Path:
    return export([path], "mcap", None, lambda share: None, **options)


def topics(path: Path) -> dict[str, tuple[Any, list[tuple[int, dict[str, Any]]]]]:
    """Return each topic's schema and its messages with their times [ns]."""
    found: dict[str, tuple[Any, list[tuple[int, dict[str, Any]]]]] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            told = found.setdefault(channel.topic, (json.loads(schema.data), []))
            told[1].append((message.log_time, json.loads(message.data)))
    return found


def test_every_row_comes_back_with_its_time_and_as_its_schema_says(tmp_path: Path) -> None:
    rows = make_rows(5100)  # more than one batch
    rows[1]["fault"][5000:, 1] = FaultCause.FOLLOWING_ERROR
    path = write_log(tmp_path / "run.parquet", rows, METADATA)
    told = topics(exported(path))
    assert set(told) == {"/loop", "/x", "/y"}
    table = pq.read_table(path)
    for topic, (schema, messages) in told.items():
        assert [t for t, _ in messages] == (np.arange(5100) * 1_000_000).tolist()
        assert schema["type"] == "object"
        validator = jsonschema.Draft202012Validator(schema)
        for _, message in messages[:: len(messages) // 10]:
            validator.validate(message)
            assert message.keys() == schema["properties"].keys()
        prefix = "" if topic == "/loop" else f"{topic[1:]}."
        columns = [name for name in table.column_names if name.rpartition(".")[0] == prefix[:-1]]
        assert len(columns) > 5
        for name in columns:
            signal = name.removeprefix(prefix)
            assert [message[signal] for _, message in messages] == table[name].to_pylist()
    _, x = told["/x"]
    schema, y = told["/y"]
    assert schema["properties"]["position_m"] == {
        "type": "number",
        "description": "measured position [m]",
    }
    assert schema["properties"]["state"]["type"] == "integer"
    assert (x[0][1]["state_name"], x[-1][1]["fault_name"]) == ("running", "none")
    assert (y[4999][1]["fault_name"], y[5000][1]["fault_name"]) == ("none", "following_error")


def test_the_log_s_metadata_go_along(tmp_path: Path) -> None:
    path = write_log(tmp_path / "run.parquet", make_rows(10), METADATA)
    with exported(path).open("rb") as file:
        (told,) = list(make_reader(file).iter_metadata())
    assert told.name == "motorctl"
    assert json.loads(told.metadata["json"])["machine"] == "bench"


def test_what_is_no_finite_number_is_left_out(tmp_path: Path) -> None:
    rows = make_rows(10)
    rows[1]["d0_hat_v"][4, 0] = np.nan
    rows[1]["command_v"][5, 0] = np.inf
    path = write_log(tmp_path / "run.parquet", rows, METADATA)
    _, messages = topics(exported(path))["/x"]
    assert [i for i, (_, m) in enumerate(messages) if "d0_hat_v" not in m] == [4]
    assert [i for i, (_, m) in enumerate(messages) if "command_v" not in m] == [5]


def test_it_tells_how_far_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(export_mcap, "BATCH_ROWS", 100)
    shares: list[float] = []
    path = write_log(tmp_path / "run.parquet", make_rows(1000), METADATA)
    export([path], "mcap", None, shares.append)
    assert shares == pytest.approx(np.arange(1, 11) / 10)
    with path.with_suffix(".mcap").open("rb") as file:  # a stream, too, without its index
        assert sum(1 for _ in NonSeekingReader(file).iter_messages()) == 3 * 1000


@pytest.mark.slow
def test_a_log_that_is_longer_takes_no_more_memory(tmp_path: Path) -> None:
    peaks = []
    for rows in (5_000, 12_500):
        path = write_log(tmp_path / f"{rows}.parquet", make_rows(rows), METADATA)
        tracemalloc.start()
        exported(path)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.3 * peaks[0]


def test_what_is_there_is_kept_unless_force_says_otherwise(tmp_path: Path) -> None:
    path = write_log(tmp_path / "run.parquet", make_rows(10), METADATA)
    exported(path)
    with pytest.raises(UsageError, match="is there already; --force replaces it"):
        exported(path)
    assert exported(path, replace=True) == tmp_path / "run.mcap"


@pytest.mark.parametrize(
    ("bad", "told"), [(-0.5, "-0.5 s"), (np.nan, "nan s"), (1e10, r"1e\+10 s")]
)
def test_a_time_that_mcap_cannot_have_is_refused_and_nothing_is_left(
    tmp_path: Path, bad: float, told: str
) -> None:
    rows = make_rows(10)
    rows[0]["time_s"][3] = bad
    path = write_log(tmp_path / "run.parquet", rows, METADATA, AXES)
    with pytest.raises(DataError, match=rf"row 4 has the time {told}; MCAP counts nanoseconds"):
        exported(path)
    assert [p.name for p in tmp_path.iterdir()] == ["run.parquet"]


def test_a_file_that_is_no_log_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "foreign.parquet"
    pq.write_table(pa.table({"t": [0.0], "name": ["a"]}), path)
    with pytest.raises(DataError, match="has no column 'time_s'"):
        exported(path)
    pq.write_table(pa.table({"time_s": [0.0], "name": ["a"]}), path)
    with pytest.raises(DataError, match="column 'name' holds string, not numbers"):
        exported(path)


def test_without_its_extra_it_says_how_to_install_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mcap", None)
    with pytest.raises(UsageError, match=r"needs mcap, .*: pip install 'motorctl\[mcap\]'"):
        exported(tmp_path / "none.parquet")


@pytest.mark.parametrize("key", ["states", "faults"])
@pytest.mark.parametrize("names", [["off", "idle"], {"zero": "off"}, "off"])
def test_names_that_are_no_table_are_refused_with_the_key(
    tmp_path: Path, key: str, names: Any
) -> None:
    path = write_log(tmp_path / "run.parquet", make_rows(10), METADATA)
    table = pq.read_table(path)
    metadata = json.loads(table.schema.metadata[b"motorctl"]) | {key: names}
    told = {**table.schema.metadata, b"motorctl": json.dumps(metadata).encode()}
    pq.write_table(table.replace_schema_metadata(told), path)
    with pytest.raises(DataError, match=f"its metadata's '{key}' is .*off.*--to csv"):
        exported(path)
    assert [file.name for file in tmp_path.iterdir()] == ["run.parquet"]
