"""Calibration of parallel robots and arms, and diagnosis of the causes of their errors, on Pinocchio.

Names are imported when they are first used, so that the command line answers to Ctrl-C from its first moment on.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gtpin.accuracy.analysis import Accuracy, analyse
    from gtpin.calibration.calibrate import calibrate
    from gtpin.calibration.result import Calibration
    from gtpin.data import Commands, Dataset
    from gtpin.data.instrument_tables import InstrumentTable
    from gtpin.diagnosis.diagnose import diagnose
    from gtpin.diagnosis.result import Diagnosis, HealthCheck
    from gtpin.effects.catalogue import catalogue
    from gtpin.errors import GtpinError, GtpinWarning
    from gtpin.estimate import Estimate
    from gtpin.extras.certificate.certify import certify
    from gtpin.extras.certificate.result import Certificate
    from gtpin.instruments.instrument import Component, Instrument, Unknown
    from gtpin.kinematics.inverse import commands_for, reach
    from gtpin.kinematics.poses import Poses
    from gtpin.kinematics.posture import ClosedPosture, geometry_jacobian, home, rod_forces, static_forces
    from gtpin.kinematics.robot import Robot, load_robot
    from gtpin.kinematics.singularities import singularities
    from gtpin.model.model import Frame, Model
    from gtpin.model.model_folder import read_model, write_model
    from gtpin.planning.plan import PosePlan, plan
    from gtpin.robot.geometry import Geometry
    from gtpin.robot.library import robot_names

    __version__: str

_HOME = {
    "Accuracy": "gtpin.accuracy.analysis",
    "analyse": "gtpin.accuracy.analysis",
    "calibrate": "gtpin.calibration.calibrate",
    "Calibration": "gtpin.calibration.result",
    "certify": "gtpin.extras.certificate.certify",
    "Certificate": "gtpin.extras.certificate.result",
    "Commands": "gtpin.data",
    "Component": "gtpin.instruments.instrument",
    "Dataset": "gtpin.data",
    "diagnose": "gtpin.diagnosis.diagnose",
    "Diagnosis": "gtpin.diagnosis.result",
    "HealthCheck": "gtpin.diagnosis.result",
    "plan": "gtpin.planning.plan",
    "PosePlan": "gtpin.planning.plan",
    "catalogue": "gtpin.effects.catalogue",
    "Estimate": "gtpin.estimate",
    "Instrument": "gtpin.instruments.instrument",
    "InstrumentTable": "gtpin.data.instrument_tables",
    "Unknown": "gtpin.instruments.instrument",
    "GtpinError": "gtpin.errors",
    "GtpinWarning": "gtpin.errors",
    "geometry_jacobian": "gtpin.kinematics.posture",
    "commands_for": "gtpin.kinematics.inverse",
    "reach": "gtpin.kinematics.inverse",
    "Poses": "gtpin.kinematics.poses",
    "ClosedPosture": "gtpin.kinematics.posture",
    "home": "gtpin.kinematics.posture",
    "singularities": "gtpin.kinematics.singularities",
    "rod_forces": "gtpin.kinematics.posture",
    "static_forces": "gtpin.kinematics.posture",
    "Frame": "gtpin.model.model",
    "Model": "gtpin.model.model",
    "read_model": "gtpin.model.model_folder",
    "write_model": "gtpin.model.model_folder",
    "Geometry": "gtpin.robot.geometry",
    "load_robot": "gtpin.kinematics.robot",
    "robot_names": "gtpin.robot.library",
    "Robot": "gtpin.kinematics.robot",
}
"""The module of each name."""


def __getattr__(name: str) -> object:
    found: object
    if name == "__version__":
        from importlib.metadata import version

        found = version("gtpin")
    elif name in _HOME:
        found = getattr(import_module(_HOME[name]), name)
    elif not name.startswith("_") and find_spec(f"gtpin.{name}") is not None:
        found = import_module(f"gtpin.{name}")
    else:
        raise AttributeError(f"module 'gtpin' has no attribute {name!r}")
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


__all__ = [
    "Accuracy",
    "Calibration",
    "Certificate",
    "ClosedPosture",
    "Commands",
    "Component",
    "Dataset",
    "Diagnosis",
    "Estimate",
    "Frame",
    "Geometry",
    "GtpinError",
    "GtpinWarning",
    "HealthCheck",
    "Instrument",
    "InstrumentTable",
    "Model",
    "PosePlan",
    "Poses",
    "Robot",
    "Unknown",
    "__version__",
    "analyse",
    "calibrate",
    "catalogue",
    "certify",
    "commands_for",
    "diagnose",
    "geometry_jacobian",
    "home",
    "load_robot",
    "plan",
    "reach",
    "read_model",
    "robot_names",
    "rod_forces",
    "singularities",
    "static_forces",
    "write_model",
]
