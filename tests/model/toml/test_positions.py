"""Where keys stand in a TOML text."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from typing import Any

import pytest
from model.samples import everything

import hybridsim as hs
from hybridsim.model.toml.positions import positions

TEXT = """\
# a comment with [brackets] and "quotes" = 1
top = 1
"quoted key" = { a = "# no comment", "b.c" = [1, 2], d = { e = 3 } }   # comment

[table]
x.y = "1"

[table.sub]   # more
list = [
  { to = "]}", when = 'a"b' },  # first
  # between
  [1,
   2],
]
long = '''
[not.a.table]
no = key
'''
after = \"\"\"a \\\"\"\" b\"\"\"\"\"
last = 1979-05-27T07:32:00Z

[[rows]]
a = 1
[[rows]]
a = 2
"""


@pytest.mark.parametrize(
    ("path", "line", "column"),
    [
        (("top",), 2, 0),
        (("quoted key",), 3, 0),
        (("quoted key", "a"), 3, 17),
        (("quoted key", "b.c"), 3, 37),
        (("quoted key", "b.c", 1), 3, 49),
        (("quoted key", "d", "e"), 3, 59),
        (("table",), 5, 1),
        (("table", "x"), 6, 0),
        (("table", "x", "y"), 6, 2),
        (("table", "sub"), 8, 7),
        (("table", "sub", "list", 0), 10, 2),
        (("table", "sub", "list", 0, "when"), 10, 15),
        (("table", "sub", "list", 1, 1), 13, 3),
        (("table", "sub", "after"), 19, 0),
        (("table", "sub", "last"), 20, 0),
        (("rows", 0, "a"), 23, 0),
        (("rows", 1, "a"), 25, 0),
    ],
)
def test_line_and_column(path: tuple[str | int, ...], line: int, column: int) -> None:
    tomllib.loads(TEXT)
    assert positions(TEXT)[path] == (line, column)


def test_nothing_inside_strings_is_taken_for_a_key() -> None:
    assert ("not", "a", "table") not in positions(TEXT)
    assert not any("no" in path for path in positions(TEXT))


def paths(data: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield (*path, key)
        yield from paths(value, (*path, key))


@pytest.mark.parametrize("name", [info.name for info in hs.list_models()])
def test_every_key_of_a_packaged_model_is_found_where_it_is(name: str) -> None:
    info = next(info for info in hs.list_models() if info.name == name)
    text = info.path.read_text(encoding="utf-8")
    check(text)


def test_every_key_of_a_written_model_is_found_where_it_is() -> None:
    check(everything().to_toml())


def check(text: str) -> None:
    found = positions(text)
    wanted = set(paths(tomllib.loads(text)))
    assert wanted == set(found)
    lines = text.split("\n")
    for path, (line, column) in found.items():
        if isinstance(path[-1], str):
            assert lines[line - 1][column:].lstrip("\"'").startswith(path[-1])
