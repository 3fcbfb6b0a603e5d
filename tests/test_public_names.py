"""The explicit list of public names: all exist, type checkers see the same ones, and none is a module."""

from __future__ import annotations

import ast
import importlib
from pathlib import Path
from types import ModuleType

import pytest

import hybridsim


@pytest.mark.parametrize("name", hybridsim.__all__)
def test_name_exists(name: str) -> None:
    assert name in dir(hybridsim)
    assert not isinstance(getattr(hybridsim, name), ModuleType)


def test_the_stub_lists_the_same_names() -> None:
    stub = ast.parse(Path(hybridsim.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    listed = {
        alias.name: node.module
        for node in ast.walk(stub)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert listed == hybridsim._HOME


def test_a_function_is_not_hidden_by_the_module_of_its_name() -> None:
    importlib.import_module("hybridsim.simulate")
    assert callable(hybridsim.simulate)


def test_unknown_name() -> None:
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        hybridsim.simulat  # noqa: B018  # reading it is the test
