"""`motorctl bench socket`."""

from __future__ import annotations

from functools import partial
from typing import Annotated

import typer

from motorctl_benchmarks.command_options import AsJson, Seed, given

LoopCpu = Annotated[
    int | None,
    typer.Option(
        min=0,
        help="The loop's CPU: all else is kept off it, as isolcpus does; by default it is shared.",
    ),
]


def socket(loop_cpu: LoopCpu = None, seed: Seed = None, as_json: AsJson = False) -> None:
    """Count late ticks at 5 kHz while 200 clients and six viewers of the scope disturb a daemon.

    In turn: left alone; 200 clients of which some send 10 million fuzzed bytes; five viewers of the
    scope and a sixth that never reads; logs that are made; busy programs. The exit status is 1
    where daemon or axes did not stand it, or a row was lost.
    """
    from motorctl_benchmarks.control_socket.figures import socket_findings
    from motorctl_benchmarks.control_socket.session import SocketOptions
    from motorctl_benchmarks.print_result import measure_and_print

    options = SocketOptions(**given(seed=seed, loop_cpu=loop_cpu))
    measure_and_print("socket", partial(socket_findings, options=options), as_json=as_json)
