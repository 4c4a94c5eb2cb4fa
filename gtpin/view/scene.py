"""The machine in 3-D in the browser, by Pinocchio's visualizer on viser. It needs the extra ``view``."""

from __future__ import annotations

import threading
from contextlib import redirect_stdout
from io import StringIO
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from gtpin.errors import GtpinError
from gtpin.kinematics.posture import ClosedPosture, home
from gtpin.model import Model
from gtpin.report.skeleton import skeleton
from gtpin.report.sketch import Camera
from gtpin.view.colors import of_errors
from gtpin.view.gap import Gap
from gtpin.view.shapes import robot_as_modelled, shapes

Floats = npt.NDArray[np.float64]

BLACK = np.array([0.1, 0.1, 0.1])
BETWEEN = 12
"""Postures shown on the way from a pose to the next."""
STEP = 0.03
"""Seconds between them."""


class Scene:
    """A server whose page shows a model; with a gap, it moves along the poses and shows the errors.

    Parameters
    ----------
    model, gap
        What is shown.
    host, port
        Where the page is served; port 0 takes any that is free.

    Raises
    ------
    GtpinError
        If viser is missing, or nothing can be served there.
    """

    def __init__(self, model: Model, gap: Gap | None, host: str = "localhost", port: int = 8080) -> None:
        self.model, self.gap = model, gap
        self.robot = robot_as_modelled(model)
        self.posture: ClosedPosture = home(self.robot)
        self.server = _serve(host, port)
        self._lock = threading.Lock()
        self._visualizer = self._load()
        self._look()
        if gap is None:
            self._sliders()
        else:
            self._poses(gap)

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}"

    def show(self, q: Floats) -> None:
        """Bring the machine to a command (n,)."""
        with self._lock:
            self.posture = self.posture.moved_to(q)
            self._visualizer.display(self.posture.configuration)

    def stop(self) -> None:
        """Serve no longer."""
        with redirect_stdout(StringIO()):  # viser talks
            self.server.stop()

    def _try(self, q: Floats) -> str:
        """Bring the machine to a command if it can go there; else say why not, and stay."""
        try:
            self.show(q)
        except GtpinError as error:
            return f"The machine can't be shown there: {error.what}."
        return ""

    def _load(self) -> Any:
        from pinocchio.visualize import ViserVisualizer

        share = {} if self.gap is None else self.gap.share
        visualizer = ViserVisualizer(self.robot.model, pin.GeometryModel(), shapes(self.robot, share))
        visualizer.initViewer(viewer=self.server)
        visualizer.loadViewerModel(self.robot.name)
        visualizer.display(self.posture.configuration)
        return visualizer

    def _look(self) -> None:
        """From where the rods hide each other the least, at the middle of the machine."""
        machine = skeleton(self.model)
        if machine is None:
            return
        middle = (machine.points.max(axis=0) + machine.points.min(axis=0)) / 2.0
        size = float(np.ptp(machine.points, axis=0).max())
        self.server.scene.set_up_direction(tuple(machine.up))
        eye = np.cross(*Camera.of(machine).axes)
        self.server.initial_camera.position = tuple(middle + 0.95 * size * eye)
        self.server.initial_camera.look_at = tuple(middle)

    def _sliders(self) -> None:
        """A slider for each actuator."""
        lower = np.where(np.isfinite(self.robot.lower), self.robot.lower, -np.pi)
        upper = np.where(np.isfinite(self.robot.upper), self.robot.upper, np.pi)
        start = np.clip(self.robot.home_q, lower, upper)
        sliders = [
            self.server.gui.add_slider(site, float(a), float(b), float((b - a) / 500.0), float(q))
            for site, a, b, q in zip(self.robot.sites, lower, upper, start, strict=True)
        ]
        note = self.server.gui.add_markdown("")

        def moved(_: object) -> None:
            note.content = self._try(np.array([slider.value for slider in sliders]))

        for slider in sliders:
            slider.on_update(moved)

    def _poses(self, gap: Gap) -> None:
        """Errors, a slider along the poses, and a button that plays them."""
        gui = self.server.gui
        legend = ", ".join(f"{site} {100.0 * part:.0f} %" for site, part in gap.share.items())
        gui.add_markdown(
            f"**{self.robot.name}**: errors of the model at {len(gap.q)} poses. Rods by share of the gap: {legend}"
        )
        place = gui.add_slider("pose", 0, len(gap.q) - 1, 1, 0, disabled=len(gap.q) < 2) if len(gap.q) > 1 else None
        factor = gap.magnification()
        larger = gui.add_slider("errors magnified", factor / 10.0, 5.0 * factor, factor / 10.0, factor)
        play = gui.add_checkbox("play", False)
        told = gui.add_markdown("")
        self._draw_errors(gap, factor)

        def here(_: object = None) -> None:
            i = 0 if place is None else int(place.value)
            trouble = self._try(gap.q[i])
            told.content = f"pose {gap.pose[i]}: off by {1e6 * gap.length[i]:.1f} µm. {trouble}".replace("<", "&lt;")
            self._draw_pose(gap, i, float(larger.value))

        def scaled(_: object) -> None:
            self._draw_errors(gap, float(larger.value))
            here()

        if place is not None:
            place.on_update(here)
        larger.on_update(scaled)
        here()
        if place is not None:
            threading.Thread(target=self._play, args=(gap, place, play), daemon=True).start()

    def _play(self, gap: Gap, place: Any, play: Any) -> None:
        """Walk from pose to pose while the box is ticked."""
        rest = threading.Event()
        while not rest.wait(STEP):
            if not play.value:
                continue
            i = int(place.value)
            j = (i + 1) % len(gap.q)
            for s in np.linspace(0.0, 1.0, BETWEEN, endpoint=False)[1:]:
                self._try((1.0 - s) * gap.q[i] + s * gap.q[j])
                rest.wait(STEP)
            place.value = j

    def _draw_errors(self, gap: Gap, factor: float) -> None:
        colors = of_errors(gap.length)
        size = max(float(np.ptp(gap.T, axis=0).max()), 0.1)
        self.server.scene.add_point_cloud("/gap/poses", gap.T, colors, point_size=size / 150.0, point_shape="circle")
        ends = np.stack([gap.T, gap.T + factor * gap.error], axis=1)
        self.server.scene.add_line_segments(
            "/gap/errors", ends, np.repeat(colors[:, None], 2, axis=1), thickness=2.0, thickness_units="screen"
        )

    def _draw_pose(self, gap: Gap, i: int, factor: float) -> None:
        """The error of the pose that the machine is at."""
        ends = np.stack([gap.T[i], gap.T[i] + factor * gap.error[i]])[None]
        self.server.scene.add_line_segments(
            "/gap/here", ends, np.broadcast_to(BLACK, (1, 2, 3)), thickness=6.0, thickness_units="screen"
        )


def _serve(host: str, port: int) -> Any:
    try:
        import viser
    except ImportError:
        raise GtpinError("3-D views need viser", hint="pip install 'gtpin[view]', or -o still.png") from None
    try:
        with redirect_stdout(StringIO()):  # viser talks
            return viser.ViserServer(host=host, port=port, label="gtpin", verbose=False)
    except OSError as error:
        raise GtpinError(
            f"can't serve at {host}:{port} ({error.strerror or error})", hint="give another --port"
        ) from None
