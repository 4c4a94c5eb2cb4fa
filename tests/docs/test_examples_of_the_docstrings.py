"""Every public name has an example, and it gives what it says."""

import doctest
import warnings
from pathlib import Path

import pytest

import gtpin
from gtpin.bench.simulator import make_case

pytestmark = pytest.mark.slow

NAMES = [name for name in gtpin.__all__ if name != "__version__"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the dataset ``measured`` of a virtual machine whose drive 1 has backlash."""
    path = tmp_path_factory.mktemp("examples")
    make_case(3, effects=[("backlash", "cart1")], noncentrality=1500.0, poses=60).dataset.save(path / "measured")
    return path


@pytest.mark.parametrize("name", NAMES)
def test_the_example_of_a_public_name_gives_what_it_says(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    text = getattr(gtpin, name).__doc__ or ""
    example = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    assert example.examples, f"gtpin.{name} has no example"
    said: list[str] = []
    with warnings.catch_warnings():
        result = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(example, out=said.append)
    assert result.failed == 0, "".join(said)
