"""Importing the package and asking for help load no heavy library (times would depend on the machine)."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = ("sympy", "scipy", "numba", "matplotlib", "sksundae", "llvmlite", "pandas", "xarray")

LOADED = f"print(*[name for name in {HEAVY} if name in sys.modules])"


def loaded_after(code: str) -> list[str]:
    """Which heavy libraries a fresh interpreter holds after running `code`."""
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{code}\n{LOADED}"], capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()[-1].split()


def test_import_is_light() -> None:
    assert loaded_after("import hybridsim") == []


@pytest.mark.parametrize(
    "argv", [["--help"], ["run", "--help"], ["--version"], ["models"], ["schema"], ["cache", "path"]]
)
def test_light_commands_are_light(argv: list[str]) -> None:
    assert loaded_after(f"from hybridsim.cli import main\nassert main({argv}) == 0") == []


def test_loading_a_model_is_light() -> None:
    assert loaded_after("import hybridsim as hs\nhs.load('dfcs').parameter_values()") == []


def test_the_picture_of_a_run_loads_no_analysis() -> None:
    """Comparisons, sweeps and steady states are a hundred modules, which the warm command would wait for."""
    code = (
        "import sys, hybridsim.plot\nprint(*[m for m in sys.modules if m.startswith('hybridsim.analysis')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
