"""A small machine, and a folder of cases made by hand."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

import joblib
import pytest
from handmade import canned, cause, diagnosis, shifted, write_case

import gtpin.bench.blind.run
from gtpin.bench.simulator.case import Case, make_case


@pytest.fixture(scope="session")
def small() -> Case:
    """A dataset of 30 poses of a machine without effects, and 8 commands; only its files matter here."""
    return make_case(1, effects=[], poses=30, held_out=8, background=False)


@pytest.fixture
def cases(tmp_path: Path, small: Case) -> Path:
    """Seven cases made by hand, with truths; see ``test_a_folder_of_cases_is_scored_by_hand``."""
    folder = tmp_path / "given"
    folder.mkdir()
    alone = diagnosis("explained", cause("linearity@cart1"), explained_fraction=0.7, interval=(0.5, 0.8))
    # Off by 4 um before and 2 um after: three quarters of the gap's power go away.
    at = {"baseline": shifted(small.truth.T, 4e-6), "model": shifted(small.truth.T, 2e-6)}
    write_case(folder, "a", small, [("linearity", "cart1")], {"said": alone, "at": at})
    (folder / "a.truth.csv").write_text(_poses(small))
    ambiguous = diagnosis("ambiguous", cause("backlash@cart1", 0.6, servo_lag_AT_cart2=0.4))
    write_case(folder, "b", small, [("servo_lag", "cart2")], {"said": ambiguous})
    write_case(folder, "c", small, [], {"said": diagnosis("none")})
    write_case(folder, "d", small, [], {"said": diagnosis("ambiguous", cause("backlash@cart1", 0.8))})
    write_case(folder, "e", small, [("hose", "")], {"said": diagnosis("unknown")})
    two = diagnosis("explained", cause("linearity@cart1"), cause("rack_step@cart2"))
    write_case(folder, "f", small, [("linearity", "cart1"), ("zero_shift", "cart3")], {"said": two})
    write_case(folder, "g", small, [("tracker_scale", "frame")], "fails")
    return folder


def _poses(case: Case) -> str:
    rows = [f"{p},{x!r},{y!r},{z!r}" for p, (x, y, z) in zip(case.commands.pose, case.truth.T.tolist(), strict=True)]
    return "\n".join(["pose,x,y,z", *reversed(rows)]) + "\n"


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work that is not for a cluster is done in this process, and the diagnoses are those that lie in the datasets' folders."""
    real = gtpin.bench.blind.run.workers

    @contextlib.contextmanager
    def workers(cluster: str | None = None) -> Iterator[None]:
        with real(cluster) if cluster else joblib.parallel_config(backend="sequential"):
            yield

    monkeypatch.setattr(gtpin.bench.blind.run, "workers", workers)
    monkeypatch.setattr(gtpin.bench.blind.run, "diagnose_alone", canned)
