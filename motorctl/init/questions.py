"""What has to be known of an axis, by its kind: the words of each question, and what answers it."""

from __future__ import annotations

from dataclasses import dataclass

from motorctl.config.axis_keys import HomingMethod
from motorctl.init import quantities as q

HOMING: tuple[HomingMethod, ...] = ("absolute", "switch", "switch_index", "index")


@dataclass(frozen=True)
class Question:
    """Something that has to be known of an axis."""

    flag: str
    """The option as it is typed."""
    words: str
    """What is asked at a terminal."""
    example: str

    @property
    def option(self) -> str:
        """Without its dashes."""
        return self.flag.removeprefix("--")


@dataclass(frozen=True)
class Asked:
    """What is asked of an axis of one kind; a mass is what moves, a force what moves it."""

    encoder: Question
    mass: Question
    force: Question
    travel: Question
    velocity: Question
    position: q.Kind
    speed: q.Kind
    acceleration: q.Kind
    inertia: q.Kind
    constant: q.Kind
    """Of the force a volt."""
    friction: q.Kind
    count: q.Kind

    @property
    def kinds(self) -> dict[Question, q.Kind]:
        """What each answer is a quantity of."""
        return {
            SCREW: q.LENGTH,
            AMPLIFIER: q.CURRENT_GAIN,
            self.encoder: self.count,
            self.mass: self.inertia,
            self.force: self.constant,
            self.velocity: self.speed,
        }


KIND = Question("--kind", "linear, in metres, or rotary, in radians", "linear")
MOTORS = Question("--motors", "motors: 1, or 2 on one beam", "1")
SKEW_LIMIT = Question("--skew-limit", "how far the two ends may be apart", "1mm")
SECOND_CHANNEL = Question("--second-channel", "channel of the second motor and encoder", "1")
SQUARE_OFFSET = Question(
    "--square-offset",
    "how far the first end's switch or mark is ahead of the second's, with the beam square",
    "0.4mm",
)
SCREW = Question("--screw-pitch", "travel of one turn of the screw", "5mm")
AMPLIFIER = Question("--amplifier", "amperes that the amplifier gives a volt", "2A/V")
HOME = Question("--homing", f"how it finds its zero: {', '.join(HOMING)}", "absolute")
OF_LINEAR = Asked(
    Question("--encoder", "encoder: length of a count, or counts a turn", "0.5um, 10000/turn"),
    Question("--mass", "mass of all that moves", "12kg"),
    Question("--force-constant", "force a volt (or an ampere) of command", "30N/V, 45N/A"),
    Question("--travel", "travel between the soft limits", "-0.2..0.3"),
    Question("--max-velocity", "top speed", "0.5m/s"),
    q.LENGTH, q.VELOCITY, q.ACCELERATION, q.MASS, q.FORCE_CONSTANT, q.FORCE, q.RESOLUTION,
)  # fmt: skip
OF_ROTARY = Asked(
    Question("--encoder", "encoder: counts a turn, or angle of a count", "1000000/turn, 5urad"),
    Question("--inertia", "inertia of all that turns", "0.02kg*m^2"),
    Question("--torque-constant", "torque a volt (or an ampere) of command", "0.8N*m/V, 1.5N*m/A"),
    Question("--travel", "travel between the soft limits", "-90..90deg"),
    Question("--max-velocity", "top speed", "2rad/s, 60rpm"),
    q.ANGLE, q.ANGULAR_VELOCITY, q.ANGULAR_ACCELERATION, q.ROTARY_INERTIA, q.TORQUE_CONSTANT,
    q.TORQUE, q.ANGLE_A_COUNT,
)  # fmt: skip
ONLY_LINEAR = (OF_LINEAR.mass.option, OF_LINEAR.force.option, SCREW.option, "rotor-inertia")
ONLY_ROTARY = (OF_ROTARY.mass.option, OF_ROTARY.force.option)
