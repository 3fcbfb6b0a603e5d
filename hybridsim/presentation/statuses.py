"""This module explains the statuses and warnings of runs, from the text in `statuses.md`.

The documentation contains the same file, so that each explanation is written once.
"""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files

from hybridsim.errors import UsageError, nearest

_HEADING = re.compile(r"^### (.+)$", re.MULTILINE)
_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")


@cache
def explanations() -> dict[str, str]:
    """Return the section for each status, and for each phrase that identifies a warning.

    A heading with several phrases, separated by " / ", has one section.
    """
    text = files("hybridsim.presentation").joinpath("statuses.md").read_text(encoding="utf-8")
    text = _LINK.sub(r"\1", re.sub(r"^## .*\n", "", text, flags=re.MULTILINE))
    _, *parts = _HEADING.split(text)
    pairs = zip(parts[::2], parts[1::2], strict=True)
    return {
        phrase: f"{heading}\n\n{body.strip()}\n" for heading, body in pairs for phrase in heading.split(" / ")
    }


def explanation(message: str) -> str:
    """Return the section for a status, for a part of a warning, or for a whole warning."""
    known, asked = explanations(), " ".join(message.split()).lower()
    if asked in known:
        return known[asked]
    contained = [phrase for phrase in known if phrase.lower() in asked]
    containing = [phrase for phrase in known if asked and asked in phrase.lower()]
    if not contained and not containing:
        raise UsageError(
            f"No explanation of {message!r}", remedy=nearest(message, known, kind="statuses and warnings")
        )
    return known[max(contained, key=len) if contained else containing[0]]
