"""Draw which floor of the package imports which, as the code says it: docs/images/floors.png.

    python docs/make/floors_graph.py

An arrow that a chain of other arrows implies is left out: `analysis` imports `errors` too, but who imports `model` has
`errors` under it anyway.
"""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "hybridsim"
# Where each box stands: its row from the ground up, and how far right of the middle.
PLACES = {
    "errors": (0, 0.0),
    "files": (1, 2.2),
    "calls": (1, -2.2),
    "forks": (0, -2.2),
    "expr": (1, 0.0),
    "model": (2, 0.0),
    "engine": (3, 0.0),
    "integrators": (4, 0.0),
    "tables": (5, 4.4),
    "colours": (4, 2.2),
    "notebook": (5, 2.2),
    "readable": (5, -2.2),
    "arguments": (5, 0.0),
    "solution": (6, 0.0),
    "preparation": (7, 2.2),
    "mechanics": (7, 0.0),
    "simulate": (8, 0.0),
    "ivp": (8, -2.2),
    "analysis": (9, 0.0),
    "testing": (10, 0.0),
    "plot": (11, 0.0),
    "cli": (12, 0.0),
}
BLUE, BOX = "#0072B2", "#E8F1F8"
HALF_WIDTH, HALF_HEIGHT = 0.85, 0.3


def floor_of(path: Path) -> str:
    """Floor of a module: its top-level folder or file."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path) -> set[str]:
    """The floors that one module imports from, at its top or inside a function, types included."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        found |= {name.split(".")[1] for name in names if name.startswith("hybridsim.")}
    return found


def graph() -> tuple[dict[str, set[str]], Counter[str]]:
    """The floors that each floor imports from, and how many modules it has."""
    below: dict[str, set[str]] = {name: set() for name in PLACES}
    sizes: Counter[str] = Counter()
    for path in sorted(PACKAGE.rglob("*.py")):
        floor = floor_of(path)
        if floor in {"__init__", "__main__"}:
            continue
        if floor not in PLACES:
            raise SystemExit(f"{floor} has no place in PLACES")
        sizes[floor] += 1
        below[floor] |= (imports(path) & set(PLACES)) - {floor}
    return below, sizes


def reached(below: dict[str, set[str]], name: str) -> set[str]:
    """Everything under a floor."""
    return below[name].union(*(reached(below, other) for other in below[name]))


def needed(below: dict[str, set[str]]) -> list[tuple[str, str]]:
    """The arrows that no chain of others implies."""
    return [
        (name, other)
        for name in below
        for other in sorted(below[name])
        if not any(other in reached(below, third) for third in below[name] - {other})
    ]


def middle(name: str) -> tuple[float, float]:
    """Of a box; rows are one unit apart."""
    row, x = PLACES[name]
    return x, float(row)


def draw() -> Path:
    """The picture, and where it went."""
    below, sizes = graph()
    figure, axes = plt.subplots(figsize=(9, 11), layout="constrained")
    for above, under in needed(below):
        (x0, y0), (x1, y1) = middle(above), middle(under)
        side = HALF_WIDTH * ((x1 > x0) - (x1 < x0))
        axes.add_patch(
            FancyArrowPatch(
                # between the middle column and another one: from or to the side of the box in the middle
                (x0 + side, y0) if side and not x0 else (x0, y0 - HALF_HEIGHT),
                (x1 - side, y1) if side and not x1 else (x1, y1 + HALF_HEIGHT),
                arrowstyle="-|>",
                mutation_scale=13,
                linewidth=1.4,
                color=BLUE,
                shrinkA=0,
                shrinkB=0,
                zorder=3,
            )
        )
    for name in PLACES:
        x, y = middle(name)
        axes.add_patch(
            FancyBboxPatch(
                (x - HALF_WIDTH + 0.05, y - HALF_HEIGHT + 0.05),
                2 * HALF_WIDTH - 0.1,
                2 * HALF_HEIGHT - 0.1,
                boxstyle="round,pad=0.05",
                facecolor=BOX,
                edgecolor="black",
                zorder=2,
            )
        )
        modules = "1 module" if sizes[name] == 1 else f"{sizes[name]} modules"
        axes.text(x, y + 0.1, name, ha="center", va="center", fontsize=12, weight="bold", zorder=4)
        axes.text(x, y - 0.15, modules, ha="center", va="center", fontsize=9, zorder=4)
    axes.set_xlim(-3.2, 5.4)
    axes.set_ylim(-0.5, max(row for row, _ in PLACES.values()) + 0.5)
    axes.axis("off")
    path = ROOT / "docs" / "images" / "floors.png"
    figure.savefig(path, dpi=100)
    plt.close(figure)
    return path


if __name__ == "__main__":
    print(draw())
