"""From words to numbers: what a person told of each axis, as options or as answers."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import yaml

from motorctl.axis_units import AxisUnits, units_of
from motorctl.config.axis_keys import HomingMethod
from motorctl.errors import UsageError
from motorctl.hal import FoundAxis, driver_class
from motorctl.init import quantities as q
from motorctl.init.channels import number_channels, second_channel
from motorctl.init.known import (
    AxisKnown,
    MachineKnown,
    SecondEnd,
    driver_key,
    force_of_torque,
    mass_of_rotor,
)
from motorctl.init.questions import (
    AMPLIFIER,
    HOME,
    HOMING,
    KIND,
    MOTORS,
    OF_LINEAR,
    OF_ROTARY,
    ONLY_LINEAR,
    ONLY_ROTARY,
    SCREW,
    SECOND_CHANNEL,
    SKEW_LIMIT,
    SQUARE_OFFSET,
    Asked,
    Question,
)
from motorctl.located_yaml import CoreLoader

AXIS_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,31}")
USUAL_NAMES = ("x", "y", "z")
IN_NEWTONS = (
    *(asked.option for own in (OF_LINEAR, OF_ROTARY) for asked in (own.mass, own.force)),
    *(AMPLIFIER.option, "rotor-inertia", "friction"),
)
"""What counts only where both mass and force constant are told: an inertia in V s^2/m, as devices
tell it, says nothing of newtons and kilograms."""


@dataclass
class AxisTold:
    """Words of one axis, by the option that they belong to; `found` is what its device told."""

    name: str
    driver: str
    channel: int
    second_channel: int | None = None
    """Where it has two motors."""
    words: dict[str, str] = field(default_factory=dict)
    found: FoundAxis | None = None

    def take(self, found: FoundAxis) -> None:
        """Take what the device told. Raises UsageError where words beside it would not be used."""
        self.found, self.channel = found, found.channel
        if self.is_dual:
            told_channel = self.words.get(SECOND_CHANNEL.option)
            self.second_channel = (
                found.channel + 1 if told_channel is None else second_channel(told_channel)
            )
        told = [f"--{option}" for option in IN_NEWTONS if option in self.words]
        both = self._has(self.asked.mass) and self._has(self.asked.force)
        if found.inertia_v_s2_m is not None and told and not both:
            raise UsageError(
                f"axis {self.name}: {', '.join(told)}: its device tells an inertia of "
                f"{found.inertia_v_s2_m:g} {self.units.words('V*s^2/m')}, and no newtons a volt: "
                f"give both --{self.asked.mass.option} and --{self.asked.force.option}, which then "
                f"go before it, or leave {', '.join(told)} out"
            )

    @property
    def units(self) -> AxisUnits:
        """Units of the axis: rotary where that, an inertia or a torque constant is told."""
        told = self.words.get(KIND.option)
        if told is None:
            told = "rotary" if any(option in self.words for option in ONLY_ROTARY) else "linear"
        return units_of(told)

    @property
    def asked(self) -> Asked:
        """What is asked of an axis of its kind."""
        return OF_ROTARY if self.units.kind == "rotary" else OF_LINEAR

    @property
    def kind_is_open(self) -> bool:
        """Whether nothing that was told so far says if it is linear or rotary."""
        return not self.words.keys() - {HOME.option} and self.found is None

    @property
    def is_dual(self) -> bool:
        """Whether two motors drive its beam. Raises UsageError where that makes no sense."""
        told = self.words.get(MOTORS.option, "1")
        if told not in ("1", "2"):
            raise UsageError(f"--motors {told}: should be 1, or 2 for a beam driven at both ends")
        beside = [
            f"--{each.option}"
            for each in (SECOND_CHANNEL, SKEW_LIMIT, SQUARE_OFFSET)
            if each.option in self.words
        ]
        if told == "1" and beside:
            raise UsageError(
                f"axis {self.name} has one motor, and {', '.join(beside)} would be of a beam with "
                "two: --motors 2 (AXIS=VALUE tells one axis alone)"
            )
        if told == "1":
            return False
        self.insist_on_kind()
        if self.units.kind == "rotary":
            raise UsageError(
                f"axis {self.name} is rotary, and --motors 2 is of a beam that two motors move in "
                "metres"
            )
        return True

    def insist_on_kind(self) -> None:
        """Raise UsageError where words are of an axis of the other kind."""
        kind = self.words.get(KIND.option, "linear")
        if kind not in ("linear", "rotary"):
            raise UsageError(f"--kind {kind}: should be linear or rotary")
        others = ONLY_LINEAR if self.units.kind == "rotary" else ONLY_ROTARY
        wrong = [f"--{option}" for option in others if option in self.words]
        if wrong:
            own = self.asked
            raise UsageError(
                f"axis {self.name} is {self.units.kind} by --"
                f"{' or --'.join(o for o in (KIND.option, *ONLY_ROTARY) if o in self.words)}, and "
                f"{', '.join(wrong)} would be of the other kind: it has --{own.mass.option} and "
                f"--{own.force.option} (AXIS=VALUE tells one axis alone)"
            )

    def missing(self) -> list[Question]:
        """Return what has still to be known, in the order in which people are asked."""
        self.insist_on_kind()
        found, own = self.found or FoundAxis(self.channel), self.asked
        needed: list[tuple[Question, object]] = [
            (own.encoder, found.resolution_m),
            (own.mass, found.inertia_v_s2_m),
            (own.force, found.inertia_v_s2_m),
            (own.travel, found.travel_m),
            (own.velocity, None),
        ]
        if self.is_dual:
            needed.append((SKEW_LIMIT, None))
        if not driver_class(self.driver).simulated:
            needed.append((HOME, found.homing))  # a wrong zero makes soft limits worthless
        missing = [asked for asked, known in needed if known is None and not self._has(asked)]
        force = self.words.get(own.force.option, "")
        encoder = self.words.get(own.encoder.option, "")
        turns = re.search(r"/\s*(turn|rev)", encoder) or re.match(r".*\d\s*N\*?m", force)
        if turns and not self._has(SCREW) and own is OF_LINEAR:
            missing.insert(0, SCREW)  # beside the answer that needs it
        if force.rstrip().endswith("/A") and not self._has(AMPLIFIER):
            missing.insert(0, AMPLIFIER)
        return missing

    def _has(self, question: Question) -> bool:
        return question.option in self.words

    def read(self, question: Question) -> None:
        """Refuse words that make no sense for a question; others may still be missing."""
        words, own = self.words[question.option], self.asked
        option = f"--{question.option}"
        turn = self._turn()
        if question is KIND:
            self._read_kind()
        elif question is own.encoder and "/" in words and turn is None:
            q.resolution(option, words, 1.0)
        elif question is own.encoder:
            q.resolution(option, words, turn, own.count)
        elif question is own.travel:
            q.travel(option, words, own.position)
        elif question is HOME:
            _homing(words)
        elif question is MOTORS:
            self._read_motors()
        elif question is SECOND_CHANNEL:
            second_channel(words)
        elif question is SKEW_LIMIT:
            q.positive(option, words, q.LENGTH)
        elif question is SQUARE_OFFSET:
            q.quantity(option, words, q.LENGTH)
        elif question in own.kinds:
            q.positive(option, words, own.kinds[question])

    def _read_kind(self) -> None:
        try:
            self.insist_on_kind()
        except UsageError:
            self.words.pop(KIND.option)
            raise

    def _read_motors(self) -> None:
        try:
            _ = self.is_dual  # it refuses what makes no sense
        except UsageError:
            self.words.pop(MOTORS.option)
            raise

    def _turn(self) -> float | None:
        """Return the way of one turn: of a rotary axis, or of a screw where that was told."""
        if self.units.kind == "rotary":
            return 2.0 * math.pi
        return self._positive(SCREW, q.LENGTH)

    def _positive(self, question: Question, kind: q.Kind) -> float | None:
        words = self.words.get(question.option)
        return None if words is None else q.positive(f"--{question.option}", words, kind)

    def known(self) -> AxisKnown:
        """Return the axis in numbers. Raises UsageError where words make no sense."""
        found, own = self.found or FoundAxis(self.channel), self.asked
        said: list[str] = []
        turn = self._turn()
        resolution = found.resolution_m
        if own.encoder.option in self.words:
            words = self.words[own.encoder.option]
            resolution = q.resolution("--encoder", words, turn, own.count)
            if turn is not None and "/" in words:
                way = f"{turn:.6g} {self.units.position}"
                said.append(f"a count is {way} a turn / {words.partition('/')[0].strip()}")
        force, mass, inertia_said = self._force_and_mass(found, turn, said)
        travel = found.travel_m
        if own.travel.option in self.words:
            travel = q.travel("--travel", self.words[own.travel.option], own.position)
        homing = _homing(self.words.get(HOME.option) or found.homing or "absolute")
        home = found.home_position_m
        if "home-position" in self.words:
            home, _ = q.quantity("--home-position", self.words["home-position"], own.position)
        velocity = self._positive(own.velocity, own.speed)
        assert resolution is not None  # what is missing was asked for
        assert travel is not None
        assert velocity is not None
        low, high = (float(f"{end:.10g}") for end in travel)
        return AxisKnown(
            name=self.name,
            driver=self.driver,
            channel=self.channel,
            resolution_m=float(f"{resolution:.10g}"),
            mass_kg=mass,
            force_constant_n_v=force,
            travel_m=(low, high),
            max_velocity_m_s=float(f"{velocity:.10g}"),
            max_acceleration_m_s2=self._optional("max-acceleration", own.acceleration),
            max_voltage_v=self._optional("max-voltage", q.VOLTAGE) or found.max_voltage_v or 10.0,
            counter_bits=self._bits() or found.counter_bits or 32,
            friction_n=self._optional("friction", own.friction),
            homing=homing,
            home_position_m=home,
            inertia_said=inertia_said,
            said=tuple(said),
            units=self.units,
            second=self._second(homing),
        )

    def _second(self, homing: HomingMethod) -> SecondEnd | None:
        if not self.is_dual:
            return None
        offset = self.words.get(SQUARE_OFFSET.option)
        if offset is not None and homing == "absolute":
            raise UsageError(
                f"--square-offset {offset}: axis {self.name} is homed by no switch or mark: with "
                "absolute encoders a beam is square where both positions agree"
            )
        assert self.second_channel is not None  # channels were numbered
        return SecondEnd(
            self.second_channel,
            q.positive("--skew-limit", self.words[SKEW_LIMIT.option], q.LENGTH),
            None if offset is None else q.quantity("--square-offset", offset, q.LENGTH)[0],
        )

    def _optional(self, option: str, kind: q.Kind) -> float | None:
        words = self.words.get(option)
        return None if words is None else q.positive(f"--{option}", words, kind)

    def _bits(self) -> int | None:
        words = self.words.get("counter-bits")
        if words is None:
            return None
        if not words.isdecimal() or not 8 <= int(words) <= 64:
            raise UsageError(f"--counter-bits {words}: should be a whole number, 8 to 64")
        return int(words)

    def _force_and_mass(
        self, found: FoundAxis, pitch: float | None, said: list[str]
    ) -> tuple[float, float, str | None]:
        """Return newtons a volt, kilograms, and where their ratio comes from if not from them."""
        own = self.asked
        if not (self._has(own.force) and self._has(own.mass)):
            assert found.inertia_v_s2_m is not None  # what is missing was asked for
            return 1.0, found.inertia_v_s2_m, "as the device tells"
        option, words = f"--{own.force.option}", self.words[own.force.option]
        force, unit = q.quantity(option, words, own.constant)
        if not force > 0.0:
            raise UsageError(f"{option} {words}: should be above 0, as in {own.constant.example}")
        if unit.startswith("N*m") and own is OF_LINEAR:
            if pitch is None:
                raise UsageError(
                    f"{option} {words}: a torque needs the travel a turn, as in --screw-pitch 5mm"
                )
            force = force_of_torque(force, pitch)
            said.append(f"force constant: {words} x 2 pi / {pitch:g} m = {force:.4g} N/{unit[-1]}")
        if unit.endswith("/A"):
            gain = self._positive(AMPLIFIER, q.CURRENT_GAIN)
            if gain is None:
                raise UsageError(
                    f"{option} {words}: the command is in volts, so amperes a volt of the "
                    "amplifier are needed, as in --amplifier 2A/V"
                )
            force *= gain
            said.append(f"the amplifier gives {gain:g} A/V: {force:.4g} {self.units.force}/V")
        if self.is_dual:
            said.append(f"two motors of {force:.4g} N/V: {2.0 * force:.4g} N/V")
            force *= 2.0
        mass = q.positive(f"--{own.mass.option}", self.words[own.mass.option], own.inertia)
        rotor = self._optional("rotor-inertia", q.ROTARY_INERTIA)
        if rotor is not None:
            if pitch is None:
                raise UsageError("--rotor-inertia needs the travel a turn, as in --screw-pitch 5mm")
            turning = mass_of_rotor(rotor, pitch)
            said.append(
                f"mass: {mass:g} kg and {turning:.4g} kg, as which {rotor:g} kg*m^2 on the screw "
                "resist"
            )
            mass += turning
        return force, mass, None


def _homing(words: str) -> HomingMethod:
    for method in HOMING:
        if words == method:
            return method
    raise UsageError(f"--homing {words}: should be one of {', '.join(HOMING)}")


def axes_told(
    names: Sequence[str], drivers: Sequence[str], words: Mapping[str, Iterable[str]]
) -> list[AxisTold]:
    """Return the axes with the words of each.

    Parameters
    ----------
    names
        The axes, in their order.
    drivers
        ``TYPE`` for all axes, or ``AXIS=TYPE`` for one.
    words
        By option: ``VALUE`` for all axes, or ``AXIS=VALUE`` for one.

    Raises
    ------
    UsageError
        Where a name is none, or is told twice.
    """
    for name in names:
        if not AXIS_NAME.fullmatch(name):
            raise UsageError(f"--axis {name}: should be a letter, then letters, digits and _")
    if len(set(names)) < len(names):
        raise UsageError(f"--axis: {', '.join(names)}: each name may be there once")
    types = _by_axis("driver", drivers, names)
    axes, numbers = [], dict.fromkeys(types.values(), 0)
    by_key: dict[str, str] = {}
    for driver in numbers:
        if (other := by_key.setdefault(driver_key(driver), driver)) != driver:
            raise UsageError(
                f"--driver {driver}: would be called {driver_key(driver)}, as {other} is: name one "
                "of them, and add the other to the file"
            )
    for name in names:
        driver = types[name]
        axes.append(AxisTold(name, driver, numbers[driver]))
        numbers[driver] += 1
    for option, given in words.items():
        for name, value in _by_axis(option, given, names).items():
            next(axis for axis in axes if axis.name == name).words[option] = value
    number_channels(axes)
    return axes


def _by_axis(option: str, given: Iterable[str], names: Sequence[str]) -> dict[str, str]:
    """Return the value of each axis that has one: what is told of one axis goes before."""
    common: dict[str, str] = {}
    own: dict[str, str] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals:
            common |= dict.fromkeys(names, text)
        elif name in names:
            own[name] = value
        else:
            raise UsageError(f"--{option} {text}: there is no axis '{name}'; {', '.join(names)}")
    return common | own


def driver_options(given: Iterable[str], drivers: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Return options of drivers by their types, from ``NAME.KEY=VALUE`` with dots in the key.

    NAME is the driver's in the configuration, as `driver_key` has it.

    Raises UsageError where one is told of no driver of the machine.
    """
    known = {driver_key(driver): driver for driver in drivers}
    options: dict[str, dict[str, Any]] = {}
    for text in given:
        path, equals, value = text.partition("=")
        driver, *keys = path.split(".")
        if not equals or not keys or driver not in known:
            raise UsageError(
                f"--driver-option {text}: should be DRIVER.KEY=VALUE, as in "
                f"{next(iter(known))}.channel=can1; drivers: {', '.join(known)}"
            )
        part: dict[Any, Any] = options.setdefault(known[driver], {})
        for key in keys[:-1]:
            part = part.setdefault(int(key) if key.isdecimal() else key, {})
        try:
            part[keys[-1]] = yaml.load(value, CoreLoader)
        except yaml.YAMLError as error:
            raise UsageError(f"--driver-option {text}: the value is no YAML") from error
    return options


def machine_told(
    name: str,
    axes: Sequence[AxisTold],
    rate: str | None,
    options: Mapping[str, Mapping[str, Any]],
    found: Mapping[str, Mapping[str, Any]],
) -> MachineKnown:
    """Return the machine in numbers. Raises UsageError where words make no sense."""
    rate_hz = None if rate is None else q.positive("--rate", rate, q.FREQUENCY)
    known = tuple(axis.known() for axis in axes)
    return replace(MachineKnown(name, known, rate_hz, driver_options=options), found_options=found)
