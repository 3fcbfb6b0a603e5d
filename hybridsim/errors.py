"""The one tree of errors: a message says what is wrong, where (file, line, caret) and what to do."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

# a word of a file, or a path, without an end to it: of more than 400 characters the first and last are shown
_ENDLESS = re.compile(r"(\S{200})\S{200,}(\S{20})")
# how NumPy writes its scalars in a repr
_NUMPY = re.compile(r"\bnp\.(?:\w+\((?P<value>[-+.\w]+|'[^']*')\)|(?P<word>True|False)_)")
# the same for words between blanks, such as a formula of a thousand terms in the place of a name
_LONG_LINE = re.compile(r"(.{1500}).{500,}(.{200})")


@dataclass(frozen=True)
class Place:
    """Where something was written.

    Parameters
    ----------
    file : str, optional
        Path as the user gave it, or None for what was built in Python.
    line : int, optional
        Line of the file, counted from 1.
    column : int, optional
        Offset into ``text``, counted from 0, under which the caret is drawn.
    text : str, optional
        The offending piece of source text, one line.

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

    def at(self, text: str, column: int | None = None) -> Place:
        """The same file and line, pointing at a piece of text."""
        return replace(self, text=text, column=column)

    @property
    def prefix(self) -> str:
        """The head of a message, ``file:line:`` and a blank, or nothing where neither is known."""
        parts = [str(part) for part in (self.file, self.line if self.file else None) if part is not None]
        if not parts and self.line is not None:
            parts = [f"line {self.line}"]
        return ":".join(parts) + ": " if parts else ""


class HybridsimError(Exception):
    """Anything hybridsim refuses or fails to do.

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
    """A model that cannot be; ``errors`` holds every fault found, each with its own place and remedy.

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
        """Every fault by itself; this error alone if it stands for no others."""
        return self._errors or (self,)

    @classmethod
    def collect(cls, errors: Iterable[ModelError], title: str) -> ModelError:
        """One error out of many: the only one itself, or a list of all, by line, under a title."""
        # a fault met twice is one
        every = {str(single): single for error in errors for single in error.errors}
        found = sorted(every.values(), key=_line)
        if len(found) == 1:
            return found[0]
        message = "\n".join([f"{title}: {len(found)} errors", *(str(error) for error in found)])
        return ModelError(message, errors=found)


class ExpressionError(ModelError):
    """A text that is no expression, or an expression that has no value.

    Examples
    --------
    >>> import hybridsim as hs
    >>> try:
    ...     hs.Model("m", states=[hs.State("x", 1, "-x*(")]).validate()
    ... except hs.ExpressionError as error:
    ...     print(error.message)
    State x: der: not an expression: '(' was never closed
    """


class UsageError(HybridsimError, ValueError):
    """A call or a command line that asks for something that does not exist.

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
    """A run that could not be carried out.

    Notes
    -----
    A run that stops early raises nothing: the status and the message of its `Solution` say why.

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
    """Ctrl-C, or KeyboardInterrupt from a function that is told of progress, in the middle of a run.

    It ends the loop or the script that the run is in, as everywhere else.

    Parameters
    ----------
    solution : Solution
        What was computed by then; its ``resume()`` goes on.
    """

    def __init__(self, solution: Any) -> None:
        super().__init__(solution)
        self.solution = solution

    def __str__(self) -> str:
        return str(self.solution.message)


def plain(text: str) -> str:
    """A message that shows what NumPy holds as a number or text shows it as that: 2.0, and not np.float64(2.0)."""
    return re.sub(_NUMPY, lambda found: found["value"] or found["word"], text)


def near(name: str, known: Iterable[str]) -> list[str]:
    """Up to three names that an unknown one may be meant for: of other case, similar, or with it as a part."""
    names = sorted(set(known))
    folded = [other for other in names if other.lower() == name.lower()]
    similar = difflib.get_close_matches(name, names, n=3, cutoff=0.6)
    # a part of two letters is in too many names to mean one of them
    holding = [
        other for other in names if len(name) > 2 and name.lower() in re.split(r"[-_ .]", other.lower())
    ]
    return list(dict.fromkeys([*folded, *similar, *holding]))[:3]


def nearest(name: str, known: Iterable[str], *, kind: str = "names") -> str:
    """The remedy for an unknown name: the near ones, else a list of what there is."""
    names = sorted(set(known))
    close = near(name, names)
    if close:
        return "did you mean " + " or ".join(f"'{other}'" for other in close) + "?"
    if not names:
        return f"there are no {kind} here."
    shown = ", ".join(names[:12]) + (f", ... ({len(names)} in all)" if len(names) > 12 else "")
    return f"known {kind}: {shown}."


def _line(error: HybridsimError) -> int:
    return (error.place.line if error.place else None) or 0


def printable(text: str) -> str:
    """A text without what would steer the terminal that shows it; any blank is one column wide, like a caret."""
    return "".join(c if c.isprintable() or c == "\n" else " " if c.isspace() else "?" for c in text)


def _window(text: str, column: int | None, width: int = 100) -> tuple[str, int | None]:
    """A long line is cut to what is around the caret, so that a message stays readable."""
    if len(text) <= width:
        return text, column
    start = max(0, min((column or 0) - width // 2, len(text) - width))
    head, tail = ("..." if start else ""), ("..." if start + width < len(text) else "")
    shifted = None if column is None else column - start + len(head)
    return head + text[start : start + width] + tail, shifted
