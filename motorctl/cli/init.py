"""`motorctl init`: begin the configuration of a new machine."""

from __future__ import annotations

import json
import re
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motorctl.cli.say import say

if TYPE_CHECKING:
    from motorctl.init.look import Looked
    from motorctl.init.questions import Question
    from motorctl.init.told import AxisTold
    from motorctl.init.write import Written

OF_AXES = "VALUE or AXIS=VALUE"
Words = list[str]


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command(
        "init",
        epilog="Example: motorctl init stage.yaml --driver sim --axis x --encoder 0.5um --mass "
        "12kg --force-constant 30N/V --travel -0.2..0.3 --max-velocity 0.8m/s",
    )(_init)


def _of_axes(words: str) -> typer.models.OptionInfo:
    info: typer.models.OptionInfo = typer.Option(help=words, metavar="[AXIS=]VALUE")
    return info


def _init(
    out: Annotated[Path, typer.Argument(help="The YAML file to write.", metavar="OUT.yaml")],
    source: Annotated[
        str | None,
        typer.Option("--from", metavar="devices", help="Ask the driver's devices what is there."),
    ] = None,
    driver: Annotated[
        Words | None,
        _of_axes("Driver: sim, can, canopen, serial, modbus, or an own one, package.module:Class."),
    ] = None,
    axis: Annotated[
        Words | None, typer.Option(help="Name of an axis; once for each.", metavar="NAME")
    ] = None,
    kind: Annotated[
        Words | None, _of_axes("linear, or rotary: positions in rad; else linear.")
    ] = None,
    encoder: Annotated[
        Words | None, _of_axes("A count: 0.5um, or 10000/turn of a screw or of a rotary axis.")
    ] = None,
    mass: Annotated[Words | None, _of_axes("All that moves: 12kg.")] = None,
    force_constant: Annotated[
        Words | None, _of_axes("Of the motor: 30N/V, 45N/A, 0.2N*m/V, 0.2N*m/A.")
    ] = None,
    motors: Annotated[
        Words | None, _of_axes("1, or 2 on one beam, which are one axis; else 1.")
    ] = None,
    second_channel: Annotated[
        Words | None, _of_axes("Of two motors: channel of the second; else the next one.")
    ] = None,
    skew_limit: Annotated[
        Words | None, _of_axes("Of two motors: how far the ends may be apart: 1mm.")
    ] = None,
    square_offset: Annotated[
        Words | None,
        _of_axes("Of two motors: the first end's switch lies so far ahead, with the beam square."),
    ] = None,
    inertia: Annotated[Words | None, _of_axes("Of a rotary axis: 0.02kg*m^2.")] = None,
    torque_constant: Annotated[
        Words | None, _of_axes("Of a rotary axis: 0.8N*m/V, 1.5N*m/A.")
    ] = None,
    travel: Annotated[Words | None, _of_axes("Between soft limits: -0.2..0.3, -90..90deg.")] = None,
    max_velocity: Annotated[Words | None, _of_axes("Top speed: 0.8m/s, 2rad/s, 60rpm.")] = None,
    homing: Annotated[Words | None, _of_axes("absolute, switch, switch_index or index.")] = None,
    home_position: Annotated[Words | None, _of_axes("Of the switch or index mark: -180mm.")] = None,
    screw_pitch: Annotated[Words | None, _of_axes("Travel a turn of a screw: 5mm.")] = None,
    rotor_inertia: Annotated[
        Words | None, _of_axes("What turns with the screw: 1.2e-5kg*m^2.")
    ] = None,
    amplifier: Annotated[Words | None, _of_axes("Amperes a volt of command: 2A/V.")] = None,
    max_voltage: Annotated[Words | None, _of_axes("Full command; else 10V.")] = None,
    max_acceleration: Annotated[
        Words | None, _of_axes("Else what half of the full command gives.")
    ] = None,
    friction: Annotated[Words | None, _of_axes("8N; else 1 % of the weight.")] = None,
    counter_bits: Annotated[Words | None, _of_axes("Of the encoder's counter; else 32.")] = None,
    rate: Annotated[
        str | None, typer.Option(metavar="HZ", help="Of the loop; else the highest usual one.")
    ] = None,
    name: Annotated[str | None, typer.Option(help="Of the machine; else the file's.")] = None,
    driver_option: Annotated[
        Words | None,
        typer.Option(metavar="DRIVER.KEY=VALUE", help="Of a driver: modbus.tcp.host=10.0.0.7"),
    ] = None,
    simulated: Annotated[
        Path | None,
        typer.Option(
            metavar="SIM.yaml", help="Write the same machine with simulated devices, too."
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that are there.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Begin the configuration of a new machine, from what is known of it.

    What is missing is asked, at a terminal. Quantities have their unit: 12kg, 30N/V, -20mm..0.3m.
    An option holds for every axis, or with AXIS= before it for one. Everything that nobody tells
    follows by arithmetic, and a comment in the file says how. `motorctl check` accepts the file.
    """
    from motorctl.errors import UsageError
    from motorctl.init import MachineKnown, write_configuration
    from motorctl.init.channels import number_channels
    from motorctl.init.look import look
    from motorctl.init.questions import (
        MOTORS,
        OF_ROTARY,
        SECOND_CHANNEL,
        SKEW_LIMIT,
        SQUARE_OFFSET,
    )
    from motorctl.init.told import axes_told, driver_options, machine_told
    from motorctl.init.write import stand_in

    if source not in (None, "devices"):
        raise UsageError(f"--from {source}: should be devices")
    _refuse_what_is_there(out, simulated, replace=force)
    drivers = driver or _asked_drivers()
    types = [text.rpartition("=")[2] for text in drivers]
    options = driver_options(driver_option or (), types)
    looked: dict[str, Looked] = {}
    if source == "devices":
        looked = {each: look(each, options.get(each, {})) for each in dict.fromkeys(types)}
        _say_what_is_there(looked)
    names = axis or [name for each in looked.values() for name in each.names] or _asked_axes()
    words = {
        "kind": kind,
        OF_ROTARY.mass.option: inertia,
        OF_ROTARY.force.option: torque_constant,
        "encoder": encoder,
        "mass": mass,
        "force-constant": force_constant,
        "travel": travel,
        "max-velocity": max_velocity,
        MOTORS.option: motors,
        SECOND_CHANNEL.option: second_channel,
        SKEW_LIMIT.option: skew_limit,
        SQUARE_OFFSET.option: square_offset,
        "homing": homing,
        "home-position": home_position,
        "screw-pitch": screw_pitch,
        "rotor-inertia": rotor_inertia,
        "amplifier": amplifier,
        "max-voltage": max_voltage,
        "max-acceleration": max_acceleration,
        "friction": friction,
        "counter-bits": counter_bits,
    }
    axes = axes_told(names, drivers, {key: given or () for key, given in words.items()})
    for type_, there in looked.items():
        there.tell([each for each in axes if each.driver == type_])
    _ask_what_is_missing(axes)
    number_channels(axes)
    machine_name = name or re.sub(r"[^A-Za-z0-9_.-]", "-", out.stem)
    found = {key: each.options for key, each in looked.items() if each.options is not None}
    known: MachineKnown = machine_told(machine_name, axes, rate, options, found)
    written = [write_configuration(known, out, replace_file=force, delays_s=None)]
    if simulated is not None:
        other, delays_s = stand_in(known, written[0])
        written.append(write_configuration(other, simulated, replace_file=force, delays_s=delays_s))
    if as_json:
        say(json.dumps(_document(written)))
    else:
        _print(written, known)


def _refuse_what_is_there(out: Path, simulated: Path | None, *, replace: bool) -> None:
    """Say so before anything is asked."""
    from motorctl.errors import UsageError
    from motorctl.replacing import refuse_what_is_there

    if simulated is not None and simulated.resolve() == out.resolve():
        raise UsageError(f"--simulated {simulated}: is the same file")
    for path in (out, simulated):
        if path is not None:
            refuse_what_is_there(path, replace=replace)


def _asked_drivers() -> Words:
    from motorctl.errors import UsageError
    from motorctl.hal import installed_drivers

    known = [entry.name for entry in installed_drivers() if entry.driver is not None]
    if not sys.stdin.isatty():
        raise UsageError(f"init needs --driver, one of: {', '.join(known)}")
    return [typer.prompt(f"driver: {', '.join(known)}", default="sim", err=True)]


def _asked_axes() -> Words:
    if not sys.stdin.isatty():
        return ["x"]
    return str(typer.prompt("names of the axes", default="x", err=True)).replace(",", " ").split()


def _ask_what_is_missing(axes: list[AxisTold]) -> None:
    """Ask at a terminal, until nothing is missing; else say all that is."""
    from motorctl.errors import UsageError
    from motorctl.init.questions import KIND, MOTORS

    if not sys.stdin.isatty():
        missing = [(each, question) for each in axes for question in each.missing()]
        if missing:
            told = "\n".join(
                f"  axis {each.name}: --{question.option}, {question.words}, as in "
                f"{question.example}"
                for each, question in missing
            )
            raise UsageError(f"init needs to know more, and there is no terminal to ask:\n{told}")
        return
    for each in axes:
        if each.kind_is_open:
            _ask(each, KIND, default="linear")
            if each.units.kind == "linear":
                _ask(each, MOTORS, default="1")
                if each.is_dual:
                    _ask_of_second_end(axes, each)
        while missing_here := each.missing():
            _ask(each, missing_here[0])


def _ask_of_second_end(axes: list[AxisTold], axis: AxisTold) -> None:
    from motorctl.init.channels import number_channels
    from motorctl.init.questions import SECOND_CHANNEL

    number_channels(axes)
    _ask(axis, SECOND_CHANNEL, default=str(axis.second_channel))


def _ask(axis: AxisTold, question: Question, default: str | None = None) -> None:
    """Ask until the answer makes sense."""
    from motorctl.errors import UsageError

    while True:
        text = f"{axis.name}: {question.words} ({question.example})"
        axis.words[question.option] = str(typer.prompt(text, default=default, err=True))
        try:
            axis.read(question)
        except UsageError as error:
            say(str(error), err=True)
        else:
            return


def _say_what_is_there(looked: dict[str, Looked]) -> None:
    for driver, each in looked.items():
        for line in each.lines:
            say(f"{driver}: {line}", err=True)


def _document(written: list[Written]) -> dict[str, object]:
    return {
        "files": [str(each.path) for each in written],
        "rate_hz": written[0].rate_hz,
        "axes": {
            name: {
                "position_unit": axis.known.units.position,
                "inertia_v_s2_m": axis.inertia,
                "max_acceleration_m_s2": axis.acceleration_m_s2,
                "k1_1_s": axis.gains.k1_1_s,
                "ks_v_s_m": axis.gains.ks_v_s_m,
                "gamma_d": axis.gains.gamma_d,
                "phase_margin_deg": axis.gains.margins.phase_margin_deg,
                "delay_s": axis.delay_s,
                "second_channel": axis.known.second and axis.known.second.channel,
            }
            for name, axis in written[0].axes.items()
        },
        "to_be_set": list(written[0].to_be_set),
    }


def _print(written: list[Written], known: object) -> None:
    from motorctl.cli.terminal import Terminal
    from motorctl.hal import driver_class

    console = Terminal(highlight=False)
    first = written[0]
    for each in written:
        say(each.path)
    for name, axis in first.axes.items():
        hardest = axis.known.units.words(f"{axis.acceleration_m_s2:g} m/s^2")
        console.print(
            f"axis {name}: {hardest}; k1 {axis.gains.k1_1_s:g} 1/s at "
            f"{1.0 / axis.period_s:g} Hz with a phase margin of "
            f"{axis.gains.margins.phase_margin_deg or 0.0:.0f} degrees",
            markup=False,
        )
    if first.to_be_set:
        console.print("to be set in it, from the devices or their papers:")
        for sentence in first.to_be_set:
            console.print(f"  {sentence}", markup=False)
    types = {axis.known.driver for axis in first.axes.values()}
    runs = all(driver_class(each).supports_virtual_time for each in types)
    say("next")
    say(f"  motorctl check {shlex.quote(str(first.path))}")
    moved = first.path if runs else written[-1].path if len(written) > 1 else None
    if moved is not None:
        log = shlex.quote(f"{moved.stem}.parquet")
        say(f"  motorctl simulate {shlex.quote(str(moved))} --log {log}")
        say(f"  motorctl diagnose {log}")
    if not runs:
        say(f"  motorctl run {shlex.quote(str(first.path))}")
