"""What docs/benchmark.md says of the set and of the rivals is so: some cases are made and answered again."""

import json
import sys
from collections import Counter
from pathlib import Path

import pytest

from gtpin.bench.benchmark.answer import SCHEMA, Answer, figures, score_answers
from gtpin.bench.benchmark.public_set import CASES, PublicSet, make

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "benchmark.md").read_text(encoding="utf-8")
RECORD = json.loads((ROOT / "docs" / "figures" / "benchmark.json").read_text(encoding="utf-8"))
AGAIN = ("tau-tracker-07", "tau-range-11", "ur5-tracker-03", "fivebar-tracker-00")
ANSWERED = ("diagnosis", "best_single", "largest_score", "lasso", "sindy", "ridge", "geometry_only", "gaussian_process")


@pytest.fixture(scope="module")
def again(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Some cases, with the answers of all rivals that need no training and no other package."""
    folder = tmp_path_factory.mktemp("benchmark")
    drafts = PublicSet.read().drafts()
    for name in AGAIN:
        make(drafts[name], folder)
    sys.path.insert(0, str(ROOT / "examples" / "benchmark"))
    import run

    for name in AGAIN:
        for rival in ANSWERED:
            run.let_answer(rival, folder / CASES / name, folder / "answers")
    return folder


@pytest.mark.parametrize("rival", ANSWERED)
def test_rivals_answer_as_the_record_says(again: Path, rival: str) -> None:
    public = PublicSet.read()
    scored = score_answers(public, again, again / "answers" / rival, AGAIN)
    same = [list(scored[name].judged.said.names) == RECORD["named"][rival][name] for name in AGAIN]
    assert sum(same) >= len(AGAIN) - 1, "measure again: examples/benchmark/run.py and record.py"
    assert figures(scored.values())["error of prediction, units of the noise"].of == len(AGAIN)


def test_the_page_counts_the_cases_as_they_are(tmp_path: Path) -> None:
    public = PublicSet.read()
    kinds = Counter(draft.kind for draft in public.drafts().values())
    words = (
        f"{kinds['one']} cases have one effect of the catalogue, {kinds['power']} one effect that is small on purpose",
        f"{kinds['none']} none, {kinds['unlisted']} one that is in no catalogue",
        f"{kinds['two']} two, {kinds['three']} three, {kinds['known_and_unlisted']} a listed and an unlisted one, "
        f"{kinds['rough']} are rough",
        f"{RECORD['rivals']['diagnosis']['one effect, E > 63: detected']['of']} have E > 63",
        f"{RECORD['rivals']['diagnosis']['one effect, D > 63: strict']['of']} have D > 63",
    )
    text = " ".join(PAGE.split())
    assert [phrase for phrase in words if phrase not in text] == []
    for block in public.blocks:
        assert f"| `{block.name}` |" in PAGE


def test_the_answer_on_the_page_is_one(tmp_path: Path) -> None:
    text = PAGE.split("```json\n")[1].split("```")[0]
    (tmp_path / "a.json").write_text(text)
    answer = Answer.read(tmp_path / "a.json")
    assert answer.schema_ == SCHEMA
    assert answer.statement.names == ("backlash@cart1",)
