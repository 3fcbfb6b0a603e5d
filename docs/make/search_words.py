"""Adds the words of `docs/search_words.toml` to the index of the site, which its search shows first."""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path

WORDS = Path(__file__).parents[1] / "search_words.toml"


@cache
def words() -> dict[str, dict[str, list[str]]]:
    """Return the words of each heading, for each page."""
    return tomllib.loads(WORDS.read_text(encoding="utf-8"))


def add(page: str, text: str) -> str:
    """Return the text of a page with an index entry after each heading that has words."""
    for heading, found in words().get(page, {}).items():
        entries = "\n".join(f"```{{index}} ! {word}\n```" for word in found)
        line = re.compile(rf"^#+ {re.escape(heading)}$", re.MULTILINE)
        text, count = line.subn(lambda at, new=entries: f"{at[0]}\n\n{new}\n", text)
        if count != 1:
            raise ValueError(
                f"{WORDS.name}: the page {page} has {count} headings {heading!r}; write the heading as on the page"
            )
    return text
