"""A sign slip that every newcomer makes is refused where the model is checked, not only where it is run."""

from __future__ import annotations

from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim.engine.run.report import describe


def test_check_refuses_a_force_that_drives(tmp_path: Path) -> None:
    text = hs.load("dfcs").to_toml().replace("- k*x - f)/m", "- k*x + f)/m")
    path = tmp_path / "slip.toml"
    path.write_text(text)
    model = hs.load(path)
    with pytest.raises(hs.ModelError, match="acts along the relative velocity"):
        describe(model)
