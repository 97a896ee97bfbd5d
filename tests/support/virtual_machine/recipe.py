"""What the machine is made of, and how: Debian packages, wheels, a disk image."""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shutil
import subprocess
import sys
import tomllib
import urllib.error
import urllib.request
from collections.abc import Mapping, Sequence
from pathlib import Path

from virtual_machine.initrd import make_initrd

HERE = Path(__file__).parent
PYPROJECT = HERE.parents[2] / "pyproject.toml"
SUITE = "bookworm"
PYTHON = "3.11"  # of that suite
PACKAGES = (
    *("python3", "python3-venv", "can-utils", "iproute2", "kmod", "busybox-static", "procps"),
    *("systemd", "systemd-sysv", "udev", "dbus"),
)
KERNEL = "linux-image-rt-amd64"
MODULES = ("net/can", "drivers/net/can", "net/sched", "fs/autofs")
PLATFORMS = ("manylinux2014_x86_64", "manylinux_2_17_x86_64", "manylinux_2_28_x86_64")
EXTRAS = ("can",)
NOT_NEEDED = ("matplotlib",)  # draws only
PROGRAMS = {"init.sh": "sbin/machine-init", "job.sh": "sbin/machine-job"}
JOB_UNIT = "machine-job.service"
ENVIRONMENT = "/opt/motorctl"
WITH_SYSTEMD = "machine_boot=systemd"
"""A word for the kernel: without it the job is all that runs."""
IMAGE_SIZE = "4G"  # sparse
TOOLS = {
    "qemu-system-x86_64": "qemu-system-x86",
    "debootstrap": "debootstrap",
    "mkfs.ext4": "e2fsprogs",
    "dpkg": "dpkg",
}
"""What the host needs, and the Debian package that has it."""


class UnavailableError(Exception):
    """This host cannot have such a machine, and why."""


def requirements() -> list[str]:
    """Return what motorctl needs inside."""
    project = tomllib.loads(PYPROJECT.read_text())["project"]
    wanted = list(project["dependencies"])
    for extra in EXTRAS:
        wanted += project["optional-dependencies"][extra]
    return [text for text in wanted if not text.startswith(NOT_NEEDED)]


def key() -> str:
    """Name this recipe by its content."""
    digest = hashlib.sha256(repr(requirements()).encode())
    for name in ("recipe.py", "initrd.py", *PROGRAMS, JOB_UNIT):
        digest.update((HERE / name).read_bytes())
    return digest.hexdigest()[:16]


def check_host() -> None:
    """Raise UnavailableError where this host cannot run the machine."""
    if platform.machine() != "x86_64" or sys.platform != "linux":
        raise UnavailableError(f"the machine is an x86_64 one, this is {platform.machine()}")
    check_tools(TOOLS)


def check_tools(packages: Mapping[str, str]) -> None:
    """Raise UnavailableError where a Debian package is not installed, or without root."""
    missing = [f"{tool} (Debian: {have})" for tool, have in packages.items() if not _which(tool)]
    if missing:
        raise UnavailableError(f"not installed: {', '.join(missing)}")
    if os.geteuid() != 0:
        raise UnavailableError("debootstrap and chroot need root")


def mirror() -> str:
    """Return the address that the host's own Debian packages come from. Raises UnavailableError."""
    files = [Path("/etc/apt/sources.list"), *Path("/etc/apt/sources.list.d").glob("*")]
    for file in files:
        text = file.read_text() if file.is_file() else ""
        for line in text.splitlines():
            found = re.search(r"https?://\S+/debian(?=/?(\s|$))", line)
            if found and not line.lstrip().startswith("#"):
                return _reached(found.group())
    raise UnavailableError("the host's apt sources name no Debian mirror")


def _reached(source: str) -> str:
    try:
        urllib.request.urlopen(f"{source}/dists/{SUITE}/Release", timeout=20).close()
    except (urllib.error.URLError, TimeoutError) as error:
        raise UnavailableError(f"no network to {source}: {error}") from error
    return source


def build(folder: Path) -> None:
    """Make `tree`, `vmlinuz`, `initrd` and `image` in a folder. Raises UnavailableError."""
    source = mirror()
    tree, kernel = folder / "tree", folder / "kernel"
    include = f"--include={','.join(PACKAGES)}"
    run("debootstrap", "--variant=minbase", include, SUITE, tree, source)
    _add_kernel(tree, kernel)
    for path in (tree / "var/cache/apt/archives").glob("*.deb"):
        path.unlink()
    (folder / "initrd").write_bytes(make_initrd(tree / "bin/busybox", kernel))
    (vmlinuz,) = (kernel / "boot").glob("vmlinuz-*")
    shutil.move(vmlinuz, folder / "vmlinuz")
    shutil.rmtree(kernel)
    _add_environment(tree)
    for name, place in PROGRAMS.items():
        shutil.copy(HERE / name, tree / place)
        (tree / place).chmod(0o755)
    shutil.copy(HERE / JOB_UNIT, tree / "etc/systemd/system")
    in_tree(tree, "systemctl", "enable", JOB_UNIT)
    (tree / "job").mkdir()
    image = folder / "image"
    run("truncate", "-s", IMAGE_SIZE, image)
    run("mkfs.ext4", "-q", "-F", "-d", tree, image)


def in_tree(tree: Path, *command: str | Path, **environment: str) -> str:
    """Run a program of the machine's, without the machine, on this kernel; give what it said."""
    usual = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "LANG": "C.UTF-8", "HOME": "/root"}
    return run("chroot", tree, *command, environment={**usual, **environment})


def _add_kernel(tree: Path, kernel: Path) -> None:
    said = in_tree(tree, "apt-cache", "depends", KERNEL)
    name = re.findall(r"Depends: (linux-image-\S+)", said)[0]
    in_tree(tree, "sh", "-c", f"cd /tmp && apt-get download -q {name}")
    (package,) = (tree / "tmp").glob("linux-image-*.deb")
    run("dpkg", "-x", package, kernel)
    package.unlink()
    (modules,) = (kernel / "lib/modules").iterdir()
    there = tree / "lib/modules" / modules.name
    for wanted in MODULES:
        shutil.copytree(modules / "kernel" / wanted, there / "kernel" / wanted)
    for path in modules.glob("modules.*"):
        shutil.copy(path, there)
    in_tree(tree, "depmod", modules.name)


def add_wheels(target: Path, platforms: Sequence[str], wanted: Sequence[str]) -> None:
    """Unpack wheels of another platform into a folder. Raises UnavailableError."""
    kinds = [f"--platform={name}" for name in platforms]
    pip = (sys.executable, "-m", "pip", "install", "--quiet", "--no-compile")
    what = (f"--python-version={PYTHON}", *kinds, "--only-binary=:all:", *wanted)
    try:
        run(*pip, "--target", target, *what)
    except RuntimeError as error:
        if "connection" in str(error).lower():
            raise UnavailableError(f"no network to PyPI: {str(error)[-300:]}") from error
        raise


def _add_environment(tree: Path) -> None:
    add_wheels(tree / "opt/packages", PLATFORMS, requirements())
    # an environment that has them, for a job that installs motorctl's own wheel
    in_tree(tree, "python3", "-m", "venv", ENVIRONMENT)
    (site,) = (tree / ENVIRONMENT.lstrip("/")).glob("lib/python*/site-packages")
    (site / "libraries.pth").write_text("/opt/packages\n")
    in_tree(tree, "python3", "-m", "compileall", "-q", "-j", "2", "/opt/packages", ENVIRONMENT)


def run(*command: str | Path, environment: dict[str, str] | None = None) -> str:
    """Run a program and return what it said; raises RuntimeError with that where it fails."""
    words = [str(word) for word in command]
    done = subprocess.run(
        words,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)}: exit status {done.returncode}\n{done.stdout}")
    return done.stdout


def _which(tool: str) -> str | None:
    return shutil.which(tool) or shutil.which(tool, path="/usr/sbin:/sbin")
