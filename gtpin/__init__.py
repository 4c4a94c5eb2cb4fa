"""Closed-chain kinematics, calibration and diagnosis of the Gantry-Tau parallel robot and its kin, on Pinocchio."""

from importlib.metadata import version

from gtpin.calibration.calibrate import calibrate
from gtpin.calibration.result import Calibration
from gtpin.data import Commands, Dataset
from gtpin.diagnosis.diagnose import diagnose
from gtpin.diagnosis.result import Diagnosis
from gtpin.errors import GtpinError, GtpinWarning
from gtpin.kinematics.geometry_jacobian import geometry_jacobian
from gtpin.kinematics.inverse import commands_for, reach
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.posture import ClosedPosture, home
from gtpin.kinematics.statics import rod_forces, static_forces
from gtpin.model import Frame, Model
from gtpin.model_folder import read_model, write_model
from gtpin.robot.geometry import Geometry
from gtpin.robot.library import load_robot, robot_names
from gtpin.robot.robot import Robot

__version__ = version("gtpin")

__all__ = [
    "Calibration",
    "ClosedPosture",
    "Commands",
    "Dataset",
    "Diagnosis",
    "Frame",
    "Geometry",
    "GtpinError",
    "GtpinWarning",
    "Model",
    "Poses",
    "Robot",
    "__version__",
    "calibrate",
    "commands_for",
    "diagnose",
    "geometry_jacobian",
    "home",
    "load_robot",
    "reach",
    "read_model",
    "robot_names",
    "rod_forces",
    "static_forces",
    "write_model",
]
