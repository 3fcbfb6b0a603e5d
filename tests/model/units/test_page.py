"""The page on units shows what the command line prints."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from hybridsim.cli.entry import main

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "check-units.md"


def test_the_page_shows_what_check_prints(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    text = PAGE.read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    Path("block.toml").write_text(re.findall(r"```toml\n(.*?)```", text, re.DOTALL)[0], encoding="utf-8")
    warnings, table = re.findall(r"```text\n(.*?)```", text, re.DOTALL)
    assert main(["check", "block.toml"]) == 0
    assert capsys.readouterr().err == warnings
    assert main(["check", "--units", "block.toml"]) == 0
    shown = capsys.readouterr()
    assert shown.out == table and shown.err == warnings
