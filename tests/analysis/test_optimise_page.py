"""The page on optimisers: its code runs where the libraries are installed, and agrees with a closed form."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from typing import Any

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "optimise.md"
G, V0, MU = 9.81, 2.0, 0.3
PLACE = V0**2 / (2 * MU * G)
GRADIENT = 2 * (PLACE - 0.5) * -PLACE / MU  # of (x - 1/2)^2 by mu


def ran(title: str, folder: Path) -> dict[str, Any]:
    """The names after the first block of the page and that of a section."""
    text = PAGE.read_text(encoding="utf-8")
    first, *others = re.split(r"^## ", text, flags=re.MULTILINE)
    section = next(part for part in others if part.startswith(title))
    script = folder / "page.py"
    script.write_text(
        "\n".join(re.findall(r"```python\n(.*?)```", first + section, re.DOTALL)), encoding="utf-8"
    )
    return runpy.run_path(str(script))


def test_the_function_of_the_page_has_the_derivative_of_the_closed_form(tmp_path: Path) -> None:
    x, slope = ran("SciPy", tmp_path)["place"](MU)
    assert x == pytest.approx(PLACE, rel=1e-12)
    assert slope == pytest.approx(-PLACE / MU, rel=1e-12)


def test_scipy_finds_the_closed_form(tmp_path: Path) -> None:
    assert ran("SciPy", tmp_path)["found"].x[0] == pytest.approx(V0**2 / G, rel=1e-6)


def test_jax_has_the_same_gradient(tmp_path: Path) -> None:
    jax = pytest.importorskip("jax")
    names = ran("JAX", tmp_path)
    found = jax.grad(lambda mu: (names["place_in_jax"](mu) - 0.5) ** 2)(MU)
    assert float(found) == pytest.approx(GRADIENT, rel=1e-12)


def test_torch_has_the_same_gradient(tmp_path: Path) -> None:
    pytest.importorskip("torch")
    assert float(ran("PyTorch", tmp_path)["mu"].grad) == pytest.approx(GRADIENT, rel=1e-12)
