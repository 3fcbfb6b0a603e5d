"""This module decides what a repeated option means: another value of a list, or an error, but never a lost value."""

from __future__ import annotations

import argparse
from typing import Any

from hybridsim.errors import UsageError


class Stored(argparse.Action):
    """An option with one value, or with a list of values to which a repeated option appends."""

    def __call__(self, parser: Any, namespace: argparse.Namespace, values: Any, option: Any = None) -> None:
        seen = vars(namespace).setdefault("seen", set())
        if option and self.dest in seen:
            before = getattr(namespace, self.dest)
            if not (isinstance(values, list | tuple) and isinstance(before, list | tuple)):
                raise UsageError(f"{option} occurs twice", remedy=f"use {option} only once")
            values = [*before, *values]
        seen.add(self.dest)
        setattr(namespace, self.dest, values)


class Appended(argparse.Action):
    """An option that may occur several times; of NAME=VALUE each name may occur once."""

    def __call__(self, parser: Any, namespace: argparse.Namespace, values: Any, option: Any = None) -> None:
        before = getattr(namespace, self.dest)
        if isinstance(values, tuple) and values[0] in [name for name, _ in before]:
            name = values[0]
            raise UsageError(f"{option} {name} occurs twice", remedy=f"use {option} {name}=... only once")
        setattr(namespace, self.dest, [*before, values])
