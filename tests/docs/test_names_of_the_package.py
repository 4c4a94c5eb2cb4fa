"""What ``import gtpin`` offers: every name, when it is first used; and where its warnings point."""

import ast
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import gtpin
from gtpin.errors import GtpinWarning, warn

SOURCE = Path(gtpin.__file__)


def test_every_name_is_found_and_is_what_type_checkers_see():
    (block,) = [node for node in ast.parse(SOURCE.read_text()).body if isinstance(node, ast.If)]
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    seen = {alias.name: node.module for node in imports for alias in node.names}
    assert seen == gtpin._HOME
    assert {*seen, "__version__"} == set(gtpin.__all__)
    assert set(gtpin.__all__) <= set(dir(gtpin))
    for name in seen:
        assert getattr(gtpin, name).__name__ == name


@pytest.mark.slow
def test_parts_of_the_package_are_found_and_nothing_else():
    code = (
        "import gtpin; print(gtpin.errors.GtpinError.__name__, gtpin.data.Dataset.__name__, hasattr(gtpin, 'gremlin'))"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=SOURCE.parents[1], capture_output=True, text=True, check=True
    )
    assert ran.stdout == "GtpinError Dataset False\n"
    with pytest.raises(ImportError):
        from gtpin import gremlin  # noqa: F401


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "unneeded"),
    [
        ("errors", {"numpy", "scipy", "pandas", "pyarrow", "pinocchio", "pydantic"}),
        ("Dataset", {"scipy", "pandas", "pyarrow", "pinocchio"}),
        ("load_robot", {"scipy.stats", "pandas", "pyarrow"}),
        ("Model", {"scipy.stats", "pandas", "pyarrow"}),
        ("calibrate", {"scipy.stats", "pandas", "pyarrow", "matplotlib", "plotly", "joblib"}),
        ("diagnose", {"scipy.stats", "pandas", "pyarrow", "matplotlib", "plotly", "joblib"}),
    ],
)
def test_what_takes_long_to_import_waits_until_it_is_needed(name: str, unneeded: set[str]):
    code = f"import sys, gtpin; gtpin.{name}; print(*sys.modules)"
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=SOURCE.parents[1], capture_output=True, text=True, check=True
    )
    assert unneeded & set(ran.stdout.split()) == set()


def test_a_warning_names_the_line_that_called_gtpin(tmp_path):
    dataset = gtpin.Dataset(
        "gantry_tau", ["a", "b"], np.zeros((2, 3)), np.zeros((2, 3)), covariates={"load": [1.0, 1.0]}
    )
    dataset.write(tmp_path / "set")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        gtpin.Dataset.read(tmp_path / "set")  # the line
    (warning,) = caught
    assert warning.category is GtpinWarning
    assert warning.filename == __file__
    assert Path(__file__).read_text().splitlines()[warning.lineno - 1].endswith("# the line")


def test_all_warnings_of_the_package_are_given_so():
    assert [file.name for file in SOURCE.parent.rglob("*.py") if "warnings.warn(" in file.read_text()] == []


def test_a_warning_is_shown_once_for_each_line_by_default():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        for _ in range(3):
            warn("look")
    assert [str(warning.message) for warning in caught] == ["look"]


ROOT = Path(gtpin.__file__).parent
KINDS = (ast.ListComp, ast.SetComp, ast.DictComp)
"""What Python 3.12 compiles into the function around it."""


def clashes(source: str) -> set[str]:
    """Names of a module's own that one comprehension of a function binds and another reads."""
    tree = ast.parse(source)
    own = {node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    imports = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    own |= {alias.asname or alias.name for node in imports for alias in node.names}
    found = set()
    for function in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
        comprehensions = [node for node in ast.walk(function) if isinstance(node, KINDS)]
        bound = [names(comprehension, ast.Store) for comprehension in comprehensions]
        read = [names(comprehension, ast.Load) for comprehension in comprehensions]
        found |= {name for one in bound for b, r in zip(bound, read, strict=True) for name in one & r - b & own}
    return found


def names(node: ast.AST, context: type[ast.expr_context]) -> set[str]:
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, context)}


def test_the_clash_is_recognised() -> None:
    assert clashes("def g(): pass\ndef f(x):\n    a = [g for g in x]\n    return a, [g(y) for y in x]") == {"g"}
    assert not clashes("def g(): pass\ndef f(x):\n    a = [h for h in x]\n    return a, [g(y) for y in x]")


@pytest.mark.slow
def test_no_module_has_such_a_clash() -> None:
    assert not {file: found for file in ROOT.rglob("*.py") if (found := clashes(file.read_text(encoding="utf-8")))}
