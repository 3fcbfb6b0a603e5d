"""Models and laws by name or path: what comes with the package, and files of the user."""

from __future__ import annotations

import os
import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from hybridsim.calls import refusing
from hybridsim.errors import ModelError, Place, UsageError, nearest
from hybridsim.model.law import FrictionLaw
from hybridsim.model.model import Model

# A model of a thousand states takes some 100 kB; what is larger is no model.
MAX_BYTES = 1_000_000


@dataclass(frozen=True)
class ModelInfo:
    """What the list of packaged models says of each."""

    name: str
    title: str
    source: str
    path: Path


@refusing
def load(name_or_path: str | os.PathLike[str]) -> Model:
    """Load a model by the name of one that comes with the package, or by the path of a ``.toml`` file.

    Parameters
    ----------
    name_or_path : str or path
        A name of `list_models`, or the path of a file, ending in ``.toml``.

    Returns
    -------
    Model
        The model, validated.

    Raises
    ------
    ModelError
        For no such model (the nearest names are listed) or file; for a file that is empty, too large, no text
        or no TOML; or for all faults of a model in one.

    Examples
    --------
    >>> import hybridsim as hs
    >>> hs.load("dfcs").parameter_values()["N"]
    40.0
    """
    given: object = name_or_path
    if not isinstance(given, str | os.PathLike):
        remedy = "give a Model, a name or a path"
        if hasattr(given, "to_model"):
            remedy = "hs.simulate takes it as it is; here give its ordinary model, system.to_model()"
        elif callable(given):
            remedy = "a function f(t, x) of the rates makes a model with names: hs.Model(states={'x': 1.0}, flow=f)"
        raise UsageError(f"the model is {given!r}", remedy=remedy)
    text = os.fspath(name_or_path)
    if isinstance(name_or_path, os.PathLike) or text.endswith(".toml") or "/" in text or os.sep in text:
        path = Path(text)
    else:
        path = models_folder() / f"{text}.toml"
        names = [info.stem for info in _model_files()]
        if text not in names:
            raise ModelError(
                f"there is no model '{text}'",
                remedy=nearest(text, names, kind="models")
                + " A file of yours is given by its path, ending in .toml.",
            )
    return Model.from_toml(read_text(path), str(path))


def list_models() -> tuple[ModelInfo, ...]:
    """List the models that come with the package, by name.

    Returns
    -------
    tuple of ModelInfo
        Of each model its ``name``, ``title``, ``source`` and ``path``.

    Examples
    --------
    >>> import hybridsim as hs
    >>> "dfcs" in [info.name for info in hs.list_models()]
    True
    """
    found = []
    for path in _model_files():
        data = tomllib.loads(path.read_text(encoding="utf-8"))
        found.append(ModelInfo(path.stem, data.get("title", ""), data.get("source", ""), path))
    return tuple(found)


def list_laws() -> tuple[str, ...]:
    """Names of the friction laws that come with the package."""
    return tuple(path.stem for path in sorted((models_folder() / "laws").glob("*.toml")))


@refusing
def load_law(name: str) -> FrictionLaw:
    """Load a friction law of the package by name, ready for a `Contact`.

    Parameters
    ----------
    name : str
        Name of the law.

    Returns
    -------
    FrictionLaw
        The law.

    Raises
    ------
    ModelError
        For an unknown name, with the nearest ones.
    UsageError
        For what is no text.

    Examples
    --------
    >>> import hybridsim as hs
    >>> hs.load_law("coulomb").is_set_valued
    True
    """
    if not isinstance(name, str):
        raise UsageError(f"the law is {name!r}", remedy="give the name of a law")
    return _packaged_law(name)


@lru_cache(maxsize=64)
def _packaged_law(name: str) -> FrictionLaw:
    from hybridsim.model.toml_laws import read_laws
    from hybridsim.model.toml_read import open_text

    if name not in list_laws():
        known = nearest(name, list_laws(), kind="laws")
        raise ModelError(
            f"there is no law '{name}'",
            remedy=f"{known} A law of your own is given as the FrictionLaw itself",
        )
    path = models_folder() / "laws" / f"{name}.toml"
    root = open_text(read_text(path), str(path), "the law")
    root.only("schema", "look", "laws")
    laws = read_laws(root)
    if root.source.errors:
        raise ModelError.collect(root.source.errors, str(path))
    return laws[name]


def models_folder() -> Path:
    """Where the packaged models are: inside the wheel, or beside the package in a checkout."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "models"
    return inside if inside.is_dir() else package.parent / "models"


def read_text(path: Path) -> str:
    """Text of a model file; ModelError naming what is wrong with the file."""
    place = Place(str(path))
    try:
        if path.is_dir():
            raise ModelError("this is a folder", place=place, remedy="give the .toml file in it.")
        if (
            path.exists() and not path.is_file() and str(path) != "/dev/stdin"
        ):  # it may have no end, or no beginning
            raise ModelError("this is no regular file", place=place, remedy="give a .toml file.")
        size = path.stat().st_size
        if size > MAX_BYTES:
            remedy = "put tables into CSV files beside the model."
            raise ModelError(
                f"the file has {size} bytes, {MAX_BYTES} are allowed", place=place, remedy=remedy
            )
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise ModelError("there is no such file", place=place, remedy=_beside(path)) from None
    except (OSError, ValueError) as fault:
        reason = getattr(fault, "strerror", None) or str(fault)
        raise ModelError(
            f"the file cannot be read: {reason}", place=place, remedy="give a readable file."
        ) from None
    if len(data) > MAX_BYTES:
        raise ModelError(f"the file has over {MAX_BYTES} bytes", place=place, remedy="give a model file.")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        line = data.count(b"\n", 0, fault.start) + 1
        raise ModelError(
            f"this is no text: byte {data[fault.start]:#04x} at offset {fault.start} is not UTF-8",
            place=Place(str(path), line),
            remedy="a model is a TOML file in UTF-8.",
        ) from None


def _beside(path: Path) -> str:
    """Near names in the same folder, else the names of the packaged models."""
    packaged = [known.stem for known in _model_files()]
    try:
        beside = [other.name for other in path.parent.glob("*.toml")]
    except OSError:
        beside = []
    near = nearest(path.name, beside)
    return near if "did you mean" in near else "models that go by name: " + ", ".join(packaged) + "."


def _model_files() -> list[Path]:
    return sorted(models_folder().glob("*.toml"))
