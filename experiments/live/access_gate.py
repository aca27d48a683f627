"""Access gate of the live page: admits only clients with the token, and refuses requests from other web pages.

viser has no authentication, so it listens on 127.0.0.1 only, and outside connections pass through this gate. A
connection is admitted by its first request and carries no further one, so that nothing passes with the token of another
request: each file of the page uses its own connection, and its web socket, once admitted, is piped both ways.
"""

import asyncio
import contextlib
import secrets
import threading
from typing import NamedTuple
from urllib.parse import parse_qs, urlsplit

from sim.errors import SimError

LOCAL_HOSTS = ("127.0.0.1", "localhost", "::1")
_COOKIE = "hvf_token"
_HEAD_TIMEOUT = 10.0  # [s] for the head of a request
_MAX_BYTES = 65536  # largest head of a request, and largest chunk that is piped
_DENIED = (
    "<!doctype html><meta name=viewport content='width=device-width'><p style='font:16px system-ui;margin:2em'>"
    "This page needs its token: open the address that <code>hvf live</code> has printed, with <code>?token=…</code>."
)


class Request(NamedTuple):
    """The head of a request: path with its query, and values of the headers by name in lower case."""

    path: str
    headers: dict[str, str]

    @staticmethod
    def of(head: bytes) -> "Request":
        """Parse the head of a request.

        Raises
        ------
        ValueError
            If it is not the head of a GET or HEAD request.
        """
        first, *lines = head.decode("latin-1").rstrip("\r\n").split("\r\n")
        method, path, _ = first.split(" ")
        if method not in ("GET", "HEAD"):
            raise ValueError(f"{method} is not allowed for a page")
        pairs = (line.split(":", 1) for line in lines)
        return Request(path, {name.strip().lower(): value.strip() for name, value in pairs})


def answer(request: Request, token: str | None) -> bytes | None:
    """The gate's own response to a request; None if the request may pass.

    Parameters
    ----------
    request : Request
        First request of a connection.
    token : str or None
        Required token; None where only this machine can connect.
    """
    host, origin = request.headers.get("host", ""), request.headers.get("origin")
    if origin is not None and urlsplit(origin).netloc != host:
        return _response(403, "Forbidden", "This page may not be used from another one.")
    if token is None:
        # A foreign host name that resolves to this machine (DNS rebinding) is refused.
        local = urlsplit(f"//{host}").hostname in LOCAL_HOSTS
        return None if local else _response(403, "Forbidden", "Open this page as http://127.0.0.1 or http://localhost.")
    parts = urlsplit(request.path)
    query_token = parse_qs(parts.query).get("token", [""])[0]
    if query_token and secrets.compare_digest(query_token.encode(), token.encode()):
        cookie = f"Set-Cookie: {_COOKIE}={token}; Path=/; HttpOnly; SameSite=Strict\r\n"
        return _response(303, "See Other", "", f"Location: {parts.path or '/'}\r\n{cookie}")
    cookies = (pair.strip().partition("=") for pair in request.headers.get("cookie", "").split(";"))
    stored = next((value for name, _, value in cookies if name == _COOKIE), "")
    return None if secrets.compare_digest(stored.encode(), token.encode()) else _response(403, "Forbidden", _DENIED)


def _response(code: int, status: str, body: str, extra_headers: str = "") -> bytes:
    content = body.encode()
    head = f"HTTP/1.1 {code} {status}\r\nContent-Type: text/html; charset=utf-8\r\nContent-Length: {len(content)}\r\n"
    return f"{head}{extra_headers}Cache-Control: no-store\r\nConnection: close\r\n\r\n".encode() + content


class AccessGate:
    """Server in front of a page on this machine.

    Parameters
    ----------
    host : str
        Address to listen on.
    port : int
        Port to listen on; if it is in use, the next free one of twenty is taken.
    behind : int
        Port of the page on 127.0.0.1.
    token : str or None
        See `answer`.

    Raises
    ------
    SimError
        If it cannot listen there.
    """

    def __init__(self, host: str, port: int, behind: int, token: str | None):
        self._page_port, self._token = behind, token
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="hvf-gate", daemon=True)
        self._thread.start()
        try:
            self._server = asyncio.run_coroutine_threadsafe(self._listen(host, port), self._loop).result()
        except OSError as error:
            self._stop_loop()
            raise SimError(
                f"cannot listen on {host}, port {port}: {error}; expected an address of this machine"
            ) from None
        self.port: int = self._server.sockets[0].getsockname()[1]

    def close(self) -> None:
        """Stop listening and close all connections."""
        self._loop.call_soon_threadsafe(self._server.close)
        self._stop_loop()

    def _stop_loop(self) -> None:
        async def cancel_tasks() -> None:
            tasks = asyncio.all_tasks() - {asyncio.current_task()}
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

        asyncio.run_coroutine_threadsafe(cancel_tasks(), self._loop).result(5.0)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5.0)
        self._loop.close()

    async def _listen(self, host: str, port: int) -> asyncio.Server:
        last = OSError("no port is free")
        for candidate in range(port, port + 20) if port else (0,):
            try:
                return await asyncio.start_server(self._handle_connection, host, candidate, limit=_MAX_BYTES)
            except OSError as error:
                last = error
        raise last

    async def _handle_connection(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, TimeoutError):
            head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), _HEAD_TIMEOUT)
            try:
                request = Request.of(head)
                response = answer(request, self._token)
            except ValueError:
                response = _response(400, "Bad Request", "")
                request = Request("", {})
            if response is None:
                await self._forward(request, head, reader, writer)
            else:
                writer.write(response)
                await writer.drain()
        writer.close()

    async def _forward(
        self, request: Request, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", self._page_port)
        inner_writer.write(head)
        pipes = [asyncio.ensure_future(_pipe(inner_reader, writer))]
        if request.headers.get("upgrade", "").lower() == "websocket":
            pipes.append(asyncio.ensure_future(_pipe(reader, inner_writer)))
        try:
            await asyncio.wait(pipes, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for pipe in pipes:
                pipe.cancel()
            inner_writer.close()


async def _pipe(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with contextlib.suppress(OSError):
        while piece := await reader.read(_MAX_BYTES):
            writer.write(piece)
            await writer.drain()
