"""The page: a server as `gmwm-jax app` starts it, a browser (Chromium, driven by Playwright), and twenty users at once.

Times of the browser are from the click to the figure that Plotly has drawn. The twenty users speak the protocol of the
page over WebSockets, from this process, so that they and the server share the same two cores: each walks the published
example, and in turn means one click at a time while all twenty pages are open.
"""

import asyncio
import contextlib
import json
import os
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from common import ROOT, Report, seconds
from playwright.sync_api import Browser, Page, sync_playwright
from websockets.asyncio.client import ClientConnection, connect

MODELS = ("WN", "WN + RW", "WN + GM", "WN + RW + 2*GM", "WN + RW + 3*GM")
"""Of the published example, in its order."""
NUM_USERS = 20

CLICK = """([selector, id]) => new Promise((done) => {
    const figure = document.getElementById(id), before = figure.dataset.count, began = performance.now();
    const seen = new MutationObserver(() => {
        if (figure.dataset.count === before || !figure.dataset.drawn) return;
        seen.disconnect();
        done((performance.now() - began) / 1000);
    });
    seen.observe(figure, {attributes: true});
    document.querySelector(selector).click();
})"""
"""In the page: seconds from a click to the next figure."""


def main() -> None:
    report = Report("app", __doc__ or "")
    starts(report)
    with served() as server, chromium() as browser:
        wait_until_idle(server.process.pid)
        pages(report, server, browser)
        uploads(report, server, browser)
        refits(report, server, browser)
        beside_a_job(report, server, browser)
    for at_once in (1, 4):
        with served() as server:
            wait_until_idle(server.process.pid)
            asyncio.run(twenty(report, server, at_once))
    report.save()


# -- the server -------------------------------------------------------------------------------------------------------


class Server(NamedTuple):
    """One that runs."""

    url: str
    process: "subprocess.Popen[str]"
    said: float
    """Seconds until it said its address."""
    answered: float
    """Seconds until it had sent a page."""


@contextmanager
def served(*options: str) -> Iterator[Server]:
    """Start a server as users do."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("JAX_")}
    environment["PYTHONPATH"] = str(ROOT)
    command = [sys.executable, "-m", "gmwm_jax", "app", "--port", "0", "--no-browser", *options]
    began = time.perf_counter()
    process = subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        said = time.perf_counter() - began
        url = next(word for word in line.split() if word.startswith("http"))
        with urllib.request.urlopen(url) as answer:
            answer.read()
        yield Server(url, process, said, time.perf_counter() - began)
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(20)
        process.stdout.close()  # type: ignore[union-attr]


def cpu_seconds(pid: int) -> float:
    """Of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def wait_until_idle(pid: int) -> None:
    """Until the usual models are compiled."""
    time.sleep(4)
    before, now = -1.0, cpu_seconds(pid)
    while now - before > 0.1:
        time.sleep(1.5)
        before, now = now, cpu_seconds(pid)


def family(pid: int) -> list[int]:
    """A process and those that it has started."""
    found = [pid]
    for one in found:
        with contextlib.suppress(OSError):
            found += [int(c) for c in Path(f"/proc/{one}/task/{one}/children").read_text().split()]
    return found


def memory(pid: int, field: str = "VmRSS") -> float:
    """MiB of a process and those that it has started."""
    total = 0
    for one in family(pid):
        with contextlib.suppress(OSError):
            lines = Path(f"/proc/{one}/status").read_text().splitlines()
            total += sum(int(line.split()[1]) for line in lines if line.startswith(field + ":"))
    return total / 1024


def starts(report: Report) -> None:
    """From the command to the first page that is sent."""
    rows = []
    for title, options in (("compiled models kept", ()), ("--no-cache", ("--no-cache",))):
        measured = []
        for _ in range(1 if report.quick else 5):
            with served(*options) as server:
                measured.append(server)
        answered = [one.answered for one in measured]
        rows.append(
            [
                title,
                seconds(min(m.said for m in measured)),
                seconds(min(answered)),
                seconds(statistics.median(answered)),
            ]
        )
        if not options:
            report.bar("page: start of the server to the first page sent", "<= 4 s", seconds(min(answered)))
    report.table("Start", ["", "address, best", "first page sent, best", "median"], rows)


# -- in the browser ---------------------------------------------------------------------------------------------------


@contextmanager
def chromium() -> Iterator[Browser]:
    """The browser of the system."""
    binary = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if binary is None:
        raise RuntimeError("There is no chromium: install it (Debian: apt-get install chromium).")
    with sync_playwright() as tools:
        options = ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"]
        browser = tools.chromium.launch(executable_path=binary, args=options)
        yield browser
        browser.close()


@contextmanager
def opened(browser: Browser, url: str) -> Iterator[Page]:
    """Open a page of a user of its own."""
    context = browser.new_context(viewport={"width": 1280, "height": 900}, reduced_motion="reduce")
    page = context.new_page()
    page.set_default_timeout(120_000)
    page.goto(url)
    yield page
    context.close()


def pages(report: Report, server: Server, browser: Browser) -> None:
    """A page in a browser that knows nothing of it."""
    shown, drawn = [], []
    for seed in range(2 if report.quick else 5):
        began = time.perf_counter()
        with opened(browser, f"{server.url}?seed={seed}") as page:
            page.locator("#about p").first.wait_for()
            shown.append(time.perf_counter() - began)
            page.locator("#series[data-drawn]").wait_for()
            drawn.append(time.perf_counter() - began)
    rows = [[what, seconds(min(t)), seconds(statistics.median(t))] for what, t in
            (("it says what it shows", shown), ("the first figure is drawn", drawn))]  # fmt: skip
    report.table("A page in an empty browser: 100,000 samples drawn, six channels", ["", "best", "median"], rows)
    report.bar("page: opened to first figure", "<= 2 s", f"{seconds(min(drawn))} (median {rows[1][2]})")


def uploads(report: Report, server: Server, browser: Browser) -> None:
    """From the file that is dropped to the figure of its variance."""
    samples = np.random.default_rng(1).standard_normal(1_000_000)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for kind, bar in (("npy", 1.5), ("csv", 4.0)):
            path = Path(folder) / f"static.{kind}"
            if kind == "npy":
                np.save(path, samples)
            else:
                np.savetxt(path, samples, fmt="%.9g")
            spans = []
            with opened(browser, f"{server.url}?source=file&room=variance&rate=100&units=rad/s") as page:
                page.locator("#upload").wait_for(state="attached")
                page.wait_for_timeout(1500)
                for again in range(2 if report.quick else 4):
                    before = page.locator("#variances").get_attribute("data-count")
                    began = time.perf_counter()
                    page.locator("#upload").set_input_files(path)
                    while page.locator("#variances[data-drawn]").count() == 0 or (
                        page.locator("#variances").get_attribute("data-count") == before
                    ):
                        page.wait_for_timeout(10)
                    if again or report.quick:  # the first compiles
                        spans.append(time.perf_counter() - began)
            rows.append([kind, f"{path.stat().st_size / 1e6:.0f} MB", seconds(min(spans)),
                         seconds(statistics.median(spans))])  # fmt: skip
            report.bar(f"page: 1,000,000 samples, {kind} dropped to variance figure", f"<= {bar:g} s",
                       f"{seconds(min(spans))} (median {rows[-1][3]})")  # fmt: skip
    report.table("A file of 1,000,000 samples, dropped to the figure", ["", "size", "best", "median"], rows)


def refits(report: Report, server: Server, browser: Browser) -> None:
    """Boxes of the room of models, among models that were fitted before."""
    spans = clicked(server, browser, "?room=model&boxes=WN,RW", report.quick)
    rows = [["100,000 samples, one channel", *quantiles(spans)]]
    report.bar("page: warm refit, click to figure, median; 95 %", "<= 0.3 s; <= 0.6 s", "; ".join(quantiles(spans)))
    spans = clicked(server, browser, "?room=model&boxes=WN,RW&source=published&channel=gyro_x", report.quick)
    rows.append(["published, 873,684 samples", *quantiles(spans)])
    report.table("A box of a model, click to figure", ["record", "median", "95 %"], rows)


def clicked(server: Server, browser: Browser, query: str, quick: bool, *, pause: int = 700) -> list[float]:
    """Seconds of clicks on boxes; what was clicked once before is warm."""
    with opened(browser, server.url + query) as page:
        page.locator("#fitted[data-drawn]").wait_for()
        spans: list[float] = []
        for again in range(2 if quick else 6):
            for box in ("GM", "RW", "QN", "RW", "QN", "GM"):
                page.wait_for_timeout(pause)  # somebody looks at it
                span = page.evaluate(CLICK, [f"#boxes input[value={box}]", "fitted"])
                spans += [span] if again else []
        return spans


def beside_a_job(report: Report, server: Server, browser: Browser) -> None:
    """A second user's clicks during the replicates of the first one."""
    with opened(browser, f"{server.url}?room=inference&boxes=WN,RW&replicates=5000&route=records") as busy:
        busy.locator("#replicated_fit p").wait_for()
        busy.locator("#replicate").click()
        busy.locator("#job_text", has_text="of 5000").wait_for()
        spans = clicked(server, browser, "?room=model&boxes=WN,RW", True)
        still = busy.locator("#job").is_visible()
        began = time.perf_counter()
        busy.locator("#cancel").click()
        busy.locator("#job").wait_for(state="hidden")
        ended = time.perf_counter() - began
    if not still:
        raise RuntimeError("the replicates were done before the clicks")
    rows = [["clicks of the second user", *quantiles(spans)], ["cancel of the first", seconds(ended), ""]]
    report.table("While another page draws 5000 replicates by records of 100,000", ["", "median", "95 %"], rows)
    report.bar("page: click during the replicates of another page, median; 95 %", "<= 0.5 s",
               "; ".join(quantiles(spans)))  # fmt: skip


def quantiles(spans: Sequence[float]) -> list[str]:
    """Median and 95 % as text."""
    return [seconds(float(np.quantile(spans, p))) for p in (0.5, 0.95)]


# -- twenty users -----------------------------------------------------------------------------------------------------


class User:
    """One page, as its script speaks to the server."""

    def __init__(self, socket: ClientConnection):
        self._socket = socket

    async def begin(self, **inputs: Any) -> None:
        """Open the page with these inputs."""
        shown = {f".clientdata_output_{id}_hidden": False for id in ("fitted", "fit_status", "about", "per_sample")}
        data = {"theme": "light", "narrow": False, "room": "model"} | inputs | shown
        await self._socket.send(json.dumps({"method": "init", "data": data}))

    async def give(self, **inputs: Any) -> None:
        """Change inputs."""
        await self._socket.send(json.dumps({"method": "update", "data": inputs}))

    async def until(self, model: str) -> None:
        """Wait for the figure of a model, and for the tables of units if there is none."""
        while True:
            message = json.loads(await asyncio.wait_for(self._socket.recv(), 120))
            errors = message.get("errors") or {}
            if errors:
                raise RuntimeError(f"the page says: {errors}")
            values = message.get("values") or {}
            if not model and "<table" in html_of(values.get("per_sample")):
                return
            said = re.search(r"<p[^>]*>(.*): objective", html_of(values.get("fit_status")))
            if model and said and "figure" in (values.get("fitted") or {}) and kinds(said[1]) == kinds(model):
                return


def html_of(value: Any) -> str:
    """What an output shows."""
    return value.get("html", "") if isinstance(value, dict) else ""


def kinds(model: str) -> list[str]:
    """Of the processes: ``WN + 2*GM`` -> GM, GM, WN."""
    plain = re.sub(r"\(.*?\)", "", model)
    return sorted(re.sub(r"(\d)\*(\w+)", lambda found: " + ".join([found[2]] * int(found[1])), plain).split(" + "))


async def twenty(report: Report, server: Server, at_once: int) -> None:
    """All walk the published example."""
    turns, spans, users = asyncio.Semaphore(at_once), [], []
    before = memory(server.process.pid)
    most = before
    host = server.url.removeprefix("http://").rstrip("/")

    async def click(user: User, *, first: bool = False, **inputs: Any) -> None:
        nonlocal most
        async with turns:
            began = time.perf_counter()
            await (user.begin(**inputs) if first else user.give(**inputs))
            await user.until(inputs.get("model", ""))
            spans.append(time.perf_counter() - began)
            most = max(most, memory(server.process.pid))

    async def walk(user: User) -> None:
        await click(user, first=True, source="published", published="mti-g", channel="gyro_x", model="WN")
        for model in (*MODELS[1:], *MODELS):
            await click(user, model=model)
        await click(user, room="units")

    async with contextlib.AsyncExitStack() as stack:
        for _ in range(4 if report.quick else NUM_USERS):
            socket = connect(f"ws://{host}/websocket/", origin=f"http://{host}", max_size=1 << 24, max_queue=None)  # type: ignore[arg-type]
            users.append(User(await stack.enter_async_context(socket)))
        began = time.perf_counter()
        await asyncio.gather(*map(walk, users))
        took = time.perf_counter() - began
    median, high = quantiles(spans)
    how = "in turn" if at_once == 1 else f"{at_once} clicks at a time"
    sizes = [f"{before:.0f} MiB", f"{most:.0f} MiB"]
    rows = [[f"{len(spans)} in {seconds(took)}", median, high, seconds(max(spans)), *sizes]]
    report.table(f"{len(users)} users, {how}", ["clicks", "median", "95 %", "longest", "memory before", "most"], rows)
    report.bar(f"page: {len(users)} users walk the example, {how}: 95 % of clicks; memory; errors",
               "<= 2 s; 1.5 GB; none", f"{high}; {most * 1.048576 / 1000:.2f} GB; none")  # fmt: skip


if __name__ == "__main__":
    main()
