"""The line for cron that docs/fleet.md shows does what it says, also beside a bad log."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from fleet_logs import plant_log

TEXT = (Path(__file__).parents[2] / "docs" / "fleet.md").read_text()


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_line_for_cron_leaves_findings_and_a_page(tmp_path: Path) -> None:
    found = re.search(r"^30 2 \* \* \*  (motorctl .+)$", TEXT, re.MULTILINE)
    assert found
    line = found[1].replace("/srv/", f"{tmp_path}/")
    logs = tmp_path / "logs" / "stage-1"
    log = plant_log(logs / "stage-1.parquet", duration_s=2.5)
    (logs / "torn.parquet").write_bytes(log.read_bytes()[:2000])
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
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
    assert "1 were looked at" in done.stdout
    page = (tmp_path / "fleet.html").read_text()
    assert "stage-1" in page
    assert "torn.parquet" in page
