"""Running a command line inside the test's own process."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple

import pytest

from hybridsim.cli import main


class Outcome(NamedTuple):
    """What a command line left behind."""

    code: int
    out: str
    err: str


@pytest.fixture
def hybridsim(
    capsys: pytest.CaptureFixture[str], tmp_path: object, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., Outcome]:
    """A function that runs one command line in an empty folder."""
    monkeypatch.chdir(str(tmp_path))
    monkeypatch.delenv("HYBRIDSIM_TRACEBACK", raising=False)

    def call(*argv: object) -> Outcome:
        capsys.readouterr()
        code = main([str(word) for word in argv])
        out, err = capsys.readouterr()
        # whichever test is the first to compile says so
        return Outcome(code, out, re.sub(r"hybridsim: compiling the engine.*\n", "", err))

    return call
