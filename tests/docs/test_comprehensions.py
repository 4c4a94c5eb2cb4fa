"""No comprehension of a function binds a name that another of its comprehensions reads from the module.

Python 3.12.1 takes the second for the first, and raises UnboundLocalError; 3.11 and 3.13 do not.
"""

import ast
from pathlib import Path

import pytest

import gtpin

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
