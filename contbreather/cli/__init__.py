"""The command `contbreather`: what a person types.

Exit status: 0 done, 1 the numerics (or the system) failed, 2 bad input, 130 interrupted. Whatever
goes wrong is one sentence on standard error, never a traceback.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from contbreather import __version__
from contbreather.cli.process import CutShort, abandon, heard, interruptible, prepare, trouble
from contbreather.errors import BadInput, ContbreatherError
from contbreather.tables import visible

if TYPE_CHECKING:
    from cyclopts import App

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
VERBOSE = "--verbose"  # of every command
STDOUT = "/dev/stdout"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit status.

    Examples
    --------
    >>> main(["point", "--a", "0.5", "--gamma", "0.3", "--k", "0.4"])
    2
    """
    if arguments is None:
        prepare()
    typed = list(sys.argv[1:] if arguments is None else arguments)
    # the parser takes a lone hyphen for an option
    tokens = [STDOUT if token == "-" else token for token in typed if token != VERBOSE]
    try:
        with interruptible(alone=arguments is None), heard(VERBOSE in typed):
            _run(tokens)
            if typed == ["--version", VERBOSE]:
                from contbreather.compiler import status as compiled

                print(compiled())  # whether loops are
            sys.stdout.flush()
    except BadInput as error:
        return _refused(error, BAD_INPUT)
    except ContbreatherError as error:
        return _refused(error, FAILED)
    except CutShort:
        return _refused("interrupted: the result is cut short", INTERRUPTED)
    except KeyboardInterrupt:
        return _refused("interrupted", INTERRUPTED)
    except BrokenPipeError:  # the reader has seen enough, as `head` does
        abandon(sys.stdout)
        return FAILED
    except OSError as error:
        abandon(sys.stdout)
        return _refused(trouble(error), FAILED)
    except MemoryError as error:
        return _refused(f"the memory is too small for that: {str(error) or 'it is full'}", FAILED)
    return DONE


def _run(tokens: list[str]) -> None:
    from cyclopts import CycloptsError

    app = application()
    try:
        command, bound, *_ = app.parse_args(tokens, print_error=False, exit_on_error=False)
    except CycloptsError as error:
        raise BadInput(_sentence(error)) from error
    command(*bound.args, **bound.kwargs)


def _sentence(error: Exception) -> str:
    """Say what the parser found, on one line, with the way on."""
    from cyclopts import UnusedCliTokensError

    command = getattr(error, "command_chain", None) or ()
    text = " ".join(str(error).split())
    text, listed, _ = text.partition(" Available commands")  # a list that stops after eight
    if listed and not text.endswith("?"):
        names = ", ".join(name for name in application() if name.isalpha())
        text = f"{text[:-1]}; there are {names}."
    if isinstance(error, UnusedCliTokensError):
        extra = " ".join(error.unused_tokens or ())
        text = f"{extra!r} belongs to no option; each value follows the name of its own, as --a 0.2"
    end = "" if text.endswith(("?", ".")) else "."
    return f"{text}{end} See {' '.join(('contbreather', *command))} --help."


def _refused(reason: object, status: int) -> int:
    try:
        sys.stdout.flush()
    except OSError:
        abandon(sys.stdout)
    try:
        print(f"contbreather: {visible(str(reason))}", file=sys.stderr, flush=True)
    except OSError:
        abandon(sys.stderr)
    return status


def _shown(default: Any) -> str | None:
    """Write a default for help; nothing where it says nothing."""
    shown = " ".join(map(str, default)) if isinstance(default, tuple) else str(default)
    return shown if shown not in ("", "False", "None") else None


def application() -> App:
    """Gather all commands; each imports what it needs when it runs."""
    from cyclopts import App, Parameter

    from contbreather.cli import curves, packages, show, simulate, zones

    app = App(
        name="contbreather",
        help="Exact discrete breathers of an impacting chain, continued, with their stability.\n\n"
        f"With {VERBOSE} any command logs its steps, with their Newton iterations; --version says "
        "whether loops are compiled.",
        version=__version__,
        help_format="markdown",
        default_parameter=Parameter(negative="", show_default=_shown),
    )
    for command in (
        curves.point, curves.branch, curves.boundary, curves.switch, curves.diagram, zones.zones,
        zones.atlas, simulate.simulate, show.show, show.extend, packages.figure, packages.explore,
        packages.run,
    ):  # fmt: skip
        app.command(command)

    tab = "Complete commands and options by the tab key, in every new shell."
    app.register_install_completion_command(help=tab)
    return app
