"""What tests do with a page."""

import time


def drawn(page, id, *, after=0, wait=60.0):
    """Wait until a figure has been drawn more than `after` times and is up to date; the number."""
    end = time.monotonic() + wait
    while time.monotonic() < end:
        count = page.locator(f"#{id}").get_attribute("data-drawn")
        if count is not None and int(count) > after:
            return int(count)
        time.sleep(0.05)
    raise AssertionError(f"#{id} was not drawn: {page.locator('.gmwm-error').all_inner_texts()}")


def curves(page, id):
    """What a figure shows: name -> (x, y), of all traces with a name."""
    read = """id => document.getElementById(id).calcdata.map(
        (c, i) => [c[0].trace.name, c.map(p => p.x), c.map(p => p.y)])"""
    return {name: (x, y) for name, x, y in page.evaluate(read, id) if name}


def enter(page, id, value):
    """Type into a field and leave it."""
    field = page.locator(f"#{id}")
    field.fill(str(value))
    field.blur()


def go_to(page, room):
    """Open a room."""
    page.locator(f'.navbar a[data-value="{room}"]').click()


def until(true, *, wait=60.0):
    """Wait until something is so."""
    end = time.monotonic() + wait
    while not true():
        assert time.monotonic() < end, "it did not become so"
        time.sleep(0.05)
