"""Models with effects: written and read bit by bit, wrong files refused by their keys, covariates asked for by name."""

import functools
import json
import warnings
from dataclasses import replace
from importlib.metadata import EntryPoint

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gtpin
from gtpin.effects import catalogue as catalogue_module
from gtpin.effects.active import ActiveEffect
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.displacement import along_track
from gtpin.effects.effect import Effect, unit
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import actuators
from gtpin.effects.smooth import frame_twist
from gtpin.errors import GtpinError, GtpinWarning, ModelError

ROBOT = gtpin.load_robot("gantry_tau")
GEOMETRY = gtpin.Geometry.nominal(ROBOT)
SETTINGS = {"rack_periodic": 0.0314, "rack_step": 0.05}
PLACES = [(name, site) for name, effect in effects_by_id().items() for site in effect.sites(ROBOT)]


def circumstances(count: int, seed: int = 0) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Commands (N, 3) and everything that an effect may ask for."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-0.3, 0.3, (count, 3))
    columns = {
        "time": np.linspace(0.0, 7200.0, count),
        "session": np.array([str(i % 3) for i in range(count)], dtype=object),
        "temp_frame": rng.uniform(18.0, 23.0, count),
        "temp_link": rng.uniform(18.0, 25.0, count),
        "payload": rng.choice([0.0, 10.0, 20.0], count),
    }
    columns |= {f"approach{i}": rng.choice([-1.0, 1.0], count) for i in (1, 2, 3)}
    columns |= {f"speed{i}": rng.uniform(-0.3, 0.3, count) for i in (1, 2, 3)}
    columns |= {f"f{axis}": rng.normal(0.0, 50.0, count) for axis in "xyz"}
    return q, columns


def active(name: str, site: str, amounts=None, without=()) -> ActiveEffect:
    """An effect of its typical size, as if fitted to 40 poses; ``amounts`` are its coefficients in typical sizes."""
    q, columns = circumstances(40)
    kinematics = gtpin.Model(GEOMETRY).kinematics
    columns = {key: values for key, values in columns.items() if key not in without}
    at = OperatingPoints(kinematics, q, kinematics.forward(q), columns)
    effect, shape_parameter = effects_by_id()[name], SETTINGS.get(name)
    size = effect.basis(at, site, shape_parameter).sigma
    if amounts is None:
        amounts = np.random.default_rng(len(name)).standard_normal(len(size))
    amounts = np.resize(np.asarray(amounts, dtype=float), len(size))
    return ActiveEffect(effect, site, shape_parameter, amounts * size, np.diag((0.1 * size) ** 2), at.references)


def with_effect(name: str, site: str, **options) -> gtpin.Model:
    """The nominal robot with one effect."""
    return gtpin.Model(GEOMETRY, effects=(active(name, site, **options),))


Q, COLUMNS = circumstances(12, seed=7)
ODD = settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def same(one: gtpin.Poses, other: gtpin.Poses) -> bool:
    return bool(np.array_equal(one.T, other.T) and np.array_equal(one.R, other.R))


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({name for name, _ in PLACES}))
@given(data=st.data())
@settings(ODD, max_examples=2)
def test_a_model_with_any_effect_predicts_the_same_bits_when_it_is_read_again(tmp_path, name, data):
    site = data.draw(st.sampled_from([s for n, s in PLACES if n == name]))
    amounts = data.draw(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=40))
    model = with_effect(name, site, amounts=amounts)
    gtpin.write_model(model, tmp_path)
    again = gtpin.read_model(tmp_path)
    expected = model.predict(Q, COLUMNS)
    assert expected.reached.all()
    assert same(again.predict(Q, COLUMNS), expected)
    (one,), (other,) = model.effects, again.effects
    assert (one.name, one.shape_parameter) == (other.name, other.shape_parameter)
    assert np.array_equal(one.covariance, other.covariance)


def test_several_effects_and_a_free_instrument_come_back_whole(tmp_path):
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    frame = gtpin.Frame(np.array([12.3, -4.5, 0.6]), turn * np.sign(np.linalg.det(turn)))
    effects = tuple(active(*place) for place in PLACES[::5])
    model = gtpin.Model(GEOMETRY, frame, effects, np.diag(GEOMETRY.tolerance**2))
    gtpin.write_model(model, tmp_path)
    again = gtpin.read_model(tmp_path)
    assert [e.name for e in again.effects] == [e.name for e in effects]
    assert same(again.predict(Q, COLUMNS), model.predict(Q, COLUMNS))
    assert np.array_equal(again.covariance, model.covariance)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A folder of a model with two effects, and what its model.json holds."""
    folder = tmp_path_factory.mktemp("model")
    effects = (active("rack_periodic", "cart2"), active("zero_shift", "cart1"))
    gtpin.write_model(gtpin.Model(GEOMETRY, effects=effects, covariance=np.diag(GEOMETRY.tolerance**2)), folder)
    return folder, (folder / "model.json").read_text()


WRONG = {
    "effects.0.effect": [("effect", "gremlin"), ("effect", 3)],
    "effects.0.site": [("site", "arm"), ("site", "cart4"), ("site", None)],
    "effects.0.setting": [("setting", None), ("setting", float("nan")), ("setting", "0.03"), ("setting", True)],
    "effects.0.coefficients": [
        ("coefficients", [1e-5] * 5),
        ("coefficients", []),
        ("coefficients", [1e-5] * 5 + ["1e-5"]),
        ("coefficients", [1e-5] * 5 + [float("inf")]),
        ("coefficients", [1.7e308] * 6),
    ],
    "effects.0.covariance": [("covariance", []), ("covariance", [[0.0] * 6] * 5), ("covariance", [[-1.0] * 6] * 6)],
    "effects.0.references.temperature": [("references.temperature", "warm")],
    "effects.0.references.time": [("references.time", {"start": 0.0, "span": 0.0}), ("references.time", [0.0, 1.0])],
    "effects.0.references.force.mean": [("references.force.mean", [1.0] * 5)],
    "effects.0.references.force.spread": [
        ("references.force.spread", [1.0] * 7),
        ("references.force.spread", [0.0] * 6),
    ],
    "effects.0.references.direction.mean": [("references.direction.mean", [[1.0, 1.0, 0.0]] * 6)],
    "effects.0.references.sessions": [("references.sessions", ["0", "0"]), ("references.sessions", [])],
    "effects.1.references.covariates": [("references.covariates", ["time"])],
    "effects.1.setting": [("setting", 0.5)],
    "effects.1.coefficients": [("references.sessions", ["0", "1"]), ("references.sessions", ["0", "1", "2", "3"])],
    "effects.0.colour": [("colour", "red")],
}
CASES = [(key, change) for key, changes in WRONG.items() for change in changes]


@pytest.mark.parametrize(("key", "change"), CASES, ids=str)
def test_a_wrong_effect_is_refused_by_file_and_key(written, key, change):
    folder, text = written
    told = json.loads(text)
    *above, last = change[0].split(".")
    place = functools.reduce(dict.__getitem__, above, told["effects"][int(key.split(".")[1])])
    place[last] = change[1]
    (folder / "model.json").write_text(json.dumps(told))
    with pytest.raises(ModelError) as refused:
        gtpin.read_model(folder)
    assert str(refused.value.file).endswith("model.json")
    assert refused.value.column.startswith(key)


@pytest.mark.parametrize(
    ("keys", "value", "column"),
    [
        (["parameters", "length[1]"], -2.0, "parameters.length[1]"),
        (["nominal_urdf"], "../nominal.urdf", "nominal_urdf"),
        (["nominal_urdf"], "/etc/robot.urdf", "nominal_urdf"),
    ],
)
def test_a_length_below_zero_and_a_file_elsewhere_are_refused_by_key(written, keys, value, column):
    folder, text = written
    told = json.loads(text)
    functools.reduce(dict.__getitem__, keys[:-1], told)[keys[-1]] = value
    (folder / "model.json").write_text(json.dumps(told))
    with pytest.raises(ModelError) as refused:
        gtpin.read_model(folder)
    assert refused.value.column == column


ANYTHING = st.none() | st.booleans() | st.integers(-(10**30), 10**30) | st.floats() | st.text(max_size=3)
JUNK = st.recursive(
    ANYTHING,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=4,
)


@pytest.mark.parametrize("whole", [pytest.param(True, marks=pytest.mark.slow), False], ids=["model", "effect"])
@given(data=st.data())
@settings(ODD, max_examples=100)
def test_a_model_with_other_values_is_read_or_refused(written, whole, data):
    folder, text = written
    told = json.loads(text)
    place = told if whole else told["effects"][data.draw(st.integers(0, 1))]
    while True:
        keys = sorted(place) if isinstance(place, dict) else range(len(place))
        key = data.draw(st.sampled_from(keys))
        if not isinstance(place[key], dict | list) or not place[key] or data.draw(st.booleans()):
            break
        place = place[key]
    if isinstance(place, dict) and data.draw(st.booleans()):
        del place[key]
    else:
        place[key] = data.draw(JUNK)
    (folder / "model.json").write_text(json.dumps(told))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            poses = gtpin.read_model(folder).predict(Q, COLUMNS)
        except GtpinError as error:
            refusal = str(error)
            assert "\n" not in refusal
        else:
            assert np.isfinite(poses.R[poses.reached]).all()


JOINT = """<joint name="turn{0}" type="revolute"><parent link="link{0}"/><child link="link{1}"/><origin xyz="1 0 0"/>
<axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>"""
ARM = f"""<robot name="arm"><link name="link0"/><link name="link1"/><link name="link2"/>{JOINT.format(0, 1)}
{JOINT.format(1, 2)}</robot>"""


def test_effects_of_another_kind_of_robot_are_refused(tmp_path, written):
    (tmp_path / "arm.urdf").write_text(ARM)
    gtpin.write_model(gtpin.read_model(tmp_path / "arm.urdf"), tmp_path)
    told = json.loads((tmp_path / "model.json").read_text())
    told["effects"] = json.loads(written[1])["effects"]
    (tmp_path / "model.json").write_text(json.dumps(told))
    with pytest.raises(ModelError, match=r"model\.json, column effects\.0"):
        gtpin.read_model(tmp_path)


def test_numbers_that_are_none_are_not_written(tmp_path):
    effect = active("backlash", "cart1")
    broken = replace(effect, coefficients=np.full(len(effect.coefficients), np.nan))
    with pytest.raises(ModelError, match=r"coefficients\.0: Input should be a finite number"):
        gtpin.write_model(gtpin.Model(GEOMETRY, effects=(broken,)), tmp_path / "new")
    assert not (tmp_path / "new").exists()


class Creep(Effect):
    """dq = c time: a belt that stretches."""

    id = "belt_creep"
    title = "a belt that stretches"
    coefficient = ("rate", "m")

    def sites(self, robot):
        return actuators(robot)

    def covariates(self, robot, site):
        return ("time",)

    def basis(self, at, site, shape_parameter=None):
        return along_track(at, site, at.time[:, None], unit([1.0], 1e-5))


def registered(monkeypatch, *points: EntryPoint) -> None:
    monkeypatch.setattr(catalogue_module, "entry_points", lambda group: points)
    effects_by_id.cache_clear()


@pytest.fixture
def stranger(monkeypatch):
    """An effect that another package registers."""
    registered(monkeypatch, EntryPoint("creep", f"{__name__}:Creep", "gtpin.effects"))
    yield
    monkeypatch.undo()
    effects_by_id.cache_clear()


def test_an_effect_of_another_package_is_written_and_read_where_it_is_installed_or_given(
    stranger, tmp_path, monkeypatch
):
    model = with_effect("belt_creep", "cart3")
    gtpin.write_model(model, tmp_path)
    assert same(gtpin.read_model(tmp_path).predict(Q, COLUMNS), model.predict(Q, COLUMNS))
    registered(monkeypatch)
    with pytest.raises(ModelError, match=r"effects\.0\.effect.*'belt_creep'.*install the package"):
        gtpin.read_model(tmp_path)
    gtpin.write_model(model, tmp_path)
    assert same(gtpin.read_model(tmp_path, effects=[Creep()]).predict(Q, COLUMNS), model.predict(Q, COLUMNS))


class FalseBacklash(Creep):
    id = "backlash"


def test_an_effect_with_the_id_of_another_is_not_written(stranger, tmp_path):
    (active,) = with_effect("belt_creep", "cart3").effects
    model = gtpin.Model(GEOMETRY, effects=(replace(active, effect=FalseBacklash()),))
    with pytest.raises(ModelError, match="another effect backlash"):
        gtpin.write_model(model, tmp_path / "new")
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("point", ["no_such_module:Effect", "json:dumps", f"{__name__}:Unmade"])
def test_an_entry_point_that_is_no_effect_is_an_error_that_names_it(stranger, monkeypatch, point):
    registered(monkeypatch, EntryPoint("bad", point, "gtpin.effects"))
    with pytest.raises(ModelError, match=r"bad of gtpin\.effects"):
        effects_by_id()


class Unmade(Effect):
    """Lacks its basis."""

    id = "unmade"


class Rude(Creep):
    """Fails when it is applied."""

    id = "rude"

    def basis(self, at, site, shape_parameter=None):
        return frame_twist(at)[0] @ None if len(at) == 1 else super().basis(at, site, shape_parameter)


def test_an_effect_of_another_package_that_fails_is_an_error_that_names_it(stranger, tmp_path, monkeypatch):
    registered(monkeypatch, EntryPoint("rude", f"{__name__}:Rude", "gtpin.effects"))
    with pytest.raises(ModelError, match="rude@cart1 can't be applied"):
        gtpin.write_model(with_effect("rude", "cart1"), tmp_path)


@pytest.mark.parametrize(
    ("name", "site", "column"),
    [
        ("backlash", "cart2", "approach2"),
        ("backlash", "cart2", "payload"),  # its bend goes with the load
        ("servo_lag", "cart3", "speed3"),
        ("thermal_links", "arm", "temp_link"),
        ("thermal_track", "cart1", "temp_frame"),
        ("tracker_drift", "frame", "time"),
        ("frame_shift", "frame", "session"),
        ("link_compliance", "link3a", "payload"),
        ("cart_compliance", "cart1", "fz"),
        ("tracker_scale", "frame", "time"),  # what it was fitted to wander with
        ("tracker_scale", "frame", "temp_frame"),
    ],
)
def test_a_covariate_that_an_active_effect_needs_and_that_is_missing_is_an_error(name, site, column):
    model = with_effect(name, site)
    rest = {key: values for key, values in COLUMNS.items() if key != column}
    with pytest.raises(ModelError, match=f"column {column}: .*which {name}@{site} needs; give a column {column}"):
        model.predict(Q, rest)


@pytest.mark.parametrize(
    ("name", "site"), [("linearity", "cart1"), ("target_offset", "platform"), ("joint_runout", "link1")]
)
def test_covariates_that_no_active_effect_needs_are_not_asked_for(name, site):
    model = with_effect(name, site)
    assert same(model.predict(Q), model.predict(Q, COLUMNS))


@pytest.mark.parametrize("name", ["thermal_links", "thermal_track"])
def test_an_effect_keeps_the_form_that_it_was_fitted_with(name):
    """Fitted without a clock it has no lag, whether or not the commands have a clock."""
    site = "arm" if name == "thermal_links" else "cart1"
    model = with_effect(name, site, without=("time",))
    rest = {key: values for key, values in COLUMNS.items() if key != "time"}
    assert same(model.predict(Q, rest), model.predict(Q, COLUMNS))


def test_a_load_that_the_fit_did_not_know_still_pulls():
    model = with_effect("link_compliance", "arm", amounts=[1.0, 0.0], without=("payload",))
    loaded, empty = (model.predict(Q, COLUMNS | {"payload": np.full(len(Q), mass)}) for mass in (20.0, 0.0))
    assert (np.linalg.norm((loaded.T - empty.T), axis=1) > 1e-7).all()


@pytest.mark.parametrize(("name", "site"), [("zero_shift", "cart2"), ("frame_shift", "frame")])
def test_a_session_never_seen_has_the_mean_shift_with_a_warning(name, site):
    model = with_effect(name, site)
    here = [{"session": np.full(len(Q), word, dtype=object)} for word in ("0", "1", "2", "night shift")]
    known = [model.predict(Q, COLUMNS | session) for session in here[:3]]
    with pytest.warns(GtpinWarning, match="night shift"):
        unseen = model.predict(Q, COLUMNS | here[3])
    plain = gtpin.Model(GEOMETRY).predict(Q)
    mean = np.mean([poses.minus(plain) for poses in known], axis=0)
    assert np.abs(mean).max() > 1e-6  # the shifts do not cancel
    assert np.abs(unseen.minus(plain) - mean).max() < 1e-8  # of second order in shifts of some 50 um


def test_sessions_are_the_same_however_they_are_spelt():
    model = with_effect("zero_shift", "cart2")
    words = COLUMNS | {"session": np.array([1.0] * len(Q))}
    ids = COLUMNS | {"session": np.array(["1"] * len(Q), dtype=object)}
    assert same(model.predict(Q, words), model.predict(Q, ids))


@pytest.mark.parametrize(
    "values", [np.ones(3), np.full(len(Q), np.nan), ["up"] * len(Q), np.ones((len(Q), 2)), 1.0], ids=str
)
def test_a_covariate_that_can_t_be_is_refused_by_name(values):
    with pytest.raises(ModelError, match="approach1"):
        with_effect("backlash", "cart1").predict(Q, COLUMNS | {"approach1": values})


def test_a_drift_of_an_earlier_release_predicts_what_it_did(tmp_path):
    """Of 54 coefficients: a constant and eight cosines over time, no straight line, each times six motions of the frame."""
    now = active("tracker_drift", "frame")
    c = 1e-5 * np.random.default_rng(3).standard_normal(54)
    c.reshape(9, 6)[:, 3:] = 0.0  # no rotations
    old = replace(now, effect=now.effect.as_stored(54), coefficients=c, covariance=np.diag(np.full(54, 1e-12)))
    gtpin.write_model(gtpin.Model(GEOMETRY, effects=(old,), covariance=np.diag(GEOMETRY.tolerance**2)), tmp_path)
    model = gtpin.read_model(tmp_path)
    (read,) = model.effects
    np.testing.assert_array_equal(read.coefficients, c)
    q, columns = circumstances(7, seed=1)
    x = 2.0 * columns["time"] / 7200.0 - 1.0
    shift = np.stack([np.cos(np.pi / 2.0 * k * (x + 1.0)) for k in range(9)], axis=1) @ c.reshape(9, 6)[:, :3]
    plain, moved = gtpin.Model(GEOMETRY).predict(q), model.predict(q, columns)
    np.testing.assert_allclose(moved.T - plain.T, shift, atol=1e-12)
    assert read.effect.parameters(c, None)["shift_x"][0] == pytest.approx(shift[-1, 0] - shift[0, 0])
