"""Datasets: reading, checking, writing and splitting measured poses."""

from gtpin.data.commands import CartMeasurements, Commands
from gtpin.data.dataset import Dataset
from gtpin.data.description import SCHEMA, Conditions, Description, Driver, Instrument
from gtpin.data.plausible import check_commands, check_measurements
from gtpin.data.split import by_region, by_session, random

__all__ = [
    "SCHEMA",
    "CartMeasurements",
    "Commands",
    "Conditions",
    "Dataset",
    "Description",
    "Driver",
    "Instrument",
    "by_region",
    "by_session",
    "check_commands",
    "check_measurements",
    "random",
]
