"""Which code of a log's configuration may be imported: what its reader chose, not its writer.

A log carries the configuration that ran, with the names of its effects. Whoever opens a log has
chosen to read it, not to run what a stranger wrote there. A configuration of one's own is such a
choice: what `load` took from one is remembered with a digest, so that one's own logs open as ever.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from motorctl.config.named_code import ALLOWED_CODE, AllowedCode, NamedCode
from motorctl.errors import UsageError
from motorctl.state_folder import state_folder

MayRun = Callable[[NamedCode], bool]
_MOST_BYTES = 1_000_000


def allowed_by(modules: Sequence[str] = ()) -> MayRun:
    """Return what tells whether code that only a log names may be imported.

    It may where it was installed, where one of `modules` or the administrator's list has it, or
    where this user has loaded a configuration that names it and the files are the same as then.

    Parameters
    ----------
    modules
        Those that are allowed for this time; one of a package allows all that is in it.

    Raises
    ------
    UsageError
        Where one is no module's name. The function returned raises it where the administrator's
        list cannot be used.
    """
    for module in modules:
        if not all(part.isidentifier() for part in module.split(".")):
            raise UsageError(f"--allow-code {module}: should be the name of a module")
    given = AllowedCode(Path("--allow-code"), frozenset(modules))

    def may_run(code: NamedCode) -> bool:
        return given.allows(code) or was_chosen(code) or AllowedCode.read(ALLOWED_CODE).allows(code)

    return may_run


def remember(codes: Iterable[NamedCode]) -> None:
    """Keep in mind that this user had code imported; where that cannot be written, nothing is."""
    own = {
        _key(code): digest for code in codes if code.origin == "named" and (digest := _digest(code))
    }
    known = _chosen() if own else {}
    if own.items() <= known.items():
        return
    path = _file()
    draft = path.with_name(f"{path.name}.{os.getpid()}")
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(handle, "w") as file:
            json.dump(known | own, file, indent=1)
        draft.replace(path)


def was_chosen(code: NamedCode) -> bool:
    """Tell whether this user had the same code imported before, from the same files."""
    digest = _digest(code)
    return digest is not None and _chosen().get(_key(code)) == digest


def _file() -> Path:
    return state_folder() / "chosen_code.json"


def _key(code: NamedCode) -> str:
    return f"{code.target} {code.file}"


def _chosen() -> dict[str, str]:
    """Return the digests of what was chosen; nothing where somebody else might have written it."""
    try:
        with _file().open("rb") as file:
            found = os.fstat(file.fileno())
            if found.st_uid != os.geteuid() or found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
                return {}
            known = json.loads(file.read(_MOST_BYTES))
    except (OSError, ValueError):
        return {}
    return known if isinstance(known, dict) else {}


def _digest(code: NamedCode) -> str | None:
    """Return the digest of a module's file and of the packages around it; None without a file."""
    if code.file is None:
        return None
    file = Path(code.file)
    inside = file.parent.parent if file.name == "__init__.py" else file.parent
    around = [inside, *inside.parents][: code.module.count(".")]
    digest = hashlib.sha256()
    try:
        digest.update(file.read_bytes())
        for folder in around:
            init = folder / "__init__.py"
            digest.update(b"\0" + (init.read_bytes() if init.exists() else b""))
    except OSError:
        return None
    return digest.hexdigest()
