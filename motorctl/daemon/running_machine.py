"""The machine that a daemon runs, for commands that move it."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager

from motorctl.config import Machine, load_resolved
from motorctl.config.chosen_code import allowed_by
from motorctl.daemon.client import Client
from motorctl.daemon.recorded_rows import partial_log
from motorctl.errors import ConfigError, DataError, RunError
from motorctl.log.convert import load_metadata
from motorctl.log.partial import PartialFile


def machine_of_daemon(client: Client) -> Machine:
    """Return the machine that a daemon runs, as the log says that it records.

    Raises RunError where that log cannot be read.
    """
    partial = partial_log(client)
    try:
        source = PartialFile(partial)
        try:
            metadata = load_metadata(source.schema)
        finally:
            source.close()
        return load_resolved(metadata["config"], str(partial), hardware=True, may_run=allowed_by())
    except (DataError, ConfigError, KeyError, OSError) as error:
        raise RunError(
            f"the log that the daemon records cannot be read ({error}): run this command on its "
            "computer, as a user who may read its logs"
        ) from error


@contextmanager
def ended_in_order() -> Iterator[None]:
    """Let a lost terminal or an order to end be what Ctrl-C is: the axis is stopped before."""
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    for number in before:
        signal.signal(number, signal.default_int_handler)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
