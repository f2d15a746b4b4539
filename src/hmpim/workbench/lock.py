"""The lock in front of the workbench: token, host, origin, and the size of what is sent.

A page in another tab of the same browser can reach every port of this computer, and what is
behind this one moves machines. So nothing is answered unless the address holds a token that
nobody else knows, the request names this host (a rebound name does not), and it comes from a page
of this server. The lock stands before the whole application, socket and static files included.
"""

import asyncio
import contextlib
import hmac
import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

__all__ = ["Lock", "fresh_token"]

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

_HEADERS = (
    (b"referrer-policy", b"no-referrer"),  # the address holds the token
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
)
_POLICY = (
    b"content-security-policy",
    b"default-src 'self' data: blob: 'unsafe-inline' 'unsafe-eval'; object-src 'none'; "
    b"base-uri 'self'; form-action 'self'; frame-ancestors 'none'",
)

_AT_ONCE = 0.1  # s within which a connection that is closed says so


def fresh_token() -> str:
    """Return a token that nobody can guess: 192 bits, safe in an address.

    Examples
    --------
    >>> len(fresh_token()), fresh_token() == fresh_token()
    (32, False)
    """
    return secrets.token_urlsafe(24)


class Lock:
    """An ASGI application that lets through only what it knows.

    Parameters
    ----------
    app : ASGI application
        What is behind the lock. It sees the token as its root path.
    token : str
        First part of the path of every address.
    port : int
        Where the server listens on loopback.
    hosts : tuple of str
        Names by which it may be called, without the port.
    largest : int
        Bytes that one request may carry.

    Examples
    --------
    >>> lock = Lock(None, token="secret", port=8080)
    >>> lock.reason({"type": "http", "path": "/secret/", "headers": [(b"host", b"evil.test")]})
    'this server is not called evil.test'
    """

    def __init__(
        self,
        app: Any,
        *,
        token: str,
        port: int,
        hosts: tuple[str, ...] = ("127.0.0.1", "localhost", "[::1]"),
        largest: int = 2_000_000_000,
    ) -> None:
        self._app, self._token, self._largest = app, token, largest
        self._hosts = {f"{host}:{port}" for host in hosts}
        if port == 80:
            self._hosts |= set(hosts)
        self._origins = {f"http://{host}" for host in self._hosts}

    def reason(self, scope: Scope) -> str:
        """Say why a request is refused; '' where it may pass.

        Parameters
        ----------
        scope : mapping
            ASGI's, of a request over HTTP or of a web socket.
        """
        headers = _by_name(scope)
        host = headers.get("host", "")
        if host not in self._hosts:
            return f"this server is not called {host[:80] or 'nothing'}"
        origin = headers.get("origin")
        if origin is None and scope["type"] == "websocket":
            return "a socket is opened by a page of this server only"
        if origin is not None and origin not in self._origins:
            return f"pages of {origin[:80]} may not use this server"
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
            return "pages of other servers may not use this one"
        given = str(scope["path"]).split("/", 2)[1:2]
        if not hmac.compare_digest((given or [""])[0].encode(), self._token.encode()):
            return "the address lacks its token; open the one that hmpim workbench printed"
        return ""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        reason = self.reason(scope)
        if reason:
            await _refuse(scope, send, 403, reason)
            return
        stated = _by_name(scope).get("content-length", "0")
        if not (stated.isascii() and stated.isdigit()):
            await _refuse(scope, send, 400, "content-length is not a number")
            return
        if int(stated) > self._largest:
            await _refuse(scope, send, 413, self._too_large)
            return
        inside = {**scope, "root_path": f"/{self._token}"}
        begun = False

        async def answer(message: Message) -> None:
            nonlocal begun
            if message["type"] == "http.response.start":
                begun = True
                own = {name for name, _ in message.get("headers", ())}
                more = [_POLICY] if _POLICY[0] not in own else []
                message = {**message, "headers": [*message["headers"], *_HEADERS, *more]}
            await send(message)

        try:
            await self._app(inside, _counted(receive, self._largest), answer)
        except _TooLargeError:
            if not begun:
                await _refuse(scope, send, 413, self._too_large)
        except RuntimeError:  # Starlette's, where nobody is left to answer: no defect, no traceback
            if begun or not await _has_left(receive):
                raise

    @property
    def _too_large(self) -> str:
        return f"more than {self._largest / 1e6:g} MB; start with a larger --max-upload"


class _TooLargeError(Exception):
    """More bytes came than a request may carry."""


def _by_name(scope: Scope) -> dict[str, str]:
    """Headers by name; of two with one name a joined value, which nothing allows."""
    found: dict[str, str] = {}
    for name, value in scope.get("headers", ()):
        key = name.decode("latin-1").lower()
        text = value.decode("latin-1")
        found[key] = f"{found[key]}, {text}" if key in found else text
    return found


def _counted(receive: Receive, largest: int) -> Receive:
    """Count the bytes of a request's body as they come, whatever its header says."""
    count = 0

    async def counting() -> Message:
        nonlocal count
        message = await receive()
        if message["type"] == "http.request":
            count += len(message.get("body", b""))
            if count > largest:
                raise _TooLargeError
        return message

    return counting


async def _has_left(receive: Receive) -> bool:
    """Whether the browser has closed the connection."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(_AT_ONCE):
            while (await receive())["type"] != "http.disconnect":
                pass
            return True
    return False


async def _refuse(scope: Scope, send: Send, status: int, reason: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": reason[:100]})
        return
    body = f"hmpim workbench: {reason}\n".encode("latin-1", "replace")
    headers = [
        (b"content-type", b"text/plain; charset=latin-1"),
        (b"content-length", str(len(body)).encode()),
        (b"connection", b"close"),
        *_HEADERS,
    ]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
