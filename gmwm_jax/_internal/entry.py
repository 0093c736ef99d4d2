"""The way into both command lines, and out of them: what is asked for is checked, said and ended in one way."""

import contextlib
import functools
import importlib
import importlib.util
import inspect
import os
import signal
import sys
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator
from typing import Annotated, Any

from gmwm_jax._internal.interrupts import INTERRUPTED, leave_at_once, leave_when_deaf
from gmwm_jax._internal.lazy import open_wide
from gmwm_jax._internal.xla_loops import fast_loops_if_known

NO_CACHE = "no_cache"
"""Parameter of commands that say by themselves whether compiled programs are kept; others have an option of that name.
"""
BAD_INPUT = 2
"""Exit code of a command that was asked for something wrong, as of one whose options are."""

OF_INPUT = (ValueError, KeyError, OSError, ImportError, MemoryError, OverflowError)
"""Errors that are the answer to an input; another one is a mistake of this program, and shows where it is."""


def run_command_line(module: str, packages: Collection[str], needs: Collection[str], *, loops: bool = False) -> None:
    """Turn on 64-bit floats and run the command line ``app`` of a module.

    Until a command has all that it needs, nothing is done that an interrupt could leave half done, and it ends the
    process at once: the import of compiled modules hears of none. What commands compile is kept for the next start.

    Parameters
    ----------
    module
        Its name.
    packages
        What its commands need loaded.
    needs
        Packages of the extra ``app``, of which one that is missing is named.
    loops
        Whether loops are compiled as a whole, see `nav_jax.fast_loops`.
    """
    for need in needs:
        if importlib.util.find_spec(need) is None:
            sys.exit(f'The command line needs the package {need}: pip install "gmwm-jax[app]".')
    signal.signal(signal.SIGINT, leave_at_once)
    os.environ["JAX_ENABLE_X64"] = "1"  # read when JAX is imported, which help is not
    if loops:
        fast_loops_if_known()
    cli = importlib.import_module(module)

    def load(*, keep: bool) -> None:
        for package in packages:
            open_wide(package)
        if keep:
            from gmwm_jax._internal.compiled import kept_if_possible

            kept_if_possible()
        leave_when_deaf()

    cli.app(obj=load)


@contextlib.contextmanager
def command_line(in_its_words: Callable[[str], str], load: Any = None) -> Iterator[None]:
    """Run a command: errors of input and warnings become a line each, which speaks of options.

    Parameters
    ----------
    in_its_words
        Python in a message -> the same for who reads it.
    load
        What `run_command_line` has to be done first, if the command comes from there.

    Raises
    ------
    SystemExit
        With the code `BAD_INPUT`, or `INTERRUPTED` after an interrupt.
    """

    def say(text: str) -> None:
        print(text, file=sys.stderr)  # noqa: T201

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        say(f"Warning: {in_its_words(str(message))}")

    with warnings.catch_warnings():
        warnings.showwarning = show
        try:
            if load is not None:
                load()
            yield
        except OF_INPUT as error:
            say(f"Error: {in_its_words(_text(error))}")
            raise SystemExit(BAD_INPUT) from error
        except KeyboardInterrupt as interrupt:
            say(str(interrupt) or "Interrupted: the results are not complete.")
            raise SystemExit(INTERRUPTED) from interrupt


def tell_version(app: Any, command: str, version: str) -> None:
    """Give a Typer application the option ``--version``."""
    import typer

    def tell(asked: bool) -> bool:
        if asked:
            typer.echo(f"{command} {version}")
            raise typer.Exit
        return asked

    @app.callback()
    def main(
        version: Annotated[bool, typer.Option("--version", callback=tell, is_eager=True, help="Say it.")] = False,
    ) -> None:
        pass


def as_command(run: Callable[..., None], parameters: Iterable[inspect.Parameter]) -> Callable[..., None]:
    """Give ``run(context, **options)`` the signature that a command of these parameters has, which Typer reads.

    A command that does not say by itself whether compiled programs are kept has the option ``--no-cache`` beside them.
    """
    import typer

    keyword = inspect.Parameter.KEYWORD_ONLY
    named = [p.replace(kind=keyword) for p in parameters]
    says_itself = any(p.name == NO_CACHE for p in named)
    option = typer.Option("--no-cache", help="Do not keep compiled programs in your folder of caches.")
    asked = inspect.Parameter(NO_CACHE, keyword, default=False, annotation=Annotated[bool, option])

    @functools.wraps(run)
    def command(context: Any, **options: Any) -> None:
        keep = not says_itself and not options.pop(NO_CACHE)
        if not keep and not says_itself:
            os.environ["JAX_ENABLE_COMPILATION_CACHE"] = "0"  # read when JAX is imported, here and by workers
        if context.obj is not None:
            context.obj = functools.partial(context.obj, keep=keep)
        run(context, **options)

    told = inspect.Parameter("context", keyword, annotation=typer.Context)
    named = [told, *named, *([] if says_itself else [asked])]
    command.__signature__ = inspect.Signature(named)  # type: ignore[attr-defined]
    command.__annotations__ = {p.name: p.annotation for p in named}
    return command


def _text(error: BaseException) -> str:
    """What an error says; one of Python's own may say nothing."""
    text = str(error.args[0]) if isinstance(error, KeyError) and error.args else str(error)
    return text or ("There is not enough memory." if isinstance(error, MemoryError) else type(error).__name__)
