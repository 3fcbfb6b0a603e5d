"""What README and docs show is true: Python runs, model files are models, links lead somewhere."""

from __future__ import annotations

import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import fresh
import pytest

import hybridsim as hs

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
IMAGES = (ROOT / "docs" / "images").resolve()
PAGES = [README, ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]


def blocks(page: Path, language: str) -> list[str]:
    """The blocks of code in a language."""
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize(
    ("page", "fewest"),
    [
        ("../README.md", 3),
        ("reference/python.md", 20),
        ("reference/asking.md", 11),
        ("how-to/questions.md", 9),
        ("how-to/choose-an-integrator.md", 5),
        ("how-to/relays.md", 8),
        ("how-to/impacts.md", 8),
        ("how-to/compare-laws.md", 8),
        ("how-to/squeal.md", 6),
        ("how-to/draw-a-mechanism.md", 1),
        ("how-to/report-a-run.md", 1),
        ("how-to/measured-input.md", 4),
        ("how-to/step-a-simulation.md", 9),
        ("how-to/test-your-integrator.md", 7),
        ("tutorials/first-stick-slip.md", 6),
        ("tutorials/compare-integrators.md", 2),
        ("tutorials/limit-cycle.md", 7),
        ("tutorials/cheat-sheet.md", 7),
        ("tutorials/coming-from.md", 2),
    ],
)
def test_a_page_prints_what_it_says(page: str, fewest: int, tmp_path: Path) -> None:
    """Its examples in order; behind each print stands, as a comment, what it prints."""
    code = "\n".join(blocks(ROOT / "docs" / page, "python"))
    done = fresh.run(code, folder=tmp_path, is_strict=True)
    assert done.returncode == 0, done.stderr
    said = re.findall(r"^ *print\(.*\)  # (.+)$", code, re.MULTILINE)
    assert len(said) == code.count("print(") >= fewest
    assert done.stdout.splitlines() == said


def test_the_page_on_measurements_prints_what_it_says(tmp_path: Path) -> None:
    """The page also prints two tables, of the fit and of the laws."""
    code = "\n".join(blocks(ROOT / "docs" / "how-to" / "fit-measurements.md", "python"))
    done = fresh.run(code, folder=tmp_path, is_strict=True)
    assert done.returncode == 0, done.stderr
    said = re.findall(r"^ *print\(.*\)  # (.+)$", code, re.MULTILINE)
    assert len(said) == 3
    assert [line for line in done.stdout.splitlines() if line in said] == said


def test_the_model_shown_is_the_model_shipped() -> None:
    (shown,) = blocks(README, "toml")
    model, shipped = hs.Model.from_toml(shown), hs.load("dfcs")
    assert model.states == shipped.states
    assert model.contacts == shipped.contacts
    assert model.parameter_values() == shipped.parameter_values()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_models_shown_are_models(page: Path) -> None:
    for text in blocks(page, "toml"):
        if "schema" in text:
            hs.Model.from_toml(text)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8"))
    places = [(page.parent / target).resolve() for target in targets if "://" not in target]
    if not IMAGES.exists():  # a source distribution leaves the pictures out
        places = [place for place in places if not place.is_relative_to(IMAGES)]
    assert [place for place in places if not place.exists()] == []


def test_the_page_on_own_laws_runs_and_keeps_them_short(tmp_path: Path) -> None:
    """The declarations are below 30 lines and run; the Python form is the same model."""
    page = ROOT / "docs" / "how-to" / "own-law.md"
    solutions = []
    for text in blocks(page, "toml"):
        assert len(text.splitlines()) < 30
        model = hs.Model.from_toml(text)
        solutions.append(hs.simulate(model, (0, model.duration_value() or 1)))
    assert [sol.status for sol in solutions] == ["finished"] * 5
    code = "\n".join(blocks(page, "python"))
    script = tmp_path / "shown.py"
    script.write_text(code.replace("fading.png", (tmp_path / "fading.png").as_posix()), encoding="utf-8")
    sol = runpy.run_path(str(script))["sol"]
    assert (tmp_path / "fading.png").stat().st_size > 10_000
    assert sol(12.0) == pytest.approx(solutions[2](12.0), rel=1e-9)


def test_the_page_on_many_contacts_runs_and_is_short(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    shown = blocks(ROOT / "docs" / "how-to" / "many-contacts.md", "python")
    assert [len(code.splitlines()) < 30 for code in shown] == [True] * 7
    script = tmp_path / "shown.py"
    script.write_text("\n".join(shown), encoding="utf-8")
    runpy.run_path(str(script))
    said = re.findall(r"^print\(.*\)  # (.+)$", "\n".join(shown), re.MULTILINE)
    assert capsys.readouterr().out.splitlines() == said
    assert len(said) == 11
    first = tmp_path / "first.py"
    first.write_text(
        shown[0] + 'hs.simulate(system.to_model(), (0, 1), integrator="dop853")', encoding="utf-8"
    )
    with pytest.raises(hs.ModelError, match="not independent"):  # as the page says of its first example
        runpy.run_path(str(first))


def test_a_long_run_goes_on(tmp_path: Path) -> None:
    code = "\n".join(blocks(ROOT / "docs" / "how-to" / "long-runs.md", "python"))
    done = fresh.run(code, folder=tmp_path, is_strict=True)
    assert done.returncode == 0, done.stderr
    status, message = done.stdout.splitlines()
    assert status == "limit" and "500 are allowed" in message


def test_the_event_trace_is_as_shown(tmp_path: Path) -> None:
    page = ROOT / "docs" / "how-to" / "event-trace.md"
    code = "\n".join(blocks(page, "python"))
    done = fresh.run(code, folder=tmp_path, is_strict=True)
    assert done.returncode == 0, done.stderr
    shown = "".join(blocks(page, "text"))
    rounded = r"within rounding \(\S+\)"  # of another machine's sine
    assert re.sub(rounded, "", done.stdout) == re.sub(rounded, "", shown)


def test_the_page_on_sweeps_runs_on_threads_processes_and_a_cluster(tmp_path: Path) -> None:
    """Warnings are not errors here: a cluster has threads and event loops of its own."""
    code = "\n".join(blocks(ROOT / "docs" / "how-to" / "sweeps.md", "python"))
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    threads, processes, cluster = done.stdout.splitlines()
    assert threads.startswith("threads") and threads.endswith("(4, 2) True")
    assert (processes, cluster) == ("ProcessPoolExecutor (2) True", "ClientExecutor (2) True")


def test_every_study_says_what_makes_its_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each page of a study is in the table, each script that a command names is there, each page gets its foot."""
    monkeypatch.syspath_prepend(ROOT / "docs" / "make")
    figures = runpy.run_path(str(ROOT / "docs" / "make" / "figures.py"))
    table = figures["table"]()
    studies = {f"studies/{page.name}" for page in (ROOT / "docs" / "studies").glob("*.md")}
    assert studies - {"studies/index.md"} <= set(table)
    assert all((ROOT / "docs" / page).is_file() for page in table)
    scripts = re.findall(r"docs/(?:studies|make)/\w+\.py", str(table))
    assert len(scripts) > 20
    assert all((ROOT / script).is_file() for script in scripts)
    assert "docs/studies/speed.py" in figures["footer"]("studies/speed.md")
    assert figures["footer"]("tutorials/index.md") == ""


def test_search_words_belong_to_headings_of_pages() -> None:
    """Each page and heading of the table exists, and no two sections have one word, so that a search is clear."""
    search = runpy.run_path(str(ROOT / "docs" / "make" / "search_words.py"))
    table = search["words"]()
    for page in table:
        text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
        assert search["add"](page, text).count("```{index}") == sum(map(len, table[page].values()))
    words = [word for headings in table.values() for found in headings.values() for word in found]
    assert len(words) == len(set(words)) and all(word == word.lower() for word in words)
    with pytest.raises(ValueError, match="has 0 headings 'Install"):
        search["add"]("tutorials/faq", "# FAQ")


def test_figures_depend_on_what_their_commands_use() -> None:
    """A page is older where a module that its command reaches has changed, through functions and packages too."""
    used = runpy.run_path(str(ROOT / "docs" / "make" / "used_sources.py"))["modules_of"]

    def reached(command: str) -> set[str]:
        return {path.relative_to(ROOT / "hybridsim").as_posix() for path in used(command)}

    speed, blade = reached("python docs/studies/speed.py"), reached("python docs/studies/blade_damper.py")
    kernels = {
        "integrators/closed_form/segments.py",
        "engine/linear/motion.py",
        "integrators/closed_form/method.py",
        "preparation.py",
    }
    asked = {"analysis/steady/steady_state.py", "analysis/sweep/collected.py"}
    assert kernels <= speed and kernels | asked <= blade
    assert not asked & speed and not any(name.startswith("cli/") for name in speed)
    atlas = reached("hybridsim atlas --out docs/atlas")
    assert {"cli/commands/atlas.py", "cli/entry.py"} <= atlas
    assert "cli/commands/advise.py" not in atlas
    # what a package makes of what it imports, and not only what it hands on
    assert "testing/catalogue/impacts.py" in atlas
    assert "reference/closed_forms/affine.py" in reached("hybridsim compare --suite")


def test_one_changed_coefficient_makes_the_pages_that_use_it_older(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The foot of a page names the folder that changed, and stays as it is for comments, docstrings and other code."""
    for name in ("hybridsim", "docs/make", "docs/studies"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__", "*.png"))
    for name in ("glossary.md", "figures.toml"):
        shutil.copy(ROOT / "docs" / name, tmp_path / "docs" / name)
    monkeypatch.syspath_prepend(tmp_path / "docs" / "make")
    for module in ("source_keys", "used_sources"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    figures = runpy.run_path(str(tmp_path / "docs" / "make" / "figures.py"))
    for module in ("source_keys", "used_sources"):
        del sys.modules[module]  # of the copy
    monkeypatch.setitem(figures["note"].__globals__, "commit", lambda: "abcdef0123")
    foot, page, rest = figures["footer"], "studies/speed.md", "studies/blade-damper.md"
    for one in (page, rest):
        figures["note"](one, 1.0)

    def change(name: str, old: str, new: str) -> None:
        path = tmp_path / "hybridsim" / name
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new, 1), encoding="utf-8")

    assert "commit abcdef0123" in foot(page) and foot(page).endswith("has not changed since.\n")
    change("integrators/runge_kutta/tsit5.py", '"""', '"""A method with another docstring. ')
    assert foot(page).endswith("has not changed since.\n")
    change("analysis/steady/settling.py", "0.25 * duration", "0.26 * duration")
    assert foot(page).endswith("has not changed since.\n")
    assert foot(rest).endswith("This has changed since: `analysis/steady`.\n")
    change("integrators/runge_kutta/tsit5.py", "0.161", "0.162")
    assert foot(page).endswith("This has changed since: `integrators/runge_kutta`.\n")


def test_a_key_of_sources_is_that_of_what_they_do() -> None:
    """Files, comments, docstrings, texts of errors and imports do not make a figure older; one coefficient does."""
    key = runpy.run_path(str(ROOT / "docs" / "make" / "source_keys.py"))["key"]
    law = b"def force(v):\n    if v < 0:\n        raise ValueError('below')\n    return 0.3 * v\n"
    flow = b"def flow(x):\n    return force(x) - x\n"
    alike = [
        [law + flow],
        [flow, law],
        [b"# how it moves\n" + law.replace(b"):\n", b'):\n    """It moves."""\n', 1), flow],
        [law.replace(b"below", b"it is below"), b"from hybridsim.engine.laws import force\n" + flow],
        [law, b"from hybridsim.engine import laws\n" + flow.replace(b"force", b"laws.force")],
    ]
    assert {key(modules, []) for modules in alike} == {key([law, flow], [])}
    other = [
        [law.replace(b"0.3", b"0.30000000000000004"), flow],
        [law.replace(b"ValueError", b"KeyError"), flow],
    ]
    assert all(key(modules, []) != key([law, flow], []) for modules in other)
    assert key([law, flow], [b"mu = 0.3"]) != key([law, flow], [b"mu = 0.4"])


def test_the_pages_of_the_atlas_are_those_that_its_data_give() -> None:
    """After a change of the texts of scenes: python docs/make/atlas_pages.py."""
    written = runpy.run_path(str(ROOT / "docs" / "make" / "atlas_pages.py"))["written"]()
    folder = ROOT / "docs" / "atlas"
    assert set(written) == {page.name for page in folder.glob("*.md")}
    old = [name for name, text in written.items() if (folder / name).read_text(encoding="utf-8") != text]
    assert not old, f"{', '.join(old)}: run python docs/make/atlas_pages.py"
