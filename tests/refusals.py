"""What every refusal of a command line owes to who reads it: one message, soon, in its words."""

import re
import resource
import sys
import time

from typer.testing import CliRunner

MOST_SECONDS, MOST_BYTES = 10.0, 1 << 30
"""Of one refusal."""

_PYTHON = re.compile(
    r"\bnum_[a-z]+\b|\bmax_bytes\b|\b[a-z_]+=(\.\.\.|None|True|False)|<class|object at 0x|\bTraceback\b|\bdtype\('"
)
"""What only somebody who calls functions can read."""

_PEAK_UNIT = 1 if sys.platform == "darwin" else 1024


def peak():
    """Most bytes that this process has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _PEAK_UNIT


def invoke(app, arguments):
    """Run a command in this process, and see that it takes neither long nor much, and ends in one of the known ways."""
    before, start = peak(), time.process_time()  # other work on the machine is none of its
    result = CliRunner().invoke(app, [str(a) for a in arguments], env={"COLUMNS": "200", "TERM": "dumb"})
    took, grown = time.process_time() - start, peak() - before
    assert result.exception is None or isinstance(result.exception, SystemExit), repr(result.exception)
    assert took < MOST_SECONDS, took
    assert grown < MOST_BYTES, grown
    return result


def assert_refused(app, arguments):
    """Exit code 2, and one message that says more than that something is wrong."""
    result = invoke(app, arguments)
    assert result.exit_code == 2, (result.exit_code, result.output)
    if result.stderr.startswith("Usage"):  # options that cannot be read
        message = result.stderr
        assert "Error" in message
    else:
        before, _, message = re.split(r"^(Error: )", result.stderr.rstrip("\n"), flags=re.M)
        assert re.sub(r"^Read as .*", "", before, flags=re.S) == "", result.stderr
    assert len(message) > 25, message
    assert not _PYTHON.search(message), message
    return message
