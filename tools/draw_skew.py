"""Draw the skew of the shipped beam with and without its skew loop: `docs/dual_drive.png`.

    python tools/draw_skew.py        # simulates both, draws, and prints the figures of the page

Without it both motors get the law's command, and the skew guard is set aside.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motorctl.config import load
from motorctl.config.load import load_resolved
from motorctl.config.machine import Machine
from motorctl.loop import VirtualMachine
from motorctl.picture_style import colour, draw_curve, panels_in_file

PICTURE = Path(__file__).parents[1] / "docs" / "dual_drive.png"
SETTLE_S, SHOWN_S = 1.0, 3.5
NEGLIGIBLE = 1e-9


def without_loop(machine: Machine) -> Machine:
    """Return the machine with a skew loop that does nothing, and a guard that lets it."""
    resolved = machine.resolved
    axes = resolved["axes"]
    assert isinstance(axes, dict)
    x = axes["x"]
    skew = x["dual_drive"]["skew"] | {"ks_v_s_m": NEGLIGIBLE, "gamma_d": 0.0}
    dual = x["dual_drive"] | {"skew": skew, "max_out_of_square_m": 0.01}
    guards = x["guards"] | {"skew": {"limit_m": 0.01, "reaction": "disable"}}
    changed = {**resolved, "axes": {"x": x | {"dual_drive": dual, "guards": guards}}}
    return load_resolved(changed, hardware=True)


def shuttle(machine: Machine) -> NDArray[np.void]:
    """Home the beam, let it settle, and return the rows of its program."""
    chunks: list[NDArray[np.void]] = []
    with VirtualMachine(machine, lambda _, samples: chunks.append(samples[:, 0])) as virtual:
        virtual.start()
        virtual.advance(round(SETTLE_S * machine.rate_hz))
        before = virtual.ticks
        virtual.follow_programs(["shuttle"])
        virtual.advance(round(SHOWN_S * machine.rate_hz))
        virtual.raise_faults()
    return np.concatenate(chunks)[before:]


def main() -> None:
    """Simulate, print and draw."""
    machine = load("dual_gantry")
    runs = {"without skew loop": without_loop(machine), "with skew loop": machine}
    with panels_in_file(3, PICTURE, height=1.7) as (_, panels):
        for k, (name, setup) in enumerate(runs.items()):
            rows = shuttle(setup)
            time_s = np.arange(len(rows)) / machine.rate_hz
            skew_um = 1e6 * rows["skew_m"]
            first_v = rows["command_v"] + rows["skew_command_v"]
            second_v = rows["command_v"] - rows["skew_command_v"]
            print(
                f"{name}: skew at most {np.abs(skew_um).max():.0f} um, "
                f"rms {np.sqrt(np.mean(skew_um**2)):.1f} um; "
                f"|u1| <= {np.abs(first_v).max():.2f} V, |u2| <= {np.abs(second_v).max():.2f} V; "
                f"following error at most {1e6 * np.abs(rows['following_error_m']).max():.1f} um"
            )
            draw_curve(panels[1], time_s, skew_um, colour(k), name)
        draw_curve(panels[0], time_s, 1e3 * rows["reference_m"], colour(2))
        draw_curve(panels[2], time_s, first_v, colour(3), "first motor")
        draw_curve(panels[2], time_s, second_v, colour(4), "second motor")
        for panel, label in zip(
            panels, ("reference, mm", "skew, µm", "command with\nskew loop, V"), strict=True
        ):
            panel.set_ylabel(label)
        panels[1].legend(loc="upper right")
        panels[2].set_ylim(-4.0, 6.0)
        panels[2].legend(loc="upper right", ncols=2)
        panels[2].set_xlabel("time, s")


if __name__ == "__main__":
    main()
