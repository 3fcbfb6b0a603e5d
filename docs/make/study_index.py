"""Write docs/studies/index.md from the first two sentences of each study, which are its question and its answer.

python docs/make/study_index.py
"""

from __future__ import annotations

from pathlib import Path

import count_prose

FOLDER = Path(__file__).parents[1] / "studies"
HEAD = """# Studies

Each study answers one question by measurement. The page of a study names the command that repeats the measurement.
"""
SECTIONS = {
    "Validation": (
        "random-models",
        "random-structures",
        "steady-states",
        "combined-forms",
        "faults-put-back",
        "guards",
        "restarts",
        "coupled-contacts",
        "impacts",
        "moreau",
        "limits-of-laws",
        "stability",
        "long-runs",
        "advice",
        "units",
    ),
    "Reliability": ("history", "steps", "survival", "sweeps", "fuzz"),
    "Speed": (
        "speed",
        "published-speed",
        "profile",
        "cost-of-stick",
        "chain",
        "repeated-runs",
        "event-costs",
    ),
    "Systems": ("blade-damper", "brake"),
    "A published study": ("he2026",),
}


def written() -> str:
    """Return the text of the index."""
    parts = [HEAD]
    for title, names in SECTIONS.items():
        rows = "".join(row(name) for name in names)
        parts.append(f"## {title}\n\n| study | question | answer |\n| --- | --- | --- |\n{rows}")
        parts.append(f"```{{toctree}}\n:hidden:\n:caption: {title}\n\n" + "\n".join(names) + "\n```\n")
    return "\n".join(parts)


def row(name: str) -> str:
    """Return the row of a study in its table."""
    text = (FOLDER / f"{name}.md").read_text(encoding="utf-8")
    title = text.split("\n", 1)[0].removeprefix("# ")
    question, answer = count_prose.sentences(count_prose.paragraphs(text)[0])[:2]
    return f"| [{title}]({name}.md) | {question} | {answer} |\n"


if __name__ == "__main__":
    (FOLDER / "index.md").write_text(written(), encoding="utf-8")
