"""What runs on the emulated processor: Debian's Python, wheels, and ruckig, which has no wheel."""

from __future__ import annotations

import hashlib
import platform
import sys
import tarfile
from pathlib import Path

from virtual_machine import recipe
from virtual_machine.recipe import UnavailableError, add_wheels, check_tools, requirements, run

EMULATOR = "qemu-aarch64-static"
COMPILER = "aarch64-linux-gnu-g++"
TOOLS = {
    EMULATOR: "qemu-user-static",
    COMPILER: "g++-aarch64-linux-gnu",
    "debootstrap": "debootstrap",
    "dpkg-deb": "dpkg",
}
PACKAGES = ("python3", f"libpython{recipe.PYTHON}-dev")
PLATFORMS = tuple(
    f"manylinux{name}_aarch64" for name in ("2014", "_2_17", "_2_26", "_2_27", "_2_28")
)
FOR_TESTS = ("pytest", "hypothesis", "pytest-timeout", "pytest-rerunfailures", "pytest-xdist")
COMPILED = "ruckig"
"""From its sources: there is no wheel for this processor."""
BINDING = "nanobind"


def key() -> str:
    """Name this recipe by its content."""
    text = repr(requirements()).encode() + Path(__file__).read_bytes()
    return hashlib.sha256(text).hexdigest()[:16]


def check_host() -> None:
    """Raise UnavailableError where this host cannot emulate the processor."""
    if sys.platform != "linux":
        raise UnavailableError(f"the emulator needs Linux, this is {sys.platform}")
    if platform.machine() == "aarch64":
        raise UnavailableError("this is such a processor: `make test` runs on it")
    check_tools(TOOLS)


def build(folder: Path) -> None:
    """Make `root`, Debian's programs, and `site`, Python's packages. Raises UnavailableError."""
    root, site = folder / "root", folder / "site"
    source = recipe.mirror()
    wanted = f"--include={','.join(PACKAGES)}"
    kind = ("--foreign", "--arch=arm64", "--variant=minbase", wanted)
    run("debootstrap", *kind, recipe.SUITE, root, source)
    for package in (root / "var/cache/apt/archives").glob("*.deb"):
        run("dpkg-deb", "--extract", package, root)
        package.unlink()
    wheels = [text for text in requirements() if not text.startswith(COMPILED)]
    add_wheels(site, PLATFORMS, [*wheels, *FOR_TESTS])
    _compile_ruckig(folder / "draft", root, site)


def _compile_ruckig(draft: Path, root: Path, site: Path) -> None:
    """Compile ruckig as its CMakeLists.txt does, by the cross compiler alone."""
    (wanted,) = (text for text in requirements() if text.startswith(COMPILED))
    pip = (sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", draft)
    run(*pip, "--no-binary", COMPILED, wanted)
    run(sys.executable, "-m", "pip", "install", "--quiet", "--target", draft / "lib", BINDING)
    (packed,) = draft.glob(f"{COMPILED}-*.tar.gz")
    with tarfile.open(packed) as tar:
        tar.extractall(draft, filter="data")
    (sources,) = (path for path in draft.glob(f"{COMPILED}-*") if path.is_dir())
    binding = draft / "lib" / BINDING
    code = [path for path in (sources / "src/ruckig").glob("*.cpp") if "cloud" not in path.name]
    code += [sources / "src/wrapper/python.cpp", binding / "src/nb_combined.cpp"]
    headers = (
        sources / "include",
        binding / "include",
        binding / "ext/robin_map/include",
        root / f"usr/include/python{recipe.PYTHON}",
        root / "usr/include",
    )
    flags = ("-std=c++20", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-fno-strict-aliasing")
    made = site / f"{COMPILED}.cpython-{recipe.PYTHON.replace('.', '')}-aarch64-linux-gnu.so"
    includes = [f"-I{path}" for path in headers[:-1]] + [f"-idirafter{headers[-1]}"]
    run(COMPILER, *flags, "-DNDEBUG", *includes, *code, "-o", made)
