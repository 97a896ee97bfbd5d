"""A loop that the test plays: a mailbox that is emptied, and answered, as the test likes."""

from __future__ import annotations

from pathlib import Path

from daemon_rig import bench_config

from motorctl.config import load
from motorctl.daemon.report import Report
from motorctl.log.sample import AxisState
from motorctl.loop import LoopMemory, Phase, Reply, Verb
from motorctl.loop.vocabulary import Word


class PlayedLoop:
    """Two axes that stand, homed and enabled, and a mailbox that is emptied as the test likes."""

    def __init__(self, folder: Path) -> None:
        (folder / "bench.yaml").write_text(bench_config())
        self.machine = load(str(folder / "bench.yaml"))
        self.names = list(self.machine.axes)
        self.memory = LoopMemory.create(tuple(self.names), 6, 400.0)
        self.memory.phase = Phase.RUNNING
        rows = self.memory.axis_status_rows
        rows["state"], rows["homed"], rows["reference_m"] = AxisState.IDLE, True, 0.1
        self.report = Report(self.machine, self.memory, folder / "s")
        self.taken: list[tuple[Verb, str]] = []
        self.answers: dict[tuple[Verb, str], Reply] = {}
        """What is not answered by OK."""

    def take(self, most: int = 64) -> None:
        """Take commands from the mailbox, and obey."""
        for _ in range(most):
            number = self.memory.look_at(Word.MAIL_TAIL)
            if number == self.memory.look_at(Word.MAIL_HEAD):
                return
            command = self.memory.mailbox[number % 64]
            order = (Verb(int(command["verb"])), self.names[int(command["axis"])])
            self.taken.append(order)
            self.memory.replies[number % 64] = self.answers.get(order, Reply.OK)
            self.memory.announce(Word.MAIL_TAIL, number + 1)
