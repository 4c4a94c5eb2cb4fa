"""An accuracy analysis as plain text."""

from __future__ import annotations

from gtpin.accuracy.analysis import Accuracy


def accuracy_text(accuracy: Accuracy) -> str:
    """Expected errors over the workspace, as text."""
    values = accuracy.to_json()
    position, orientation = values["expected"]["position"], values["expected"]["orientation"]
    lines = [f"Expected error of {values['robot']} over {values['poses']} poses, from {values['uncertainty']}:"]
    for what, unit, error in (("position", "um", position), ("orientation", "urad", orientation)):
        if error is None:
            lines.append(f"  {what:<12} constant: the arm is reduced")
            continue
        mean, p95, largest = (error[key] * 1e6 for key in ("mean", "p95", "maximum"))
        lines.append(
            f"  {what:<12} mean {mean:.1f} {unit}; 95 % of machines and poses below {p95:.1f} {unit}; "
            f"largest of a machine, on average, {largest:.1f} {unit}"
        )
    return "\n".join(lines)
