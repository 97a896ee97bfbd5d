"""Who may have how many connections, so that a place is left for whoever has none. No I/O."""

from __future__ import annotations

from collections import Counter
from enum import Enum

MAX_CLIENTS_A_USER = 32
MAX_CLIENTS = 400
"""Of all users together; each takes a file descriptor, of which a process has 1024 by default."""
KEPT_FOR_NEW_USERS = 40
"""Of these places: for users who have no connection yet."""
MAX_STOP_CALLERS_A_USER = 4
MAX_STOP_CALLERS = 64
"""Connections beyond these limits that are heard at all: for an emergency stop."""


class Place(Enum):
    """What a connection may do by the number of others."""

    FULL = "full"
    STOP_ONLY = "stop only"
    """One request, which is carried out if it is an emergency stop."""
    NONE = "none"


class Places:
    """Counts the connections of each user."""

    def __init__(self) -> None:
        self._full: Counter[int] = Counter()
        self._stop_only: Counter[int] = Counter()

    def take(self, uid: int) -> tuple[Place, str]:
        """Take a place for a connection.

        Parameters
        ----------
        uid
            The user at its other end.

        Returns
        -------
        Place
            Which it got; `give_back` it when the connection ends.
        str
            Where it is not a full one: why.
        """
        mine, all_ = self._full[uid], self._full.total()
        if mine >= MAX_CLIENTS_A_USER:
            why = f"user {uid} already has {mine} connections (the limit)"
        elif all_ >= MAX_CLIENTS - (KEPT_FOR_NEW_USERS if mine else 0):
            why = f"there already are {all_} connections (the limit)"
            if mine:
                why += f", and the last {KEPT_FOR_NEW_USERS} places are for users who have none"
        else:
            self._full[uid] += 1
            return Place.FULL, ""
        why += ": close some; beyond it only an emergency stop is carried out"
        callers = self._stop_only
        if callers[uid] >= MAX_STOP_CALLERS_A_USER or callers.total() >= MAX_STOP_CALLERS:
            return Place.NONE, why
        callers[uid] += 1
        return Place.STOP_ONLY, why

    def give_back(self, uid: int, place: Place) -> None:
        """Give a place back."""
        if place is Place.NONE:
            return
        counts = self._full if place is Place.FULL else self._stop_only
        counts[uid] -= 1
        if not counts[uid]:
            del counts[uid]
