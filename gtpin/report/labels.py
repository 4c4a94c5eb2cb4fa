"""Places for labels of a drawing: no label hides another or leaves the picture, and few hide a joint or a line."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gtpin.report.camera import HEIGHT, WIDTH
from gtpin.typing import Floats

LETTER, LINE = 8.6, 19.0
"""Width of a letter and height of a line, pixels: between those of a wide and of a narrow page, whose letters are larger."""
FAR = 24.0
"""Distance of a label from its spot, pixels, from which a line joins them."""
COVERED, JOINT, CROSSED = 1e3, 12.0, 0.35
"""Costs of a label on another one, on a joint, and on a twentieth of a line; the cost of a pixel of distance is a tenth."""
ROUND = ((1, 0), (-1, 0), (0, -1), (0, 1), *((side, row) for row in (-1, 1, -2, 2, -3, 3, -4, 4) for side in (1, -1)))
"""Places about a spot, the first is the best: side (0: centred) and row."""


@dataclass
class Labels:
    """Places labels one after the other. ``marks``: (m, 2) joints, pixels; ``lines``: (k, 2) points on the lines."""

    marks: Floats
    lines: Floats
    taken: list[tuple[float, float, float, float]] = field(default_factory=list)

    def place(self, words: str, spot: Floats, gap: float = 15.0, size: float = 1.0) -> tuple[str, Floats | None]:
        """SVG attributes that place a label about a spot (2,), pixels, and the end of a line to it where it is far from there.

        ``gap``: distance from the spot, pixels; ``size``: that of the letters, relative to normal ones.
        """
        wide, high = size * LETTER * len(words), size * LINE
        best, anchor, cost = (0.0, 0.0, wide, high), "", np.inf
        for rank, (side, row) in enumerate(ROUND):
            x = spot[0] + (gap if side > 0 else -gap - wide if side < 0 else -wide / 2.0)
            y = spot[1] - high / 2.0 + row * (high if side else high / 2.0 + gap)
            x, y = np.clip(x, 2.0, WIDTH - wide - 2.0), np.clip(y, 2.0, HEIGHT - high - 2.0)
            box = (float(x), float(y), float(x) + wide, float(y) + high)
            price = COVERED * sum(_overlap(box, other) for other in self.taken) + 0.01 * rank
            price += JOINT * _inside(self.marks, box, 6.0) + CROSSED * _inside(self.lines, box, 0.0)
            price += 0.1 * _distance(spot, box)
            if price < cost:
                best, cost, anchor = box, price, "start" if side > 0 else "end" if side else "middle"
        self.taken.append(best)
        x = {"start": best[0], "end": best[2], "middle": (best[0] + best[2]) / 2.0}[anchor]
        end = np.clip(spot, best[:2], best[2:]) if _distance(spot, best) > FAR else None
        return f'x="{x:.1f}" y="{best[3] - 0.28 * high:.1f}" text-anchor="{anchor}"', end


def _overlap(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _inside(points: Floats, box: tuple[float, float, float, float], margin: float) -> int:
    low, high = np.array(box[:2]) - margin, np.array(box[2:]) + margin
    return int(((points > low) & (points < high)).all(axis=1).sum())


def _distance(spot: Floats, box: tuple[float, float, float, float]) -> float:
    return float(np.hypot(*(spot - np.clip(spot, box[:2], box[2:]))))
