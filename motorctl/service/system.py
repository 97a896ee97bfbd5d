"""The system that a service is put into: the running one, or a folder that will be one."""

from __future__ import annotations

import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

from motorctl.errors import RunError, UsageError
from motorctl.service.outcome import Outcome

COMMAND_TIMEOUT_S = 120.0


@dataclass(frozen=True)
class System:
    """A root folder, and what may be done to it."""

    root: Path
    dry_run: bool

    @property
    def running(self) -> bool:
        """Whether it is the system that this program runs in."""
        return self.root == Path("/")

    def at(self, path: Path) -> Path:
        """Return where a path of that system is found from here."""
        return self.root / path.relative_to("/")

    def insist(self, doing: str) -> None:
        """Raise UsageError where this program may not, or cannot, change it."""
        if not self.root.is_dir():
            raise UsageError(f"--root {self.root}: there is no such folder")
        if self.dry_run:
            return
        if self.running and os.geteuid() != 0:
            raise UsageError(
                f"{doing} a service takes root: sudo, or --dry-run to see what it does"
            )
        if self.running and not Path("/run/systemd/system").is_dir():
            raise UsageError(
                "systemd does not run this computer; --root DIR writes the files into the folder "
                "of another system"
            )
        if not os.access(self.root, os.W_OK | os.X_OK):
            raise UsageError(f"--root {self.root}: no permission to write there")

    def write(self, path: Path, text: str, outcome: Outcome, mode: int = 0o644) -> None:
        """Make a file hold a text: the old one or the new one, never a part. Raises RunError."""
        place = self.at(path)
        before = place.read_text() if place.is_file() else None
        if before == text:
            outcome.tell("unchanged", path)
            return
        if not self.dry_run:
            draft = place.with_name(f".{place.name}.{os.getpid()}")
            try:
                place.parent.mkdir(parents=True, exist_ok=True)
                draft.write_text(text)
                draft.chmod(mode)
                draft.replace(place)
            except OSError as error:
                draft.unlink(missing_ok=True)
                raise RunError(f"{place}: not written: {error.strerror}") from error
        outcome.tell("written" if before is None else "updated", path)

    def remove(self, path: Path, outcome: Outcome) -> None:
        """Take a file away, if it is there. Raises RunError."""
        place = self.at(path)
        if not place.exists():
            return
        if not self.dry_run:
            try:
                place.unlink()
            except OSError as error:
                raise RunError(f"{place}: not removed: {error.strerror}") from error
        outcome.tell("removed", path)

    def give_to_root(self, path: Path, outcome: Outcome) -> None:
        """Let nobody but root change a file, if it is there. Raises RunError."""
        place = self.at(path)
        if not place.is_file():
            return
        if not self.dry_run:
            try:
                place.chmod(0o644)
                if os.geteuid() == 0:
                    os.chown(place, 0, 0)
            except OSError as error:
                raise RunError(f"{place}: not given back to root: {error.strerror}") from error
        outcome.tell("updated", path, "nobody but root may change it")

    def run(self, outcome: Outcome, *command: str) -> None:
        """Run a command, in the running system only. Raises RunError where it fails."""
        if not self.running:
            return
        words = " ".join(command)
        if not self.dry_run:
            try:
                done = subprocess.run(
                    command,
                    capture_output=True,
                    text=True,
                    check=False,
                    timeout=COMMAND_TIMEOUT_S,
                    stdin=subprocess.DEVNULL,
                )
            except OSError as error:
                raise RunError(f"{words}: {error.strerror}") from error
            except subprocess.TimeoutExpired as error:
                message = f"{words}: did not end within {COMMAND_TIMEOUT_S:g} s"
                raise RunError(message) from error
            if done.returncode:
                said = done.stderr.strip() or done.stdout.strip()
                raise RunError(f"{words}: exit status {done.returncode}: {said}")
        outcome.tell("run", words)
