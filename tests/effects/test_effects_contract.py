"""The catalogue is the contract's: ids, sites, what each needs, names and units of what it says."""

import ast
import doctest
import importlib
import inspect
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from effect_places import (
    EFFECTS,
    FIT,
    PLACES,
    ROBOT,
    SEEN,
    SETTINGS,
    Floats,
    active,
    arm_with,
    basis,
    drawn,
    moved,
    operating_points,
    some,
)

import gtpin
from gtpin.data import Driver
from gtpin.effects.catalogue import OWN
from gtpin.effects.driver import DriverColumn, DriverEffect
from gtpin.effects.modulation import MODULATION
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.tracks import TIPS
from gtpin.effects.untestable import Untestable

CARTS = ("cart1", "cart2", "cart3")
LINKS = ("link1", "link2a", "link2b", "link3a", "link3b", "link3c")
TABLE = {
    "encoder_scale": CARTS,
    "linearity": CARTS,
    "rack_periodic": CARTS,
    "rack_step": CARTS,
    "zero_shift": CARTS,
    "backlash": CARTS,
    "servo_lag": CARTS,
    "cross_coupling": CARTS,
    "straightness": CARTS,
    "cart_rotation": CARTS,
    "cart_compliance": CARTS,
    "link_compliance": ("arm", *LINKS),
    "joint_clearance": LINKS,
    "joint_runout": LINKS,
    "thermal_links": ("arm", *LINKS),
    "thermal_track": CARTS,
    "tracker_drift": ("frame",),
    "frame_shift": ("frame",),
    "tracker_scale": ("frame",),
    "target_offset": ("platform",),
    "target_drift": ("platform",),
    "target_shift": ("platform",),
}
NEEDED = {
    "zero_shift": "session",
    "backlash": "approach2",
    "servo_lag": "speed2",
    "thermal_links": "temp_link",
    "thermal_track": "temp_frame",
    "tracker_drift": "time",
    "frame_shift": "session",
    "target_drift": "time",
    "target_shift": "session",
}
UNITS = {"m", "rad", "s", "m/m", "m/N", "rad/(N m)", "1/K", "m/K"}


def of_rows(at: OperatingPoints, rows: Floats) -> OperatingPoints:
    covariates = {name: values[rows] for name, values in at.covariates.items()}
    return replace(at, q=at.q[rows], poses=at.poses[rows], covariates=covariates)


def second(name: str) -> str:
    sites = EFFECTS[name].sites(ROBOT)
    return sites[min(1, len(sites) - 1)]


def test_the_effects_of_the_table_are_there_with_their_sites() -> None:
    assert {name: effect.sites(ROBOT) for name, effect in EFFECTS.items() if name in TABLE} == TABLE


@pytest.mark.parametrize("name", TABLE)
def test_an_effect_needs_the_covariate_that_it_goes_with_and_is_untestable_without(name: str) -> None:
    effect, site = EFFECTS[name], second(name)
    assert effect.covariates(ROBOT, site) == ((NEEDED[name],) if name in NEEDED else ())
    assert effect.untestable(FIT, site) is None
    if name in NEEDED:
        rest = {n: values for n, values in FIT.covariates.items() if n != NEEDED[name]}
        missing = replace(FIT, covariates=rest)
        assert effect.untestable(missing, site) == Untestable("missing", NEEDED[name])
        constant = {**FIT.covariates, NEEDED[name]: FIT.covariates[NEEDED[name]][[0] * len(FIT)]}
        still = replace(FIT, covariates=constant)
        assert effect.untestable(still, site) == Untestable("constant", NEEDED[name])


@pytest.mark.parametrize(("name", "site"), SEEN)
def test_an_effect_of_typical_size_moves_the_tcp_by_micrometres_to_millimetres(name: str, site: str) -> None:
    at = operating_points(40, seed=5, fixed=FIT.references)
    sigma, rng = basis(name, site, at).sigma, np.random.default_rng(0)
    either = [active(name, site, sigma * rng.choice([-1.0, 1.0], len(sigma))) for _ in range(3)]
    rms = [np.sqrt((moved(at, effect)[:, :3] ** 2).sum(axis=1).mean()) for effect in either]
    assert 1e-6 < np.median(rms) < 3e-3


@pytest.mark.parametrize(("name", "site"), PLACES)
def test_what_the_coefficients_say_has_a_name_a_unit_and_a_line_in_the_documentation(name: str, site: str) -> None:
    effect = EFFECTS[name]
    told = effect.parameters(some(name, site, FIT), SETTINGS.get(name))
    documented = inspect.getdoc(type(effect))
    assert told
    for parameter, (value, unit) in told.items():
        assert np.isfinite(value)
        assert unit in UNITS, "units of parameters are listed in UNITS, in their shortest form"
        # ``shift[2]`` is documented as ``shift[k]``, ``turn_x`` as itself or by its beginning and ``_x``.
        stem, _, axis = parameter.split("[")[0].rpartition("_")
        assert parameter.replace("[1]", "[k]").split("[")[0] in documented or (
            stem in documented and f"_{axis}``" in documented
        )


@pytest.mark.parametrize(("name", "site"), PLACES)
def test_parameters_of_twice_the_coefficients_are_twice_as_large(name: str, site: str) -> None:
    c, shape_parameter = some(name, site, FIT), SETTINGS.get(name)
    once, twice = EFFECTS[name].parameters(c, shape_parameter), EFFECTS[name].parameters(2.0 * c, shape_parameter)
    for parameter, (value, _) in once.items():
        # Places, periods and phases are where, not how much.
        factor = 1.0 if parameter in ("period", "phase", "place", "fixed_point") else 2.0
        assert twice[parameter][0] == pytest.approx(factor * value, rel=1e-9)


@pytest.mark.parametrize(("name", "site"), PLACES)
def test_rows_may_come_in_any_order_and_company(name: str, site: str) -> None:
    c = some(name, site, FIT)
    at = operating_points(7, seed=6, fixed=FIT.references)
    whole = moved(at, active(name, site, c))
    rows = np.array([5, 2, 6])
    few = of_rows(at, rows)
    np.testing.assert_allclose(moved(few, active(name, site, c)), whole[rows], rtol=0, atol=1e-13)


@pytest.mark.parametrize(("name", "site"), PLACES)
def test_columns_do_not_depend_on_the_order_of_the_rows_of_the_fit(name: str, site: str) -> None:
    rows = np.random.default_rng(0).permutation(len(FIT))
    mixed = of_rows(FIT, rows)
    one, other = basis(name, site, FIT).displacement(FIT)[rows], basis(name, site, mixed).displacement(mixed)
    np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-9 * np.abs(one).max())


@pytest.mark.parametrize(
    "name",
    [name for name, effect in EFFECTS.items() if effect.core and effect.sites(ROBOT) and name != "cart_compliance"],
)
def test_the_core_of_an_effect_is_its_largest_columns(name: str) -> None:
    found, core = basis(name, second(name), FIT), list(EFFECTS[name].core)
    moved_by = np.abs(found.displacement(FIT) * found.sigma).mean(axis=(0, 1))
    assert moved_by[core].max() > np.delete(moved_by, core).max()


def test_the_form_of_a_carts_compliance_is_what_its_parameters_name() -> None:
    size = len(basis("cart_compliance", "cart2", FIT))
    named = {"along", "across_a", "across_b", "roll", "tip_a", "tip_b"}
    core = {
        column
        for column in range(size)
        if any(EFFECTS["cart_compliance"].parameters(np.eye(size)[column], None)[name][0] for name in named)
    }
    assert set(EFFECTS["cart_compliance"].core) == core


def test_what_bends_a_carts_compliance_moves_less_than_what_it_bends() -> None:
    at = basis("cart_compliance", "cart2", FIT)
    moved_by = np.abs(at.displacement(FIT) * at.sigma).mean(axis=(0, 1))
    for column in range(3, TIPS):
        assert moved_by[column] < moved_by[column % 3]
    for column in range(TIPS + 3, len(at)):
        assert moved_by[column] < moved_by[TIPS + (column - TIPS) % 3]


def test_a_track_that_turns_grows_by_angles() -> None:
    robot = gtpin.load_robot("tau")
    assert robot.actuators[0].revolute
    effect = EFFECTS["thermal_track"]
    units = {
        n: unit for n, (_, unit) in effect.parameters_at(robot, robot.sites[0], np.array([1e-5, 2e-6]), None).items()
    }
    assert units == {"expansion": "1/K", "at_zero": "rad/K", "fixed_point": "rad"}


ROOT = Path(gtpin.__file__).parent
IDS = {kind.id for kind in OWN}
ELSEWHERE = {("comparison/figures.py", "linearity")}
"""A figure of the paper, which is called so."""


@pytest.mark.slow
def test_no_other_module_decides_by_an_effects_name() -> None:
    """The plant's causes stand apart: it must not share the diagnosis's effects."""
    named = set()
    for file in ROOT.rglob("*.py"):
        where = file.relative_to(ROOT).as_posix()
        if where.startswith(("effects/", "bench/simulator/")):
            continue
        texts = [n.value for n in ast.walk(ast.parse(file.read_text())) if isinstance(n, ast.Constant)]
        named |= {(where, text) for text in texts if isinstance(text, str) and text.split("@")[0] in IDS}
    assert named - ELSEWHERE == set()


def test_the_catalogue_has_every_effect_of_the_folder_once() -> None:
    nodes = [node for file in (ROOT / "effects").glob("*.py") for node in ast.walk(ast.parse(file.read_text()))]
    written = [
        node.name
        for node in nodes
        if isinstance(node, ast.ClassDef)
        and "id" in {ast.unparse(n.targets[0]) for n in node.body if isinstance(n, ast.Assign)}
    ]
    assert sorted(kind.__name__ for kind in OWN) == sorted(written)
    assert len({kind.id for kind in OWN}) == len(OWN) == len(written) > 20


@pytest.mark.parametrize("module", ["gtpin.effects.effect", "gtpin.effects.catalogue"])
def test_the_examples_of_a_docstring_run_and_give_what_they_show(module: str) -> None:
    found = doctest.testmod(importlib.import_module(module), optionflags=doctest.NORMALIZE_WHITESPACE)
    assert found.attempted > 0
    assert found.failed == 0


SLIDING = arm_with('name="elbow" type="revolute"', 'name="elbow" type="prismatic"')
MACHINES = [operating_points(10, kinematics=drawn(robot)) for robot in ("gantry_tau", "stewart", "ur5", SLIDING)]
DRIVEN = DriverEffect([DriverColumn("payload", 10.0, 20.0)], [Driver("payload", "platform", "z", 1e-4)])
WITH_DRIVEN = {**EFFECTS, DRIVEN.id: DRIVEN}


def sizes_of_modulations() -> dict[tuple[str, str, str], Floats]:
    """Typical sizes of the coefficients, by robot, effect and site."""
    return {
        (at.robot.name, name, site): effect.basis(at, site, SETTINGS.get(name)).sigma
        for at in MACHINES
        for name, effect in WITH_DRIVEN.items()
        for site in effect.sites(at.robot)
    }


@pytest.fixture(scope="module")
def unchanged_sizes() -> dict[tuple[str, str, str], Floats]:
    return sizes_of_modulations()


@pytest.mark.parametrize("name", [field.name for field in fields(MODULATION)])
def test_every_number_changes_the_modulation_of_an_effect_and_no_core(name, unchanged_sizes, monkeypatch):
    before = unchanged_sizes
    doubled = replace(MODULATION, **{name: 2.0 * getattr(MODULATION, name)})
    users = [m for key, m in sys.modules.items() if key.startswith("gtpin.effects.") and hasattr(m, "MODULATION")]
    for module in users:
        monkeypatch.setattr(module, "MODULATION", doubled)
    changed = {place: np.flatnonzero(after != before[place]) for place, after in sizes_of_modulations().items()}
    assert any(len(columns) for columns in changed.values())
    for (_, effect, _), columns in changed.items():
        assert not set(columns) & set(WITH_DRIVEN[effect].core)


def test_no_file_of_the_effects_has_a_name_that_their_package_gives() -> None:
    files = {file.stem for file in Path(gtpin.effects.__path__[0]).glob("*.py")}
    assert not files & set(gtpin.effects.__all__)
