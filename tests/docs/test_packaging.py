"""What packages, citations and workflows say of gtpin agrees with pyproject.toml."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

yaml = pytest.importorskip("yaml")
ROOT = Path(__file__).parents[2]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
WORKFLOW = ROOT / ".github" / "workflows" / "test.yml"
OF_CONDA = {"pin": "pinocchio"}
"""Names of distributions that conda-forge calls otherwise."""


def read(path: Path) -> Any:
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def test_the_citation_names_the_version_the_licence_and_the_paper() -> None:
    citation = read(ROOT / "CITATION.cff")
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()  # what the format requires
    assert (citation["version"], citation["license"]) == (PROJECT["version"], PROJECT["license"])
    assert "A Kinematic Error Model for a Parallel Gantry-Tau Manipulator" in [
        r["title"] for r in citation["references"]
    ]


def test_the_conda_recipe_needs_what_the_wheel_needs() -> None:
    recipe = read(ROOT / ".ci" / "conda" / "recipe.yaml")
    assert recipe["context"]["version"] == PROJECT["version"]
    needed = [re.split(r"(?=[<>=])", text, maxsplit=1) for text in PROJECT["dependencies"]]
    expected = [f"{OF_CONDA.get(name, name)} {bounds}" for name, bounds in needed]
    python, *others = recipe["requirements"]["run"]
    assert others == expected
    assert python == "python >=${{ python_min }}"
    assert f">={recipe['context']['python_min']}" == PROJECT["requires-python"]
    (command,) = recipe["build"]["python"]["entry_points"]
    assert command == f"gtpin = {PROJECT['scripts']['gtpin']}"


def test_the_workflow_tests_each_python_that_the_classifiers_name() -> None:
    matrix = read(WORKFLOW)["jobs"]["wheel"]["strategy"]["matrix"]
    classifiers = [text.removeprefix("Programming Language :: Python :: ") for text in PROJECT["classifiers"]]
    assert matrix["python"] == [text for text in classifiers if re.fullmatch(r"3\.\d+", text)]
    assert any(one["resolution"] == "lowest-direct" for one in matrix["include"])


def test_every_extra_is_on_the_page_of_the_installation() -> None:
    table = (ROOT / "docs" / "install.md").read_text(encoding="utf-8").split("| extra | for |")[1].split("\n\n")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) == set(PROJECT["optional-dependencies"])


def test_the_changelog_has_the_version() -> None:
    headings = re.findall(r"^## (.*)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert PROJECT["version"] in headings


def test_what_only_some_need_is_no_requirement() -> None:
    required = {re.split(r"[<>=]", text)[0] for text in PROJECT["dependencies"]}
    assert not required & {"pyarrow", "matplotlib", "plotly", "viser", "dask", "distributed", "mujoco"}


def test_the_files_that_start_first_are_files_of_tests() -> None:
    text = (ROOT / "tests" / "conftest.py").read_text(encoding="utf-8")
    long = re.findall(r'^    "(.+/test_.+\.py)",$', text, re.MULTILINE)
    assert len(long) > 10
    assert [name for name in long if not (ROOT / "tests" / name).is_file()] == []
