"""The line for cron that docs/fleet.md shows does what it says, also beside a bad log."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TEXT = (Path(__file__).parents[2] / "docs" / "fleet.md").read_text()


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_line_for_cron_leaves_findings_and_a_page(good_log: Path, tmp_path: Path) -> None:
    found = re.search(r"^30 2 \* \* \*  (motorctl .+)$", TEXT, re.MULTILINE)
    assert found
    line = found[1].replace("/srv/", f"{tmp_path}/")
    logs = tmp_path / "logs" / "stage-1"
    logs.mkdir(parents=True)
    shutil.copy(good_log, logs)
    (logs / "torn.parquet").write_bytes(good_log.read_bytes()[:2000])
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    for _ in range(2):  # the next night
        done = subprocess.run(
            ["/bin/sh", "-c", line],
            env={**os.environ, "PATH": path},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        assert "torn.parquet" in done.stderr
    assert "0 were looked at" in done.stdout
    page = (tmp_path / "fleet.html").read_text()
    assert "stage-1" in page
    assert "torn.parquet" in page
