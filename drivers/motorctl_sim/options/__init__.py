"""Options of the simulated gantry: a preset, and what differs from it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

from pydantic import Field, model_validator

from motorctl.hal import DriverOptions
from motorctl_sim.options.beam import Beam
from motorctl_sim.options.faults import Fault
from motorctl_sim.options.plant import Plant
from motorctl_sim.options.presets import PRESETS, PresetName
from motorctl_sim.options.stability import check_beam, check_stability

__all__ = ["Beam", "Fault", "Plant", "SimOptions"]


class SimOptions(DriverOptions):
    """A preset, what differs from it on each channel, and faults to come.

    In YAML, one more effect on channel 0 of a preset is::

        plants:
          0: {stribeck: {force_v: 0.05, velocity_m_s: 0.005}}

    Tables are merged key by key; ``null`` or ``off`` takes an effect away. Channels beyond the
    preset's take its plants in turn.
    """

    preset: PresetName = "published_gantry"
    """The simulated machine that plants begin from."""
    seed: int = Field(default=1, ge=0, lt=2**63)
    """Of all noise; two runs with the same seed are the same, bit for bit."""
    substep_s: float = Field(default=20e-6, ge=10e-6, le=1e-3)
    """Longest step of the integration; a period is divided evenly into steps no longer."""
    plants: dict[int, Plant] = Field(default_factory=dict)
    """What differs from the preset, by channel; after validation whole plants."""
    beams: tuple[Beam, ...] = Field(default=(), max_length=8)
    """Beams, each between two channels."""
    faults: tuple[Fault, ...] = Field(default=(), max_length=32)
    """What breaks, and when."""

    @model_validator(mode="before")
    @classmethod
    def _merge_with_preset(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            return data
        preset = data.get("preset", "published_gantry")
        changes = data.get("plants")
        if isinstance(changes, list | tuple):
            changes = dict(enumerate(changes))
        if not isinstance(preset, str) or preset not in PRESETS:
            return {**data, "plants": {}}  # the unknown preset is the one problem to tell
        if not isinstance(changes, Mapping | None):
            return data
        plants: dict[Any, Any] = dict(enumerate(PRESETS[preset]))
        for key, change in (changes or {}).items():
            number = _channel_number(key)
            plants[number] = _changed(_preset_plant(preset, number), change)
        return {**data, "plants": plants}

    @model_validator(mode="after")
    def _integrates_stably(self) -> Self:
        for number, plant in self.plants.items():
            check_stability(f"plants.{number}", plant, self.substep_s)
            coupled = plant.cross_axis
            if coupled and coupled.channel == number:
                raise ValueError(f"plants.{number}.cross_axis.channel {number} is the axis itself")
        return self

    @model_validator(mode="after")
    def _beams_stand_alone(self) -> Self:
        taken: set[int] = set()
        for k, beam in enumerate(self.beams):
            if shared := taken & set(beam.channels):
                raise ValueError(f"beams.{k}.channels: {min(shared)} has a beam already")
            taken |= set(beam.channels)
            check_beam(
                f"beams.{k}", beam, [self.plant(end) for end in beam.channels], self.substep_s
            )
        return self

    def plant(self, channel: int) -> Plant:
        """Return the plant on a channel: as configured, else the preset's."""
        if channel in self.plants:
            return self.plants[channel]
        return Plant.model_validate(_preset_plant(self.preset, channel))


def _channel_number(key: Any) -> Any:
    # JSON has no integer keys; what is not a number is left for the schema to refuse
    return int(key) if isinstance(key, str) and key.isdecimal() else key


def _preset_plant(preset: str, number: Any) -> dict[str, Any]:
    plants = PRESETS[preset]
    return plants[number % len(plants) if isinstance(number, int) else 0]


def _changed(plant: dict[str, Any], change: Any) -> Any:
    if change is None:
        return plant
    if not isinstance(change, Mapping):
        return change
    # YAML 1.1 reads a bare `off` as false
    return _merged(plant, {key: None if v is False else v for key, v in change.items()})


def _merged(base: Mapping[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    result = dict(base)
    for key, value in change.items():
        before = result.get(key)
        if isinstance(value, Mapping) and isinstance(before, Mapping):
            result[key] = _merged(before, value)
        else:
            result[key] = value
    return result
