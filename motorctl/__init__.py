"""motorctl: real-time motion control that closes the loop with measured data.

The public names live in `motorctl.api` and are imported when somebody asks for them: the command
line and the daemon start without what they do not need.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from motorctl.api.async_connection import AsyncConnection, connect_async
    from motorctl.api.comparison import compare
    from motorctl.api.connection import Connection, connect
    from motorctl.api.diagnosis import diagnose, refine
    from motorctl.api.fitting import fit
    from motorctl.api.log import Log, open_log
    from motorctl.api.samples import Samples, Subscription
    from motorctl.api.simulation import simulate
    from motorctl.daemon.conversation import AxisFaultError, DaemonRefusedError, NotReachedError
    from motorctl.errors import ConfigError, DataError, MotorctlError, RunError, UsageError

    __version__: str

__all__ = [
    "AsyncConnection",
    "AxisFaultError",
    "ConfigError",
    "Connection",
    "DaemonRefusedError",
    "DataError",
    "Log",
    "MotorctlError",
    "NotReachedError",
    "RunError",
    "Samples",
    "Subscription",
    "UsageError",
    "compare",
    "connect",
    "connect_async",
    "diagnose",
    "fit",
    "open_log",
    "refine",
    "simulate",
]

_HOMES = {
    **dict.fromkeys(("ConfigError", "DataError", "MotorctlError"), "errors"),
    **dict.fromkeys(("RunError", "UsageError"), "errors"),
    **dict.fromkeys(("AxisFaultError", "NotReachedError"), "daemon.conversation"),
    "DaemonRefusedError": "daemon.conversation",
    **dict.fromkeys(("Connection", "connect"), "api.connection"),
    **dict.fromkeys(("AsyncConnection", "connect_async"), "api.async_connection"),
    **dict.fromkeys(("Log", "open_log"), "api.log"),
    **dict.fromkeys(("diagnose", "refine"), "api.diagnosis"),
    **dict.fromkeys(("Samples", "Subscription"), "api.samples"),
    "compare": "api.comparison",
    "fit": "api.fitting",
    "simulate": "api.simulation",
}


def __getattr__(name: str) -> object:
    """Import a public name from the module where it lives."""
    if name == "__version__":
        return import_module("motorctl.version").VERSION
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    """Return the public names."""
    return [*__all__, "__version__"]
