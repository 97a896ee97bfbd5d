"""Under which names a small web server is asked for: its own, none that another's DNS gives it."""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Container

LOOPBACK = ("localhost", "127.0.0.1", "::1")
EVERYWHERE = ("0.0.0.0", "::")
"""Listens on every address of this computer; nobody elsewhere can ask for it."""


def needs_token(address: str) -> bool:
    """Tell whether others than this computer's users reach an address."""
    return address not in LOOPBACK


def own_names() -> frozenset[str]:
    """Return the names of this computer; may wait for a name server."""
    return frozenset({socket.gethostname().lower(), socket.getfqdn().lower()})


def name_to_ask(address: str) -> str:
    """Return what stands in the URL of a server that listens on an address, for who asks it."""
    name = socket.gethostname() if address in EVERYWHERE else address
    return f"[{name}]" if ":" in name else name


def name_of(host: str) -> str:
    """Return the name in a request's `Host`, without its port."""
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0]


def is_own(name: str, address: str, names: Container[str], *, others: bool) -> bool:
    """Tell whether a name is this computer's.

    A page of another site that lets its own name lead here is told apart by that.

    Parameters
    ----------
    name
        Which a request asks for.
    address
        Where the server listens.
    names
        Those of this computer, as `own_names` returns them.
    others
        Whether it is reached from other computers, which know this one by any address or its name.
    """
    if name in ("localhost", address):
        return True
    if not others:
        return name in LOOPBACK
    return _is_address(name) or name.lower() in names


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
