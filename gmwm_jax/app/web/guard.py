"""What every request passes before the page's framework sees it: host, origin, sizes, sessions, headers.

The framework takes uploads of any size, a socket opened by any other page, and any host name; here they are refused.
"""

import asyncio
import re
import shutil
import tempfile
import time
from collections.abc import Iterable
from typing import Any

from gmwm_jax.app.web.limits import Limits

HEADERS = {
    "content-security-policy": (
        "default-src 'self'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; "
        "img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self'; frame-ancestors 'none'; "
        "object-src 'none'; base-uri 'none'; form-action 'self'"
    ),
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
}
"""Of every answer."""
_LIBRARY = {"cache-control": "no-cache"}
"""Of programs and styles: a browser keeps them, and asks whether they have changed."""

_UPLOAD = re.compile(r"/session/(\w+)/upload/\w+$")
_SMALL = 1 << 20
"""Bytes of a request that is no upload."""
_COUNTED = 10_000
"""Sessions of which it is known how much they have sent."""


class Guard:
    """An ASGI application around another one.

    Parameters
    ----------
    app
        The application.
    hosts
        Names by which it may be called, without port.
    limits
        Sizes and counts.
    """

    def __init__(self, app: Any, hosts: Iterable[str], limits: Limits):
        self._app, self._hosts, self._limits = app, frozenset(hosts), limits
        self._open = 0
        self._uploaded: dict[str, int] = {}

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] == "http":
            await self._http(scope, receive, send)
        elif scope["type"] == "websocket":
            await self._websocket(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    async def _http(self, scope: Any, receive: Any, send: Any) -> None:
        headers = _headers(scope)
        if _name(headers.get("host", "")) not in self._hosts:
            await _answer(send, 421, "This server does not answer to that name: start it with --name NAME.")
            return
        upload = _UPLOAD.search(scope["path"])
        if scope["path"].rstrip("/") == scope.get("root_path", "") and self._open >= self._limits.sessions:
            await _answer(send, 503, self._limits.too_many_sessions())
            return
        if upload is None:
            most, refusal = _SMALL, "The request is too large."
        else:
            origin = headers.get("origin")
            if origin is not None and origin.partition("://")[2] != headers.get("host"):
                await _answer(send, 403, "The request comes from another page.")
                return
            left = self._limits.uploads_per_session - self._uploaded.get(upload[1], 0)
            free = shutil.disk_usage(tempfile.gettempdir()).free - self._limits.free_disk
            most = min(self._limits.upload, left, free)
            refusal = self._limits.too_large()
            if most < self._limits.upload:
                refusal = "This session has sent too much, or the server's disk is full: open the page again later."
        declared = headers.get("content-length", "0")
        if not declared.isdigit() or int(declared) > most:
            await _answer(send, 413, refusal)
            return
        given = HEADERS | _LIBRARY if scope["path"].startswith(scope.get("root_path", "") + "/lib/") else HEADERS
        state = {"bytes": 0, "answered": False, "cut": False}

        async def counted() -> Any:
            if state["cut"]:
                return {"type": "http.disconnect"}
            message = await receive()
            if message["type"] == "http.request":
                state["bytes"] += len(message.get("body", b""))
                if upload is not None:
                    self._count(upload[1], len(message.get("body", b"")))
                if state["bytes"] > most:
                    state["cut"] = True
                    if not state["answered"]:
                        state["answered"] = True
                        await _answer(send, 413, refusal)
                    return {"type": "http.disconnect"}
            return message

        async def headed(message: Any) -> None:
            if state["cut"]:
                return
            if message["type"] == "http.response.start":
                state["answered"] = True
                kept = [(k, v) for k, v in message.get("headers", []) if k.decode().lower() not in HEADERS]
                message = {**message, "headers": [*kept, *_encoded(given)]}
            await send(message)

        try:
            await self._app(scope, counted, headed)
        except Exception:
            if not state["cut"]:  # else it is the end that was made here
                raise

    def _count(self, session: str, size: int) -> None:
        """Add to what a session has sent; anybody may make up a session, so that the oldest of many is forgotten."""
        self._uploaded[session] = self._uploaded.pop(session, 0) + size
        if len(self._uploaded) > _COUNTED:
            del self._uploaded[next(iter(self._uploaded))]

    async def _websocket(self, scope: Any, receive: Any, send: Any) -> None:
        headers = _headers(scope)
        origin, host = headers.get("origin", ""), headers.get("host", "")
        if _name(host) not in self._hosts or origin.partition("://")[2] != host or self._open >= self._limits.sessions:
            await receive()
            await send({"type": "websocket.close", "code": 1008})  # before it is accepted: 403
            return
        self._open += 1
        last = time.monotonic()

        async def timed() -> Any:
            nonlocal last
            try:
                message = await asyncio.wait_for(receive(), max(0.01, last + self._limits.idle - time.monotonic()))
            except TimeoutError:
                await send({"type": "websocket.close", "code": 4000, "reason": "idle"})
                return {"type": "websocket.disconnect", "code": 4000}
            last = time.monotonic()
            return message

        try:
            await self._app(scope, timed, send)
        finally:
            self._open -= 1


def _headers(scope: Any) -> dict[str, str]:
    return {key.decode("latin-1").lower(): value.decode("latin-1") for key, value in scope["headers"]}


def _name(host: str) -> str:
    """Return the host without its port."""
    return re.sub(r":\d*$", "", host).lower()


def _encoded(headers: dict[str, str]) -> list[tuple[bytes, bytes]]:
    return [(key.encode(), value.encode()) for key, value in headers.items()]


async def _answer(send: Any, status: int, text: str) -> None:
    body = text.encode()
    given = {"content-type": "text/plain; charset=utf-8", "content-length": str(len(body)), "connection": "close"}
    await send({"type": "http.response.start", "status": status, "headers": _encoded(HEADERS | given)})
    await send({"type": "http.response.body", "body": body})
