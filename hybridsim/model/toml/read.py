"""This module reads a model from TOML text, with one function for each kind of table."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from hybridsim.errors import ModelError, Place
from hybridsim.expr import Expression
from hybridsim.model.laws.law import FrictionLaw
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.impact import Impact
from hybridsim.model.parts.model import Model
from hybridsim.model.parts.monitor import Monitor
from hybridsim.model.parts.quantities import Discrete, Output, Parameter, State
from hybridsim.model.parts.schedule import Schedule
from hybridsim.model.parts.switching import SwitchingSurface
from hybridsim.model.toml.automata import read_components
from hybridsim.model.toml.drawing import read_drawing
from hybridsim.model.toml.elements import read_elements
from hybridsim.model.toml.inputs import read_inputs
from hybridsim.model.toml.laws import read_law_of_contact, read_laws
from hybridsim.model.toml.positions import positions
from hybridsim.model.toml.table import Source, Table
from hybridsim.model.toml.use import PartFiles, read_uses

SCHEMA = 1
KEYS = (
    "schema", "name", "title", "source", "description", "look", "duration", "use", "parameters", "states", "discrete",
    "definitions", "inputs", "laws", "contacts", "surfaces", "impacts", "initial", "limit", "modes", "components",
    "monitors", "schedules", "clocks", "outputs", "drawing", "elements",
)  # fmt: skip


def read_model(text: str, path: str | None = None) -> Model:
    """Read a model from TOML text, and check it.

    Raises
    ------
    ModelError
        For invalid TOML (with line and column), for all errors of the tables, or for all errors of the model.
    """
    files = PartFiles(_model, path)
    model = _model(text, path, files).validate()
    vars(model)["_part_files"] = files.files
    return model


def open_text(text: str, path: str | None, kind: str) -> Table:
    """Return the top table of a TOML text, or raise ModelError if it is empty or not valid TOML."""
    if not text.strip():
        raise ModelError(
            "the file is empty", place=Place(path), remedy="declare at least one state, under [states]"
        )
    try:
        data = tomllib.loads(text)
        source = Source(path, _split(text), positions(text))
    except tomllib.TOMLDecodeError as fault:
        raise _not_toml(fault, text, path) from None
    except (ValueError, RecursionError) as fault:
        reason = "the text is nested too deeply" if isinstance(fault, RecursionError) else str(fault)
        raise ModelError(f"invalid TOML: {reason}", place=Place(path), remedy="simplify the file") from None
    return Table(source, (), data, kind)


# Parts of the messages of tomllib, and what to do; the last one is for all other messages.
_REMEDIES = (
    ("at the end of a table declaration", "write the name of a table in brackets: [states]"),
    ("overwrite a value", "this name is declared a second time: rename or remove one of the two"),
    ("twice", "this table is declared a second time: write its lines below the first one"),
    ("initial character for a key part", "write { ... } on one line, with commas between its entries"),
    ("Unclosed", "close a list with ], and { ... } with } on the same line"),
    ("Illegal character", "close the text with the quotes that open it, on the same line"),
    ("Unescaped", "write a backslash twice, or the text in single quotes"),
    ("after a statement", "write one key = value in a line"),
    ("after a key", "write key = value, such as mu = 0.3"),
    ("", 'write key = value, with expressions in double quotes: der = "-k*x"'),
)


def _not_toml(fault: tomllib.TOMLDecodeError, text: str, path: str | None) -> ModelError:
    found = re.search(r"\(at line (\d+), column (\d+)\)", str(fault))
    message = re.sub(r"\s*\(at [^)]*\)", "", str(fault))
    lines = _split(text)
    line, column = (int(found[1]), int(found[2]) - 1) if found else (len(lines), 0)
    shown = lines[line - 1] if 0 < line <= len(lines) else ""
    return ModelError(
        f"invalid TOML: {message[:1].lower()}{message[1:]}",
        place=Place(path, line, column, shown),
        remedy=next((remedy for part, remedy in _REMEDIES if part in message), _REMEDIES[-1][1]),
    )


def _split(text: str) -> list[str]:
    """Split a text into lines as TOML does, only at line feeds."""
    return [line.rstrip("\r") for line in text.split("\n")]


def _model(text: str, path: str | None, files: PartFiles) -> Model:
    """Build a model from a text, or raise all errors of its tables and parts."""
    root = open_text(text, path, "the model")
    name = root.text("name") or (Path(root.source.file).stem if root.source.file else "model")
    errors = root.source.errors
    try:
        model = _declared(root, name, files)
    except ModelError as fault:
        errors.extend(fault.errors)
    files.others.extend(root.source.files)
    if errors:
        raise ModelError.collect(errors, root.source.file or f"model {name}", root.source.file)
    return model


def _declared(root: Table, name: str, files: PartFiles) -> Model:
    """Return the model that the tables of a file declare; errors are collected in the source."""
    folder = Path(root.source.file).parent if root.source.file else Path()
    loose = [
        key
        for key, value in root.data.items()
        if key not in KEYS and (type(value) in (int, float) or (isinstance(value, dict) and "value" in value))
    ]
    root.only_in(*KEYS, others=loose, remedy="write the line [parameters] above them, if they are parameters")
    if root.data.get("schema", SCHEMA) != SCHEMA:
        root.fail(f"unknown schema {root.data['schema']!r}", f"write schema = {SCHEMA}", "schema")
    laws = read_laws(root, folder)
    uses = tuple(read_uses(root, folder, files, laws))
    return Model(
        name=name,
        use=() if root.source.errors else uses,
        states=tuple(_states(root)),
        parameters=tuple(_parameters(root)),
        discrete=tuple(_discrete(root)),
        components=tuple(read_components(root)),
        contacts=tuple(_contacts(root, laws, folder)),
        surfaces=tuple(_surfaces(root)),
        impacts=tuple(_impacts(root)),
        inputs=tuple(read_inputs(root, folder)),
        monitors=tuple(_monitors(root)),
        schedules=(*_schedules(root), *_clocks(root)),
        outputs=tuple(_outputs(root)),
        drawing=tuple(read_drawing(root)),
        elements=tuple(read_elements(root)),
        definitions=tuple(root.expressions("definitions").items()),
        title=root.text("title"),
        source=root.text("source"),
        description=root.text("description"),
        look=root.text("look"),
        duration=root.expression("duration"),
        path=root.source.file,
        place=Place(root.source.file),
    )


def _parameters(root: Table) -> Iterable[Parameter]:
    for name, table in root.entries("parameters", "parameter", "value"):
        table.only("value", "unit", "title")
        value = table.required("value", 'write value = NUMBER or "EXPRESSION"')
        yield Parameter(name, value, table.text("unit"), table.text("title"), place=table.place)


def _states(root: Table) -> Iterable[State]:
    for name, table in root.entries("states", "state"):
        table.only("start", "der", "unit", "nominal", "title")
        start = table.required("start", "write start = NUMBER, the initial value")
        der = table.required("der", 'write der = "EXPRESSION"; modes may replace it by their own der')
        nominal, title = table.real("nominal"), table.text("title")
        yield State(name, start, der, table.text("unit"), nominal, title, place=table.place)


def _discrete(root: Table) -> Iterable[Discrete]:
    for name, table in root.entries("discrete", "discrete state", "start"):
        table.only("start", "unit", "title")
        start = table.required("start", "write start = NUMBER, the initial value")
        yield Discrete(name, start, table.text("unit"), table.text("title"), place=table.place)


def _contacts(root: Table, laws: dict[str, FrictionLaw], folder: Path) -> Iterable[Contact]:
    for name, table in root.entries("contacts", "contact"):
        name_of_law = table.data.get("law")
        numbers = [key for key, value in table.data.items() if type(value) in (int, float)]
        table.only_in(
            *("velocity", "normal", "law", "opens", "start", "nominal"),
            others=numbers if isinstance(name_of_law, str) else [],
            remedy=f'write arguments of a law beside its name: law = {{ name = "{name_of_law}", ... }}',
        )
        velocity = table.required("velocity", 'write velocity = "EXPRESSION", the relative velocity')
        normal = table.required("normal", 'write normal = "EXPRESSION", the normal load')
        law = read_law_of_contact(table, laws, folder)
        if law is not None:
            yield Contact(
                name,
                velocity,
                normal,
                *law,
                table.flag("opens"),
                table.expressions("start"),
                table.reals("nominal"),
                place=table.place,
            )


def _surfaces(root: Table) -> Iterable[SwitchingSurface]:
    for name, table in root.entries("surfaces", "surface", "expr"):
        table.only("expr", "above", "below")
        expr = table.required("expr", 'write expr = "EXPRESSION", which changes its sign at the surface')
        above, below = table.expressions("above"), table.expressions("below")
        single = sorted(set(above) ^ set(below))
        for one in single:
            declared_side, side = ("above", "below") if one in above else ("below", "above")
            table.fail(
                f"'{one}' is set in '{declared_side}' but not in '{side}'",
                f"write {side} = {{ {one} = ... }}",
                declared_side,
                one,
            )
        if not single:
            yield SwitchingSurface(name, expr, above, below, place=table.place)


def _impacts(root: Table) -> Iterable[Impact]:
    for name, table in root.entries("impacts", "impact"):
        table.only("gap", "restitution")
        gap = table.required("gap", 'write gap = "EXPRESSION" of positions, which cannot become negative')
        restitution = table.required("restitution", "write restitution = NUMBER from 0 to 1")
        yield Impact(name, gap, restitution, place=table.place)


def _monitors(root: Table) -> Iterable[Monitor]:
    for name, table in root.entries("monitors", "monitor", "expr"):
        table.only("expr", "direction", "action", "reset")
        expr = table.required("expr", 'write expr = "EXPRESSION", whose zeros are the events')
        action = table.text("action", "reset" if "reset" in table.data else "record")
        direction = table.text("direction", "both")
        yield Monitor(name, expr, direction, action, table.resets("reset"), place=table.place)


def _schedules(root: Table) -> Iterable[Schedule]:
    for name, table in root.entries("schedules", "schedule", "times"):
        table.only("times", "start", "period", "count", "reset", "terminate")
        yield Schedule(
            name,
            tuple(_times(table)),
            table.expression("start"),
            table.expression("period"),
            table.count("count"),
            table.resets("reset"),
            table.flag("terminate"),
            place=table.place,
        )


def _times(table: Table) -> Iterable[Expression]:
    times: Any = table.data.get("times", [])
    for index, time in enumerate(times if isinstance(times, list) else [times]):
        yield table.parsed(time, "times", index)


def _clocks(root: Table) -> Iterable[Schedule]:
    for name, table in root.entries("clocks", "clock"):
        table.only("period", "offset", "set")
        period = table.required("period", "write period = NUMBER, the time between ticks")
        start = table.expression("offset")
        yield Schedule(name, start=start, period=period, reset=table.resets("set"), place=table.place)


def _outputs(root: Table) -> Iterable[Output]:
    for name, table in root.entries("outputs", "output", "expr"):
        table.only("expr", "unit", "modes", "title")
        expr = table.required("expr", 'write expr = "EXPRESSION", the value of the output')
        modes, title = table.expressions("modes"), table.text("title")
        yield Output(name, expr, table.text("unit"), modes, title, place=table.place)
