"""This module reads friction laws from TOML: [laws.*], and the laws of contacts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from hybridsim.errors import ModelError, Place, UsageError, nearest
from hybridsim.expr import Expression, parse
from hybridsim.model.laws.law import SPEED, FrictionLaw
from hybridsim.model.laws.law_table import LawTable
from hybridsim.model.parts.quantities import State
from hybridsim.model.toml.automata import read_mode
from hybridsim.model.toml.table import Table
from hybridsim.model.toml.table_file import numbers_from_file

KEYS = (
    "slip", "stick", "slip_backward", "stick_backward", "force", "states", "definitions", "modes", "initial", "copies",
    "tables", "parameters", "title", "source",
)  # fmt: skip
_OWN = ("name", "file", *KEYS)
_BRINGS = ("slip", "stick", "force")
_POINTS = ("at", "values")
_EXAMPLE = '{ name = "coulomb", mu = 0.5 }'

Laws = Mapping[str, FrictionLaw]  # the laws that a file declares, by name


def read_laws(root: Table, folder: Path) -> dict[str, FrictionLaw]:
    """Return the laws that the file declares, by name; paths of tables are relative to ``folder``."""
    found = {}
    for name, table in root.entries("laws", "law"):
        table.only(*KEYS)
        law = _law(name, table, (), folder)
        if law is not None:
            found[name] = law
    return found


def read_law_of_contact(
    contact: Table, laws: Laws, folder: Path
) -> tuple[FrictionLaw, dict[str, Expression]] | None:
    """Return the law and the arguments of a contact, or None after reporting an unknown law."""
    if not contact.require("law", f"write law = {_EXAMPLE}"):
        return None
    table = contact.sub(contact.data["law"], f"{contact.kind}, law", "name", "law")
    return None if table is None else read_law(table, str(contact.path[-1]), laws, folder)


def read_law(
    table: Table, contact: str, laws: Laws, folder: Path, form: Callable[[Any, Place], Any] = parse
) -> tuple[FrictionLaw, dict[str, Any]] | None:
    """Return the law and the arguments that a table gives to a contact, or None after reporting an unknown law.

    ``{ name = "coulomb", mu = "mu" }`` refers to a law of the file or the package, and
    ``{ file = "pad.toml", mu = "mu" }`` to the law in a file of its own. With ``slip`` and ``stick``, or with
    ``force``, the table declares the law itself, and every other key is a parameter with its value.

    Parameters
    ----------
    form : reads the value of an argument.
    """
    arguments = {
        key: table.parsed(value, key, form=form) for key, value in table.data.items() if key not in _OWN
    }
    if "file" in table.data:
        own = _of_file(table, folder)
        return None if own is None else (own, arguments)
    name = table.text("name")
    if any(key in table.data for key in _BRINGS):
        own = _law(name or contact, table, arguments, folder)
        return None if own is None else (own, arguments)
    for key in KEYS:
        if key in table.data:
            table.fail(
                f"'{key}' is allowed only in the declaration of a law", f"write it in [laws.{name}]", key
            )
    if not table.require("name", f"write {_EXAMPLE}"):
        return None
    law = laws.get(name) or _packaged(name)
    if law is None:
        from hybridsim.model.library import list_laws

        remedy = nearest(name, {*laws, *list_laws()}, kind="laws")
        remedy += f"\ndeclare a law of your own, such as a table, in [laws.{name}]"
        table.fail(f"unknown law '{name}'", remedy, "name")
        return None
    return law, arguments


def _packaged(name: str) -> FrictionLaw | None:
    from hybridsim.model.library import list_laws, load_law

    return load_law(name) if name in list_laws() else None


def _of_file(table: Table, folder: Path) -> FrictionLaw | None:
    """Return the law from the file that a contact names, or None after reporting the errors of the file."""
    from hybridsim.model.library import law_of_text, read_text

    for key in _OWN:
        if key != "file" and key in table.data:
            table.fail(f"'{key}' and 'file' cannot be combined", f"remove '{key}' or 'file'", key)
    errors, path = len(table.source.errors), folder / table.text("file")
    if len(table.source.errors) > errors:
        return None  # no text
    try:
        text = read_text(path)
    except ModelError as fault:
        where = fault.place.prefix if fault.place else ""
        table.fail(where + fault.message, f"paths are relative to the folder {folder.resolve()}", "file")
        return None
    try:
        law, files = law_of_text(text, str(path))
    except ModelError as fault:
        table.source.errors.extend(fault.errors)
        return None
    table.source.files.extend(files)
    return law


def _law(name: str, table: Table, arguments: Iterable[str], folder: Path) -> FrictionLaw | None:
    parameters, units = _parameters(table)
    for argument in arguments:
        parameters.setdefault(argument, None)
    force = table.expression("force")
    slip: Any = table.expression("slip")  # None only together with a force, which FrictionLaw checks
    stick: Any = table.expression("stick")
    if force is None:
        slip = table.required(
            "slip", 'write slip = "EXPRESSION" of v >= 0, N and parameters, or force = "EXPRESSION"'
        )
        stick = table.required("stick", 'write stick = "EXPRESSION" of N and parameters')
    modes = dict(table.entries("modes", "mode"))
    marked = [mode for mode, part in modes.items() if part.flag("initial")]
    texts = {key: table.text(key) for key in ("initial", "copies") if key in table.data}
    tables = tuple(_tables(table, folder, units))
    try:
        return FrictionLaw(
            name,
            slip,
            stick,
            parameters,
            table.text("title"),
            table.text("source"),
            slip_backward=table.expression("slip_backward"),
            stick_backward=table.expression("stick_backward"),
            force=force,
            states=tuple(_states(table)),
            definitions=table.expressions("definitions"),
            modes=tuple(read_mode(mode, part) for mode, part in modes.items()),
            initial=texts.get("initial", marked[0] if marked else None),
            copies=texts.get("copies"),
            tables=tables,
            units=units,
            place=table.place,
        )
    except UsageError as fault:
        table.fail(fault.message.partition(": ")[2], fault.remedy or "")
        return None


def _states(law: Table) -> Iterator[State]:
    for name, table in law.entries("states", f"{law.kind}, state", "der"):
        table.only("start", "der", "unit", "nominal")
        start = table.expression("start") or parse(0)
        der = table.required("der", 'write der = "EXPRESSION" of v, N, parameters and states of the law')
        yield State(name, start, der, table.text("unit"), table.real("nominal"), place=table.place)


def _tables(law: Table, folder: Path, units: dict[str, str]) -> Iterator[LawTable]:
    """Yield the tables of a law, and add the units of their values to the units of the law."""
    for name, table in law.entries("tables", f"{law.kind}, table"):
        table.only(*_POINTS, "over", "interpolation", "across", "across_at", "file", "columns", "unit")
        across = table.expression("across")
        if "file" in table.data:
            if across is not None:
                table.fail(
                    "'file' and 'across' cannot be combined", "write the points in the model file", "across"
                )
                continue
            numbers: dict[str, Any] = numbers_from_file(table, folder, _POINTS, "arguments")
            if not numbers:
                continue
        else:
            for key in _POINTS:
                table.require(key, f"write {key} = [0, ...]")
            numbers = {"at": table.numbers("at")}
            numbers["values"] = table.values("values") if across is None else table.rows("values")
        over = table.expression("over") or parse(SPEED)
        way = table.text("interpolation", "cubic")
        try:
            yield LawTable(
                name,
                **numbers,
                over=over,
                interpolation=way,
                across=across,
                across_at=table.numbers("across_at"),
                place=table.place,
            )
            units[name] = table.text("unit")
        except UsageError as fault:
            table.fail(fault.message.partition(": ")[2], fault.remedy or "")


def _parameters(law: Table) -> tuple[dict[str, Expression | None], dict[str, str]]:
    """Return the default of each parameter of a law, or None, and the declared units."""
    defaults: dict[str, Expression | None] = {}
    units: dict[str, str] = {}
    declared: Any = law.data.get("parameters", {})
    is_list = isinstance(declared, list)
    for index, item in enumerate(declared if is_list else [law.mapping("parameters", "parameters")]):
        where = ("parameters", index) if is_list else ("parameters",)
        if isinstance(item, str):
            defaults[item] = None
        elif isinstance(item, dict):
            for name, value in item.items():
                entry = law.sub(value, f"{law.kind}, parameter {name}", "value", *where, name)
                if entry is not None:
                    entry.only("value", "unit")
                    defaults[name], units[name] = entry.expression("value"), entry.text("unit")
        else:
            law.fail(f"'parameters' contains {item!r}", "write a name, or { name = default }", *where)
    return defaults, units
