"""The machine, built once and kept; a job goes in and its result comes out."""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import tarfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from virtual_machine import recipe

GRACE_S = 60
"""For starting and going off, beside the job's own time."""
KEPT = "kept"
"""A folder of the job that stays from one job to the next, as `/job/kept`."""
FORGOTTEN_ABOVE = 200_000_000  # bytes; of what was kept


@dataclass(frozen=True)
class Result:
    """What a job left."""

    exit_status: int
    stdout: str
    stderr: str
    console: str
    folder: Path
    """What it wrote to `/job/result`."""


class Machine:
    """A machine whose image exists."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def run(
        self,
        job: Path,
        scratch: Path,
        limit_s: int,
        before: str | None = None,
        systemd: bool = False,
        tell: Callable[[str], None] | None = None,
    ) -> Result:
        """Run `run.sh` of a job's folder, as root in `/job`, in a machine that is new each time.

        `before` is a shell command that runs in the machine's tree without the machine, at this
        host's full speed, for what is slow to compute; it finds the job in `/job` as well. With
        `systemd` the job is a service beside others, and may start the machine anew: `run.sh` is
        then run again. `tell` is given each line of the console as it comes.
        """
        packed, result_disk = scratch / "job.tar", scratch / "result.disk"
        with _locked(self._folder):
            self._prepare(job, packed, before)
        with result_disk.open("wb") as file:
            file.truncate(256_000_000)
        console = scratch / "console"
        words = f"console=ttyS0 quiet panic=-1 job_limit_s={limit_s}"
        if systemd:
            words += f" {recipe.WITH_SYSTEMD} systemd.getty_auto=no systemd.show_status=no"
            # a look at any other clock stops the emulator
            words += " tsc=reliable clocksource=tsc mitigations=off"
            # what the kernel's modules here are too few for
            for unit in ("systemd-binfmt.service", "proc-sys-fs-binfmt_misc.automount"):
                words += f" systemd.mask={unit}"
        emulator = ["qemu-system-x86_64", "-accel", "tcg,thread=multi", "-cpu", "max"]
        # a loop that locks its memory takes 700 MB, and so does a device
        size = ["-m", "4096" if systemd else "2048", "-smp", "2"]
        plain = ["-nodefaults", "-no-user-config", "-display", "none"]
        if not systemd:
            plain.append("-no-reboot")
        kernel = ["-kernel", self._folder / "vmlinuz", "-initrd", self._folder / "initrd"]
        disks = [
            f"file={self._folder / 'image'},snapshot=on",
            f"file={packed},readonly=on",
            f"file={result_disk}",
        ]
        command = [
            *emulator,
            *size,
            *plain,
            *kernel,
            "-append",
            words,
            "-serial",
            f"file:{console}",
        ]
        for disk in disks:
            command += ["-drive", f"{disk},if=virtio,format=raw"]
        with (scratch / "qemu").open("w+") as said:
            process = subprocess.Popen(command, stdout=said, stderr=said)
            try:
                _follow(process, console, tell, limit_s + GRACE_S)
            finally:
                process.kill()
                process.wait()
        if process.returncode:
            raise RuntimeError(f"qemu: {_read(scratch / 'qemu')}")
        return _result(result_disk, scratch, _read(console))

    def _prepare(self, job: Path, packed: Path, before: str | None) -> None:
        inside = self._folder / "tree/job"
        for path in inside.iterdir():
            if path.name != KEPT:
                shutil.rmtree(path) if path.is_dir() else path.unlink()
        kept = inside / KEPT
        if sum(p.stat().st_size for p in kept.rglob("*") if p.is_file()) > FORGOTTEN_ABOVE:
            shutil.rmtree(kept)
        kept.mkdir(exist_ok=True)
        shutil.copytree(job, inside, dirs_exist_ok=True)
        # compilers' caches compare time stamps; those of a tar have whole seconds
        for path in inside.rglob("*.py"):
            os.utime(path, (1e9, 1e9))
        if before is not None:
            recipe.in_tree(self._folder / "tree", "sh", "-c", f"cd /job && {before}")
        with tarfile.open(packed, "w", format=tarfile.GNU_FORMAT) as tar:
            for path in sorted(inside.iterdir()):
                tar.add(path, path.name)


def machine() -> Machine:
    """Return the machine, built now if that was not done before; raises UnavailableError."""
    recipe.check_host()
    return Machine(kept_build("machine", recipe.key(), recipe.build))


def kept_build(what: str, key: str, build: Callable[[Path], None]) -> Path:
    """Return the folder that `build` has filled, now or earlier; older ones of its kind go."""
    base = os.environ.get("XDG_CACHE_HOME")
    cache = (Path(base) if base else Path.home() / ".cache") / "motorctl-tests"
    cache.mkdir(parents=True, exist_ok=True)
    folder = cache / f"{what}-{key}"
    with _locked(cache):
        if not folder.exists():
            for old in cache.glob(f"{what}-*"):
                shutil.rmtree(old)
            draft = cache / f"{what}-draft-{os.getpid()}"
            draft.mkdir()
            try:
                build(draft)
            except BaseException:
                shutil.rmtree(draft, ignore_errors=True)
                raise
            draft.rename(folder)
    return folder


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    with (folder / "lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _follow(
    process: subprocess.Popen[bytes],
    console: Path,
    tell: Callable[[str], None] | None,
    limit_s: float,
) -> None:
    """Wait for the machine's end and hand on what it says; raises TimeoutError."""
    told, deadline = 0, time.monotonic() + limit_s
    ended = False
    while not ended:
        try:
            process.wait(1.0)
            ended = True
        except subprocess.TimeoutExpired:
            if time.monotonic() > deadline:
                raise TimeoutError(f"the machine did not end:\n{_read(console)}") from None
        whole = _read(console).splitlines()[: None if ended else -1]
        for line in whole[told:] if tell is not None else ():
            tell(line)
        told = len(whole)


def _result(disk: Path, scratch: Path, console: str) -> Result:
    try:
        with tarfile.open(disk, "r:") as tar:
            tar.extractall(scratch, filter="data")
    except tarfile.TarError as error:
        raise RuntimeError(f"the machine wrote no result:\n{console}") from error
    folder = scratch / "result"
    status = int(_read(folder / "exit_status"))
    return Result(status, _read(folder / "stdout"), _read(folder / "stderr"), console, folder)


def _read(path: Path) -> str:
    return path.read_text(errors="replace") if path.exists() else ""
