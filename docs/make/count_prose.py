"""Count how plain the prose of the pages is: the length of sentences, punctuation, and phrases of the style sheet.

    python docs/make/count_prose.py            # one row for each folder
    python docs/make/count_prose.py PAGE ...   # one row for each page, and the sentences to change

Code blocks, tables, headings, pictures and the targets of links are not prose. `docs/style.md` has the rules.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LONG = 45  # words: a sentence with more of them is too long

# Phrases that the style sheet replaces. Each is a regular expression, without regard to capitals.
PHRASES = {
    "held against": r"\b(held|holds?) (\w+ )?against\b",
    "stands": r"\bstands?\b(?! still| for\b)",
    "beside": r"\bbeside\b",
    "some 30": r"\bsome \d",
    "as a rule": r"\bas a rule\b",
    "anew": r"\banew\b",
    "dear": r"\bdear(er|est)?\b",
    "mend": r"\bmend(s|ed|ing)?\b",
    "but for": r"\bbut for\b",
    "the very": r"\bthe very\b",
    "in short": r"\bin short\b",
    "for ever": r"\bfor (ever|good)\b",
    "comes to": r"\bcomes? to\b(?! rest)",
    "by itself": r"\bby itself\b",
    "loaded down": r"\bloaded down\b",
    "in distinction from": r"\bin distinction from\b",
    "stops to be": r"\bstop(s|ped)? to be\b",
    "is no": r"(?<!there )(?<!there may )\b(is|are|was|were|be) no\b"
    r"(?! (longer|more|less|other|better|worse|greater|larger|smaller))",
    "says, knows": r"\b(says|tells|asks|knows|sees|owes|forgets)\b",
    "What ... at the start": r"^(What|Who|Whoever|Where)\b(?!.*\?$)",
    "-isation": r"\b(regular|linear|discret|optim|initial|normal|synchron)is(e|ed|es|ing|ation)\b",
}
# A full stop after these does not end a sentence.
ABBREVIATION = re.compile(r"\b(e\.g|i\.e|et al|Fig|Eq|vs|cf|No|pp?)\.$")
END = re.compile(r"[.!?][)\"'*”]*(?=\s+[(\[\"'“*]*([A-Z0-9`]|(hybridsim|numba)\b))")


@dataclass
class Counts:
    """What was counted on some pages."""

    words: int = 0
    sentences: int = 0
    longest: int = 0
    semicolons: int = 0
    colons: int = 0
    too_long: list[tuple[int, str]] = field(default_factory=list)
    phrases: list[tuple[str, str]] = field(default_factory=list)

    @property
    def average(self) -> float:
        """Words in a sentence."""
        return self.words / max(self.sentences, 1)

    def per_thousand(self, count: int) -> float:
        """Return how many of something there are in a thousand words."""
        return 1000 * count / max(self.words, 1)

    def add(self, other: Counts) -> None:
        """Add what was counted on another page."""
        self.words += other.words
        self.sentences += other.sentences
        self.longest = max(self.longest, other.longest)
        self.semicolons += other.semicolons
        self.colons += other.colons
        self.too_long += other.too_long
        self.phrases += other.phrases


def paragraphs(text: str) -> list[str]:
    """Return the paragraphs and list items of a page, without what is not prose."""
    text = re.sub(r"^( *)(`{3,}|~{3,}|:{3,}).*?^\1\2 *$", "\n", text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"<!--.*?-->|!\[[^\]]*\]\([^)]*\)|\$\$.*?\$\$", "", text, flags=re.DOTALL)
    found: list[list[str]] = [[]]
    for line in text.splitlines():
        if not line.strip() or re.match(r"\s*([|#]|-{3,}|\(.*\)=$|<)", line):
            found.append([])
        elif item := re.match(r"\s*([-*+:]|\d+\.)\s+(.*)", line):
            found.append([item[2]])
        else:
            found[-1].append(line.strip())
    return [" ".join(lines) for lines in found if lines]


def plain(paragraph: str) -> str:
    """Return a paragraph with one word for each piece of code, and without marks and the targets of links."""
    paragraph = re.sub(r"\{[\w:]+\}(?=`)", "", paragraph)
    paragraph = re.sub(r"(`+).+?\1|\$[^$]+\$", "CODE", paragraph)
    paragraph = re.sub(r"\[([^\]]*)\](\([^)]*\)|\[[^\]]*\])", r"\1", paragraph)
    return re.sub(r"\*\*|__|<[^>]*>|https?://\S+", "", paragraph)


def sentences(paragraph: str) -> list[str]:
    """Divide a paragraph into sentences."""
    found, start = [], 0
    for end in END.finditer(paragraph):
        if not ABBREVIATION.search(paragraph[start : end.start() + 1]):
            found.append(paragraph[start : end.end()].strip())
            start = end.end()
    return [*found, paragraph[start:].strip()]


def count(page: Path) -> Counts:
    """Count on one page."""
    counts = Counts()
    for sentence in (
        one for text in paragraphs(page.read_text(encoding="utf-8")) for one in sentences(plain(text))
    ):
        words = len(re.findall(r"\S*\w\S*", sentence))
        if not words:
            continue
        counts.words += words
        counts.sentences += 1
        counts.longest = max(counts.longest, words)
        counts.semicolons += sentence.count(";")
        counts.colons += len(re.findall(r":(?=\s|$)", sentence))
        if words > LONG:
            counts.too_long.append((words, sentence))
        for name, pattern in PHRASES.items():
            counts.phrases += [(name, sentence)] * len(re.findall(pattern, sentence, re.IGNORECASE))
    return counts


def folder_of(page: Path) -> str:
    """Return the row to which a page belongs: its folder, or for a page at the root its name."""
    path = page.relative_to(ROOT)
    return (
        path.name
        if path.parent == Path()
        else "/".join(path.parts[:2] if len(path.parts) > 2 else path.parts[:1])
    )


def by_folder() -> dict[str, Counts]:
    """Count on all pages, one row for each folder."""
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    rows: dict[str, Counts] = {}
    for page in sorted(page for page in pages if "_build" not in page.parts and "gallery" not in page.parts):
        rows.setdefault(folder_of(page), Counts()).add(count(page))
    return rows


def table(rows: Iterable[tuple[str, Counts]]) -> str:
    """Return the counts as a table."""
    heads = ("words", "average", "longest", "over 45", "; /1000", ": /1000", "phrases")
    lines = [" " * 34 + "".join(f"{head:>9}" for head in heads)]
    for name, row in rows:
        lines.append(
            f"{name:34}{row.words:9}{row.average:9.1f}{row.longest:9}{len(row.too_long):9}"
            f"{row.per_thousand(row.semicolons):9.1f}{row.per_thousand(row.colons):9.1f}{len(row.phrases):9}"
        )
    return "\n".join(lines)


def main(names: list[str]) -> None:
    """Print the table, and for named pages the sentences to change."""
    if not names:
        print(table(by_folder().items()))
        return
    rows = {name: count(Path(name)) for name in names}
    print(table(rows.items()))
    for name, row in rows.items():
        for words, sentence in row.too_long:
            print(f"\n{name}: {words} words: {sentence}")
        for phrase, sentence in row.phrases:
            print(f"\n{name}: '{phrase}': {sentence}")


if __name__ == "__main__":
    main(sys.argv[1:])
