"""Every block of code in README and docs is right: Python runs, commands parse, TOML, XML and JSON read; and the page of
symptoms has every effect, that of limitations the page that shows each."""

import json
import re
import shlex
import tomllib
from pathlib import Path
from typing import Any

import pytest
import typer
from defusedxml import ElementTree

import gtpin
import gtpin.cli
from gtpin.commands.registry import LazyCommand
from gtpin.effects.rack import RackPeriodic

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))]
OTHERS = ("klippy/", "optimize_robot_geometry.py")
"""Beginnings of the names of other projects' files."""
SYMPTOMS = (ROOT / "docs" / "symptoms.md").read_text(encoding="utf-8")
LIMITATIONS = (ROOT / "docs" / "limitations.md").read_text(encoding="utf-8")
COMMANDS = [line for line in re.findall(r"`(gtpin [^`]+)`", SYMPTOMS) if " -o " in line or "view " in line]


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
    command = group.commands[name]
    command = command.imported() if isinstance(command, LazyCommand) else command
    if hasattr(command, "commands"):
        return [name, *called(command, arguments)]
    command.make_context(name, arguments)
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


def test_every_link_between_the_documents_leads_somewhere() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\((?!https?:|#)([^)#]+)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_the_files_that_pages_name_exist() -> None:
    there = [f"/{file.relative_to(ROOT).as_posix()}" for file in ROOT.rglob("*.py") if ".venv" not in file.parts]
    for page in PAGES:
        for name in re.findall(r"`([\w/]+\.py)`", page.read_text(encoding="utf-8")):
            known = name.startswith(OTHERS) or any(file.endswith(f"/{name}") for file in there)
            assert known, f"{page.name}: {name}"


def test_readme_shows_the_package_in_about_thirty_lines() -> None:
    code = re.findall(
        r"^```python\n(.*?)^```$", (ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    assert sum(bool(line.strip()) for line in "".join(code).splitlines()) <= 32


def test_the_page_of_symptoms_has_the_commands_of_a_calibration_engineer() -> None:
    assert len(COMMANDS) > 15
    group = typer.main.get_command(gtpin.cli.app)
    names = {called(group, shlex.split(line)[1:])[0] for line in COMMANDS}
    wanted = {
        "diagnose",
        "calibrate",
        "import",
        "plan",
        "sensitivity",
        "predict",
        "view",
        "export",
        "simulate",
        "blind",
    }
    assert names >= wanted
    assert {"--against", "--history", "--hold-out", "--exclude"} <= set(shlex.split(" ".join(COMMANDS)))


def test_every_effect_of_the_catalogue_has_a_symptom() -> None:
    linked = set(re.findall(r"\[`(\w+)`\]\(effects\.md#\1\)", SYMPTOMS))
    assert linked == {effect.id for effect in gtpin.catalogue()}


def test_every_limitation_names_the_page_that_shows_it() -> None:
    rows = [line for line in LIMITATIONS.splitlines() if line.startswith("| ") and not line.startswith("| limitation")]
    assert len(rows) > 20
    for row in rows:
        _, limitation, where, _ = row.split("|")
        assert limitation.strip()
        assert re.search(r"\]\((\w+/)*\w+\.md", where), row


def test_the_largest_number_of_lines_is_the_codes() -> None:
    assert f"at most {RackPeriodic.most_values} for each joint" in LIMITATIONS


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ("diagnose a -o b --agianst c", "agianst"),
        ("plan a --poses 4 -o b", "purpose"),
        ("mend a", "mend"),
        ("import clipper-delta a -o b", "clipper-delta"),
    ],
)
def test_a_wrong_command_would_be_noticed(wrong: str, why: str) -> None:
    with pytest.raises(Exception, match=why):
        called(typer.main.get_command(gtpin.cli.app), shlex.split(wrong))


def test_the_folders_that_pages_name_exist() -> None:
    named = {
        (page.name, name)
        for page in PAGES
        for name in re.findall(r"`((?:gtpin|examples|tests)/[\w/]*/)`", page.read_text("utf-8"))
    }
    assert len(named) > 3
    assert sorted(one for one in named if not (ROOT / one[1]).is_dir()) == []
