"""`motorctl response`: an axis' measured frequency response."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motorctl.cli.recording_argument import WholeRun
from motorctl.cli.say import say
from motorctl.cli.socket_option import SocketOption

if TYPE_CHECKING:  # the analysis takes long to import: the command does so when it runs
    from motorctl.config import Machine
    from motorctl.response.measurement import Measurement
    from motorctl.response.plan import ResponsePlan


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command(
        "response",
        epilog="Example: motorctl response x --config published_gantry --out response",
    )(_response)


def _response(
    axis: Annotated[str, typer.Argument(help="The axis that is measured.")],
    config: Annotated[
        str | None,
        typer.Option(
            help="Measure in virtual time: a configuration, or a shipped one's name. Else the "
            "running daemon's axis is, which holds."
        ),
    ] = None,
    socket: SocketOption = None,
    recording: Annotated[
        list[Path] | None,
        typer.Option(metavar="LOG", help="Only analyse the log of an excited axis."),
    ] = None,
    whole_run: WholeRun = False,
    band: Annotated[
        str | None,
        typer.Option(
            metavar="LOW,HIGH",
            help="Hz; usual: from a seventh of the model's crossover to a quarter of the Nyquist "
            "frequency. A lower begin also resolves finer, and takes longer.",
        ),
    ] = None,
    amplitude: Annotated[
        float | None,
        typer.Option(
            metavar="V",
            help="Peak of the excitation; usual: half of what limits.max_excitation_share allows.",
        ),
    ] = None,
    periods: Annotated[
        int | None, typer.Option(min=4, help="How often it is repeated; usual: for two minutes.")
    ] = None,
    standing: Annotated[
        bool,
        typer.Option(
            "--standing", help="Hold the axis; usual: it moves to and fro, so that it slides."
        ),
    ] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where picture, JSON and log go.")
    ] = None,
    yes: Annotated[
        bool,
        typer.Option(
            "--yes",
            help="Do not ask; only where the machine is simulated, or within what "
            "axes.NAME.experiments allows.",
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Measure an axis' frequency response: plant, loop, sensitivities, margins, resonances.

    A multisine is added to its command, within a limit of its own, while the axis moves slowly to
    and fro. What it is going to do is told before anything moves.
    """
    from motorctl.cli.progress import showing_stages
    from motorctl.errors import UsageError
    from motorctl.response.document import response_document
    from motorctl.response.measurement import measure_response
    from motorctl.response.picture import draw_response

    given = [name for name, value in (("--config", config), ("--socket", socket),
                                      ("--recording", recording)) if value]  # fmt: skip
    if len(given) > 1:
        raise UsageError(f"{' and '.join(given)}: name one of them: where the axis is")
    wanted = _Wanted(axis, _band(band), amplitude, periods, moving=not standing)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) if out is None else out
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(f"{folder}: cannot be written: {error.strerror}") from error
        log = folder / f"response_{axis}.parquet"
        if recording:
            _require_own(log, recording)
            measured = measure_response(recording, axis, whole_run=whole_run)
        elif config is not None:
            measured = _in_virtual_time(config, wanted, log)
        else:
            measured = _through_daemon(socket, wanted, log, yes=yes)
        files: list[str] = []
        document = response_document(measured)
        if out is not None:
            with showing_stages() as progress:
                progress("drawing", 0.0)
                files.append(str(draw_response(measured, out / f"response_{axis}.png")))
            told = out / f"response_{axis}.json"
            told.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
            files += [str(told), *([] if recording else [str(log)])]
    if as_json:
        say(json.dumps(document | {"files": files}))
        return
    _print(measured)
    for file in files:
        say(file)


class _Wanted:
    """What was asked for."""

    def __init__(
        self,
        axis: str,
        band_hz: tuple[float, float] | None,
        amplitude_v: float | None,
        periods: int | None,
        *,
        moving: bool,
    ) -> None:
        self.axis = axis
        self._band_hz, self._amplitude_v, self._periods = band_hz, amplitude_v, periods
        self._moving = moving

    def plan(self, machine: Machine) -> ResponsePlan:
        """Return the plan of it for a machine."""
        from motorctl.errors import UsageError
        from motorctl.response.plan import plan_response

        if self.axis not in machine.axes:
            known = ", ".join(machine.axes)
            raise UsageError(f"{machine.source}: no axis '{self.axis}'; it has: {known}")
        return plan_response(
            machine.axes[self.axis],
            machine.period_of(self.axis),
            band_hz=self._band_hz,
            amplitude_v=self._amplitude_v,
            periods=self._periods,
            moving=self._moving,
        )


def _band(text: str | None) -> tuple[float, float] | None:
    from motorctl.errors import UsageError

    if text is None:
        return None
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--band {text}: should be two frequencies in Hz, as 5,400") from None
    return low, high


def _in_virtual_time(config: str, wanted: _Wanted, log: Path) -> Measurement:
    """Simulate the axis; nothing real moves, so nobody is asked."""
    from motorctl.cli.progress import showing_stages
    from motorctl.config import load
    from motorctl.loop.virtual import require_virtual_time
    from motorctl.response.measurement import measure_response
    from motorctl.response.rigs import record_simulated

    machine = load(config)
    plan = wanted.plan(machine)
    require_virtual_time(machine)
    _make_room(log)
    say(f"{plan.words}; in virtual time", err=True)
    with showing_stages(lines=True) as progress:
        record_simulated(machine, plan, log, progress)
        progress("reading the response from the log", 0.0)
        return measure_response([log], wanted.axis)


def _through_daemon(socket: Path | None, wanted: _Wanted, log: Path, *, yes: bool) -> Measurement:
    """Excite the axis of a running daemon, once somebody has said yes."""
    from motorctl.cli.progress import showing_stages
    from motorctl.daemon.client import Client
    from motorctl.daemon.running_machine import ended_in_order, machine_of_daemon
    from motorctl.response.measurement import measure_response
    from motorctl.response.rigs import beyond_allowed, record_through_daemon, require_holding

    with Client(socket) as client:
        machine = machine_of_daemon(client)
        plan = wanted.plan(machine)
        require_holding(client, wanted.axis)
        say(plan.words, err=True)
        beyond = beyond_allowed(machine, plan, client.axis(wanted.axis)["reference_m"])
        _insist_on_consent(wanted.axis, beyond, yes=yes)
        _make_room(log)
        with ended_in_order(), showing_stages(lines=True) as progress:
            record_through_daemon(client, plan, log, progress)
            progress("reading the response from the log", 0.0)
            return measure_response([log], wanted.axis)


def _require_own(log: Path, recordings: list[Path]) -> None:
    """Insist that no other log stands where the response of these is going to.

    Raises UsageError where one does: log and response there would be of two measurements.
    """
    from motorctl.errors import UsageError

    if log.exists() and not any(log.samefile(each) for each in recordings if each.exists()):
        raise UsageError(
            f"{log} is the log of another measurement: name a folder of its own with --out"
        )


def _make_room(log: Path) -> None:
    """Take away what an earlier measurement left: no part of it shall stand beside a new one."""
    for suffix in (".parquet", ".json", ".png"):
        log.with_suffix(suffix).unlink(missing_ok=True)


def _insist_on_consent(axis: str, beyond: list[str], *, yes: bool) -> None:
    """Ask whoever is there; raises UsageError where nobody says yes.

    beyond is what of the motion nobody has allowed before, so that --yes does not do.
    """
    from motorctl.cli.asking import insist_on_yes
    from motorctl.errors import UsageError

    if yes and not beyond:
        return
    if yes:
        raise UsageError(
            f"axis {axis}: --yes does not do, a person at its side has to say yes: "
            f"{'; '.join(beyond)}"
        )
    insist_on_yes(
        f"Excite axis {axis}?",
        nobody=f"nobody is there to say yes to exciting axis {axis}: run this in a terminal"
        + ("" if beyond else "; or with --yes, as nothing of it is beyond what is allowed"),
        refused=f"axis {axis} was not excited: nobody said yes",
    )


def _print(measured: Measurement) -> None:
    """Print the margins as a table, and what was found in words."""
    from motorctl.cli.terminal import print_axis
    from motorctl.response.rows import rows, words

    headings = ("measured", "fitted to it", "configured model")
    print_axis(measured.response.axis, headings, rows(measured), words(measured))
