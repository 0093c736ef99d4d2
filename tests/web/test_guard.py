"""What the server refuses before the page's framework sees it; without a browser."""

import asyncio
import base64
import contextlib
import http.client
import os
import random
import re
import socket
import subprocess
import sys
import threading
import time
from urllib.parse import parse_qsl, urlsplit

import jax
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin

from gmwm_jax.app.web.guard import Guard
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.server import PREFIX, Running
from gmwm_jax.app.web.state import State

CACHE = str(jax.config.values["jax_compilation_cache_dir"])


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


def test_a_browser_keeps_libraries_and_asks_whether_they_have_changed(small):
    _, page = get(small)
    path = "/" + re.search(r'src="(lib/plotly[^"]*)"', page)[1]
    first, content = get(small, path)
    assert len(content) > 1_000_000
    assert first.headers["cache-control"] == "no-cache"
    again, nothing = get(small, path, **{"If-None-Match": first.headers["etag"]})
    assert (again.status, nothing) == (304, "")


def test_other_hosts_are_not_answered(small):
    answer, text = get(small, Host="evil.example")
    assert answer.status == 421
    assert "--name" in text


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


async def reads_all(scope, receive, send):
    while (message := await receive())["type"] == "http.request":
        scope["seen"].append(len(message["body"]))
        if not message["more_body"]:
            await send({"type": "http.response.start", "status": 200, "headers": []})
            return await send({"type": "http.response.body", "body": b""})
    raise OSError("cut off")


def guarded(**limits):
    return Guard(reads_all, ["localhost"], Limits(upload=1000, free_disk=0, **limits))


def sent(body, declared, guard=None, session="abc"):
    """What a guarded application that reads all bodies answers to one, and how many bytes it saw."""
    seen, answers = [], []
    parts = [body[i : i + 300] for i in range(0, len(body), 300)]
    messages = iter([{"type": "http.request", "body": p, "more_body": p is not parts[-1]} for p in parts])

    async def receive():
        return next(messages)

    async def send(message):
        answers.append(message)

    headers = [(b"host", b"localhost"), (b"content-length", str(declared).encode())][: 1 + (declared is not None)]
    scope = {"type": "http", "path": f"/session/{session}/upload/def", "headers": headers, "seen": seen}
    thread = threading.Thread(
        target=asyncio.run, args=((guard or guarded())(scope, receive, send),)
    )  # this one may have a loop
    thread.start()
    thread.join()
    return answers[0]["status"], sum(seen)


def test_bytes_are_counted_whatever_is_declared():
    assert sent(b"x" * 900, 900) == (200, 900)
    assert sent(b"x" * 5000, 5000) == (413, 0)
    assert sent(b"x" * 5000, 10) == (413, 900)
    assert sent(b"x" * 5000, None) == (413, 900)  # in parts of any number


def test_a_session_sends_so_much_and_sessions_that_are_made_up_take_no_memory(monkeypatch):
    monkeypatch.setattr("gmwm_jax.app.web.guard._COUNTED", 3)
    guard = guarded(uploads_per_session=1000)
    assert [sent(b"x" * 400, 400, guard)[0] for _ in range(3)] == [200, 200, 413]
    for k in range(10):
        assert sent(b"x", 1, guard, f"other{k}")[0] == 200
    assert len(guard._uploaded) == 3
    assert sent(b"x" * 400, 400, guard)[0] == 200  # it is forgotten by then


def test_a_message_that_is_too_large_ends_its_page_alone(small):
    own = Origin(f"http://127.0.0.1:{small.port}")
    with connect(f"ws://127.0.0.1:{small.port}/websocket/", origin=own) as link:
        with contextlib.suppress(ConnectionClosed):
            link.send("x" * 2_000_000)
        with pytest.raises(ConnectionClosed) as ended:
            list(link)  # all that it says until it ends, which is no error where it ends well
        assert ended.value.rcvd is not None
        assert ended.value.rcvd.code == 1009
    assert get(small)[0].status == 200


def test_behind_a_proxy():
    """It takes the root path away and keeps the name by which it was called."""
    with Running(port=0, root_path="/noise", names=["Lab.example.org"]) as server:
        assert server.url.endswith("/noise/")
        assert get(server, Host="lab.example.org")[0].status == 200
        assert get(server, Host="evil.example.org")[0].status == 421
        for origin, status in (("https://lab.example.org", "101"), ("https://evil.example.org", "403")):
            link, said = handshake(server, Host="lab.example.org", Origin=origin)
            link.close()
            assert said.split()[1] == status


def test_what_is_stored_on_the_server_is_found_by_name_alone(tmp_path):
    for name in ("static.csv", ".hidden"):
        (tmp_path / name).write_text("1\n")
    (tmp_path / "folder").mkdir()
    (tmp_path / "link.csv").symlink_to("/etc/passwd")
    assert Limits(folder=tmp_path).stored() == {"static.csv": tmp_path / "static.csv"}
    assert not Limits().stored()


def test_two_hundred_links_of_nonsense():
    """Each is a state within its ranges."""
    draw = random.Random(1)
    texts = ["", "-1", "1e999", "nan", "../../etc/passwd", "<img src=x>", "\0", "9" * 400, "true", "[]", "=cmd()"]
    fields = [*State.model_fields, "unknown", "__class__"]
    for _ in range(200):
        query = {draw.choice(fields): draw.choice(texts) for _ in range(8)}
        state = State.from_query(query)
        assert 1000 <= state.samples <= 2_000_000
        assert State.from_query(dict(parse_qsl(state.to_query(), keep_blank_values=True))) == state


@contextlib.contextmanager
def started(temporary):
    """A server of its own, with its temporary files there."""
    environment = os.environ | {"TMPDIR": str(temporary), "JAX_COMPILATION_CACHE_DIR": CACHE}
    command = [sys.executable, "-m", "gmwm_jax", "app", "--port", "0", "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True)
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        yield process, next(word for word in line.split() if word.startswith("http"))
    finally:
        process.kill()
        process.wait()
        process.stdout.close()  # type: ignore[union-attr]


UPLOAD = """() => new Promise((done) => Shiny.shinyapp.makeRequest(
    "uploadInit", [[{name: "half.csv", size: 1000000, type: "text/csv"}]], done))"""


def test_killed_during_an_upload_and_a_job_nothing_is_left_and_the_link_restores(browser, base_of_temporary_folders):
    temporary = base_of_temporary_folders / "k"  # names of sockets are short
    temporary.mkdir()
    context = browser.new_context()
    page = context.new_page()
    page.set_default_timeout(60_000)
    inputs = "?room=inference&samples=5000&boxes=WN%2CRW&replicates=5000&route=records&draw_seed=9"
    with started(temporary) as (process, address):
        assert urlsplit(address).hostname == "127.0.0.1"
        (folder,) = temporary.glob(f"{PREFIX}*")
        assert folder.stat().st_mode & 0o777 == 0o700
        page.goto(address + inputs)
        page.locator("#replicated_fit p").wait_for()
        page.locator("#replicate").click()
        page.locator("#job_text", has_text="of 5000").wait_for()
        to = page.evaluate(UPLOAD)["uploadUrl"]
        with socket.create_connection(("127.0.0.1", urlsplit(address).port)) as link:
            name = urlsplit(address).netloc
            link.sendall(f"POST /{to} HTTP/1.1\r\nHost: {name}\r\nContent-Length: 1000000\r\n\r\n".encode())
            link.sendall(b"1\n" * 200_000)
            until(lambda: any(f.is_file() and f.stat().st_size > 0 for f in folder.glob("files-*/**/*")))
            process.kill()
            process.wait()
    assert folder.exists()
    link = urlsplit(page.url).query
    with started(temporary) as (_, address):
        assert not folder.exists()
        page.goto(f"{address}?{link}")
        page.locator("#replicated_fit p").wait_for()
        assert page.locator("#draw_seed").input_value() == "9"
        assert page.locator("#replicates").input_value() == "5000"
        assert page.locator("#boxes input[value=RW]").is_checked()
        assert page.locator("#about", has_text="5000 samples").count() == 1
        context.close()


def until(true, seconds=30.0):
    """Wait for a state."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.02)
