"""Answers of the scope's server, as a client has them."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

from motorctl.scope.access import Access

OWN = Access("127.0.0.1", None)


def asked(paths: list[Path], *requests: tuple[str, dict[str, Any]], access: Access = OWN) -> Any:
    """Return status, headers and body of each answer; the client's own are usual headers."""

    from aiohttp.test_utils import TestClient, TestServer

    from motorctl.scope.server import Logs, application

    async def run() -> list[tuple[int, Any, bytes]]:
        app = application(Logs.of(paths), access)
        async with TestClient(TestServer(app)) as client:
            answers = []
            for path, options in requests:
                method = options.pop("method", "GET")
                answer = await client.request(method, path, allow_redirects=False, **options)
                answers.append((answer.status, answer.headers, await answer.read()))
            return answers

    answers = asyncio.run(run())
    return answers[0] if len(answers) == 1 else answers
