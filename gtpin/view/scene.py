"""The machine in 3-D in the browser, by Pinocchio's visualizer on viser. It needs the extra ``view``."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from contextlib import redirect_stdout
from io import StringIO
from typing import Any

import numpy as np
import pinocchio as pin

from gtpin.errors import GtpinError
from gtpin.kinematics.posture import ClosedPosture, home
from gtpin.model.model import FittedInstrument, Model
from gtpin.report.camera import Camera
from gtpin.report.instrument_places import InstrumentPlaces
from gtpin.report.skeleton import Skeleton, skeleton
from gtpin.typing import Floats
from gtpin.view.chain_display import ChainDisplay
from gtpin.view.gap import DrawnGap
from gtpin.view.gap_panel import GapPanel
from gtpin.view.instrument_display import InstrumentDisplay
from gtpin.view.shapes import Shape, joint_places, parts, robot_as_modelled, shapes

SIDES = ("center-left", "center-right", "bottom-center", "top-center")
"""Which point of a label is at its part, for parts that are near each other."""
NEAR = 0.15
"""Distance of near parts over the largest distance of parts."""


class Scene:
    """A server whose page shows a model. With a gap, the page shows the errors, and moves the machine from pose to pose.

    Parameters
    ----------
    model, gap
        The model, and its gap or None.
    host, port
        Address at which the page is served; port 0 takes any that is free.
    instruments
        The instruments to show; the model's by default.

    Attributes
    ----------
    instruments : InstrumentDisplay or None
        The shown instruments; None if there are none.
    panel : GapPanel or None
        The part of the page for the gap; None without a gap.
    labels, names : dict of Part to label, and checkbox
        viser's labels of the parts' names, and the box that hides them.

    Raises
    ------
    GtpinError
        If viser is missing, or the page can't be served at this address.
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
        self.server = _serve(host, port)
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
        self.names = self._name_box()

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
        """Draw the instruments' parts on the platform and at joints, at the present pose."""
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
        if not self.robot.rods:
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

    def _name_parts(self) -> dict[Shape, Any]:
        """A label at each part, at alternate sides of parts that are near each other."""
        data, scene, named = self._visualizer.data, self.server.scene, dict[Shape, Any]()
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
        """Add a slider for each actuator."""
        lower = np.where(np.isfinite(self.robot.lower), self.robot.lower, -np.pi)
        upper = np.where(np.isfinite(self.robot.upper), self.robot.upper, np.pi)
        start = np.clip(self.robot.home_q, lower, upper)
        sliders = [
            self.server.gui.add_slider(site, float(a), float(b), float((b - a) / 500.0), float(q))
            for site, a, b, q in zip(self.robot.sites, lower, upper, start, strict=True)
        ]
        note = self.server.gui.add_markdown("")

        def moved(_: object) -> None:
            note.content = self._go(np.array([slider.value for slider in sliders]))

        for slider in sliders:
            slider.on_update(moved)

    def _name_box(self) -> Any:
        """Add a box that hides the names."""
        box = self.server.gui.add_checkbox("names", True)

        def changed(_: object) -> None:
            for label in (*self.labels.values(), *(self.instruments.labels if self.instruments else ())):
                label.visible = box.value

        box.on_update(changed)
        return box


def _serve(host: str, port: int) -> Any:
    try:
        import viser
    except ImportError:
        raise GtpinError("3-D views need viser", hint="pip install 'gtpin[view]', or -o still.png") from None
    try:
        with redirect_stdout(StringIO()):  # viser prints messages
            return viser.ViserServer(host=host, port=port, label="gtpin", verbose=False)
    except OSError as error:
        raise GtpinError(
            f"can't serve at {host}:{port} ({error.strerror or error})", hint="give another --port"
        ) from None
