"""Random faults of units in the packaged models: what is changed, where, and whether it alters a unit.

The units here are written down by hand, apart from those of the package, so that they judge it independently.
"""

from __future__ import annotations

import ast
import random
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import cycle
from pathlib import Path
from typing import Any

MODELS = Path(__file__).parents[3] / "models"

Size = tuple[tuple[Fraction, ...], float]
"""Powers of kg, m, s, A and K, and the scale."""


def size(kg: int = 0, m: int = 0, s: int = 0, A: int = 0, K: int = 0, scale: float = 1.0) -> Size:
    """A unit by its powers."""
    return tuple(map(Fraction, (kg, m, s, A, K))), scale


UNITS: dict[str, Size] = {
    "1": size(), "rad": size(), "m": size(m=1), "kg": size(kg=1), "s": size(s=1), "h": size(s=1, scale=3600),
    "A": size(A=1), "K": size(K=1), "degC": size(K=1), "m/s": size(m=1, s=-1), "m/s^2": size(m=1, s=-2),
    "rad/s": size(s=-1), "1/s": size(s=-1), "N": size(1, 1, -2), "N/m": size(1, 0, -2), "N s/m": size(1, 0, -1),
    "N m": size(1, 2, -2), "N m/rad": size(1, 2, -2), "N/(m s)": size(1, 0, -3), "N/kg": size(m=1, s=-2),
    "J/kg": size(m=2, s=-2), "m s": size(m=1, s=1), "kg m^2": size(1, 2), "V": size(1, 2, -3, -1),
    "Ohm": size(1, 2, -3, -2), "H": size(1, 2, -2, -2), "F": size(-1, -2, 4, 2),
    # the ones that a fault puts in place of another: the same dimension in another size
    "mm": size(m=1, scale=1e-3), "km": size(m=1, scale=1e3), "g": size(kg=1, scale=1e-3),
    "t": size(kg=1, scale=1e3), "ms": size(s=1, scale=1e-3), "min": size(s=1, scale=60),
    "kN": size(1, 1, -2, scale=1e3), "N/mm": size(1, 0, -2, scale=1e3), "kN/m": size(1, 0, -2, scale=1e3),
    "N s/mm": size(1, 0, -1, scale=1e3), "kN m": size(1, 2, -2, scale=1e3), "N mm": size(1, 2, -2, scale=1e-3),
    "mm/s": size(m=1, s=-1, scale=1e-3), "km/h": size(m=1, s=-1, scale=1 / 3.6),
    "mm/s^2": size(m=1, s=-2, scale=1e-3), "rpm": size(s=-1, scale=0.10471975511965977),
    "deg/s": size(s=-1, scale=0.017453292519943295), "deg": size(scale=0.017453292519943295),
    "mV": size(1, 2, -3, -1, scale=1e-3), "kV": size(1, 2, -3, -1, scale=1e3), "mA": size(A=1, scale=1e-3),
    "kohm": size(1, 2, -3, -2, scale=1e3), "mH": size(1, 2, -2, -2, scale=1e-3),
    "uF": size(-1, -2, 4, 2, scale=1e-6), "kHz": size(s=-1, scale=6283.185307179586), "1/ms": size(s=-1, scale=1e3),
    "mK": size(K=1, scale=1e-3), "g m^2": size(1, 2, scale=1e-3), "%": size(scale=1e-2), "Pa": size(1, -1, -2),
    "W": size(1, 2, -3), "J": size(1, 2, -2),
}  # fmt: skip
# Names whose units no file declares.
N, RATE, NUMBER = UNITS["N"], UNITS["m/s"], UNITS["1"]
DERIVED: dict[str, dict[str, Size]] = {
    "base-isolation": {"S": N, "acc_b": UNITS["m/s^2"], "f": N},
    "buck-converter": {"control": UNITS["V"], "supply": UNITS["V"]},
    "clutches": {"c1": UNITS["N m"], "c2": UNITS["N m"], "c3": UNITS["N m"]},
    "drill-string": {"torque": UNITS["N m"]},
    "elastic-gap": {"spring": N},
    "pid-servo": {"u": N, "f": N},
    "relay-control": {"u": NUMBER},
    "rocking-block": {"lean": NUMBER},
    "sampled-servo": {"error": UNITS["m"], "f": N},
    "thermostat": {"heat": UNITS["K"], "t": UNITS["h"]},
    "thrown-block": {"f": N, "p": N},
    "twisting-controller": {"u": NUMBER, "w": NUMBER},
    "vibrating-plate": {"plate": RATE, "f": UNITS["N/kg"]},
    "vibrating-table": {"table": UNITS["m"], "p": N},
    "water-tanks": {"rest": UNITS["m"], "to1": RATE, "to2": RATE, "out1": RATE, "out2": RATE},
    "blade-damper": {"f": N}, "dfcs": {"f": N}, "dfcs-stribeck": {"f": N}, "lugre-presliding": {"f": N},
    "square-wave": {"f": N}, "static-kinetic": {"f": N}, "valve-stiction": {"f": N},
}  # fmt: skip
# Tables with other texts than expressions of the model, and those whose names are those of a law.
SKIPPED = ("drawing", "laws", "name", "title", "source", "look", "description")
TEXTS = (
    "unit",
    "title",
    "kind",
    "shape",
    "file",
    "to",
    "interpolation",
    "name",
    "direction",
    "action",
    "limit",
)
# Places where an expression that is one product may have any unit, so that no unit is altered that anything needs.
FREE = ("surfaces", "monitors", "guards")


@dataclass(frozen=True)
class Written:
    """An expression as it is written in a file: where in the tables, and on which line."""

    keys: tuple[str, ...]
    text: str
    line: int


@dataclass(frozen=True)
class Fault:
    """A model with one fault."""

    model: str
    kind: str
    what: str
    text: str
    lines: frozenset[int]  # the lines on which a warning is right


class Source:
    """The text of a packaged model, its expressions, and the units of its names."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.text = (MODELS / f"{name}.toml").read_text(encoding="utf-8")
        data = tomllib.loads(self.text)
        self.lines = self.text.split("\n")
        self.units = {"t": UNITS["s"], **_declared(data), **DERIVED.get(name, {})}
        self.expressions = [*self._expressions(data, ())]

    def _expressions(self, value: Any, keys: tuple[str, ...]) -> Iterator[Written]:
        if isinstance(value, dict):
            for key, item in value.items():
                if not (not keys and key in SKIPPED) and key not in TEXTS:
                    yield from self._expressions(item, (*keys, key))
        elif isinstance(value, list):
            for item in value:
                yield from self._expressions(item, keys)
        elif isinstance(value, str) and re.search("[A-Za-z]", value):
            found = [k for k, line in enumerate(self.lines) if f'"{value}"' in line and _has_key(line, keys)]
            if len(found) == 1:  # else the line is not certain
                yield Written(keys, value, found[0])

    def readers(self, name: str) -> frozenset[int]:
        """The lines of expressions that read a name, and those of the law of a contact that reads it."""
        lines = set()
        for one in self.expressions:
            if name in names_in(one.text):
                lines.add(one.line + 1)
                if one.keys[0] == "contacts":
                    lines |= {k + 1 for k, line in enumerate(self.lines) if line.startswith("law =")}
        return frozenset(lines)


def _declared(data: dict[str, Any]) -> dict[str, Size]:
    tables = (data.get(kind, {}) for kind in ("parameters", "states", "discrete", "inputs"))
    entries = [(name, entry) for table in tables for name, entry in table.items() if isinstance(entry, dict)]
    return {name: UNITS[entry["unit"]] for name, entry in entries if "unit" in entry}


def _has_key(line: str, keys: tuple[str, ...]) -> bool:
    return bool(re.search(rf'\b{re.escape(keys[-1])}\b"? ?=', line))


def names_in(text: str) -> set[str]:
    """The names in an expression."""
    return {
        node.id
        for node in ast.walk(ast.parse(" ".join(text.split()), mode="eval"))
        if isinstance(node, ast.Name)
    }


def _other_unit(source: Source, rng: random.Random) -> Fault | None:
    """Change the unit of one declaration in its dimension, or in its prefix."""
    places = [
        (k, found) for k, line in enumerate(source.lines) for found in re.finditer(r'unit = "([^"]*)"', line)
    ]
    line, found = rng.choice(places)
    old = found[1]
    alike = rng.random() < 0.5
    others = [u for u, one in UNITS.items() if one != UNITS[old] and (one[0] == UNITS[old][0]) == alike]
    if not others:
        return None
    new = rng.choice(others)
    changed = source.lines[line][: found.start(1)] + new + source.lines[line][found.end(1) :]
    name = _name_of(source, line)
    lines = source.readers(name) | {line + 1}
    if lines == {line + 1} and not names_in_line(source, line):
        return None  # nothing reads it
    return _with(source, line, changed, "unit", f"{name}: {old} -> {new}", lines)


def names_in_line(source: Source, line: int) -> bool:
    """Whether the line of a declaration has an expression of names."""
    return any(one.line == line for one in source.expressions)


def _name_of(source: Source, line: int) -> str:
    """The name that a line declares, or that of the table in which it is."""
    first = source.lines[line].split("=")[0].strip()
    if first != "unit":
        return first
    heads = [text for text in source.lines[:line] if text.startswith("[")]
    return heads[-1].split("]")[0].rpartition(".")[2].strip("[")


def _dropped_factor(source: Source, rng: random.Random) -> Fault | None:
    """Leave out one factor of a product."""
    one = rng.choice(source.expressions)
    tree = _parsed(one.text)
    products = [
        n for n in ast.walk(tree) if isinstance(n, ast.BinOp) and isinstance(n.op, ast.Mult | ast.Div)
    ]
    if not products:
        return None
    product = rng.choice(products)
    drop, keep = (product.left, product.right) if rng.random() < 0.5 else (product.right, product.left)
    if drop is product.left and isinstance(product.op, ast.Div):
        return None  # 1/b in place of a/b is no dropped factor
    unit = size_of(drop, source.units)
    if unit is None or unit == NUMBER or _is_free(one, tree, product):
        return None
    if not names_in(ast.unparse(keep)) - {"pi"}:
        return None  # a number alone has the unit that its place needs
    return _rewritten(source, one, tree, product, keep, "factor", f"without {ast.unparse(drop)}")


def _other_name(source: Source, rng: random.Random) -> Fault | None:
    """Exchange a name for another one of the model."""
    one = rng.choice(source.expressions)
    tree = _parsed(one.text)
    names = [n for n in ast.walk(tree) if isinstance(n, ast.Name) and n.id in source.units]
    if not names:
        return None
    old = rng.choice(names)
    parameters = tomllib.loads(source.text)["parameters"]
    is_early = one.keys[0] in ("parameters", "duration", "clocks") or one.keys[-1] in (
        "start",
        "period",
        "amplitude",
    )
    own = {*one.keys}
    others = [n for n in source.units if n not in own and (n in parameters or not is_early) and n != "t"]
    new = rng.choice(others)
    if source.units[new] == source.units[old.id] or _is_free(one, tree, old):
        return None
    part = ast.Name(new, ast.Load())
    return _rewritten(source, one, tree, old, part, "name", f"{old.id} -> {new}")


def _is_free(one: Written, tree: ast.expr, node: ast.expr) -> bool:
    """Whether a part is in an expression of one product at a place that may have any unit."""
    if not any(key in FREE for key in one.keys) or one.keys[-1] in ("when",) or "reset" in one.keys:
        return False
    while tree is not node:
        inner = [part for part in ast.iter_child_nodes(tree) if isinstance(part, ast.expr)]
        if not isinstance(tree, ast.UnaryOp) and not (
            isinstance(tree, ast.BinOp) and isinstance(tree.op, ast.Mult | ast.Div | ast.Pow)
        ):
            return False
        tree = next(part for part in inner if any(deep is node for deep in ast.walk(part)))
    return True


def _parsed(text: str) -> ast.expr:
    return ast.parse(" ".join(text.split()), mode="eval").body


def _rewritten(
    source: Source, one: Written, tree: ast.expr, old: ast.expr, new: ast.expr, kind: str, what: str
) -> Fault:
    class Swap(ast.NodeTransformer):
        def visit(self, node: ast.AST) -> ast.AST:
            return new if node is old else self.generic_visit(node)

    text = ast.unparse(Swap().visit(tree))
    changed = source.lines[one.line].replace(f'"{one.text}"', f'"{text}"', 1)
    what = f"{'.'.join(one.keys)} = {one.text}: {what}"
    return _with(source, one.line, changed, kind, what, frozenset({one.line + 1}))


def _with(source: Source, line: int, changed: str, kind: str, what: str, lines: frozenset[int]) -> Fault:
    text = "\n".join([*source.lines[:line], changed, *source.lines[line + 1 :]])
    return Fault(source.name, kind, what, text, lines)


def size_of(node: ast.expr, units: dict[str, Size]) -> Size | None:
    """The unit of a part of an expression of the packaged models, in which all terms of a sum have one unit."""
    match node:
        case ast.Constant():
            return NUMBER
        case ast.Name(id="pi"):
            return NUMBER
        case ast.Name(id=name):
            return units.get(name)
        case ast.UnaryOp(operand=operand):
            return size_of(operand, units)
        case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int() as power)):
            base = size_of(left, units)
            return None if base is None else (tuple(p * power for p in base[0]), base[1] ** power)
        case ast.BinOp(left=left, op=op, right=right):
            first, second = size_of(left, units), size_of(right, units)
            if first is None or second is None:
                return None
            if isinstance(op, ast.Mult):
                return tuple(p + q for p, q in zip(first[0], second[0], strict=True)), first[1] * second[1]
            if isinstance(op, ast.Div):
                return tuple(p - q for p, q in zip(first[0], second[0], strict=True)), first[1] / second[1]
            return second if first == NUMBER else first
        case ast.Call(func=ast.Name(id="sqrt"), args=[argument]):
            inner = size_of(argument, units)
            return None if inner is None else (tuple(p / 2 for p in inner[0]), inner[1] ** 0.5)
        case ast.Call(func=ast.Name(id="abs" | "min" | "max"), args=[argument, *_]):
            return size_of(argument, units)
        case ast.Call():
            return NUMBER
    return None


NAMES = tuple(
    path.stem
    for path in sorted(MODELS.glob("*.toml"))
    if "unit = " in path.read_text(encoding="utf-8").split("[drawing]")[0]
)


def faults(seed: int) -> Iterator[Fault]:
    """Faults without end, the kinds in turn, each in a random model that has units."""
    rng = random.Random(seed)
    sources = {name: Source(name) for name in NAMES}
    for kind in cycle((_other_unit, _dropped_factor, _other_name)):
        fault = None
        while fault is None:
            fault = kind(sources[rng.choice(NAMES)], rng)
        yield fault
