"""Write the pages of docs/atlas again from its atlas.json, after a change of their texts.

python docs/make/atlas_pages.py [--pictures] [SCENE ...]

With `--pictures` it also draws the pictures again, of these scenes or of all. For this it runs two methods in each
scene. `hybridsim atlas --out docs/atlas` runs all methods, and writes the data, the pictures and the same pages.
"""

from __future__ import annotations

import sys
from pathlib import Path

from hybridsim.plot.atlas import save_small
from hybridsim.plot.atlas import scene as picture
from hybridsim.testing.atlas import Atlas, example, pages

FOLDER = Path(__file__).parents[1] / "atlas"


def stored() -> Atlas:
    """Return the stored verdicts."""
    return Atlas.from_json((FOLDER / "atlas.json").read_text(encoding="utf-8"))


def written() -> dict[str, str]:
    """Return the text of each page, from the stored verdicts and the pictures that are there."""
    return pages(stored(), {path.stem for path in FOLDER.glob("*/*.png")})


def draw(names: list[str]) -> None:
    """Draw the pictures of these scenes again, or of all."""
    result = stored()
    for scene in result.scenes:
        path = FOLDER / scene.trouble / f"{scene.name}.png"
        if scene.name in names or (not names and path.exists()):
            found = example(result, scene)
            assert found is not None, f"{scene.name} has no run to draw"
            print(save_small(picture(found), path), flush=True)


if __name__ == "__main__":
    if "--pictures" in sys.argv[1:]:
        draw([name for name in sys.argv[1:] if name != "--pictures"])
    for name, text in written().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
