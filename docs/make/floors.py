"""Make the tables and the picture of docs/explanation/floors.md out of the package itself.

    python docs/make/floors.py

The tables hold the first sentence of each folder and file, the picture which floor imports which.
"""

from __future__ import annotations

import ast
import hashlib
import re
import textwrap
from collections import Counter
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "hybridsim"
PAGE = ROOT / "docs" / "explanation" / "floors.md"

# The floors from the ground up. `tests/test_layering.py` holds every import against this order.
FLOORS = (
    "errors",
    "files",
    "calls",
    "forks",
    "expr",
    "model",
    "reference",
    "engine.native",
    "engine.series",
    "engine.lowering",
    "engine.system",
    "engine.record",
    "engine.roots",
    "engine.linear",
    "engine.events",
    "engine.run",
    "engine.stepping",
    "integrators",
    "ensemble",
    "presentation",
    "arguments",
    "solution",
    "preparation",
    "mechanics",
    "simulate",
    "simulator",
    "ivp",
    "analysis",
    "testing",
    "plot",
    "report",
    "studies",
    "cli",
)
BLUE, BOX, WIDTH = "#0072B2", "#E8F1F8", 3.1


def floor_of(path: Path) -> str:
    """The floor of a module: its folder or file at the top, and one level further down in the engine."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:2] if parts[0] == "engine" and parts[1] != "__init__" else parts[:1])


def floor_of_module(module: str) -> str:
    """The floor of a module that is imported; the whole package is none."""
    parts = module.split(".")[1:]
    return ".".join(parts[:2] if parts[:1] == ["engine"] else parts[:1])


@cache
def imports(path: Path) -> tuple[tuple[str, int], ...]:
    """Every module of the package that a file imports, at its top, for types or inside a function, with the line."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [(alias.name, node.lineno) for alias in node.names if alias.name.startswith("hybridsim")]
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("hybridsim"):
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                place = PACKAGE.joinpath(*name.split(".")[1:])
                is_module = place.with_suffix(".py").exists() or (place / "__init__.py").exists()
                found.append((name if is_module else str(node.module), node.lineno))
    return tuple(found)


def first_sentence(path: Path) -> str:
    """The first line of a module's docstring, or of a folder's."""
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").split("\n")[0]


def graph() -> tuple[dict[str, set[str]], Counter[str]]:
    """The floors that each floor imports from, and how many modules it has."""
    below: dict[str, set[str]] = {name: set() for name in FLOORS}
    sizes: Counter[str] = Counter()
    for path in sorted(PACKAGE.rglob("*.py")):
        floor = floor_of(path)
        if floor in ("__init__", "__main__", "engine"):
            continue
        if floor not in FLOORS:
            raise SystemExit(f"{floor} has no place in FLOORS")
        sizes[floor] += 1
        below[floor] |= ({floor_of_module(module) for module, _ in imports(path)} & set(FLOORS)) - {floor}
    return below, sizes


def tables() -> dict[str, str]:
    """The tables of the page: the floors from the top down, and every folder of the engine in reading order."""
    _, sizes = graph()
    sizes["engine"] = sum(count for name, count in sizes.items() if name.startswith("engine."))
    tops = list(dict.fromkeys(name.split(".")[0] for name in FLOORS))
    floors = [f"| `{name}` | {first_sentence(PACKAGE / name)} | {sizes[name]} |" for name in reversed(tops)]
    folders = []
    for name in FLOORS:
        folder = PACKAGE.joinpath(*name.split("."))
        if not name.startswith("engine.") or not folder.is_dir():
            continue
        inner = sorted(path.parent for path in folder.rglob("__init__.py"))
        folders += [
            f"| `{path.relative_to(PACKAGE).as_posix()}/` | {first_sentence(path)} | {len(list(path.glob('*.py')))} |"
            for path in inner
        ]
    head = "| floor | what it is for | files |\n| --- | --- | --- |\n"
    return {
        "floors": head + "\n".join(floors),
        "engine": head.replace("floor", "folder") + "\n".join(folders),
    }


def page() -> str:
    """Return the page with its tables generated again."""
    text = PAGE.read_text(encoding="utf-8")
    for name, table in tables().items():
        text, count = re.subn(
            rf"(<!-- {name}: [^>]*-->\n)(?:(?!<!--).)*(<!-- end -->)",
            lambda found, table=table: f"{found[1]}\n{table}\n\n{found[2]}",
            text,
            flags=re.DOTALL,
        )
        if count != 1:
            raise SystemExit(f"{PAGE} has no place for the table {name}")
    return text


def reached(below: dict[str, set[str]], name: str) -> set[str]:
    """Everything under a floor."""
    return below[name].union(*(reached(below, other) for other in below[name]))


def needed(below: dict[str, set[str]]) -> list[tuple[str, str]]:
    """The arrows that no chain of others implies."""
    everything = {name: reached(below, name) for name in below}
    return [
        (name, other)
        for name in below
        for other in sorted(below[name])
        if not any(other in everything[third] for third in below[name] - {other})
    ]


def drawn_from() -> str:
    """What the picture shows, in short; the picture carries it, so that a test sees when it is old."""
    below, sizes = graph()
    shown = [
        needed(below),
        sorted(sizes.items()),
        [first_sentence(PACKAGE.joinpath(*n.split("."))) for n in FLOORS],
    ]
    return "floors " + hashlib.sha256(repr(shown).encode()).hexdigest()[:16]


def purpose(floor: str) -> list[str]:
    """The first sentence of a floor without its first two words, in lines that fit the picture."""
    sentence = first_sentence(PACKAGE.joinpath(*floor.split("."))).replace("`", "")
    return textwrap.wrap(re.sub(r"^This (package|module) ", "", sentence), 72)


def draw() -> Path:
    """Draw the picture; returns where it went."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

    below, sizes = graph()
    drawn = [name for name in FLOORS if name != "engine.stepping"]  # an earlier path, deprecated
    row = {name: float(i) for i, name in enumerate(drawn)}
    figure, axes = plt.subplots(
        figsize=(8.8, 12), layout="constrained"
    )  # inches: as wide as the text of a page
    for above, under in needed({name: below[name] for name in drawn}):
        gap = row[above] - row[under]
        if gap == 1.0:
            ends, bend = [(WIDTH / 2, row[above] - 0.36), (WIDTH / 2, row[under] + 0.36)], "arc3"
        else:
            ends, bend = [(0.0, row[above]), (0.0, row[under])], f"arc3,rad={0.25 + 0.3 / gap}"
        arrow = FancyArrowPatch(*ends, arrowstyle="-|>", mutation_scale=10, connectionstyle=bend, color=BLUE)
        axes.add_patch(arrow)
    for name in drawn:
        is_engine = name.startswith("engine.")
        corner = (0.05, row[name] - 0.31)
        axes.add_patch(
            FancyBboxPatch(
                corner,
                WIDTH - 0.1,
                0.62,
                boxstyle="round,pad=0.05",
                facecolor="#FDF0D5" if is_engine else BOX,
                edgecolor="black",
            )
        )
        modules = "1 file" if sizes[name] == 1 else f"{sizes[name]} files"
        axes.text(0.15, row[name], name, va="center", fontsize=8.5, weight="bold")
        axes.text(WIDTH - 0.15, row[name], modules, va="center", ha="right", fontsize=8)
        axes.text(WIDTH + 0.15, row[name], "\n".join(purpose(name)), va="center", fontsize=8, linespacing=1.0)
    axes.set_xlim(-2.6, 10.4)
    axes.set_ylim(-0.6, len(drawn) - 0.4)
    axes.axis("off")
    path = ROOT / "docs" / "images" / "floors.png"
    figure.savefig(path, dpi=100, metadata={"Description": drawn_from()})
    plt.close(figure)
    return path


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE, draw(), sep="\n")
