"""Friction laws out of TOML: [laws.*], and the law that a contact names or brings along."""

from __future__ import annotations

from typing import Any

from hybridsim.errors import nearest
from hybridsim.expr import Expression
from hybridsim.model.law import FrictionLaw
from hybridsim.model.toml_table import Table

_OWN = ("name", "slip", "stick", "parameters", "title", "source")


def read_laws(root: Table) -> dict[str, FrictionLaw]:
    """The laws that the file declares, by name."""
    found = {}
    for name, table in root.entries("laws", "law"):
        table.only("slip", "stick", "parameters", "title", "source")
        found[name] = _law(name, table, {})
    return found


def read_law_of_contact(
    contact: Table, laws: dict[str, FrictionLaw]
) -> tuple[FrictionLaw, dict[str, Expression]] | None:
    """Law and arguments of a contact; None, with the fault noted, where there is none of that name.

    ``law = { name = "coulomb", mu = "mu" }`` names one of the file or of the package; with ``slip`` and
    ``stick`` the law is brought along, and every other key is a parameter of it with its value.
    """
    if not contact.require("law", 'write law = { name = "coulomb", mu = 0.5 }.'):
        return None
    table = contact.sub(contact.data["law"], f"{contact.kind}, law", "name", "law")
    if table is None:
        return None
    arguments = {key: table.parsed(value, key) for key, value in table.data.items() if key not in _OWN}
    name = table.text("name")
    if "slip" in table.data or "stick" in table.data:
        return _law(name or str(contact.path[-1]), table, arguments), arguments
    for key in ("parameters", "title", "source"):
        if key in table.data:
            table.fail(f"'{key}' belongs to the declaration of a law", f"write it in [laws.{name}].", key)
    if not table.require("name", 'write law = { name = "coulomb", mu = 0.5 }.'):
        return None
    law = laws.get(name) or _packaged(name)
    if law is None:
        from hybridsim.model.library import list_laws

        table.fail(f"there is no law '{name}'", nearest(name, {*laws, *list_laws()}, kind="laws"), "name")
        return None
    return law, arguments


def _packaged(name: str) -> FrictionLaw | None:
    from hybridsim.model.library import list_laws, load_law

    return load_law(name) if name in list_laws() else None


def _law(name: str, table: Table, arguments: dict[str, Expression]) -> FrictionLaw:
    slip = table.needed("slip", 'write slip = "force over v >= 0, N and parameters".')
    stick = table.needed("stick", 'write stick = "limit over N and parameters".')
    given: Any = table.data.get("parameters", {})
    parameters: dict[str, Expression | None] = {}
    if isinstance(given, list):
        for index, item in enumerate(given):
            parameters.update(_listed(table, item, index))
    else:
        parameters.update(table.expressions("parameters"))
    for argument in arguments:
        parameters.setdefault(argument, None)
    return FrictionLaw(
        name, slip, stick, parameters, table.text("title"), table.text("source"), place=table.place
    )


def _listed(table: Table, item: Any, index: int) -> dict[str, Expression | None]:
    """One entry of a list of parameters: a name without default, or a table of names with theirs."""
    if isinstance(item, str):
        return {item: None}
    if isinstance(item, dict):
        return {name: table.parsed(value, "parameters", index, name) for name, value in item.items()}
    table.fail(f"'parameters' holds {item!r}", "write a name, or { name = default }.", "parameters", index)
    return {}
