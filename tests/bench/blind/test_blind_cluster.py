"""The same work on a dask cluster: a scheduler and two workers on this machine."""

from pathlib import Path

import pytest
from handmade import Quiet, canned

from gtpin.bench.blind.run import check_given
from gtpin.bench.blind.score import score
from gtpin.bench.blind.spread import spread, workers
from gtpin.errors import GtpinError

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.filterwarnings("ignore")  # dask's own


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_a_cluster_gives_the_same_score(cases: Path, tmp_path: Path) -> None:
    local = check_given(tmp_path / "local", cases, Quiet())
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        assert address.startswith("tcp://")
        far = check_given(tmp_path / "far", cases, Quiet(), address)
    assert score(far.cases) == score(local.cases)


@pytest.mark.slow
def test_a_scheduler_that_does_not_answer_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gtpin.bench.blind.spread.CONNECT", 1)
    for address in ("tcp://127.0.0.1:9", "nonsense"):
        with pytest.raises(GtpinError, match="no dask scheduler at"), workers(address):
            spread(canned, [], lambda _: (), lambda *_: None)


def test_a_cluster_without_workers_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    class Lonely:
        """Answers for a scheduler that has no workers."""

        def __init__(self, address: str, timeout: float) -> None:
            self.closed = False

        def __enter__(self) -> "Lonely":
            return self

        def __exit__(self, *_: object) -> None:
            self.closed = True

        def scheduler_info(self) -> dict[str, dict[str, object]]:
            return {"workers": {}}

    monkeypatch.setattr(distributed, "Client", Lonely)
    with pytest.raises(GtpinError, match="has no workers"), workers("tcp://127.0.0.1:8786"):
        pass
