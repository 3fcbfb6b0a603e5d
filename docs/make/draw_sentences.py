"""Draws sentences of all pages at random, for somebody to read afresh.

python docs/make/draw_sentences.py [SEED]        (100 sentences)

The reader marks what has to be read twice. The aim is at most 3 of 100.
"""

from __future__ import annotations

import random
import sys

import count_prose

NUMBER = 100
SHORTEST = 5  # words of a sentence that can be drawn


def all_sentences() -> list[tuple[str, str]]:
    """Return the sentences of all pages, each with the name of its page."""
    pages = [*count_prose.ROOT.glob("*.md"), *(count_prose.ROOT / "docs").rglob("*.md")]
    found = []
    for page in sorted(page for page in pages if not {"_build", "gallery"} & set(page.parts)):
        for paragraph in count_prose.paragraphs(page.read_text(encoding="utf-8")):
            named = [
                (str(page.relative_to(count_prose.ROOT)), one) for one in count_prose.sentences(paragraph)
            ]
            found += [(name, one) for name, one in named if len(one.split()) >= SHORTEST]
    return found


if __name__ == "__main__":
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    for number, (name, sentence) in enumerate(random.Random(seed).sample(all_sentences(), NUMBER), 1):
        print(f"{number:3d}  {name}: {sentence}")
