"""Write docs/reference/integrators.md from the integrators themselves: their uses, limitations and options.

python docs/make/integrator_page.py
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from hybridsim.integrators import list_integrators
from hybridsim.integrators.contract import CAPABILITIES, Integrator
from hybridsim.integrators.options import options_of

PAGE = Path(__file__).parents[1] / "reference" / "integrators.md"
HEAD = """# Integrators

This page lists the integrators with their limitations and options. The script `docs/make/integrator_page.py` writes
it from the code. The command `hybridsim integrators NAME` prints the same text. See [Choose an
integrator](../how-to/choose-an-integrator.md) for advice.

Pass an option as a keyword of `hs.simulate`, or with `--option NAME=VALUE` on the command line.

## Capabilities

If a model needs a capability that the integrator lacks, the run raises an error that names the capability.

"""


def page() -> str:
    """Return the text of the page."""
    capabilities = table(
        ("capability", "meaning"), [(f"`{name}`", text) for name, text in CAPABILITIES.items()]
    )
    return f"{HEAD}{capabilities}" + "\n".join(section(each) for each in list_integrators())


def section(each: type[Integrator]) -> str:
    """Return the section of one integrator."""
    text = f"## {each.name}\n\n{each.title[:1].upper()}{each.title[1:]}.\n\n"
    text += table(("order", "use", "reference"), [(each.order, each.when, each.reference)])
    if each.lacks:
        text += table(("lacks", "reason"), [(f"`{name}`", reason) for name, reason in each.lacks.items()])
    options = options_of(each)
    if options:
        rows = [
            (f"`{o.name}`", o.kind, "" if o.default is None else f"`{o.default}`", o.text) for o in options
        ]
        text += table(("option", "value", "default", "meaning"), rows)
    return text.rstrip() + "\n"


def table(heads: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    """Return a table in Markdown, and an empty line."""
    lines = [heads, ["---"] * len(heads), *rows]
    shown = ["| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |" for line in lines]
    return "\n".join(shown) + "\n\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
