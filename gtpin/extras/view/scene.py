"""The machine in 3-D in the browser, by Pinocchio's visualizer on viser. It needs the extra ``view``."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from io import StringIO
from typing import Any

import numpy as np
import pinocchio as pin

from gtpin.effects.sites import joints
from gtpin.errors import GtpinError
from gtpin.extras.view.displays import (
    ChainDisplay,
    InstrumentDisplay,
    NamedPart,
    joint_places,
    of_errors,
    parts,
    robot_as_modelled,
    shapes,
)
from gtpin.extras.view.gap import DrawnGap
from gtpin.kinematics.posture import ClosedPosture, home
from gtpin.model.model import FittedInstrument, Model
from gtpin.report.instrument_places import InstrumentPlaces
from gtpin.report.skeleton import Camera, Skeleton, skeleton
from gtpin.typing import Floats

BLACK = np.array([0.1, 0.1, 0.1])
BETWEEN = 12
"""Number of steps from a pose to the next one while the poses are played."""
STEP = 0.03
"""Time between two steps, s."""
SIDES = ("center-left", "center-right", "bottom-center", "top-center")
"""Which point of a label is at its part, for parts that are near each other."""
NEAR = 0.15
"""Distance of near parts over the largest distance of parts."""


class GapPanel:
    """Errors, a choice of poses by their ids, a slider along them, and a box that plays them.

    ``go`` brings the machine with this ``name`` to a command (n,), m or rad, and returns an error message, or an empty text.
    """

    def __init__(self, server: Any, name: str, gap: DrawnGap, go: Callable[[Floats], str]) -> None:
        self.gap, self._scene, self._go = gap, server.scene, go
        self.names = gap.names
        gui, factor, alone = server.gui, gap.magnification(), len(gap.q) == 1
        shares = ", ".join(f"{site} {100.0 * part:.0f} %" for site, part in gap.share.items())
        rods = f" Rods by share of the gap: {shares}." if shares else ""
        gui.add_markdown(_plain(f"**{name}**: {gap.what}, {gap.summary}.{rods}"))
        self.chosen = gui.add_dropdown("pose", self.names, disabled=alone, hint="Its id, and its row in the table.")
        # A slider's end must be above its beginning, even if there is only one pose.
        self.place = gui.add_slider("one by one", 1, max(len(gap.q), 2), 1, 1, disabled=alone, hint="Along the table.")
        self.larger = gui.add_slider("errors magnified", factor / 10.0, 5.0 * factor, factor / 10.0, factor)
        self.play = gui.add_checkbox("play", False, disabled=alone)
        self.message = gui.add_markdown("")
        self.chosen.on_update(lambda _: setattr(self.place, "value", self.names.index(self.chosen.value) + 1))
        self.place.on_update(self._here)
        self.larger.on_update(self._scaled)
        self.play.on_update(self._played)
        self._walking: threading.Thread | None = None
        self._scaled()

    @property
    def index(self) -> int:
        """Index of the shown pose among those of the gap."""
        return int(self.place.value) - 1

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
        walking = threading.Thread(target=self._walk, daemon=True, name="poses played") if self.play.value else None
        self._walking = walking
        if walking is not None:
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


def _plain(text: str) -> str:
    """Markdown in which a name with "<" is not read as HTML."""
    return text.replace("<", "&lt;")


class Scene:
    """A server whose page shows a model. With a gap, the page shows the errors, and moves the machine from pose to pose.

    ``host``, ``port``: address at which the page is served; port 0 takes any that is free. ``instruments``: those to show; the
    model's by default. Attributes: ``instruments``: their display; None if there are none; ``panel``: the part of the page for
    the gap; None without one; ``labels``, ``names``: viser's labels of the parts' names, and the box that hides them.

    Raises `GtpinError` if viser is missing, or the page can't be served at this address.
    """

    def __init__(
        self,
        model: Model,
        gap: DrawnGap | None,
        host: str = "localhost",
        port: int = 8080,
        instruments: Sequence[FittedInstrument] | None = None,
    ) -> None:
        self.model, self.gap = model, gap
        self.robot = robot_as_modelled(model)
        self.posture: ClosedPosture = home(self.robot)
        try:
            import viser
        except ImportError:
            raise GtpinError("3-D views need viser", hint="pip install 'gtpin[view]', or -o still.png") from None
        try:
            with redirect_stdout(StringIO()):  # viser prints messages
                self.server: Any = viser.ViserServer(host=host, port=port, label="gtpin", verbose=False)
        except OSError as error:
            what = f"can't serve at {host}:{port} ({error.strerror or error})"
            raise GtpinError(what, hint="give another --port") from None
        self._lock = threading.Lock()
        self._visualizer = self._load()
        self.labels = self._name_parts()
        places = InstrumentPlaces.of(model.instruments if instruments is None else instruments)
        machine = skeleton(self.model)  # None if its loops can't be closed
        size = self.robot.size / 4.0 if machine is None else float(np.ptp(machine.points, axis=0).max())
        self.instruments = InstrumentDisplay(self.server, places, size) if places else None
        self._show_instruments()
        self._look(machine)
        self.panel = None if gap is None else GapPanel(self.server, self.robot.name, gap, self._go)
        if gap is None:
            self._sliders()
        self.names = self.server.gui.add_checkbox("names", True)
        self.names.on_update(self._named)

    @property
    def address(self) -> str:
        """Address of the page, to open in a browser."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}"

    def show(self, q: Floats) -> None:
        """Show the machine at a command (n,), m or rad."""
        with self._lock:
            self.posture = self.posture.moved_to(q)
            self._visualizer.display(self.posture.configuration)
            for part, label in self.labels.items():
                label.position = part.place(self._visualizer.data)
            self._show_instruments()

    def stop(self) -> None:
        """Stop serving the page."""
        with redirect_stdout(StringIO()):  # viser prints messages
            self.server.stop()

    def _show_instruments(self) -> None:
        if self.instruments is not None:
            encoders = self.instruments.places.encoders.values()
            joints = joint_places(self.robot, self._visualizer.data, encoders)
            self.instruments.show(self.posture.T, self.posture.R, joints)

    def _go(self, q: Floats) -> str:
        """Show the machine at a command, m or rad. If it can't reach it, change nothing and return an error message."""
        try:
            self.show(q)
        except GtpinError as error:
            return f"The machine can't be shown there: {error.what}."
        return ""

    def _load(self) -> Any:
        if joints(self.robot):
            display = ChainDisplay(self.server, self.robot)
            display.display(self.posture.configuration)
            return display
        from pinocchio.visualize import ViserVisualizer

        share = {} if self.gap is None else self.gap.share
        visualizer = ViserVisualizer(self.robot.model, pin.GeometryModel(), shapes(self.robot, share))
        visualizer.initViewer(viewer=self.server)
        visualizer.loadViewerModel(self.robot.name)
        visualizer.display(self.posture.configuration)
        return visualizer

    def _name_parts(self) -> dict[NamedPart, Any]:
        """A label at each part, at alternate sides of parts that are near each other."""
        data, scene, named = self._visualizer.data, self.server.scene, dict[NamedPart, Any]()
        places = {part: part.place(data) for part in parts(self.robot)}
        near = NEAR * max(float(np.ptp(np.array(list(places.values())), axis=0).max()), 1e-9) if places else 0.0
        for part, place in places.items():
            count = sum(float(np.linalg.norm(place - places[other])) < near for other in named)
            side = SIDES[count % len(SIDES)]
            named[part] = scene.add_label(f"/names/{part.name}", part.name, position=place, anchor=side)
        return named

    def _look(self, machine: Skeleton | None) -> None:
        """Set the camera: towards the middle of machine and poses, in the direction in which rods hide each other the least."""
        if machine is None:
            return
        points = machine.points if self.gap is None else np.vstack([machine.points, self.gap.T])
        middle = (points.max(axis=0) + points.min(axis=0)) / 2.0
        size = float(np.ptp(points, axis=0).max())
        self.server.scene.set_up_direction(tuple(machine.up))
        eye = np.cross(*Camera.of(machine).axes)
        self.server.initial_camera.position = tuple(middle + 0.95 * size * eye)
        self.server.initial_camera.look_at = tuple(middle)

    def _sliders(self) -> None:
        lower, upper = self.robot.ends
        start = np.clip(self.robot.home_q, lower, upper)
        ranges = zip(
            self.robot.sites, *(v.tolist() for v in (lower, upper, (upper - lower) / 500.0, start)), strict=True
        )
        sliders = [self.server.gui.add_slider(*one) for one in ranges]
        note = self.server.gui.add_markdown("")

        def moved(_: object) -> None:
            note.content = self._go(np.array([slider.value for slider in sliders]))

        for slider in sliders:
            slider.on_update(moved)

    def _named(self, _: object) -> None:
        for label in (*self.labels.values(), *(self.instruments.labels if self.instruments else ())):
            label.visible = self.names.value
