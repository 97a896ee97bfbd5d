"""What a diagnosis is worth: the refined controller on a motion that no diagnosis has seen.

Four controllers of one law, with the same gains, follow it, and the true error is compared:

- *own*: the machine's configuration as it was recorded
- *declared*: its declared model at its best, with the plant's own parameters
- *refined*: what `motorctl refine` writes
- *oracle*: the machine without the effect, the declared model with the plant's own parameters

The machine is as its recording left it: a load that was put down stays there, a motor is warm.

Declared and oracle have the covariances and bounds of the refined one, so that adaptation is given
no other freedom. The error is the simulated plant's true position minus the reference.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import yaml

from motorctl.config import load_resolved
from motorctl.config.freeze import decode
from motorctl.identify.diagnose.result import RecordingDiagnosis
from motorctl.identify.refine.refinement import refine_config
from motorctl_benchmarks.diagnosis.cases import Case, as_left, on_other_motion, without_effects
from motorctl_benchmarks.diagnosis.configuration import CHANNELS, DRIVER
from motorctl_benchmarks.diagnosis.motions import DURATION_S
from motorctl_benchmarks.diagnosis.plants import Options
from motorctl_benchmarks.diagnosis.true_motion import true_error_rms_m

UNSEEN = 7_000_000
"""Added to a case's seed to draw the motion that its diagnosis has not seen."""

LEAST_EXCESS = 0.1
"""Parts of the oracle's error: an effect that adds less counts as adding so much."""

IN_THE_PLANT = {
    "inertia": "inertia_v_s2_m",
    "viscous_friction": "viscous_friction_v_s_m",
    "coulomb_friction": "coulomb_friction_v",
    "offset": "offset_v",
    "em_quadratic": "em_quadratic_1_v",
    "em_cubic": "em_cubic_1_v2",
}
"""The declared parameters by the names of the simulator's options."""


@dataclass(frozen=True)
class ClosedLoop:
    """True errors on the unseen motion, rms [m]."""

    own_m: float
    declared_m: float
    refined_m: float
    oracle_m: float
    added: tuple[str, ...]
    """Effects that the refined configuration has more."""

    @property
    def over_oracle(self) -> float:
        """The refined controller's error over the oracle's."""
        return self.refined_m / self.oracle_m

    @property
    def excess_left(self) -> float:
        """What is left of what the effect adds to the error."""
        excess = max(self.declared_m - self.oracle_m, LEAST_EXCESS * self.oracle_m)
        return (self.refined_m - self.oracle_m) / excess

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self) | {"over_oracle": self.over_oracle, "excess_left": self.excess_left}


def close_loop(
    case: Case,
    diagnosis: RecordingDiagnosis,
    folder: Path,
    *,
    duration_s: float = DURATION_S,
) -> ClosedLoop:
    """Refine the case's configuration by its diagnosis and drive the unseen motion.

    Parameters
    ----------
    case
        The machine with its effects.
    diagnosis
        Of the case's recording.
    folder
        Where the configurations are written.
    duration_s
        Length of each run [s].

    Raises
    ------
    ConfigError, UsageError
        No valid configuration results.
    RunError
        An axis trips.
    """
    written = folder / f"{case.name}.yaml"
    written.write_text(yaml.safe_dump(case.config, sort_keys=False))
    out = folder / f"{case.name}-refined.yaml"
    refinement = refine_config(diagnosis, written, out)
    refined: Options = decode(refinement.machine.resolved)["axes"][case.axis]
    unseen = on_other_motion(as_left(case, DURATION_S), case.seed + UNSEEN)
    clean = without_effects(unseen)
    best = refined | {"model": _true_model(refined["model"], case)}

    def error_m(config: Options, axis: Options) -> float:
        changed = config | {"axes": config["axes"] | {case.axis: axis}}
        machine = load_resolved(changed, case.name, hardware=True)
        return true_error_rms_m(machine, case.axis, duration_s)

    return ClosedLoop(
        own_m=error_m(unseen.config, unseen.config["axes"][case.axis]),
        declared_m=error_m(unseen.config, best),
        refined_m=error_m(unseen.config, refined),
        oracle_m=error_m(clean.config, best),
        added=refinement.axes[case.axis].added,
    )


def _true_model(refined: Mapping[str, Options], case: Case) -> dict[str, Options]:
    """Return the declared effects with the plant's parameters as initial values."""
    plant = case.config["drivers"][DRIVER]["plants"][str(CHANNELS[case.axis])]
    model = {}
    for name in case.config["axes"][case.axis]["model"]:
        truth = plant[IN_THE_PLANT[name]]
        low, high = refined[name]["bounds"]
        bounds = [min(low, truth), max(high, truth)]
        model[name] = refined[name] | {"initial": truth, "bounds": bounds}
    return model
