"""`motorctl bench buses`."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from motorctl_benchmarks.command_options import AsJson


def buses(
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="BUS", help="The bus of this name alone; may be repeated."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Run C2 in wall-clock time over each bus, a minute each, beside the direct simulation.

    The simulated gantry stands behind each bus.

    Example: motorctl bench buses --only "canopen udp_multicast"
    """
    from motorctl_benchmarks.buses.figures import BusesOptions, bus_findings
    from motorctl_benchmarks.print_result import measure_and_print

    options = BusesOptions(tuple(only or ()))
    measure_and_print("buses", partial(bus_findings, options=options), as_json=as_json)
