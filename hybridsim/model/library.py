"""This module loads models and friction laws by name or path."""

from __future__ import annotations

import os
import time
import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from hybridsim.calls import refusing
from hybridsim.errors import ModelError, Place, UsageError, nearest
from hybridsim.model.laws.law import FrictionLaw
from hybridsim.model.parts.model import Model

# Limit of the size of a model file; a model with a thousand states has about 100 kB.
MAX_BYTES = 1_000_000
_MAX_LOADED = 64  # most models kept in memory
# A file that was written this many nanoseconds ago may change again without a change of its time stamp.
_MIN_AGE = 200_000_000

State = tuple[tuple[int, ...], ...]
"""What changes when one of the files of a model changes: device, inode, time stamp and size of each."""

# Where each model lies, by the argument of `load`: the path, the state of its files when it was read, and the model.
_loaded: dict[str, tuple[str, State, Model]] = {}


@dataclass(frozen=True)
class ModelInfo:
    """Name, title, source and path of a packaged model."""

    name: str
    title: str
    source: str
    path: Path


@refusing
def load(name_or_path: str | os.PathLike[str]) -> Model:
    """Load a packaged model by name, or a model file by its path.

    Parameters
    ----------
    name_or_path : str or path
        A name from `list_models`, or the path of a ``.toml`` file.

    Returns
    -------
    Model
        The model, validated.

    Raises
    ------
    ModelError
        For an unknown model (similar names are listed) or a missing file, for a file that is empty, too large or not
        TOML, and for an invalid model, with all its errors.

    Examples
    --------
    >>> import hybridsim as hs
    >>> hs.load("dfcs").parameter_values()["N"]
    40.0
    """
    return loaded(name_or_path).with_()  # an object of its own


def loaded(name_or_path: str | os.PathLike[str]) -> Model:
    """Return a model by name or path; repeated calls return the same object until the model's file changes."""
    argument: object = name_or_path
    if not isinstance(argument, str | os.PathLike):
        remedy = "use a Model, a name or a path"
        if hasattr(argument, "to_model"):
            remedy = "pass the system to hs.simulate or hs.steady_state, or convert it to a model by system.to_model()"
        elif callable(argument):
            remedy = "for rates from a function f(t, x, p) use hs.Model('m', states={'x': 1.0}, flow=f)"
        raise UsageError(f"The model cannot be {argument!r}", remedy=remedy)
    text = os.fspath(name_or_path)
    is_path = isinstance(name_or_path, os.PathLike) or _is_path(text)
    known = _loaded.get(text)
    if known is not None and is_path == (known[0] == text):
        path, state, model = known
        if state == _state_of(path, *model._part_files):
            return model
    path = text if is_path else str(path_of(text, Path()))
    before = _state_of(path)
    model = Model.from_toml(read_text(Path(path)), path)
    state = (*before, *_state_of(*model._part_files))
    if all(state) and time.time_ns() - max(file[2] for file in state) > _MIN_AGE:
        if len(_loaded) >= _MAX_LOADED:
            _loaded.clear()
        _loaded[text] = path, state, model
    return model


def path_of(name_or_path: str, folder: Path) -> Path:
    """Return the path of a packaged model from its name, or a path relative to a folder.

    Raises
    ------
    ModelError
        For an unknown name; the message lists similar names.
    """
    if _is_path(name_or_path):
        return folder / name_or_path
    names = [info.stem for info in _model_files()]
    if name_or_path not in names:
        raise ModelError(
            f"there is no model '{name_or_path}'",
            remedy=nearest(name_or_path, names, kind="models")
            + "; for your own file pass its path, ending in .toml",
        )
    return models_folder() / f"{name_or_path}.toml"


def _is_path(text: str) -> bool:
    return text.endswith(".toml") or "/" in text or os.sep in text


def _state_of(*paths: str) -> State:
    """Return device, inode, time and size of each file, or an empty tuple for a missing file."""
    states: list[tuple[int, ...]] = []
    for path in paths:
        try:
            found = os.stat(path)
        except (OSError, ValueError):
            states.append(())
        else:
            states.append((found.st_dev, found.st_ino, found.st_mtime_ns, found.st_size))
    return tuple(states)


def list_models() -> tuple[ModelInfo, ...]:
    """Return the packaged models, sorted by name.

    Returns
    -------
    tuple of ModelInfo
        The ``name``, ``title``, ``source`` and ``path`` of each model.

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
    """Return the names of the packaged friction laws."""
    return tuple(path.stem for path in sorted((models_folder() / "laws").glob("*.toml")))


@refusing
def load_law(name_or_path: str | os.PathLike[str]) -> FrictionLaw:
    """Load a friction law, packaged or in a file of its own, for use in a `Contact`.

    Parameters
    ----------
    name_or_path : str or path
        Name of a packaged law, or the path of a ``.toml`` file with one law.

    Returns
    -------
    FrictionLaw
        The law.

    Raises
    ------
    ModelError
        For an unknown name (similar names are listed), and for a file that is missing or has errors.
    UsageError
        If it is neither a name nor a path.

    Examples
    --------
    >>> import hybridsim as hs
    >>> hs.load_law("coulomb").is_set_valued
    True
    """
    if not isinstance(name_or_path, str | os.PathLike):
        raise UsageError(f"The law cannot be {name_or_path!r}", remedy="use the name of a law, or a path")
    path = os.fspath(name_or_path)
    if not isinstance(name_or_path, str) or _is_path(path):
        return law_of_text(read_text(Path(path)), path)[0]
    return _packaged_law(path)


@lru_cache(maxsize=64)
def _packaged_law(name: str) -> FrictionLaw:
    if name not in list_laws():
        suggestion = nearest(name, list_laws(), kind="laws")
        raise ModelError(
            f"there is no law '{name}'",
            remedy=f"{suggestion}; for your own law pass the FrictionLaw object, or the path of a .toml file",
        )
    path = models_folder() / "laws" / f"{name}.toml"
    return law_of_text(read_text(path), str(path))[0]


def is_packaged(law: FrictionLaw) -> bool:
    """Return whether a law was read from a file of the package, which its users do not change."""
    file = law.place.file if law.place else None
    return file is not None and Path(file).parent == models_folder() / "laws"


def law_of_text(text: str, path: str) -> tuple[FrictionLaw, list[str]]:
    """Return the only law in the text of a file, and all files from which the law was read."""
    from hybridsim.model.toml.laws import KEYS, read_laws
    from hybridsim.model.toml.read import open_text

    root = open_text(text, path, "the file of a law")
    keys = [key for key in root.data if key in KEYS]
    root.only_in("schema", "look", "laws", others=keys, remedy="write the line [laws.NAME] above them")
    laws = read_laws(root, Path(path).parent)
    if not root.source.errors and len(laws) != 1:
        names = f": {', '.join(laws)}" if laws else ""
        root.fail(f"it declares {len(laws)} laws{names}", "declare one law, [laws.NAME], in each file")
    if root.source.errors:
        raise ModelError.collect(root.source.errors, path)
    return next(iter(laws.values())), [path, *root.source.files]


def models_folder() -> Path:
    """Return the folder of the packaged models: inside the package, or next to it in a checkout."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "models"
    return inside if inside.is_dir() else package.parent / "models"


def read_text(path: Path) -> str:
    """Return the text of a model file, or raise ModelError with the reason."""
    place = Place(str(path))
    try:
        if path.is_dir():
            raise ModelError(
                "the path is a folder", place=place, remedy="use a .toml file inside this folder"
            )
        # a device or a pipe may be endless
        if path.exists() and not path.is_file() and str(path) != "/dev/stdin":
            raise ModelError("the path is not a regular file", place=place, remedy="use a .toml file")
        size = path.stat().st_size
        if size > MAX_BYTES:
            remedy = "move tables to CSV files in the same folder"
            raise ModelError(
                f"the file has {size} bytes, but at most {MAX_BYTES} are allowed", place=place, remedy=remedy
            )
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise ModelError("the file does not exist", place=place, remedy=_beside(path)) from None
    except (OSError, ValueError) as fault:
        reason = getattr(fault, "strerror", None) or str(fault)
        raise ModelError(
            f"the file cannot be read: {reason}", place=place, remedy="use a readable file"
        ) from None
    if len(data) > MAX_BYTES:
        raise ModelError(f"the file has more than {MAX_BYTES} bytes", place=place, remedy="use a model file")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        line = data.count(b"\n", 0, fault.start) + 1
        raise ModelError(
            f"the file is not a text file: byte {data[fault.start]:#04x} at offset {fault.start} is not UTF-8",
            place=Place(str(path), line),
            remedy="write the model as a TOML file in UTF-8",
        ) from None


def _beside(path: Path) -> str:
    """Return similar file names in the same folder, or the names of the packaged models."""
    packaged = [known.stem for known in _model_files()]
    try:
        beside = [other.name for other in path.parent.glob("*.toml")]
    except OSError:
        beside = []
    near = nearest(path.name, beside)
    return near if "did you mean" in near else "packaged models: " + ", ".join(packaged)


def _model_files() -> list[Path]:
    return sorted(models_folder().glob("*.toml"))
