"""`hybridsim steady` where not everything can be read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest


def test_what_varies_too_fast_is_named_beside_the_others(tmp_path: Path, hybridsim: Callable) -> None:
    """The oscillator x'' + 0.1 x' + x = cos(2 t) has an amplitude of 1/|-3 + 0.2 i|."""
    (tmp_path / "oscillator.toml").write_text(
        'schema = 1\nname = "oscillator"\n'
        '[states]\nx = {start = 0, der = "v"}\nv = {start = 0, der = "-x - 0.1*v + cos(2*t)"}\n'
        '[outputs]\nfast = "sin(1e9*x)"\nsquare = "x**2"\n'
    )
    code, out, err = hybridsim("steady", tmp_path / "oscillator.toml")
    assert code == 0, err
    assert "fast: varies too fast, or jumps too often, to be read" in out
    square = next(line.split() for line in out.splitlines() if line.split()[:1] == ["square"])
    assert float(square[3]) == pytest.approx(1.0 / 9.04, rel=1e-5)  # its maximum, in six digits
