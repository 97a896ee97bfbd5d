"""Who may ask the scope's server: pages of its own, and elsewhere whoever has the token."""

from __future__ import annotations

import re
import secrets
from dataclasses import dataclass
from urllib.parse import urlsplit

from aiohttp import web
from aiohttp.typedefs import Handler, Middleware

from motorctl.own_names import is_own, name_of
from motorctl.printable import one_line

COOKIE = "motorctl_scope"
"""How the name of the cookie begins; the port follows."""
TOKEN_PARAMETER = "token"
LOG_PAGE = "/log/{log_id:[0-9a-f]{64}}"
"""Where a log of a fleet has its page, as a route."""
LINKED = re.compile(r"/log/[0-9a-f]{64}/")
"""Such a page: the page of a fleet, which is a file or of another server, has links to it."""
CHANGED = ("/api/trigger",)
"""What is changed by a request, of the scope itself; a machine is by none."""
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}


@dataclass(frozen=True)
class Access:
    """What the server asks of a request."""

    address: str
    """Where it listens."""
    token: str | None
    """What a request has to show, in a cookie or once in its address; None: nothing."""
    names: frozenset[str] = frozenset()
    """Of this computer, as others may know it; asked for once, as a name server may be slow."""

    def refusal(self, request: web.Request) -> str | None:
        """Return why a request is refused, in words; None where it is not."""
        host = request.headers.get("Host", "")
        if not is_own(name_of(host), self.address, self.names, others=self.token is not None):
            return (
                f"the page was asked for under the name '{_shown(host)}', which is none of this "
                "server's: open the address that motorctl scope printed"
            )
        origin = request.headers.get("Origin")
        if origin is not None and _place(origin) != host:
            return f"a page from '{_shown(origin)}' asked: only the scope's own page may"
        if request.headers.get("Sec-Fetch-Site") in ("cross-site", "same-site") and not _leads_here(
            request
        ):
            return "another page asked: only the scope's own page may"
        if self.token is not None and not self.knows(request.cookies.get(cookie_of(host))):
            return "the token is missing or wrong: open the address that motorctl scope printed"
        return None

    def knows(self, token: str | None) -> bool:
        """Tell whether this is the token."""
        return self.token is not None and secrets.compare_digest(
            (token or "").encode(errors="surrogateescape"), self.token.encode()
        )


def guarded(access: Access) -> Middleware:
    """Return what stands before every handler: it refuses, and sets the headers of every answer."""

    @web.middleware
    async def guard(request: web.Request, handler: Handler) -> web.StreamResponse:
        response: web.StreamResponse
        if TOKEN_PARAMETER in request.query and access.knows(request.query[TOKEN_PARAMETER]):
            # The token leaves the address at once: addresses are copied, cookies are not.
            response = web.Response(status=302, headers={"Location": "/"})
            name = cookie_of(request.headers.get("Host", ""))
            response.set_cookie(name, access.token or "", httponly=True, samesite="Strict")
        elif refusal := access.refusal(request):
            response = web.Response(status=403, text=f"refused: {refusal}\n")
        elif request.method not in ("GET", "HEAD") and request.path not in CHANGED:
            text = f"refused: {request.method}: the scope only shows\n"
            response = web.Response(status=405, text=text)
        elif request.method == "POST" and "Origin" not in request.headers:
            text = "refused: only the scope's own page changes anything\n"
            response = web.Response(status=403, text=text)
        else:
            try:
                response = await handler(request)
            except web.HTTPException as error:
                error.headers.update(HEADERS)
                raise
        response.headers.update(HEADERS)
        return response

    return guard


def cookie_of(host: str) -> str:
    """Return the cookie's name for a Host header: a browser tells no cookies apart by port."""
    port = re.search(r":(\d{1,5})$", host)
    return f"{COOKIE}_{port[1]}" if port else COOKIE


def new_token() -> str:
    """Return a token that nobody guesses."""
    return secrets.token_urlsafe(24)


def _leads_here(request: web.Request) -> bool:
    """Tell whether a person followed a link from elsewhere to a page itself, not its data."""
    page = request.path == "/" or LINKED.fullmatch(request.path)
    return bool(page) and request.headers.get("Sec-Fetch-Mode") == "navigate"


def _place(origin: str) -> str | None:
    """Return the host and port of an Origin header; None where it has none."""
    try:
        return urlsplit(origin).netloc
    except ValueError:  # a bracket that is not closed
        return None


def _shown(header: str) -> str:
    """Return a header as an answer may tell it: whatever bytes came, it is text."""
    return one_line(header[:80])
