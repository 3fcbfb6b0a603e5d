"""The JSON Schema for editors says what the reader of model files says."""

from __future__ import annotations

import json
import re
import runpy
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import hybridsim as hs
from hybridsim.cli import main
from hybridsim.model.toml.laws import read_laws
from hybridsim.model.toml.read import open_text
from hybridsim.model.toml.table import Table

ROOT = Path(__file__).parents[3]
SCHEMA = json.loads((ROOT / "hybridsim" / "model" / "toml" / "model.schema.json").read_text(encoding="utf-8"))
FILES = [*sorted((ROOT / "models").glob("*.toml")), *sorted((ROOT / "models" / "laws").glob("*.toml"))]
SHOWN = [
    text
    for page in sorted((ROOT / "docs").rglob("*.md"))
    for text in re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    if "schema" in text
]


def is_valid(data: Any) -> bool:
    return bool(jsonschema.Draft202012Validator(SCHEMA).is_valid(data))


def test_it_is_what_its_script_writes() -> None:
    script = runpy.run_path(str(ROOT / "docs" / "make" / "schema.py"))
    assert script["MODEL"] == SCHEMA
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_files_of_the_package_are_valid(file: Path) -> None:
    jsonschema.validate(tomllib.loads(file.read_text(encoding="utf-8")), SCHEMA)


@pytest.mark.parametrize("text", SHOWN, ids=range(len(SHOWN)))
def test_models_shown_are_valid(text: str) -> None:
    jsonschema.validate(tomllib.loads(text), SCHEMA)


def keys_of(schema: Any) -> set[frozenset[str]]:
    """The sets of keys of all tables that a schema describes."""
    if isinstance(schema, list):
        return {keys for part in schema for keys in keys_of(part)}
    if not isinstance(schema, dict):
        return set()
    found = {frozenset(schema["properties"])} if schema.get("additionalProperties") is False else set()
    return found | {keys for part in schema.values() for keys in keys_of(part)}


def test_it_knows_the_keys_that_the_reader_knows(monkeypatch: pytest.MonkeyPatch) -> None:
    read: set[frozenset[str]] = set()
    only = Table.only

    def noted(self: Table, *known: str) -> None:
        read.add(frozenset(known))
        only(self, *known)

    monkeypatch.setattr(Table, "only", noted)
    for file in FILES:
        text = file.read_text(encoding="utf-8")
        if "[states" in text:
            hs.Model.from_toml(text, str(file))  # not `load`, which reads a file once
        else:
            read_laws(open_text(text, None, "laws"), file.parent)
    for text in SHOWN:
        hs.Model.from_toml(text)
    hs.Model.from_toml(EVERYTHING)
    assert read - {frozenset({"schema", "look", "laws"})} == keys_of(SCHEMA)  # but for files of laws alone


EVERYTHING = """
schema = 1
[states]
x = { start = 0, der = "n + u" }
[discrete]
n = { start = 1 }
[inputs]
u = { kind = "chirp", f0 = 1, f1 = 2, duration = 3, amplitude = 1 }
h = { kind = "held", value = 1, unit = "N" }
z = { kind = "connected", unit = "m" }
[use.part]
model = "belt"
[monitors]
m = "x - 1"
[schedules.s]
times = [1, 2]
terminate = false
[clocks.c]
period = 1
set = { n = "n + 1" }
[components.a.surface]
function = "x"
unknown = "f"
above = "up"
below = "down"
hold = "on"
jump_above = 0
jump_below = 0
[components.a.modes]
up = { guards.g = "x", set = { f = 1 } }
down = { guards.g = "-x", set = { f = -1 } }
on = { guards = { up = "1 - f", low = "f + 1" } }
[elements]
e1 = { kind = "relay", input = "x", on = 1, off = 0 }
e2 = { kind = "saturation", input = "x", lower = 0, upper = 1 }
e3 = { kind = "backlash", input = "x", width = 1 }
e4 = { kind = "quantizer", input = "x", step = 1 }
e5 = { kind = "delay", input = "x", clock = "c", ticks = 1 }
[drawing]
mass = { kind = "mass", at = [0, 0] }
pendulum = { kind = "pendulum", at = [0, 0], length = 1, angle = "x" }
wall = { kind = "wall", at = [0, 0] }
belt = { kind = "belt", at = [0, 0], travel = "t" }
tank = { kind = "tank", at = [0, 0], level = "x" }
spring = { kind = "spring", ends = ["wall", "mass"] }
rod = { kind = "rod", ends = ["wall", ["x", 0]] }
shaft = { kind = "shaft", ends = [[0, 0], [0, 1]] }
arrow = { kind = "arrow", at = [0, 0], vector = ["x", 0] }
line = { kind = "line", points = [[0, 0], ["x", 0]] }
body = { kind = "body", points = [[0, 0], ["x", 0], [1, 1]] }
"""


@pytest.mark.parametrize(
    "text",
    [
        "[states]\nx = { start = 0, dre = 1 }",
        "[states]\nx = { start = 0 }",
        "[contacts.f]\nvelocity = 'v'\nnormal = 1\nlaw = { mu = 1 }",
        "[impacts.p]\ngap = 'h'",
        "[inputs.u]\nkind = 'wavy'",
        "[use.a]\nrepeat = 2",
        "[use.a]\nmodel = 'belt'\nfirst.x = 1",
        "[monitors.m]\nexpr = 'x'\ndirection = 'sideways'",
        "[parameters]\n'a b' = 1",
        "schema = 2",
        "contact = 1",
        "[drawing]\na = { kind = 'mass' }",
        "[drawing]\na = { kind = 'mass', at = [0] }",
        "[drawing]\na = { kind = 'mas', at = [0, 0] }",
    ],
)
def test_what_the_reader_refuses_is_not_valid(text: str) -> None:
    assert not is_valid(tomllib.loads(text))
    with pytest.raises(hs.ModelError):
        hs.Model.from_toml(text)


def test_the_command_prints_it(capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    assert json.loads(capfd.readouterr().out) == SCHEMA
