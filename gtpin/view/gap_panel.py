"""The gap in the 3-D page: errors as lines, controls to choose a pose, and motion from pose to pose."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from gtpin.typing import Floats
from gtpin.view.gap import DrawnGap
from gtpin.view.shapes import of_errors

BLACK = np.array([0.1, 0.1, 0.1])
BETWEEN = 12
"""Number of steps from a pose to the next one while the poses are played."""
STEP = 0.03
"""Time between two steps, s."""


class GapPanel:
    """Errors, a choice of poses by their ids, a slider along them, and a box that plays them.

    - ``server``: the page's viser server.
    - ``name``: the machine's name.
    - ``gap``: the gap to show.
    - ``go``: function that brings the machine to a command (n,), m or rad. It returns an error message, or an empty text.
    """

    def __init__(self, server: Any, name: str, gap: DrawnGap, go: Callable[[Floats], str]) -> None:
        self.gap, self._scene, self._go = gap, server.scene, go
        self.names = gap.names
        gui, factor, alone = server.gui, gap.magnification(), len(gap.q) == 1
        gui.add_markdown(_plain(_summary(name, gap)))
        self.chosen = gui.add_dropdown("pose", self.names, disabled=alone, hint="Its id, and its row in the table.")
        # A slider's end must be above its beginning, even if there is only one pose.
        self.place = gui.add_slider("one by one", 1, max(len(gap.q), 2), 1, 1, disabled=alone, hint="Along the table.")
        self.larger = gui.add_slider("errors magnified", factor / 10.0, 5.0 * factor, factor / 10.0, factor)
        self.play = gui.add_checkbox("play", False, disabled=alone)
        self.message = gui.add_markdown("")
        self.chosen.on_update(self._choose)
        self.place.on_update(self._here)
        self.larger.on_update(self._scaled)
        self.play.on_update(self._played)
        self._walking: threading.Thread | None = None
        self._scaled()

    @property
    def index(self) -> int:
        """Index of the shown pose among those of the gap."""
        return int(self.place.value) - 1

    def _choose(self, _: object) -> None:
        self.place.value = self.names.index(self.chosen.value) + 1

    def _here(self, _: object = None) -> None:
        i = self.index
        self.chosen.value = self.names[i]
        trouble = self._go(self.gap.q[i])
        self.message.content = _plain(f"**Pose {self.names[i]}**: {self.gap.said(i)}. {trouble}")
        self._draw("/gap/here", slice(i, i + 1), BLACK[None], 6.0)

    def _scaled(self, _: object = None) -> None:
        gap, colors = self.gap, of_errors(self.gap.size)
        size = max(float(np.ptp(gap.T, axis=0).max()), 0.1)
        self._scene.add_point_cloud("/gap/poses", gap.T, colors, point_size=size / 150.0, point_shape="circle")
        self._draw("/gap/errors", slice(None), colors, 2.0)
        self._here()

    def _draw(self, name: str, rows: slice, colors: Floats, thickness: float) -> None:
        """Draw errors of k poses as lines from the predicted positions of the TCP; colors (k, 3), thickness in pixels."""
        start = self.gap.T[rows]
        ends = np.stack([start, start + float(self.larger.value) * self.gap.error[rows]], axis=1)
        both = np.repeat(colors[:, None], 2, axis=1)
        self._scene.add_line_segments(name, ends, both, thickness=thickness, thickness_units="screen")

    def _played(self, _: object) -> None:
        """Start to go from pose to pose where the box was ticked; a thread that still goes then ends."""
        if not self.play.value:
            self._walking = None
            return
        walking = threading.Thread(target=self._walk, daemon=True, name="poses played")
        self._walking = walking
        walking.start()

    def _walk(self) -> None:
        """Go from pose to pose while the box is ticked."""
        rest, q = threading.Event(), self.gap.q
        while self._walking is threading.current_thread():
            i = self.index
            j = (i + 1) % len(q)
            for s in np.linspace(0.0, 1.0, BETWEEN, endpoint=False)[1:]:
                if self._walking is not threading.current_thread():
                    return
                self._go((1.0 - s) * q[i] + s * q[j])
                rest.wait(STEP)
            self.place.value = j + 1
            rest.wait(STEP)


def _summary(name: str, gap: DrawnGap) -> str:
    text = f"**{name}**: {gap.what}, {gap.summary}."
    shares = ", ".join(f"{site} {100.0 * part:.0f} %" for site, part in gap.share.items())
    return f"{text} Rods by share of the gap: {shares}." if shares else text


def _plain(text: str) -> str:
    """Markdown in which a name with "<" is not read as HTML."""
    return text.replace("<", "&lt;")
