"""Write the pages of docs/atlas again from its atlas.json, after a change of their texts. No scene is run.

python docs/make/atlas_pages.py

`hybridsim atlas --out docs/atlas` runs the scenes, and writes the data, the pictures and the same pages.
"""

from __future__ import annotations

from pathlib import Path

from hybridsim.testing.atlas import Atlas, pages

FOLDER = Path(__file__).parents[1] / "atlas"


def written() -> dict[str, str]:
    """Return the text of each page, from the stored verdicts and the pictures that are there."""
    result = Atlas.from_json((FOLDER / "atlas.json").read_text(encoding="utf-8"))
    return pages(result, {picture.stem for picture in FOLDER.glob("*/*.png")})


if __name__ == "__main__":
    for name, text in written().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
