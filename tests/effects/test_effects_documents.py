"""Every effect has a section on the page of the effects, and a docstring that gives its parameters as the code has them."""

import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from effect_places import ARM, ARM_FIT, EFFECTS, FIT, ROBOT, SETTINGS, some

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "effects"
PAGE = (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")
SECTIONS = {part.split("`")[1]: part for part in PAGE.split("\n## ")[1:] if part.startswith("<a id=")}
LARGEST = 60_000


def units(name: str) -> dict[str, str]:
    """Of all parameters at all sites of the Gantry-Tau; of an arm where it has none."""
    effect = EFFECTS[name]
    if not effect.sites(ROBOT):
        found = [effect.parameters(some(name, s, ARM_FIT), None) for s in effect.sites(ARM)]
    else:
        found = [effect.parameters(some(name, s, FIT), SETTINGS.get(name)) for s in effect.sites(ROBOT)]
    return {re.sub(r"\[\d+\]", "[k]", parameter): unit for one in found for parameter, (_, unit) in one.items()}


@pytest.mark.parametrize("name", EFFECTS)
def test_a_section_has_the_effects_title_and_what_it_looks_like(name: str) -> None:
    assert name in SECTIONS, f"docs/effects.md has no section for {name}"
    title, section = SECTIONS[name].split("\n", 1)
    assert title == f'<a id="{name}"></a>`{name}`: {EFFECTS[name].title.split(" (")[0]}'
    for part in ("Mistaken for", "How to distinguish"):
        assert f"**{part}.**" in section


@pytest.mark.parametrize("name", EFFECTS)
def test_a_docstring_has_the_parameters_their_units_and_the_typical_size(name: str) -> None:
    text = " ".join(inspect.getdoc(type(EFFECTS[name])).split())
    parameters = text[text.index("Parameters: ") :]
    named = set(re.findall(r"``([\w\[\]]+)``", parameters))
    named |= {f"{one.rsplit('_', 1)[0]}{rest}" for one in named for rest in named if rest.startswith("_")}
    found = units(name)
    assert found.keys() <= named
    assert [
        unit for unit in found.values() if not re.search(rf"(?<![\w/(]){re.escape(unit)}(?![\w/(])", parameters)
    ] == []
    assert re.search(r"Typical sizes?\b.* \d", text)


def test_the_table_lists_every_effect_with_its_covariate() -> None:
    rows = dict(re.findall(r"^\| \[`(\w+)`\]\(#\1\) (\|.*)$", PAGE, re.MULTILINE))
    assert list(rows) == list(EFFECTS)
    for name, effect in EFFECTS.items():
        if not effect.sites(ROBOT):
            assert "joints of robots without rods" in rows[name]
            continue
        site = effect.sites(ROBOT)[0]
        assert f"`{site}`" in rows[name]
        for covariate in effect.covariates(ROBOT, site):
            assert f"`{covariate}`" in rows[name]


def test_every_section_has_its_picture() -> None:
    for name in EFFECTS:
        assert f"(effects/{name}.svg)" in SECTIONS[name]
        assert (PICTURES / f"{name}.svg").exists(), f"python examples/effects/pictures.py docs/effects {name}"
        assert 1_000 < (PICTURES / f"{name}.svg").stat().st_size < LARGEST


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "some_names"),
    [("pictures.py", ["backlash", "joint_clearance", "frame_shift"]), ("chain_pictures.py", ["axis_motion"])],
)
def test_the_script_draws_pictures_anew(script: str, some_names: list[str], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    program = ROOT / "examples" / "effects" / script
    subprocess.run(
        [sys.executable, str(program), str(tmp_path), *some_names],
        check=True,
        capture_output=True,
        env={**os.environ, "MPLBACKEND": "agg"},
    )
    drawn = {path.stem: path.stat().st_size for path in tmp_path.glob("*.svg")}
    assert set(drawn) == set(some_names)
    assert max(drawn.values()) < LARGEST
