"""Access control: what other users and other web pages cannot do to a server on this machine, and why.

* Another user of the machine can connect: the printed address has a token, which becomes a cookie.
* A page of the web can send requests here (CSRF): the cookie is kept from it (``SameSite``), and requests
  that change something need our own ``Origin``. No answer allows another origin to read or frame it.
* A name of the web can be made to lead here (DNS rebinding): ``Host`` must be an address or ``localhost``.
* Uploads can be hostile: answers state their type, forbid guessing it, and let nothing in them run or load.
  The policy of our own page is in its head (``pages.environment.policy``).
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from collections.abc import Mapping
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from warpsplat.errors import printable

TOKEN = "token"
"""Name of the token in an address' query."""

HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
    # An SVG that is opened by itself runs and loads nothing.
    "Content-Security-Policy": (
        "default-src 'none'; style-src 'unsafe-inline'; sandbox; frame-ancestors 'none'"
    ),
}
"""Headers of every answer that has none of its own."""


class Guard:
    """Middleware that admits authorised requests only, and adds the headers of every answer."""

    def __init__(self, app: ASGIApp, token: str, host: str = "") -> None:
        """Wrap an application; ``host``: a name that is trusted besides addresses and ``localhost``."""
        self._app, self._token, self._host = app, token, host.lower()
        self._tickets: set[str] = set()

    def ticket(self) -> str:
        """Return a token for one use: other users can read the command line of a browser."""
        ticket = secrets.token_urlsafe(16)
        self._tickets.add(ticket)
        return ticket

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        await (self._refusal(Request(scope)) or self._app)(scope, receive, send_with_headers)

    def _refusal(self, request: Request) -> Response | None:
        """Return the answer to a request that is refused or brings the token; None: it is admitted."""
        name, port = _host_and_port(request.headers.get("host", ""))
        if not self._is_trusted(name):
            return line(403, f"this server does not answer to the name '{printable(name)}'")
        if request.method not in {"GET", "HEAD"} and not _is_same_origin(request.headers):
            return line(403, "requests from other pages are not allowed")
        cookie = f"warpsplat-{port}"
        given = request.query_params.get(TOKEN, "") if request.url.path == "/" else ""
        if given in self._tickets or self._is_token(given):
            self._tickets.discard(given)
            answer = RedirectResponse("/", 303)
            answer.set_cookie(cookie, self._token, httponly=True, samesite="strict")
            return answer
        if not self._is_token(request.cookies.get(cookie, "")):
            return line(403, "open the address that warpsplat serve printed: it contains a token")
        return None

    def _is_trusted(self, name: str) -> bool:
        """Return whether a host is an address or a name that nobody else can make lead here."""
        if name.lower() in {"localhost", self._host}:
            return bool(name)
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True

    def _is_token(self, token: str) -> bool:
        return hmac.compare_digest(token.encode(), self._token.encode())


def _is_same_origin(headers: Headers) -> bool:
    """Return whether a request comes from a page of this server, or from no page."""
    origin = headers.get("origin")
    if origin is None:
        return headers.get("sec-fetch-site", "none") in {"same-origin", "none"}
    return urlsplit(origin).netloc.lower() == headers.get("host", "").lower()


def _host_and_port(host: str) -> tuple[str, int]:
    """Return what a request was sent to; an empty name if it is malformed."""
    try:
        found = urlsplit(f"//{host}")
        return found.hostname or "", found.port or 80
    except ValueError:
        return "", 80


def line(status: int, text: str, headers: Mapping[str, str] | None = None) -> PlainTextResponse:
    """Return an answer of one line."""
    return PlainTextResponse(f"{text}\n", status, headers)
