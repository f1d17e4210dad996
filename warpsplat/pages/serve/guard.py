"""Protect the server on this machine from other users and other pages.

* Another user of the machine can connect: a token, which only the printed address has, becomes a cookie.
* A page of the web can send requests here (CSRF): the cookie is kept from it (``SameSite``), and what
  changes something needs our own ``Origin``. No answer allows another origin to read it, or to frame it.
* A name of the web can be made to lead here (DNS rebinding): ``Host`` must be an address or ``localhost``.
* What was uploaded can be hostile: answers say their type and that it is not to be guessed, and that nothing
  in them may run or load. Our own page says itself what it may do (``pages.environment.policy``).
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from collections.abc import Iterable
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from warpsplat.errors import printable

TOKEN = "token"
"""Query parameter of the address."""

HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Headers of every response."""

NOTHING = "default-src 'none'; style-src 'unsafe-inline'; sandbox; frame-ancestors 'none'"
"""Policy of other responses: an SVG opened by itself runs and loads nothing."""


class Guard:
    """Wraps an application: rejects unauthorised requests, and adds headers to responses."""

    def __init__(self, app: ASGIApp, token: str, host: str = "") -> None:
        """Wrap ``app``.

        Args:
            app: behind it.
            token: what the address must have.
            host: a name of this machine under which it may be asked, beside addresses and ``localhost``.
        """
        self._app, self._token, self._host = app, token, host.lower()
        self._tickets: set[str] = set()

    def ticket(self) -> str:
        """Return a token for one use, because other users can read a browser's command line."""
        made = secrets.token_urlsafe(16)
        self._tickets.add(made)
        return made

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def marked(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in (HEADERS | {"Content-Security-Policy": NOTHING}).items():
                    headers.setdefault(name, value)
            await send(message)

        await (self._checked(Request(scope)) or self._app)(scope, receive, marked)

    def _checked(self, request: Request) -> Response | None:
        """Return the response to an unauthorised request, or to one with the token; None to pass it on."""
        headers = request.headers
        name, port = _place(headers.get("host", ""))
        if not self._is_ours(name):
            return line(403, f"this server is asked by its address, not as {printable(name) or 'nobody'}")
        if request.method not in {"GET", "HEAD"} and not _is_same(headers):
            return line(403, "another page may not ask for this")
        cookie = f"warpsplat-{port}"
        given = request.query_params.get(TOKEN)
        if given is not None and request.url.path == "/" and self._is_right(given):
            answer = RedirectResponse("/", 303)
            answer.set_cookie(cookie, self._token, httponly=True, samesite="strict")
            return answer
        if not self._is_known(request.cookies.get(cookie, "")):
            return line(403, "open the address that warpsplat serve printed: it has a token")
        return None

    def _is_ours(self, name: str) -> bool:
        """Return whether a host name is safe from DNS rebinding."""
        if name.lower() in {"localhost", self._host}:
            return bool(name)
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True

    def _is_right(self, token: str) -> bool:
        if token in self._tickets:
            self._tickets.remove(token)
            return True
        return self._is_known(token)

    def _is_known(self, token: str) -> bool:
        return hmac.compare_digest(token.encode(), self._token.encode())


def _is_same(headers: Headers) -> bool:
    """Return whether a request comes from a page of this server, or from no page."""
    origin = headers.get("origin")
    if origin is None:
        return headers.get("sec-fetch-site", "none") in {"same-origin", "none"}
    return urlsplit(origin).netloc.lower() == headers.get("host", "").lower()


def _place(host: str) -> tuple[str, int]:
    """Return the host and port of a request; no host if invalid."""
    try:
        found = urlsplit(f"//{host}")
        return found.hostname or "", found.port or 80
    except ValueError:
        return "", 80


def line(status: int, text: str, headers: Iterable[tuple[str, str]] = ()) -> PlainTextResponse:
    """Return a response of one line."""
    return PlainTextResponse(f"{text}\n", status, dict(headers))
