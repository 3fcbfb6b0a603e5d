"""The reference is complete: each public name has an entry, and the page on integrators agrees with the code."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

import hybridsim
from hybridsim import plot, testing
from hybridsim.integrators import list_integrators
from hybridsim.integrators.options import options_of

DOCS = Path(__file__).parents[1] / "docs"
API = (DOCS / "reference" / "api.md").read_text(encoding="utf-8")
INTEGRATORS = (DOCS / "reference" / "integrators.md").read_text(encoding="utf-8")


def entries(module: str) -> set[str]:
    """The names of a module for which the page on public names has a page or a description."""
    blocks = re.findall(r"```\{eval-rst\}\n(.*?)```", API, re.DOTALL)
    own = "\n".join(block for block in blocks if f".. currentmodule:: {module}\n" in block)
    return set(re.findall(r"^(?:   |\.\. data:: )(\w+)$", own, re.MULTILINE))


@pytest.mark.parametrize(
    ("module", "names"),
    [
        ("hybridsim", set(hybridsim.__all__) - {"__version__"}),
        ("hybridsim.plot", set(plot.__all__)),
        ("hybridsim.testing", set(testing.__all__)),
    ],
)
def test_each_public_name_has_an_entry(module: str, names: set[str]) -> None:
    assert entries(module) == names


def test_each_option_of_each_integrator_is_described() -> None:
    for each in list_integrators():
        section = INTEGRATORS.partition(f"## {each.name}\n")[2].partition("\n## ")[0]
        assert each.when in section
        for option in options_of(each):
            assert f"| `{option.name}` |" in section and option.text


def test_the_page_on_integrators_is_up_to_date(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path, str(DOCS / "make")])
    import integrator_page

    assert integrator_page.page() == INTEGRATORS, "run: python docs/make/integrator_page.py"
