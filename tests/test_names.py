"""Names in the package are terms of the field: no retired word, and no new registry that is keyed by strings.

`docs/glossary.md` says which words are retired and what stands in their place. A name is split at `_` and at capitals;
a retired word is found as a whole name and as one or more of its parts.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import hybridsim

PACKAGE = Path(hybridsim.__file__).parent
GLOSSARY = Path(__file__).parents[1] / "docs" / "glossary.md"
SOURCES = sorted(PACKAGE.rglob("*.py"))

# fmt: off
RETIRED = (
    "allowance", "anew", "at_once", "at_zero", "bench", "blow", "call_apart", "chain", "crossings", "decide",
    "desk", "door", "driving", "eight", "faint", "few", "fleet", "gathering", "gauge", "given", "goes_on", "heard",
    "holds_so_far", "hygiene", "jets", "judge", "keep", "kept", "laid", "landing", "lanes", "leads_nowhere", "lean",
    "leap", "leaper", "leaps", "leapt", "lender", "lent", "meeting", "merged", "needed", "panels", "pieces",
    "places", "plan", "plant", "race", "ready", "recent", "resting", "rests_for_ever", "room", "rungs", "runs",
    "said", "sails", "settle", "sheet", "shelf", "ship", "sightings", "stand", "standing", "stretch", "strips",
    "ties", "told", "twins", "wanted", "watched", "words",
)
# fmt: on

# Names with a retired word in another meaning, or that users have in their programs: each with its reason.
ALLOWED = {
    ("mechanics", "chain_on_belt"): "a public name",
    ("cli", "keep"): "the option --keep",
    ("simulate", "keep"): "an argument of hs.simulate",
    ("mechanics", "keep"): "the same",
    ("simulator", "keep"): "an argument of Simulator.run",
    ("analysis", "keep"): "the same argument, passed on",
    ("studies", "keep"): "the same argument, passed on",
    ("cli", "rungs"): "the option --rungs",
    ("analysis", "rungs"): "an argument of hs.advise",
    ("analysis", "settle"): "an argument of hs.steady_state and hs.bifurcation",
    ("studies", "break_long_words"): "an argument of textwrap.fill",
    ("preparation", "chain"): "itertools.chain",
    ("model", "pieces"): "cubics of a table: a function is called piecewise",
}
# Folders where a retired word has its usual meaning.
USUAL = {
    ("analysis", "runs"): "runs of a model",
    ("ensemble", "runs"): "runs of a model",
    ("engine", "runs"): "runs of a model",
    ("engine", "crossings"): "crossings of zero, as roots of odd order are called",
    ("engine", "lanes"): "lanes of a SIMD register",
    ("engine", "needed"): "parts of numba without which nothing is compiled",
    ("ensemble", "lanes"): "lanes of a SIMD register",
    ("studies", "runs"): "runs of a model",
    ("preparation", "runs"): "runs that are stored with a system",
    ("plot", "panels"): "parts of a figure",
    ("studies", "panels"): "parts of a figure",
}


def retired_in(name: str) -> list[str]:
    """Return the retired words in a name."""
    plain = "_" + re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower().strip("_") + "_"
    return [word for word in RETIRED if f"_{word}_" in plain]


def folder_of(path: Path) -> str:
    """Return the first folder of a module within the package; a module beside them stands for itself."""
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def identifiers(tree: ast.AST) -> Iterator[str]:
    """Yield every name that code uses: variables, attributes, functions, arguments, keywords and modules."""
    for node in ast.walk(tree):
        for field in ("id", "attr", "name", "arg", "asname", "module", "rest"):
            value = getattr(node, field, None)
            if isinstance(value, str):
                yield from value.split(".")
        if isinstance(node, ast.Global | ast.Nonlocal):
            yield from node.names


@cache
def names() -> frozenset[tuple[str, str]]:
    """Return all names of the package with the folder that has them, names of files and folders included."""
    found = {
        (folder_of(path), name)
        for path in SOURCES
        for name in identifiers(ast.parse(path.read_text(encoding="utf-8")))
    }
    of_files = {
        (folder_of(path), part)
        for path in SOURCES
        for part in path.relative_to(PACKAGE).with_suffix("").parts
    }
    return frozenset(found | of_files)


def rows() -> list[tuple[str, str]]:
    """Return the rows of the glossary: the name before, and the name now."""
    return re.findall(r"^\| `(\w+)` \| `(\w+)` \|", GLOSSARY.read_text(encoding="utf-8"), re.MULTILINE)


def test_no_name_has_a_retired_word() -> None:
    left = [
        (folder, name)
        for folder, name in sorted(names() - ALLOWED.keys())
        if any((folder, word) not in USUAL for word in retired_in(name))
    ]
    assert not left, f"give these the term of the field (docs/glossary.md): {left}"


@pytest.mark.parametrize("allowed", sorted(ALLOWED), ids=str)
def test_each_allowed_name_is_needed(allowed: tuple[str, str]) -> None:
    assert retired_in(allowed[1]) and allowed in names(), "take it off the list"


@pytest.mark.parametrize("usual", sorted(USUAL), ids=str)
def test_each_usual_meaning_is_needed(usual: tuple[str, str]) -> None:
    folder, word = usual
    assert any(word in retired_in(name) for here, name in names() if here == folder), "take it off the list"


def test_the_glossary_has_the_same_words() -> None:
    known = {word for before, _ in rows() for word in retired_in(before)}
    assert known == set(RETIRED), f"on one side only: {sorted(known ^ set(RETIRED))}"


def test_the_glossary_names_what_there_is() -> None:
    """A name that was given is a name of the package, was itself replaced, or is how names of symbols begin."""
    here = {name for _, name in names()}
    former = {before for before, _ in rows()}
    whole = [(before, now) for before, now in rows() if not now.endswith("_")]
    lost = [(before, now) for before, now in whole if now not in here and now not in former]
    assert not lost, f"the glossary names what is not in the package: {lost}"


def test_no_registry_is_keyed_by_strings() -> None:
    """What all systems of one structure share is stored under the function that makes it, which has a type."""
    users = {
        path.name
        for path in SOURCES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute)
        and node.attr == "shared"
        and "code" in (getattr(node.value, "attr", ""), getattr(node.value, "id", ""))
    }
    assert users == {"per_structure.py"}, "use `hybridsim.engine.system.per_structure`"


def test_parts_of_names_are_seen() -> None:
    assert retired_in("LeaperPlan") == ["leaper", "plan"]
    assert retired_in("_is_at_zero") == ["at_zero"]
    assert retired_in("_KEPT") == ["kept"]
    assert not retired_in("airplane") and not retired_in("planar") and not retired_in("bedroom")
