"""This module defines the exceptions; each message states the error, its place and the remedy."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

# a very long word or path, which is shortened to its first 200 and last 20 characters
_ENDLESS = re.compile(r"(\S{200})\S{200,}(\S{20})")
# the repr of a NumPy scalar
_NUMPY = re.compile(r"\bnp\.(?:\w+\((?P<value>[-+.\w]+|'[^']*')\)|(?P<word>True|False)_)")
# a very long line, such as a formula of a thousand terms, which is shortened likewise
_LONG_LINE = re.compile(r"(.{1500}).{500,}(.{200})")


@dataclass(frozen=True)
class Place:
    """The place in a file or text that an error refers to.

    Parameters
    ----------
    file : str, optional
        Path as the user wrote it, or None for a model built in Python.
    line : int, optional
        Line of the file, counted from 1.
    column : int, optional
        Offset into ``text``, counted from 0, under which the caret is drawn.
    text : str, optional
        The offending piece of source text, one line.
    within : str, optional
        The part of the model to which the file belongs, such as ``"use.left > use.hub"``.

    Examples
    --------
    >>> import hybridsim as hs
    >>> hs.Place(file="block.toml", line=7).prefix
    'block.toml:7: '
    """

    file: str | None = None
    line: int | None = None
    column: int | None = None
    text: str | None = None
    within: str = ""

    def at(self, text: str, column: int | None = None) -> Place:
        """Return a place in the same file and line, but with another piece of text."""
        return replace(self, text=text, column=column)

    @property
    def prefix(self) -> str:
        """The start of a message, ``file:line:`` and a space; an empty string if the place is unknown."""
        parts = [str(part) for part in (self.file, self.line if self.file else None) if part is not None]
        if not parts and self.line is not None:
            parts = [f"line {self.line}"]
        where = ", ".join(text for text in (":".join(parts), self.within) if text)
        return f"{where}: " if where else ""

    def inside(self, use: str) -> Place:
        """Return the place as seen from a model that contains the file as its part ``use``."""
        return replace(self, within=f"{use} > {self.within}" if self.within else use)


class HybridsimError(Exception):
    """The base class of all errors that hybridsim raises.

    Parameters
    ----------
    message : str
        What is wrong, naming the object and the value.
    place : Place, optional
        Where it is written, if it is written anywhere.
    remedy : str, optional
        What the user can do about it.

    Examples
    --------
    >>> import hybridsim as hs
    >>> try:
    ...     hs.load("dfsc")
    ... except hs.HybridsimError as error:
    ...     print(error.message)
    there is no model 'dfsc'
    """

    exit_code = 1

    def __init__(self, message: str, *, place: Place | None = None, remedy: str | None = None) -> None:
        message = plain(message)
        super().__init__(message)
        self.message = message
        self.place = place
        self.remedy = remedy

    def __str__(self) -> str:
        place = self.place or Place()
        lines = [place.prefix + self.message]
        if place.text is not None:
            text, column = _window(place.text, place.column)
            lines.append("    " + text)
            if column is not None:
                lines.append("    " + " " * column + "^")
        if self.remedy:
            lines.append(self.remedy)
        for endless in (_ENDLESS, _LONG_LINE):
            lines = [re.sub(endless, r"\1...\2", line) for line in lines]
        return printable("\n".join(lines))


class ModelError(HybridsimError):
    """An error in a model; ``errors`` holds every error found, each with its place and remedy.

    Parameters
    ----------
    message : str
        What is wrong, naming the object and the value.
    place : Place, optional
        Where it is written, if it is written anywhere.
    remedy : str, optional
        What the user can do about it.
    errors : iterable of ModelError, optional
        The single faults, where there are several.

    Examples
    --------
    >>> import hybridsim as hs
    >>> try:
    ...     hs.Model("m", states=[hs.State("x", 1, "-y"), hs.State("v", 0, "z")]).validate()
    ... except hs.ModelError as error:
    ...     print([single.place.text for single in error.errors])
    ['-y', 'z']
    """

    exit_code = 3

    def __init__(
        self,
        message: str,
        *,
        place: Place | None = None,
        remedy: str | None = None,
        errors: Iterable[ModelError] = (),
    ) -> None:
        super().__init__(message, place=place, remedy=remedy)
        self._errors = tuple(errors)

    @property
    def errors(self) -> tuple[ModelError, ...]:
        """Every single error, as a tuple; an error that combines no other errors is the only element."""
        return self._errors or (self,)

    def inside(self, use: str) -> tuple[ModelError, ...]:
        """Return the errors of a part as errors of the model that uses the part under the name ``use``."""
        return tuple(
            type(error)(error.message, place=(error.place or Place()).inside(use), remedy=error.remedy)
            for error in self.errors
        )

    @classmethod
    def collect(cls, errors: Iterable[ModelError], title: str, own: str | None = None) -> ModelError:
        """Return a single error itself, or combine several errors into one error that lists them by file and line.

        Errors in the model's own file come last, because errors in the files of its laws and parts may cause them.
        """
        # errors with equal texts are reported once
        every = {str(single): single for error in errors for single in error.errors}
        files = list(dict.fromkeys(_file(single) for single in every.values()))
        order = {file: (file is not None, file == own, k) for k, file in enumerate(files)}
        found = sorted(every.values(), key=lambda single: (order[_file(single)], _line(single)))
        if len(found) == 1:
            return found[0]
        message = "\n".join([f"{title}: {len(found)} errors", *(str(error) for error in found)])
        return ModelError(message, errors=found)


class ExpressionError(ModelError):
    """An error in an expression: a text that cannot be parsed, or an expression that has no value.

    Examples
    --------
    >>> import hybridsim as hs
    >>> try:
    ...     hs.Model("m", states=[hs.State("x", 1, "-x*(")]).validate()
    ... except hs.ExpressionError as error:
    ...     print(error.message)
    State x, der: invalid expression: '(' was never closed
    """


class UsageError(HybridsimError, ValueError):
    """An error in a call or a command line: a wrong or unknown argument.

    Examples
    --------
    >>> import hybridsim as hs
    >>> try:
    ...     hs.simulate("dfcs", (0, 1), params={"massa": 2})
    ... except hs.UsageError as error:
    ...     print(error.message)
    the model 'dfcs' has no parameter 'massa'
    """

    exit_code = 2


class SimulationError(HybridsimError):
    """Raised if a computation could not be carried out.

    Notes
    -----
    A run that stops early does not raise. The status and message of its `Solution` state the reason.

    Examples
    --------
    >>> import hybridsim as hs
    >>> growth = hs.Model("growth", states=[hs.State("x", 1, "1 + x**2")])
    >>> try:
    ...     hs.linearize(growth)
    ... except hs.SimulationError as error:
    ...     print("no equilibrium" in error.message)
    True
    """


class RunInterrupted(KeyboardInterrupt):
    """Raised if a run was stopped by Ctrl-C, or by KeyboardInterrupt from its progress function.

    Like any KeyboardInterrupt it ends the loop or the script around the run.

    Parameters
    ----------
    solution : Solution
        The part computed before the interruption; its ``resume()`` continues the run.
    """

    def __init__(self, solution: Any) -> None:
        super().__init__(solution)
        self.solution = solution

    def __str__(self) -> str:
        return str(self.solution.message)


def plain(text: str) -> str:
    """Return a message in which NumPy scalars appear as plain numbers: 2.0 instead of np.float64(2.0)."""
    return re.sub(_NUMPY, lambda found: found["value"] or found["word"], text)


def near(name: str, known: Iterable[str]) -> list[str]:
    """Return up to three known names that are similar to a name, or contain it."""
    names = sorted(set(known))
    folded = [other for other in names if other.lower() == name.lower()]
    similar = difflib.get_close_matches(name, names, n=3, cutoff=0.6)
    # parts of one or two letters occur in too many names to be useful
    holding = [
        other for other in names if len(name) > 2 and name.lower() in re.split(r"[-_ .]", other.lower())
    ]
    return list(dict.fromkeys([*folded, *similar, *holding]))[:3]


def nearest(name: str, known: Iterable[str], *, kind: str = "names") -> str:
    """Return the remedy for an unknown name: similar names, or a list of the known names."""
    names = sorted(set(known))
    close = near(name, names)
    if close:
        return "did you mean " + " or ".join(f"'{other}'" for other in close) + "?"
    if not names:
        return f"there are no {kind}"
    shown = ", ".join(names[:12]) + (f", ... ({len(names)} in all)" if len(names) > 12 else "")
    return f"known {kind}: {shown}"


def _file(error: HybridsimError) -> str | None:
    return error.place.file if error.place else None


def _line(error: HybridsimError) -> int:
    return (error.place.line if error.place else None) or 0


def printable(text: str) -> str:
    """Replace the control characters of a text by "?" or a blank, because they could change the terminal."""
    return "".join(c if c.isprintable() or c == "\n" else " " if c.isspace() else "?" for c in text)


def _window(text: str, column: int | None, width: int = 100) -> tuple[str, int | None]:
    """Shorten a long line to the part around the marked column."""
    if len(text) <= width:
        return text, column
    start = max(0, min((column or 0) - width // 2, len(text) - width))
    head, tail = ("..." if start else ""), ("..." if start + width < len(text) else "")
    shifted = None if column is None else column - start + len(head)
    return head + text[start : start + width] + tail, shifted
