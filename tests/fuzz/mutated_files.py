"""Model files with something wrong with them: lines, words, numbers, names, types, expressions and paths changed."""

from __future__ import annotations

import random
import re
from collections.abc import Callable

from fuzz.nasty import NUMBERS, PLACES, TYPES, UNICODE, misspelt, nasty_expression

NUMBER = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:e[+-]?\d+)?(?![\w.])")
TEXT = re.compile(r'"[^"\n]*"')
NAME = re.compile(r"[A-Za-z_]\w*")


def mutated(pick: random.Random, texts: list[str]) -> bytes:
    """One of the texts after one to four changes, as bytes, since a few of them are no text any more."""
    text = pick.choice(texts)
    other = pick.choice(texts)
    for _ in range(pick.choice((1, 1, 1, 2, 2, 3, 4))):
        text = pick.choice(CHANGES)(pick, text, other)
    raw = text.encode("utf-8", errors="surrogatepass")
    if pick.random() < 0.02 and raw:
        k = pick.randrange(len(raw))
        raw = raw[:k] + bytes(pick.randrange(256) for _ in range(3)) + raw[k:]
    return raw


def names_in(text: str) -> list[str]:
    """Keys of the file: parameters, states, contacts and the like."""
    return sorted({m.group(1) for m in re.finditer(r"^\s*([A-Za-z_]\w*)\s*=", text, re.MULTILINE)})


def at(pick: random.Random, text: str, pattern: re.Pattern[str], new: Callable[[str], str]) -> str:
    """One place where a pattern matches, changed."""
    found = list(pattern.finditer(text))
    if not found:
        return text
    place = pick.choice(found)
    return text[: place.start()] + new(place.group()) + text[place.end() :]


def line_deleted(pick: random.Random, text: str, other: str) -> str:
    lines = text.split("\n")
    k = pick.randrange(len(lines))
    del lines[k : k + pick.choice((1, 1, 2, 5))]
    return "\n".join(lines)


def line_repeated(pick: random.Random, text: str, other: str) -> str:
    lines = text.split("\n")
    lines.insert(pick.randrange(len(lines) + 1), pick.choice(lines))
    return "\n".join(lines)


def lines_swapped(pick: random.Random, text: str, other: str) -> str:
    lines = text.split("\n")
    j, k = pick.randrange(len(lines)), pick.randrange(len(lines))
    lines[j], lines[k] = lines[k], lines[j]
    return "\n".join(lines)


def line_of_another(pick: random.Random, text: str, other: str) -> str:
    lines = text.split("\n")
    lines.insert(pick.randrange(len(lines) + 1), pick.choice(other.split("\n")))
    return "\n".join(lines)


def part_of_another(pick: random.Random, text: str, other: str) -> str:
    """A whole table of another file, at the end or in place of the one of the same name."""
    parts = re.split(r"^(?=\[)", other, flags=re.MULTILINE)
    return text + "\n" + pick.choice(parts)


def cut(pick: random.Random, text: str, other: str) -> str:
    k = pick.randrange(len(text) + 1)
    return text[:k] if pick.random() < 0.7 else text[k:]


def character(pick: random.Random, text: str, other: str) -> str:
    k = pick.randrange(len(text) + 1)
    return text[:k] + pick.choice((*"[]{}\"'=.,#\\\n\t", *UNICODE)) + text[k + pick.choice((0, 1)) :]


def number(pick: random.Random, text: str, other: str) -> str:
    return at(pick, text, NUMBER, lambda old: pick.choice(NUMBERS))


def scaled(pick: random.Random, text: str, other: str) -> str:
    factors = (-1.0, 0.0, 1e-9, 1e-3, 0.5, 2.0, 1e3, 1e9, 1e150)
    return at(pick, text, NUMBER, lambda old: repr(float(old) * pick.choice(factors)))


def kind_of_value(pick: random.Random, text: str, other: str) -> str:
    value = re.compile(NUMBER.pattern + "|" + TEXT.pattern)
    return at(
        pick, text, value, lambda old: pick.choice((*TYPES, f'"{old}"', f"[{old}]", f"{{ value = {old} }}"))
    )


def quoted(text: str) -> str:
    """A TOML string that holds this text."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'


def expression(pick: random.Random, text: str, other: str) -> str:
    return at(pick, text, TEXT, lambda old: quoted(nasty_expression(pick, names_in(text))))


def inside_expression(pick: random.Random, text: str, other: str) -> str:
    """A name or number in an expression by something nasty, the rest kept."""
    names = names_in(text)

    def changed(old: str) -> str:
        inner = old[1:-1]
        word = re.compile(NUMBER.pattern + "|" + NAME.pattern)
        return quoted(at(pick, inner, word, lambda _: f"({nasty_expression(pick, names)})"))

    return at(pick, text, TEXT, changed)


def name_changed(pick: random.Random, text: str, other: str) -> str:
    return at(pick, text, NAME, lambda old: misspelt(pick, old))


def name_by_another(pick: random.Random, text: str, other: str) -> str:
    return at(pick, text, NAME, lambda old: pick.choice(NAME.findall(other) or ["x"]))


def name_everywhere(pick: random.Random, text: str, other: str) -> str:
    """A name by another in all places, so that the model stays whole and clashes may arise."""
    names = names_in(text)
    if not names:
        return text
    reserved = (
        "t",
        "pi",
        "e",
        "E",
        "I",
        "S",
        "N",
        "sin",
        "x",
        "lambda",
        "None",
        "nan",
        "__x",
        "_",
        "class",
        "numba",
    )
    new = pick.choice((*names, *reserved, *UNICODE))
    return re.sub(rf"(?<!\w){re.escape(pick.choice(names))}(?!\w)", lambda _: new, text)


def operator(pick: random.Random, text: str, other: str) -> str:
    signs = re.compile(r"(?<=[\w )])(\*\*|[-+*/])(?=[\w (])")
    return at(pick, text, signs, lambda old: pick.choice(("+", "-", "*", "/", "**", "<", ",", "")))


def path(pick: random.Random, text: str, other: str) -> str:
    """A table of an input somewhere else."""
    place = quoted(pick.choice(PLACES))
    if re.search(r"^file\s*=", text, re.MULTILINE):
        return re.sub(r"^file\s*=.*$", lambda _: f"file = {place}", text, flags=re.MULTILINE)
    return text + f'\n[inputs.{pick.choice(("u", "x", "base"))}]\nkind = "table"\nfile = {place}\n'


def nested(pick: random.Random, text: str, other: str) -> str:
    n = pick.choice((10, 200, 3000))
    opening, closing = pick.choice((("[", "]"), ("{ a = ", " }"), ("[{ a = ", " }]")))
    return text + f"\nfuzz = {opening * n}1{closing * n}\n"


def ends_of_lines(pick: random.Random, text: str, other: str) -> str:
    return text.replace("\n", pick.choice(("\r\n", "\r", "\n\n", "\u2028")))


CHANGES = (
    line_deleted, line_repeated, lines_swapped, line_of_another, part_of_another, cut, character, number, number,
    scaled, scaled, scaled, kind_of_value, expression, expression, inside_expression, inside_expression, name_changed,
    name_by_another, name_everywhere, operator, operator, path, nested, ends_of_lines,
)  # fmt: skip
