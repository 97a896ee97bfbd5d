"""An object store on loopback that refuses requests: moto's S3, behind a door shut at times."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

BUCKET = "logs"
REGION = "us-east-1"
NOBODY = {"AWS_ACCESS_KEY_ID": "nobody", "AWS_SECRET_ACCESS_KEY": "nothing"}
"""moto asks for a name, and looks at none."""

Application = Callable[[dict[str, Any], Callable[..., Any]], Iterable[bytes]]


@dataclass
class Door:
    """A WSGI application that refuses one request in so many, as a busy store does."""

    behind: Application
    one_in: int
    is_shut: bool = False
    """Whether it refuses at all yet."""
    asked: int = 0
    refused: int = 0

    def __post_init__(self) -> None:
        """Requests come from several threads."""
        self._lock = threading.Lock()

    def __call__(self, request: dict[str, Any], respond: Callable[..., Any]) -> Iterable[bytes]:
        """Answer a request, or refuse it."""
        with self._lock:
            self.asked += self.is_shut
            refuses = self.is_shut and self.asked % self.one_in == 0
            self.refused += refuses
        if refuses:
            respond("503 Slow Down", [("Content-Type", "application/xml"), ("Content-Length", "0")])
            return []
        return self.behind(request, respond)


@contextmanager
def refusing_store(folder: Path, one_in: int) -> Iterator[tuple[str, Door]]:
    """Serve the logs of a folder as `s3://`, to this process and to those that it starts.

    Parameters
    ----------
    folder
        Whose files are put into the store.
    one_in
        Of so many requests one is refused.

    Yields
    ------
    str, Door
        A pattern of the logs, and what was asked and refused.
    """
    import s3fs
    from moto.moto_server.werkzeug_app import DomainDispatcherApplication, create_backend_app
    from werkzeug.serving import WSGIRequestHandler, make_server

    class Quiet(WSGIRequestHandler):
        def log(self, *_: Any) -> None:
            pass

    door = Door(DomainDispatcherApplication(create_backend_app), one_in)
    server = make_server("127.0.0.1", 0, door, threaded=True, request_handler=Quiet)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    told = NOBODY | {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{server.port}",
        "AWS_DEFAULT_REGION": REGION,
        "AWS_EC2_METADATA_DISABLED": "true",
    }
    before = {name: os.environ.get(name) for name in told}
    os.environ.update(told)
    try:
        files = s3fs.S3FileSystem(skip_instance_cache=True)
        files.mkdir(BUCKET)
        for path in sorted(folder.glob("**/*.parquet")):
            files.put_file(str(path), f"{BUCKET}/{path.relative_to(folder)}")
        door.is_shut = True
        yield f"s3://{BUCKET}/**/*.parquet", door
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
        server.shutdown()
        thread.join()
        server.server_close()
