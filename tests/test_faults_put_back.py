"""The edits that bring mended faults back still apply; `docs/studies/faults_put_back.py` runs their trials."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest
from reference.combined.further import TRIALS
from reference.put_back.copies import ROOT, DoesNotApply, Edit, Fault, faults, put_back


@pytest.mark.parametrize("fault", faults(), ids=lambda fault: fault.name)
def test_a_fault_can_be_put_back(fault: Fault, tmp_path: Path) -> None:
    for edit in fault.edits:
        copy = tmp_path / edit.file
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes((ROOT / "hybridsim" / edit.file).read_bytes())
    put_back(fault, tmp_path)
    for edit in fault.edits:
        compile((tmp_path / edit.file).read_text(encoding="utf-8"), edit.file, "exec")
    assert fault.trial in (*TRIALS, "test")
    assert (ROOT / fault.test.partition("::")[0]).exists()


def test_an_edit_that_no_longer_applies_is_named(tmp_path: Path) -> None:
    (tmp_path / "one.py").write_text("a = 1\n", encoding="utf-8")
    fault = Fault("lost", "It is lost.", "", (Edit("one.py", "b = 2", "b = 3"),))
    with pytest.raises(DoesNotApply, match=r"lost cannot be put back: one\.py has 0 times 'b = 2'"):
        put_back(fault, tmp_path)


@pytest.mark.parametrize(
    "trial", ["steady states", "linearizations", "poles", "mechanical systems", "moving bases"]
)
def test_the_package_stands_the_trials(trial: str) -> None:
    found = Counter(record["kind"] for number in range(8) for record in TRIALS[trial](number))
    assert found == {}
