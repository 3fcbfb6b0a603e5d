"""This module defines an argparse parser that raises `UsageError` and suggests similar names."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from hybridsim.errors import UsageError, nearest


class Parser(argparse.ArgumentParser):
    """An argument parser that raises errors instead of exiting, and rejects abbreviated options."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(allow_abbrev=False, formatter_class=argparse.RawDescriptionHelpFormatter, **settings)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse the line; unknown options are reported by this parser, which knows similar names."""
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
