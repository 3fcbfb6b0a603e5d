"""Docstrings of the public names: they have numpydoc's form, and what their examples print is true."""

from __future__ import annotations

import doctest
import importlib

import pytest

import hybridsim as hs

NAMES = [name for name in hs.__all__ if name != "__version__"]

# What numpydoc would also have, and why it does not here.
NOT_ASKED = {
    "GL01": "a summary begins on the line of the quotes",
    "SA01": "other names are linked where they are mentioned",
    "ES01": "where one sentence says it all there is no second one",
}


@pytest.mark.parametrize("name", NAMES)
def test_form(name: str) -> None:
    from numpydoc.validate import Validator, validate

    where = f"{getattr(hs, name).__module__}.{name}"
    assert Validator._load_obj(where) is getattr(hs, name)
    found = validate(where)["errors"]
    thing = getattr(hs, name)
    # an error that is made as its base is says nothing anew of its parameters
    inherited = {"PR01"} if isinstance(thing, type) and "__init__" not in vars(thing) else set()
    assert [(code, text) for code, text in found if code not in NOT_ASKED.keys() | inherited] == []


@pytest.mark.parametrize("name", NAMES)
def test_examples(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    monkeypatch.chdir(tmp_path)
    thing = getattr(hs, name)
    module = importlib.import_module(thing.__module__)
    finder = doctest.DocTestFinder(recurse=False)
    runner = doctest.DocTestRunner()
    said: list[str] = []
    for example in finder.find(thing, name, module=module, globs=dict(vars(module))):
        runner.run(example, out=said.append)
    assert runner.tries > 0, "there is no example"
    assert runner.failures == 0, "".join(said)


def test_public_members_say_what_they_are() -> None:
    silent = [
        f"{name}.{member}"
        for name in NAMES
        if isinstance(getattr(hs, name), type)
        for part in getattr(hs, name).__mro__
        if part.__module__.startswith("hybridsim")
        for member, value in vars(part).items()
        if not member.startswith("_") and (callable(value) or isinstance(value, property | classmethod))
        if not (value.__doc__ or "").strip()
    ]
    assert silent == []
