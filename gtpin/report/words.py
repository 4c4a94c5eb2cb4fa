"""Numbers, sites and coordinates as text."""

from __future__ import annotations

import math
import re

from gtpin.effects.sites import turning_joint
from gtpin.robot.chain import Chain

PREFIXES = {0: "", -3: "m", -6: "µ", -9: "n"}
"""Prefixes of units, by the power of ten."""
ROUNDING = 1e-12
"""Size, m or rad, below which a value is 0 but for rounding."""
SITES = {"arm": "all links", "frame": "the instrument", "platform": "the platform"}
"""Names of the sites that are the same for all machines."""
COORDINATES = {
    "time": "time",
    "session": "the session",
    "payload": "the payload",
    "load": "the load",
    "force": "the force at the TCP",
    "approach": "the direction of approach",
    "speed": "the speed",
    "direction": "the link's direction",
    "position": "the TCP's position",
    "temp_frame": "the frame's temperature",
    "temp_link": "the links' temperature",
}
UNITS = {"time": "s", "temp_frame": "°C", "temp_link": "°C", "payload": "kg", "fx": "N", "fy": "N", "fz": "N"}
"""Units of covariates, by name."""
PER_TRAVEL = {"q": "", "speed": "/s"}
"""What follows the unit of an actuator's travel, by the name of its columns without number."""
MINUS = re.compile(r"(?<![\w.-])-(?=\.?\d)")
"""A hyphen that is a minus sign before a number: not one that joins words or digits, or begins an option of a command."""
POWER = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)e([+-])0*(\d+)\b")
"""A number with an exponent, such as ``1.2e-05``."""
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "+")


def site_words(site: str) -> str:
    """A site: ``cart2``, ``the instrument``."""
    return SITES.get(site, site)


def travel_words(robot: Chain, site: str) -> str:
    """The motion of an actuator: ``travel of cart2``, ``angle of elbow_joint``."""
    return f"{'angle' if turning_joint(robot, site) else 'travel'} of {site}"


def coordinate_words(name: str) -> str:
    """Coordinates of a smooth term: ``q3``, ``the payload``, ``q1 and q3``."""
    return " and ".join(COORDINATES.get(word, word) for word in name.split(","))


def covariate_unit(name: str, robot: Chain) -> str:
    """The unit of a command or covariate of a robot; empty if it has none or it is not known."""
    word = name.rstrip("0123456789")
    number = int(name[len(word) :] or 0)
    if word in PER_TRAVEL and 0 < number <= robot.n_actuators:
        return ("rad" if robot.actuators[number - 1].revolute else "m") + PER_TRAVEL[word]
    return UNITS.get(name, "")


def with_unit(name: str, unit: str) -> str:
    """The title of an axis."""
    return f"{name} ({unit})" if unit else name


def length(value: float) -> str:
    """A length with a suitable unit: ``26.0 µm``, ``1.20 mm``."""
    return quantity(value, "m")


def quantity(value: float, unit: str, sigma: float | None = None, *, alone: bool = False) -> str:
    """A value with its standard deviation, without a line break: ``25.00 ± 0.90 µm``.

    Both have the decimals with which the standard deviation has two significant digits; a value alone has three. ``alone``:
    the standard deviation is not written: it only takes digits from the value that are not known. Below `ROUNDING` a value in
    m or rad is written as 0.
    """
    value = 0.0 if unit in ("m", "rad") and abs(value) < ROUNDING else value
    size = max(abs(value), sigma or 0.0)
    if not math.isfinite(size):
        return "not known"
    exponent = _exponent(size, unit)
    value = value / 10.0**exponent
    digits = _digits(value, 3)
    if sigma:
        own = _digits(sigma / 10.0**exponent, 1 if alone else 2)
        digits = min(digits, own) if alone else own
        sigma = None if alone else sigma
    text = f"{value:z.{digits}f}"
    if sigma:
        text += f" ± {sigma / 10.0**exponent:.{digits}f}"
    if unit.startswith("1/"):
        power = {0: " ", -3: "·10⁻³", -6: "·10⁻⁶", -9: "·10⁻⁹"}[exponent]
        return whole(f"({text}){power}/{unit[2:]}" if sigma else f"{text}{power}/{unit[2:]}")
    return whole(f"{text} {PREFIXES[exponent]}{unit}".rstrip())


def _exponent(size: float, unit: str) -> int:
    if size == 0.0 or unit.split("/")[0] not in ("m", "rad", "s", "1", "N"):
        return 0
    return max(-9, min(0, 3 * math.floor(math.log10(size) / 3.0 + 1e-12)))


def _digits(value: float, significant: int) -> int:
    """Number of decimals with which a value has ``significant`` significant digits."""
    if value == 0.0:
        return 0
    return max(0, significant - 1 - math.floor(math.log10(abs(value))))


def whole(text: str) -> str:
    """Text without line breaks, with true minus signs."""
    return text.replace(" ", "\u00a0").replace("-", "−").replace("^2", "²")


def typeset(text: str) -> str:
    """Text with true minus signs and powers of ten: ``−0.5``, ``1.2·10⁻⁵``."""
    return MINUS.sub("−", POWER.sub(lambda found: f"{found[1]}·10{(found[2] + found[3]).translate(RAISED)}", text))


def short(words: str) -> str:
    """Words as a label: without their article."""
    return words.removeprefix("the ")


def percent(share: float) -> str:
    """A fraction as ``86 %``; values close to 0 and 1 are not rounded to them."""
    if 0.0 < share < 0.005:
        return whole("< 1 %")
    if 0.995 <= share < 1.0:
        return whole("> 99 %")
    return whole(f"{100.0 * share:.0f} %")


def chance(probability: float) -> str:
    """A probability as a percentage, never rounded to 0 or 100 %."""
    return percent(min(max(probability, 1e-3), 1.0 - 1e-3))


def joined(words: list[str], last: str = "and") -> str:
    """A list in a sentence."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}" if words else ""


def capital(words: str) -> str:
    """Words with a capital first letter; the others are left as they are."""
    return words[:1].upper() + words[1:]


def counted(number: int, what: str) -> str:
    """``1 pose``, ``3 poses``."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def number_word(count: int) -> str:
    """A small number as a word."""
    return {2: "two", 3: "three", 4: "four"}.get(count, str(count))
