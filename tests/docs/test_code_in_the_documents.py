"""Every block of code in README and docs is right: Python runs, commands parse, TOML, XML and JSON read; the pages build."""

import json
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import typer
from defusedxml import ElementTree

import gtpin.cli

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))]


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [p for p in PAGES if "```python" in p.read_text(encoding="utf-8")], ids=lambda p: p.name
)
def test_the_python_of_a_page_runs_from_top_to_bottom(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    code = "\n".join(re.findall(r"^```python\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL))
    exec(compile(code, str(page), "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out  # the pages show results, so silence would mean that nothing ran


def blocks(page: Path, *languages: str) -> list[str]:
    """The blocks of code of a page, indented ones too, without their indentation."""
    kinds = "|".join(languages)
    found = re.findall(
        rf"^( *)```(?:{kinds})\n(.*?)^ *```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    return [re.sub(rf"^{indentation}", "", code, flags=re.MULTILINE) for indentation, code in found]


def called(group: Any, words: list[str]) -> list[str]:
    """The names of the command of a line, and of its groups; raises where an option or an argument is not known."""
    name, *arguments = words
    if hasattr(group.commands[name], "commands"):
        return [name, *called(group.commands[name], arguments)]
    group.commands[name].make_context(name, arguments)
    return [name]


def test_every_command_in_the_documents_is_one_that_gtpin_takes() -> None:
    seen: set[str] = set()
    group = typer.main.get_command(gtpin.cli.app)
    for page in PAGES:
        for line in "".join(blocks(page, "sh")).replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if "gtpin" not in {Path(word).name for word in words}:
                continue
            start = next(i for i, word in enumerate(words) if Path(word).name == "gtpin")
            seen |= {*called(group, words[start + 1 :])}
    assert seen >= {"demo", "diagnose", "calibrate", "predict", "simulate"}


def test_every_block_of_toml_json_and_xml_reads() -> None:
    readers = {"toml": tomllib.loads, "json": json.loads, "xml": lambda t: ElementTree.fromstring(f"<all>{t}</all>")}
    assert sum(len(blocks(page, *readers)) for page in PAGES) > 2
    for language, read in readers.items():
        for page in PAGES:
            for code in blocks(page, language):
                read(code)


@pytest.mark.slow
def test_the_pages_build_without_a_warning_and_are_all_in_the_navigation(tmp_path: Path) -> None:
    pytest.importorskip("mkdocs")
    pytest.importorskip("mkdocstrings")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", ROOT / "docs/site/mkdocs.yml", "-d", tmp_path]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    told = (tmp_path / "python.html").read_text(encoding="utf-8")
    assert "Probability of naming a cause where there is none" in told


def test_every_link_between_the_documents_leads_somewhere() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\((?!https?:|#)([^)#]+)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_readme_shows_the_package_in_about_thirty_lines() -> None:
    code = re.findall(
        r"^```python\n(.*?)^```$", (ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    assert sum(bool(line.strip()) for line in "".join(code).splitlines()) <= 32
