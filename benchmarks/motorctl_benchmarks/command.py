"""`motorctl bench`: a command for each subject, in the subject's own room."""

from __future__ import annotations

import typer

from motorctl.cli.whole_help import WholeHelp
from motorctl_benchmarks.buses.command import buses
from motorctl_benchmarks.closing.command import closing
from motorctl_benchmarks.command_options import AsJson
from motorctl_benchmarks.control_socket.command import socket
from motorctl_benchmarks.diagnosis.command import diagnosis
from motorctl_benchmarks.experiments.command import experiments
from motorctl_benchmarks.fleet.command import fleet
from motorctl_benchmarks.other_machines.command import machines
from motorctl_benchmarks.real_machines.command import recordings
from motorctl_benchmarks.safety.command import campaign
from motorctl_benchmarks.swaps.command import swaps
from motorctl_benchmarks.tuning.command import tuning

bench = typer.Typer(cls=WholeHelp, add_completion=False, rich_markup_mode=None)


@bench.callback(invoke_without_command=True)
def _speed_unless_told(context: typer.Context, as_json: AsJson = False) -> None:
    """Measure how fast motorctl is here, how often its diagnoses are right, what guards detect.

    Without a subject it measures speed; a subject's own options come after it. The exit status is 0
    whether or not the targets are met: what is not met is told. Where a subject says so it is 1 if
    something is not as promised.

    Example: motorctl bench --json
    """
    subject = context.invoked_subcommand
    if subject is None:
        speed(as_json)
    elif as_json:  # it may stand before the subject as well
        context.default_map = {subject: {"as_json": True}}


@bench.command()
def speed(as_json: AsJson = False) -> None:
    """Measure the law, the tick, virtual time and a daemon's first start, as ratios to peers.

    The peers are measured in the same run.
    """
    from motorctl_benchmarks.print_result import measure_and_print
    from motorctl_benchmarks.speed import speed_findings

    measure_and_print("speed", speed_findings, as_json=as_json)


for _subject in (
    diagnosis,
    machines,
    recordings,
    campaign,
    buses,
    socket,
    tuning,
    experiments,
    closing,
    swaps,
    fleet,
):
    bench.command()(_subject)
