"""Random files with parts, most of them with something wrong, and the judge of what becomes of one."""

from __future__ import annotations

import builtins
import random
from pathlib import Path
from unittest.mock import patch

import hybridsim as hs
from fuzz.nasty import CANARY, NUMBERS, UNICODE, nasty_expression

NAMES = (
    "a",
    "b",
    "block",
    "left.x",
    "i",
    "x",
    "u",
    "k",
    "sin",
    "a b",
    "",
    "__x",
    "é",
    "a.b",
    "1",
    "t",
    "if",
    "block1",
)
FILES = (
    "spring.toml",
    "inner.toml",
    "whole.toml",
    "belt",
    "dfcs",
    "none.toml",
    "../whole.toml",
    "/etc/passwd",
    "",
    ".",
)
INDICES = (
    "i-1",
    "i+1",
    "i",
    "1",
    "0",
    "-1",
    "i/2",
    "i**9",
    "x",
    "i-1 if i > 1 else 3",
    "1/(i-1)",
    "b[i].x",
    "",
    ":",
    "'a'",
)
KEYS = (
    ("connect", "u", 1.0),
    ("parameters", "k", 0.9),
    ("start", "x", 0.9),
    ("start", "left.x", 0.2),
    ("first", "u", 0.2),
)
RIGHT = (
    "1", "a.x + 2", "block[2].pull", "block1.pull*t", "sin(t)", "2 if t > a.x else block3.x", "z - a.u",
    "block[1 + 1].x",
)  # fmt: skip
SPRING = """
[inputs]
u = { kind = "connected" }
[states]
x = { start = 0, der = "k*(u - x)" }
[parameters]
k = 2
[outputs]
pull = "k*(u - x)"
"""
INNER = "[use.left]\nmodel = 'spring.toml'\nconnect.u = 'y'\n[states]\ny = { start = 1, der = 'left.pull' }\n"


def expression(pick: random.Random) -> str:
    """One expression about parts, right or wrong."""
    name = pick.choice(NAMES)
    forms = (
        f"{name}.x", f"{name}[{pick.choice(INDICES)}].x", f"block[{pick.choice(INDICES)}].pull - block[i].x",
        f"block[{pick.choice(INDICES)}].x if i > 1 else {pick.choice(NAMES)}", "2*i", name, pick.choice(NUMBERS),
        nasty_expression(pick, list(NAMES)), f"a{pick.choice(UNICODE)}.x", "a.__class__.__mro__", "().x",
        "a[1][2].x", "a[1]", "a.x.y(1)",
        "(a if i > 2 else b).x", "[1, 2]", "block[i" * pick.randrange(1, 60) + "].x" * pick.randrange(1, 60),
    )  # fmt: skip
    return str(pick.choice(forms))


def value(pick: random.Random, rough: float) -> str:
    """One value of a key, as TOML; with a probability it is wrong."""
    if pick.random() > rough:
        return "'" + pick.choice(RIGHT) + "'"
    quoted = "'" + expression(pick).replace("'", "").replace("\n", " ") + "'"
    listed = "[" + ", ".join(quoted for _ in range(pick.randrange(5))) + "]"
    table = "{ " + pick.choice(("x", "left.x", '"a b"', "u")) + " = " + quoted + " }"
    return pick.choice(
        (quoted, quoted, quoted, "1", "-2.5", "true", listed, table, "1979-05-27", "nan", "1e999")
    )


def use(pick: random.Random, name: str, rough: float) -> str:
    """One table of a part."""
    if pick.random() < rough:
        name = pick.choice(("a", "block", "block1", "sin", '"a b"'))
    right, wrong = pick.random() > rough, pick.choice(("0", "-1", "1.5", "9999999999", "true", "1000"))
    lines = [f"model = '{'spring.toml' if right else pick.choice(FILES)}'"]
    if name == "block" or pick.random() < rough:
        lines.append(f"repeat = {'3' if right else wrong}")
    for key, quantity, share in KEYS:
        if pick.random() < share * (1 if key == "connect" else rough):
            lines.append(f"{key}.{quantity} = {value(pick, rough)}")
    if pick.random() < rough / 4:
        lines.pop(pick.randrange(len(lines)))
    return "\n".join([f"[use.{name}]", *lines])


def files(pick: random.Random) -> dict[str, str]:
    """The files of one model with parts; the share of wrong things in them differs from model to model."""
    rough = pick.choice((0.02, 0.1, 0.3))
    spring = SPRING
    if pick.random() < rough:
        spring = SPRING.replace("k*(u - x)", expression(pick).replace('"', ""))
    inner = INNER if pick.random() > rough else use(pick, "left", rough)
    names = pick.sample(("a", "b", "block", "c"), pick.choice((1, 2, 3, 4)))
    whole = "\n".join(use(pick, name, rough) for name in dict.fromkeys((*names, "block", "a")))
    if pick.random() < 0.5:
        whole += "\n[use.axle]\nmodel = 'inner.toml'\n"
    whole += f"\n[states]\nz = {{ start = 0, der = {value(pick, rough)} }}\n"
    return {"spring.toml": spring, "inner.toml": inner, "whole.toml": whole}


def fault_of(pick: random.Random, folder: Path) -> str:
    """What is wrong with the treatment of one random model: an empty text if it loads again, or is refused rightly.

    A refusal has a message and a remedy, and every fault in it has a file. Nothing may run as code.
    """
    texts = files(pick)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    ran: list[str] = []
    with patch.object(builtins, CANARY, lambda: ran.append("code"), create=True):
        try:
            model = hs.load(folder / "whole.toml")
            if hs.Model.from_toml(model.to_toml()) != model:
                return "the flat text is another model"
        except hs.ModelError as refusal:
            for single in refusal.errors:
                if not (single.message and single.place is not None and single.place.file):
                    return f"no place: {single}"
        except Exception as crash:
            return f"{type(crash).__name__}: {crash}"
    return "a text was run as code" if ran else ""
