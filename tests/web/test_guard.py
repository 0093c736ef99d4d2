"""What the server refuses before the page's framework sees it; without a browser."""

import asyncio
import base64
import contextlib
import http.client
import os
import socket
import subprocess
import sys
import tempfile
import threading
from urllib.parse import urlsplit

import pytest

from gmwm_jax.app.web.guard import Guard
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.server import PREFIX, Running


@pytest.fixture(scope="module")
def small():
    """A server that serves two pages and takes files of a kilobyte."""
    with Running(port=0, limits=Limits(upload=1000, sessions=2, idle=1.5)) as running:
        yield running


def get(server, path="/", **headers):
    with contextlib.closing(http.client.HTTPConnection("127.0.0.1", server.port, timeout=20)) as link:
        link.request("GET", path, headers=headers)
        answer = link.getresponse()
        return answer, answer.read().decode(errors="replace")


def handshake(server, **headers):
    """Open a socket to the page; the line of status."""
    link = socket.create_connection(("127.0.0.1", server.port), timeout=20)
    given = {
        "Host": f"127.0.0.1:{server.port}", "Upgrade": "websocket", "Connection": "Upgrade",
        "Sec-WebSocket-Key": base64.b64encode(os.urandom(16)).decode(), "Sec-WebSocket-Version": "13",
    } | headers  # fmt: skip
    lines = "".join(f"{key}: {value}\r\n" for key, value in given.items())
    link.sendall(f"GET /websocket/ HTTP/1.1\r\n{lines}\r\n".encode())
    return link, link.recv(4096).split(b"\r\n")[0].decode()


def test_headers_of_every_answer(small):
    answer, _ = get(small)
    assert answer.status == 200
    policy = answer.headers["content-security-policy"]
    assert "unsafe-eval" not in policy
    assert "default-src 'self'" in policy
    assert "frame-ancestors 'none'" in policy
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["cache-control"] == "no-store"
    assert answer.headers["server"] is None


def test_other_hosts_are_not_answered(small):
    answer, text = get(small, Host="evil.example")
    assert answer.status == 421
    assert "--host" in text


def test_a_socket_opens_for_the_own_page_only(small):
    for origin in ({}, {"Origin": "http://evil.example"}, {"Origin": "null"}):
        link, status = handshake(small, **origin)
        assert " 403 " in status
        link.close()


def test_one_page_too_many_gets_a_sentence_and_idle_ones_end(small):
    own = {"Origin": f"http://127.0.0.1:{small.port}"}
    links = [handshake(small, **own) for _ in range(3)]
    assert [status.split()[1] for _, status in links] == ["101", "101", "403"]
    answer, text = get(small)
    assert answer.status == 503
    assert "2 pages are open" in text
    links[0][0].settimeout(20)
    seen = b""
    while b"\x88" not in seen:  # the server closes those that say nothing
        seen = links[0][0].recv(4096)
        assert seen
    for link, _ in links:
        link.close()


@pytest.mark.parametrize(
    "path",
    ["/..%2f..%2fetc/passwd", "/lib/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/session/0/upload/0",
     "/session/abc/download/x", "/lib/gmwm-0.1.0/../../../server.py", "//etc/passwd"],
)  # fmt: skip
def test_no_path_leads_out(small, path):
    answer, text = get(small, path)
    assert answer.status == 404
    assert "root:" not in text


def sent(body, declared):
    """What a guarded application that reads all bodies answers to one, and how many bytes it saw."""
    seen, answers = [], []

    async def reads_all(scope, receive, send):
        while (message := await receive())["type"] == "http.request":
            seen.append(len(message["body"]))
            if not message["more_body"]:
                await send({"type": "http.response.start", "status": 200, "headers": []})
                return await send({"type": "http.response.body", "body": b""})
        raise OSError("cut off")

    parts = [body[i : i + 300] for i in range(0, len(body), 300)]
    messages = iter([{"type": "http.request", "body": p, "more_body": p is not parts[-1]} for p in parts])

    async def receive():
        return next(messages)

    async def send(message):
        answers.append(message)

    headers = [(b"host", b"localhost"), (b"content-length", str(declared).encode())][: 1 + (declared is not None)]
    scope = {"type": "http", "path": "/session/abc/upload/def", "headers": headers}
    guard = Guard(reads_all, ["localhost"], Limits(upload=1000, free_disk=0))
    thread = threading.Thread(target=asyncio.run, args=(guard(scope, receive, send),))  # this one may have a loop
    thread.start()
    thread.join()
    return answers[0]["status"], sum(seen)


def test_bytes_are_counted_whatever_is_declared():
    assert sent(b"x" * 900, 900) == (200, 900)
    assert sent(b"x" * 5000, 5000) == (413, 0)
    assert sent(b"x" * 5000, 10) == (413, 900)
    assert sent(b"x" * 5000, None) == (413, 900)  # in parts of any number


def test_a_server_that_was_killed_leaves_nothing(base_of_temporary_folders):
    """The next one removes its folder."""
    tmp_path = base_of_temporary_folders / "k"  # names of sockets are short
    tmp_path.mkdir()
    program = (
        "import jax; jax.config.update('jax_enable_x64', True)\n"
        "from gmwm_jax.app.web.server import serve\n"
        "serve('127.0.0.1', 0, lambda text: print(text, flush=True), browser=False)"
    )
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    process = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, env=environment, text=True)
    assert process.stdout is not None
    line = process.stdout.readline()
    address = next(word for word in line.split() if word.startswith("http"))
    assert urlsplit(address).hostname == "127.0.0.1"
    (folder,) = tmp_path.glob(f"{PREFIX}*")
    assert folder.stat().st_mode & 0o777 == 0o700
    process.kill()
    process.wait()
    process.stdout.close()
    before, tempfile.tempdir = tempfile.tempdir, str(tmp_path)
    try:
        with Running(port=0):
            assert not folder.exists()
    finally:
        tempfile.tempdir = before
