"""Random files with parts, most of them with something wrong, and the judge of what becomes of one."""

from __future__ import annotations

import random
from pathlib import Path

import hybridsim as hs
from fuzz.judge import Finding, observed
from fuzz.nasty import NUMBERS, UNICODE, nasty_expression

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
CONTACTS = ("rub", "rub", "rub", "left.rub", "x", "rub.x", "a.b", "''", "_z")
LAWS = (
    "'coulomb'", "{ name = 'coulomb', mu = 0.2 }", "{ name = 'pad', c = 'k0' }", "{ force = 'c*v', c = 2 }",
    "{ name = 'dahl', sigma = 10, mu = 1 }", "{ name = 'coulomb', mu = 'a.k/9' }",
)  # fmt: skip
RIGHT = (
    "1", "a.x + 2", "block[2].pull", "block1.pull*t", "sin(t)", "2 if t > a.x else block3.x", "z - a.u",
    "block[1 + 1].x",
)  # fmt: skip
SPRING = """
[inputs]
u = { kind = "connected" }
[states]
x = { start = 0, der = "k*(u - x)" }
v = { start = 1, der = "-rub" }
[parameters]
k = 2
[contacts.rub]
velocity = "v"
normal = 1
law = { name = "coulomb", mu = 0.5 }
[outputs]
pull = "k*(u - x)"
"""
OWN_LAW = "[laws.pad]\nparameters = ['c']\nforce = 'c*N*v'\n[parameters]\nk0 = 2\n"
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


def law(pick: random.Random, rough: float) -> str:
    """One law of a contact of a part, as TOML; with a probability it is wrong."""
    if pick.random() > rough:
        return pick.choice(LAWS)
    quoted = "'" + expression(pick).replace("'", "").replace("\n", " ") + "'"
    key = pick.choice(
        ("mu", "c", "slip", "stick", "force", "states", "tables", "name", "file", "x.y", "v", "N")
    )
    wrong = pick.choice(
        (
            f"{{ name = 'coulomb', {key} = {quoted} }}", f"{{ {key} = {quoted} }}", f"{{ file = {quoted} }}", quoted,
            f"{{ force = {quoted}, c = {quoted} }}", f"{{ slip = {quoted}, stick = {quoted}, mu = 1 }}",
            "3", "true", "[]", "nan", "1979-05-27", "{}", "[[]]", "{ name = { name = 'coulomb' } }",
        )
    )  # fmt: skip
    listed = f"[{', '.join((wrong, *pick.choices(LAWS, k=pick.randrange(4))))}]"
    return pick.choice((wrong, wrong, listed))


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
    if pick.random() < 0.3:
        contact = "rub" if pick.random() > rough else pick.choice(CONTACTS)
        lines.append(f"laws.{contact} = {law(pick, rough)}")
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
    whole += f"\n[states]\nz = {{ start = 0, der = {value(pick, rough)} }}\n{OWN_LAW}"
    return {"spring.toml": spring, "inner.toml": inner, "whole.toml": whole}


def parts_case(seed: int, number: int, folder: Path) -> Finding:
    """A random model with parts: it loads and its flat text is the same model, or every fault has a place.

    Nothing may run as code.
    """
    for name, text in files(random.Random(f"parts {seed} {number}")).items():
        (folder / name).write_text(text, encoding="utf-8")
    with observed(folder, lambda place: False) as finding:
        try:
            model = hs.load(folder / "whole.toml")
        except hs.ModelError as refusal:
            finding.end = "refused"
            for single in refusal.errors:
                if not (single.message and single.remedy and single.place is not None and single.place.file):
                    finding.faults.append(f"no message, remedy or place: {single!r}")
            return finding
        if hs.Model.from_toml(model.to_toml()) != model:
            finding.faults.append("the flat text is another model")
        finding.end = "loaded"
    return finding
