"""What a running machine says of an axis is shown in that axis' units."""

from __future__ import annotations

from typing import Any

import pytest

from motorctl.api.status import AxisStatus, MachineStatus

AXIS: dict[str, Any] = {
    "state": "running", "homed": True, "position_m": 0.5, "velocity_m_s": 0.004,
    "reference_m": 0.5, "following_error_m": 1e-6, "command_v": 0.1, "travel_m": [-1.0, 1.0],
    "max_voltage_v": 10.0, "fault": None, "theta_hat": {},
}  # fmt: skip


@pytest.mark.parametrize(
    ("unit", "shown"),
    [("m", ["500.0000 mm", "4.00 mm/s", "1.00 µm"]),
     ("rad", ["0.500000 rad", "0.0040 rad/s", "1.00 µrad"])],
)  # fmt: skip
def test_a_slow_axis_is_not_shown_at_rest(unit: str, shown: list[str]) -> None:
    axis = AxisStatus.of("c", AXIS | {"position_unit": unit})
    html = MachineStatus("bench", 1000.0, {"c": axis}, None, {})._repr_html_()
    for words in shown:
        assert f"<td>{words}</td>" in html
