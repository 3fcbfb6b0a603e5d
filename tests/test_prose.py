"""The prose of the pages stays plain: sentences are short, and phrases that the style sheet replaces become fewer.

`docs/style.md` has the rules, and `docs/make/count_prose.py` counts. Lower the row of a folder when its pages
have become plainer.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "docs" / "make"))
import count_prose

# The most that each folder may have: the average of words in a sentence, sentences of more than 45 words, semicolons
# in 1000 words, colons in 1000 words, and phrases to replace. A row may only become lower. The aim is 20, 0, 2, 10, 0.
# fmt: off
CEILINGS = {
    "CHANGELOG.md": (12.5, 0, 0.5, 3, 0),
    "CONTRIBUTING.md": (11, 0, 0.5, 1, 0),
    "README.md": (13, 0, 1, 8, 0),
    "docs": (12, 0, 0.5, 10, 0),
    "docs/atlas": (11.6, 0, 0, 14.5, 0),
    "docs/explanation": (12.5, 0, 0, 4, 0),
    "docs/how-to": (12, 0, 0.5, 6.5, 0),
    "docs/reference": (10, 0, 1, 7.5, 0),
    "docs/studies": (12.5, 0, 0, 3.5, 0),
    "docs/tutorials": (9, 0, 0, 8, 0),
}
# fmt: on
COUNTED = count_prose.by_folder()


def test_each_folder_has_its_ceilings() -> None:
    assert sorted(COUNTED) == sorted(CEILINGS)


@pytest.mark.parametrize("folder", CEILINGS)
def test_no_folder_becomes_less_plain(folder: str) -> None:
    row = COUNTED[folder]
    counts = (
        row.average,
        len(row.too_long),
        row.per_thousand(row.semicolons),
        row.per_thousand(row.colons),
        len(row.phrases),
    )
    names = (
        "words in a sentence",
        "sentences of more than 45 words",
        "semicolons",
        "colons",
        "phrases to replace",
    )
    above = [
        f"{name}: {n:.4g} > {most}" for name, n, most in zip(names, counts, CEILINGS[folder]) if n > most
    ]
    assert not above, f"{folder}: {', '.join(above)}; run: python docs/make/count_prose.py PAGE"


def test_counts_on_a_page_counted_by_hand(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# A heading: not counted\n\nOne sentence has six words here. Two; are `a: b` joined: by it [a link](x.md).\n\n"
        "```python\nprint(1)  # code: not counted\n```\n\n| a | table: not |\n\n- It was held against, e.g. It.\n"
    )
    counts = count_prose.count(page)
    assert (counts.words, counts.sentences, counts.longest) == (6 + 8 + 6, 3, 8)
    assert (counts.semicolons, counts.colons) == (1, 1)
    assert [name for name, _ in counts.phrases] == ["held against"]


@pytest.mark.parametrize(
    ("sentence", "phrases"),
    [
        ("What moves is a block.", ["What ... at the start"]),
        ("What is a mode?", []),
        ("A bounce is no event.", ["is no"]),
        ("There is no event, and the body is no longer at rest.", []),
        ("It comes to rest and stands still.", []),
        ("It comes to 3 and stands beside it, for some 30 s.", ["stands", "beside", "some 30", "comes to"]),
        ("The linearised model is linearized.", ["-isation"]),
    ],
)
def test_phrases_that_the_style_sheet_replaces(sentence: str, phrases: list[str], tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(sentence + "\n")
    assert [name for name, _ in count_prose.count(page).phrases] == phrases


def test_a_sentence_of_46_words_is_too_long(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(" ".join(["word"] * 45) + ". Word " + " ".join(["word"] * 45) + ".\n")
    assert [words for words, _ in count_prose.count(page).too_long] == [46]
