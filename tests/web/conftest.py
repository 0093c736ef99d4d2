"""A server, a browser and a page: nothing is asked of any other host, and the page makes no error."""

import os
import shutil
from urllib.parse import urlsplit

import pytest

from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.server import Running

WAIT = 60_000
"""Milliseconds: of a first compilation on a busy machine too."""


@pytest.fixture(scope="session", autouse=True)
def base_of_temporary_folders(tmp_path_factory):
    """Made before a server makes its own folder that of the process."""
    return tmp_path_factory.getbasetemp()


@pytest.fixture(scope="session")
def server():
    """The one server of this process that serves pages: a lock of the framework belongs to its loop of events."""
    with Running(port=0, limits=Limits(upload=2_000_000, idle=120.0, pasted=20_000)) as running:
        yield running


@pytest.fixture(scope="session")
def browser():
    """Chromium of the system."""
    binary = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if binary is None:
        message = "There is no chromium: install it (Debian: apt-get install chromium)."
        if os.environ.get("CI"):
            pytest.fail(message)
        pytest.skip(message)
    from playwright.sync_api import sync_playwright

    options = ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"]
    with sync_playwright() as tools:
        found = tools.chromium.launch(executable_path=binary, args=options)
        yield found
        found.close()


@pytest.fixture
def open_page(server, browser):
    """Function that opens a page of its own user; at the end, nothing outside was asked for, and nothing went wrong."""
    outside, errors, contexts = [], [], []

    def open_(query="", *, size=(1280, 900), scheme="light"):
        context = browser.new_context(
            viewport={"width": size[0], "height": size[1]}, color_scheme=scheme, reduced_motion="reduce"
        )
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(WAIT)

        def gate(route):
            if urlsplit(route.request.url).netloc == urlsplit(server.url).netloc:
                route.continue_()
            else:
                outside.append(route.request.url)
                route.abort()

        page.route(lambda url: urlsplit(url).scheme not in ("data", "blob"), gate)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(server.url + query)
        return page

    yield open_
    for context in contexts:
        context.close()
    assert not outside
    assert not errors
