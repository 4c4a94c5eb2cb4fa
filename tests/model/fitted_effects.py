"""Models with effects whose coefficients were given instead of fitted, and commands with every covariate."""

import numpy as np

import gtpin
from gtpin.effects.active import ActiveEffect
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.operating_points import OperatingPoints

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
