"""This module runs a command line and returns its exit code; user errors never end in a traceback.

Exit codes: 0 success, 1 the simulation failed, 2 wrong usage, 3 faulty model, 130 interrupted (Ctrl-C), 143
terminated (SIGTERM), 141 the reader of the pipe closed it. Data goes to stdout, everything else to stderr.
"""

from __future__ import annotations

import argparse
import atexit
import errno
import gc
import os
import re
import sys
import traceback
import warnings
from collections.abc import Sequence
from contextlib import suppress
from types import ModuleType
from typing import Any, NoReturn, TextIO

from hybridsim import __version__
from hybridsim.cli.commands import (
    advise,
    atlas,
    cache,
    check,
    compare,
    explain_status,
    fit,
    integrators,
    models,
    report,
    resume,
    run,
    schema,
    steady,
    study,
    sweep,
)
from hybridsim.cli.output import complain, only_data_on_stdout
from hybridsim.cli.repetition import Appended, Stored
from hybridsim.cli.session import Session
from hybridsim.errors import HybridsimError, UsageError, nearest
from hybridsim.files import cannot_write


class Parser(argparse.ArgumentParser):
    """An argument parser that raises errors instead of exiting, and rejects abbreviated options."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(allow_abbrev=False, formatter_class=argparse.RawDescriptionHelpFormatter, **settings)
        for name, action in ((None, Stored), ("store", Stored), ("append", Appended)):
            self.register("action", name, action)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse a command line; unknown options are reported with similar names."""
        line = sys.argv[1:] if args is None else list(args)
        known, unknown = super().parse_known_args(_join_negative_values(line), namespace)
        if unknown:
            self._refuse(unknown)
        return known, unknown

    def _refuse(self, unknown: Sequence[str]) -> NoReturn:
        first = unknown[0]
        if not first.startswith("-"):
            self.error(f"Unexpected argument {first!r}")
        options = re.findall(r"(?<![\w-])--?[a-z][a-z0-9-]*", self.format_help())
        self.error(f"Unknown option {first!r}", nearest(first.split("=")[0], options, kind="options"))

    def error(self, message: str, remedy: str | None = None) -> NoReturn:
        """Raise a `UsageError`; the default remedy is to read the help of the command."""
        raise UsageError(message, remedy=remedy or f"see: {self.prog} --help")


def _join_negative_values(line: Sequence[str]) -> list[str]:
    """Write `--t-end -5T` as `--t-end=-5T`, because argparse would read `-5T` as an option."""
    joined: list[str] = []
    for word in line:
        if re.match(r"-\.?\d", word) and joined and re.fullmatch(r"--[a-z][a-z0-9-]*", joined[-1]):
            joined[-1] += "=" + word
        else:
            joined.append(word)
    return joined


COMMANDS: tuple[ModuleType, ...] = (
    run,
    resume,
    report,
    compare,
    fit,
    advise,
    steady,
    sweep,
    study,
    atlas,
    check,
    models,
    schema,
    integrators,
    explain_status,
    cache,
)

PIPE_CLOSED = 141  # 128 + SIGPIPE, as shells report it
_DISK_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS}


def build_parser() -> Parser:
    """Return the parser of the whole command line, with all commands."""
    parser = Parser(
        prog="hybridsim",
        description="Simulate piecewise-smooth systems (dry friction, impacts, switching) and compare integrators.",
        epilog="exit codes: 0 success, 1 the simulation failed, 2 wrong usage, 3 faulty model, 130 interrupted",
    )
    parser.add_argument("--version", action="version", version=f"hybridsim {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True, parser_class=Parser)
    for command in COMMANDS:
        command.add_to(commands)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line (default: `sys.argv`) and return the exit code."""
    if argv is None:
        # imports create half a million permanent objects; scanning them would cost a tenth of a short run
        gc.set_threshold(100_000, 50, 50)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            # an accent in a title must not fail on an ASCII terminal
            stream.reconfigure(errors="backslashreplace")
    session = Session()
    lighter = ""  # options of the command that reduce its memory
    with warnings.catch_warnings(), session.listening():
        warnings.showwarning = _show_warning
        try:
            args = build_parser().parse_args(argv)
            lighter = getattr(args, "lighter", "")
            with only_data_on_stdout():
                code: int = args.execute(args, session)
        except SystemExit as done:  # argparse exits so after --help and --version
            return done.code if isinstance(done.code, int) else 0
        except KeyboardInterrupt:
            return _interrupted(session)
        except BrokenPipeError:
            # Python flushes stdout again at exit, which must not fail
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return PIPE_CLOSED
        except HybridsimError as error:
            _show_traceback_if_asked()
            complain(str(error))
            return error.exit_code
        except MemoryError:
            complain(f"out of memory{lighter and f'; use {lighter}'}")
            return HybridsimError.exit_code
        except Exception as bug:  # every other exception is a bug of hybridsim
            if isinstance(bug, OSError) and bug.errno in _DISK_FULL:
                complain(str(cannot_write(bug.filename or "the output", bug)))
                return UsageError.exit_code
            if session.interrupted:  # compiled code may turn Ctrl-C into another exception
                return _interrupted(session)
            if not _show_traceback_if_asked():
                complain(
                    f"internal error, please report it: {type(bug).__name__}: {bug}\n"
                    "set HYBRIDSIM_TRACEBACK=1 to print the traceback"
                )
            return HybridsimError.exit_code
    return code


def command() -> NoReturn:
    """Run the command line of this process, then end the process without freeing its memory.

    The interpreter would otherwise free all objects and the compiled code, which takes a second or more. The exit
    handlers run and the streams are flushed; the operating system frees the memory.
    """
    # hybridsim reports the relevant warnings of SUNDIALS in the messages of runs
    os.environ.setdefault("SUNLOGGER_WARNING_FILENAME", os.devnull)
    code = main()
    atexit._run_exitfuncs()
    with suppress(OSError, ValueError, AttributeError):  # a stream may be closed or missing
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)


def _interrupted(session: Session) -> int:
    complain(f"interrupted; {session.summary_of_written()}")
    return session.interrupted_code


def _show_traceback_if_asked() -> bool:
    is_asked = os.environ.get("HYBRIDSIM_TRACEBACK", "0") not in ("", "0")
    if is_asked:
        traceback.print_exc()
    return is_asked


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    complain(f"warning: {message} ({category.__name__})")
