"""The example with a slider: its turning points, and the picture without a notebook."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "plot_12_slider.py"


def test_the_slider_example_draws_without_widgets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each half swing loses 2 mu g of the amplitude, with m = k = 1."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "ipywidgets", None)
    found = runpy.run_path(str(EXAMPLE))
    assert found["turns"] == pytest.approx([1 - 2 * k * 0.01 * 9.81 for k in (1, 2, 3)])
    assert (tmp_path / "slider.png").stat().st_size > 1000
