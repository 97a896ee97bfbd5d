"""Other models on their way into the running loop, in a thread beside the ticks.

The supervisor sends through a pipe what another process has made of them. This thread links it
and offers it to the ticks; between two of them it takes over, or the old one goes on and the
supervisor is told why.
"""

from __future__ import annotations

import os
import pickle
import threading
import time
from dataclasses import dataclass

from motorctl.errors import MotorctlError
from motorctl.loop.layout import MODELS_TOLD_BYTES
from motorctl.loop.other_models import OtherModels
from motorctl.loop.realtime import prefault
from motorctl.loop.shared import LoopMemory
from motorctl.loop.succession import Succession
from motorctl.loop.tick import Tick
from motorctl.loop.vocabulary import Word

LOOK_S = 2e-3
"""Between two looks whether a tick has taken the offer [s]: as in `reopening`."""


@dataclass(frozen=True)
class ModelOrder:
    """What the supervisor asks for."""

    number: int
    """Counts the orders, from 1; announced when it is done."""
    models: OtherModels | None
    """What shall run; None: what runs already, with other windows."""
    windows: tuple[float, ...] = ()
    """As of `Succession`."""


class ModelThread:
    """The thread that takes orders, one at a time, for as long as the pipe is open.

    Parameters
    ----------
    tick
        What runs now.
    memory
        Where it tells what became of an order.
    orders_fd
        The pipe's end that is read; closed by the end of the process.
    """

    def __init__(self, tick: Tick, memory: LoopMemory, orders_fd: int) -> None:
        self._tick = tick
        self._memory = memory
        self._orders_fd = orders_fd
        self._last: Succession | None = None
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="models", daemon=True)

    def begin(self) -> int:
        """Start the thread, which then sleeps until it is sent an order; return its id."""
        self._thread.start()
        self._ready.wait()
        assert self._thread.native_id is not None
        return self._thread.native_id

    def _serve(self) -> None:
        try:
            prefault()
        finally:
            self._ready.set()
        with os.fdopen(self._orders_fd, "rb") as pipe:
            while True:
                try:
                    order: ModelOrder = pickle.load(pipe)
                except EOFError:  # nobody is there who could send one
                    return
                try:
                    refused = self._carry_out(order)
                except (
                    BaseException
                ) as error:  # whatever it is, who asked is told, and served again
                    foreseen = isinstance(error, MotorctlError)
                    refused = str(error) if foreseen else f"{type(error).__name__}: {error}"
                status = self._memory.status
                status["models_refused"][0] = refused is not None
                told = (refused or "").encode(errors="replace")[:MODELS_TOLD_BYTES]
                status["models_told"][0] = told
                self._memory.announce(Word.MODELS_DONE, order.number)

    def _carry_out(self, order: ModelOrder) -> str | None:
        """Return why the old models go on, None where the new ones run."""
        if order.models is None:
            if self._last is not None:
                self._last.set_windows(order.windows)
            return None
        succession = Succession(self._tick, order.models, order.windows)
        self._tick.successor = succession
        while not succession.outcome.done:
            time.sleep(LOOK_S)
        if succession.outcome.refused is None:
            self._tick, self._last = succession.after, succession
        return succession.outcome.refused
