"""Datasets: reading, checking, writing and splitting measured poses."""

from gtpin.data.commands import CartMeasurements, Commands
from gtpin.data.dataset import Dataset
from gtpin.data.description import SCHEMA, Conditions, Description, Driver, InstrumentSection
from gtpin.data.split import by_region, by_session, random
from gtpin.errors import renamed_names

__all__ = [
    "SCHEMA",
    "CartMeasurements",
    "Commands",
    "Conditions",
    "Dataset",
    "Description",
    "Driver",
    "InstrumentSection",
    "by_region",
    "by_session",
    "random",
]

__getattr__ = renamed_names(__name__, {"Instrument": "InstrumentSection"})
