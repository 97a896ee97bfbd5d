"""`motorctl fit`: identify the declared model from a recording."""

from __future__ import annotations

import json
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from motorctl.errors import UsageError

if TYPE_CHECKING:  # the analysis takes long to import: the command does so when it runs
    from motorctl.identify.fit.settings import FitOptions

EXAMPLE = (
    "Example: motorctl fit run.parquet --model C2    or: "
    "motorctl fit emps.yaml --model C1 --settings janot2019 --evaluate pulses.yaml"
)


class Left(StrEnum):
    """The column that stands on the left of the regression."""

    ACCELERATION = "acceleration"
    COMMAND = "command"


class Estimator(StrEnum):
    """Where the values come from."""

    AUTO = "auto"
    LEAST_SQUARES = "least_squares"
    INSTRUMENTS = "instruments"


class Derivative(StrEnum):
    """How the position is differentiated."""

    SECOND_DIFFERENCE = "second_difference"
    CENTRAL = "central"


class FilterTarget(StrEnum):
    """What the low pass goes over."""

    COLUMNS = "columns"
    POSITION = "position"


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("fit", epilog=EXAMPLE)(_fit)


def _fit(
    recording: Annotated[
        Path,
        typer.Argument(help="A log, a CSV, Parquet or MAT file, or its YAML description."),
    ],
    model: Annotated[
        str | None,
        typer.Option(help="C1, C2 or a configuration; else what the log declares, or C1."),
    ] = None,
    axis: Annotated[str | None, typer.Option(help="This axis only.")] = None,
    evaluate: Annotated[
        Path | None,
        typer.Option(metavar="RECORDING", help="A second recording, for the held-out error."),
    ] = None,
    settings: Annotated[
        str | None,
        typer.Option(metavar="NAME-OR-FILE", help="A set of the options below: janot2019 or YAML."),
    ] = None,
    filter_hz: Annotated[float | None, typer.Option(help="Cut-off of the low pass.")] = None,
    filter_order: Annotated[int | None, typer.Option(help="Its order.")] = None,
    filter_target: Annotated[
        FilterTarget | None, typer.Option(help="What it goes over, forward and backward.")
    ] = None,
    derivative: Annotated[
        Derivative | None, typer.Option(help="How the position is differentiated.")
    ] = None,
    discard: Annotated[
        int | None, typer.Option(help="Samples dropped at the start; else what the filter needs.")
    ] = None,
    discard_end: Annotated[int | None, typer.Option(help="Samples dropped at the end.")] = None,
    decimate: Annotated[int | None, typer.Option(help="Keep every so many samples.")] = None,
    decimation_order: Annotated[
        int | None, typer.Option(help="Order of the Chebyshev filter before it; 0: none.")
    ] = None,
    left: Annotated[
        Left | None, typer.Option(help="What stands on the left of least squares.")
    ] = None,
    estimator: Annotated[
        Estimator | None,
        typer.Option(help="auto: instruments built from the reference, where there is one."),
    ] = None,
    hold_alignment: Annotated[
        bool | None,
        typer.Option("--hold-alignment/--no-hold-alignment", help="Align the zero-order hold."),
    ] = None,
    coulomb: Annotated[
        str | None,
        typer.Option(metavar="SLOPE", help="Slope of Sf in s/m, or 'sign'; else the model's."),
    ] = None,
    rest_velocity: Annotated[
        float | None, typer.Option(help="Leave out rows slower than this in m/s; 0: none.")
    ] = None,
    delay: Annotated[
        bool | None, typer.Option("--delay/--no-delay", help="Estimate the input delay.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON document.")] = False,
) -> None:
    """Identify the declared model: parameters, standard errors, input delay and error."""
    from motorctl.identify.fit.declared_models import declared_models
    from motorctl.identify.fit.recording import fit_recording
    from motorctl.identify.fit.report import fit_document, print_fit
    from motorctl.log import read_recording

    options = _options(
        settings,
        filter_hz=filter_hz,
        filter_order=filter_order,
        filter_target=filter_target,
        derivative=derivative,
        discard_start=discard,
        discard_end=discard_end,
        decimation=decimate,
        decimation_order=decimation_order,
        left=left,
        estimator=estimator,
        hold_alignment=hold_alignment,
        coulomb_slope_s_m=_slope(coulomb),
        rest_velocity=rest_velocity,
        estimate_delay=delay,
    )
    with _progress() as progress:
        task = progress.add_task("reading")
        read = read_recording(recording, gaps="keep")
        other = None if evaluate is None else read_recording(evaluate, gaps="keep")
        models = declared_models(read, model, axis)
        found = fit_recording(
            read,
            models,
            options,
            other,
            lambda name: progress.update(task, description=f"fitting axis {name}"),
        )
    if as_json:
        print(json.dumps(fit_document(found)))
    else:
        print_fit(Console(), found)


def _options(settings: str | None, **given: object) -> FitOptions:
    from motorctl.identify.fit.settings import FitOptions, load_settings

    options = FitOptions() if settings is None else load_settings(settings)
    return options.with_changes(**{key: v for key, v in given.items() if v is not None})


def _slope(text: str | None) -> float | None:
    if text is None or text == "sign":
        return None if text is None else float("inf")
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"--coulomb: '{text}' is neither a slope in s/m nor 'sign'") from None


def _progress() -> Progress:
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    console = Console(stderr=True)
    return Progress(*columns, console=console, transient=True, disable=not sys.stderr.isatty())
