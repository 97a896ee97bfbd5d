"""The example notebook runs from its first cell to its last, in a kernel of Jupyter."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).parents[2] / "examples" / "motorctl.ipynb"
RUN = """
import sys, nbformat
from nbclient import NotebookClient
notebook = nbformat.read(sys.argv[1], as_version=4)
NotebookClient(notebook, timeout=240, resources={"metadata": {"path": "."}}).execute()
nbformat.write(notebook, "executed.ipynb")
"""


def shown(notebook: Path) -> str:
    """Return everything that the cells of an executed notebook show."""
    document = json.loads(notebook.read_text())
    assert document["cells"]
    outputs = [part for cell in document["cells"] for part in cell.get("outputs", ())]
    assert not [part for part in outputs if part["output_type"] == "error"]
    return json.dumps(outputs)


def test_the_notebook_is_kept_with_what_it_showed() -> None:
    assert "The model lacks cogging" in shown(NOTEBOOK)
    assert NOTEBOOK.stat().st_size < 500_000


@pytest.mark.slow
def test_the_notebook_runs_and_finds_what_the_model_lacks(tmp_path: Path) -> None:
    command = [sys.executable, "-c", RUN, str(NOTEBOOK)]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=280, check=False
    )
    assert done.returncode == 0, done.stderr
    told = shown(tmp_path / "executed.ipynb")
    assert "The model lacks cogging" in told
    assert "before / after" in told
    assert told.count("image/png") == 2
