"""The token gate: requests without the token, or from other web pages, are refused."""

import http.client
import socket
import threading

import pytest

from controllers.errors import ParameterError
from experiments.live.access_gate import AccessGate, Request, answer
from experiments.live.command import token_for

TOKEN = "0123456789abcdef0123456789abcdef"


def request(path: str = "/", **headers: str) -> Request:
    return Request(path, {"host": "10.0.0.5:8080"} | headers)


@pytest.fixture(scope="module")
def behind():
    """A page that answers every connection once, as viser does."""
    server = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        while True:
            try:
                peer, _ = server.accept()
            except OSError:
                return
            peer.recv(65536)
            peer.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 4\r\nConnection: close\r\n\r\npage")
            peer.close()

    threading.Thread(target=serve, daemon=True).start()
    yield server.getsockname()[1]
    server.close()


def get(port: int, path: str = "/", headers: dict[str, str] | None = None) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request("GET", path, headers=headers or {})
    answered = connection.getresponse()
    answered.body = answered.read()  # type: ignore[attr-defined]
    connection.close()
    return answered


def test_page_is_served_only_with_the_token(behind):
    gate = AccessGate("127.0.0.1", 0, behind, TOKEN)
    try:
        assert get(gate.port).status == 403
        assert get(gate.port, "/?token=" + "f" * 32).status == 403
        assert get(gate.port, headers={"Cookie": "hvf_token=" + "f" * 32}).status == 403
        entered = get(gate.port, f"/?token={TOKEN}")
        assert entered.status == 303
        assert entered.getheader("Location") == "/"
        cookie = entered.getheader("Set-Cookie")
        assert cookie is not None
        assert "HttpOnly" in cookie
        assert "SameSite=Strict" in cookie
        assert get(gate.port, headers={"Cookie": cookie.split(";")[0]}).body == b"page"
    finally:
        gate.close()


def test_web_socket_without_token_is_refused(behind):
    gate = AccessGate("127.0.0.1", 0, behind, TOKEN)
    try:
        assert get(gate.port, headers={"Upgrade": "websocket", "Connection": "Upgrade"}).status == 403
    finally:
        gate.close()


def test_second_request_on_one_connection_is_not_forwarded(behind):
    gate = AccessGate("127.0.0.1", 0, behind, TOKEN)
    try:
        with socket.create_connection(("127.0.0.1", gate.port), timeout=10) as peer:
            head = f"GET / HTTP/1.1\r\nHost: x\r\nCookie: hvf_token={TOKEN}\r\n\r\n"
            peer.sendall((head + "GET /secret HTTP/1.1\r\nHost: x\r\n\r\n").encode())
            received = b""
            while piece := peer.recv(4096):
                received += piece
        assert received.count(b"HTTP/1.1") == 1
    finally:
        gate.close()


def test_malformed_request_is_answered_with_400(behind):
    gate = AccessGate("127.0.0.1", 0, behind, TOKEN)
    try:
        with socket.create_connection(("127.0.0.1", gate.port), timeout=10) as peer:
            peer.sendall(b"nonsense\r\n\r\n")
            assert peer.recv(4096).startswith(b"HTTP/1.1 400")
    finally:
        gate.close()


def test_requests_from_other_origins_are_refused():
    assert answer(request(origin="http://evil.example"), None) is not None
    assert answer(request(origin="http://evil.example", cookie=f"hvf_token={TOKEN}"), TOKEN) is not None
    assert answer(request(origin="http://10.0.0.5:8080", cookie=f"hvf_token={TOKEN}"), TOKEN) is None


def test_foreign_host_name_without_token_is_refused():
    assert answer(Request("/", {"host": "127.0.0.1:8080"}), None) is None
    assert answer(Request("/", {"host": "localhost:8080"}), None) is None
    assert answer(Request("/", {"host": "rebound.example:8080"}), None) is not None
    assert answer(Request("/", {}), None) is not None


def test_non_local_host_always_gets_a_strong_token():
    assert token_for("127.0.0.1", "") is None
    token = token_for("0.0.0.0", "")
    assert token is not None
    assert len(token) == 32
    assert token != token_for("0.0.0.0", "")
    assert token_for("127.0.0.1", TOKEN) == TOKEN
    with pytest.raises(ParameterError, match="easily guessed"):
        token_for("0.0.0.0", "secret")
