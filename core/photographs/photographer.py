"""The folders that a simulated photographer leaves: photographs and their description (paper 4.2).

The light comes in as noise-free pictures. What goes out is what a laboratory would have: a file for
each exposure, grey steps of the monitor, black, and some patterns a second time.

Examples
--------
>>> rig = MonitorRig(Monitors(("top",), 1, "white", 32, 32), simulate.Camera(bits=8))
>>> files = {}
>>> said = rig.photograph(lambda k: np.full((6, 3, 4, 3), 0.2), files.__setitem__)
>>> len(said.photographs) == len(files), files["top/0000_white_0.png"].dtype
(True, dtype('uint8'))
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from . import simulate
from .description import LINEAR, Description, Kind, Lamp, Monitors, Photograph
from .screen_curve import measured_curve
from .screens import hemicube_of
from .shown import ANGLES, STEPS, photographs

# Keeps the values of a photograph under a name.
Put = Callable[[str, NDArray], None]


@dataclass(frozen=True)
class Exposing:
    """How often a light is photographed, and how long.

    Parameters
    ----------
    count : int
        Exposures of each light.
    stops : float
        Between two exposures.
    """

    count: int = 3
    stops: float = 3.0


def true_curve() -> NDArray[np.float64]:
    """Make the curve of a monitor that is no power: dark greys are crushed, and each channel has
    its own.

    Returns
    -------
    (3, 256) float64
    """
    values = np.linspace(0, 1, 256)
    powers = np.array([2.15, 2.25, 2.35])[:, None]
    return 0.92 * values**powers + 0.08 * values**5


@dataclass(frozen=True)
class MonitorRig:
    """Monitors and a camera.

    Parameters
    ----------
    monitors : Monitors
        As the laboratory has them. Their curve is measured by the rig itself.
    camera : Camera
    exposing : Exposing
    screen : TrueScreen
        What the monitors really do.
    falls : float
        How their light falls off with the angle, as a power of the cosine.
    ending : str
        Of the camera's files.
    seed : int
        Of the noise.
    """

    monitors: Monitors
    camera: simulate.Camera = field(default_factory=simulate.Camera)
    exposing: Exposing = Exposing()
    screen: simulate.TrueScreen = field(
        default_factory=lambda: simulate.TrueScreen(true_curve(), black=0.002)
    )
    falls: float = 0.0
    ending: str = "png"
    seed: int = 0

    @property
    def calibrated(self) -> Monitors:
        """The monitors with the curve that greys tell, which are shown without noise."""
        if self.monitors.curve is not None:
            return self.monitors
        steps = np.array(STEPS)
        curve = measured_curve(steps, self.screen.shows(steps))
        rows = tuple(tuple(float(x) for x in row) for row in curve)
        return replace(self.monitors, curve=rows, falls=self.falls)

    def photograph(
        self,
        moments: Callable[[int], NDArray],
        put: Put,
        ambient: NDArray | None = None,
        brightest: float | None = None,
    ) -> Description:
        """Take all photographs of a thing.

        Parameters
        ----------
        moments : callable
            Gives the pictures (6, H, W, 3) of a patch by its number, under each of
            `patterns.MONOMIALS`, of a screen whose white is 1. It is called for one patch after
            the other.
        put : callable
            Keeps the values (H, W, 3) of a photograph under its file's name.
        ambient : (H, W, 3) float, optional
            The light that is always there.
        brightest : float, optional
            The light that the shortest exposure is chosen for; by default the brightest of the
            first patches.

        Returns
        -------
        Description
            What the laboratory knows: the photographs, the monitors without their curve, which
            the grey steps tell, and the camera's curve where it is linear.
        """
        monitors, rng = self.calibrated, np.random.default_rng(self.seed)
        hemicube = hemicube_of(monitors)
        shows = simulate.emissions(self.screen, hemicube, monitors)
        sides = [monitors.sides.index(face) for face, _, _ in hemicube.grid]
        first = moments(0)
        room = np.zeros(first.shape[1:]) if ambient is None else np.asarray(ambient, np.float64)
        # what black screens shine: all patches of a side at once
        black = [np.zeros(room.shape) for _ in monitors.sides]
        most = 0.0
        for k in range(len(hemicube)):
            white = moments(k)[0]
            most = max(most, float(np.percentile(white, 99.9)))
            black[sides[k]] += self.screen.white * self.screen.black * white
        brightest = brightest or self.screen.white * most
        exposures = simulate.exposures_for(brightest, self.exposing.count, self.exposing.stops)
        # white fills the camera's picture, and is photographed for as long as it needs
        screens = simulate.exposures_for(
            self.screen.white * 1.05, self.exposing.count, self.exposing.stops
        )
        listed = [
            replace(photo, exposure=screens[exposures.index(photo.exposure or 0.0)])
            if photo.kind is Kind.STEP
            else photo
            for photo in photographs(self.monitors, hemicube, exposures, self.ending)
        ]
        listed += self._aside(screens)
        of: tuple[int, NDArray] | None = None
        for photo in listed:
            if photo.kind is Kind.STEP:
                light = self.screen.shows(np.array(photo.step))
                light = light * np.cos(np.radians(photo.angle or 0.0)) ** self.falls
                light = np.broadcast_to(light, room.shape)
            else:
                side = monitors.sides.index(photo.side or "")
                light = room + black[side]
            if photo.kind is Kind.PATTERN:
                k, p = photo.patch or 0, photo.pattern or 0
                if of is None or of[0] != k:
                    of = k, moments(k)
                scale = self.screen.white * (1 - self.screen.black)
                light = light + scale * simulate.basis_image(of[1], shows[p])
            put(photo.file, self.camera.values(light, photo.exposure or 1.0, rng))
        return Description(
            tuple(listed),
            monitors=replace(self.monitors, curve=None, falls=self.falls),
            width=room.shape[1],
            height=room.shape[0],
            curve=LINEAR if self.camera.curve == LINEAR else None,
        )

    def _aside(self, exposures: tuple[float, ...]) -> list[Photograph]:
        """White from the side, where the light falls off."""
        if not self.falls:
            return []
        side = self.monitors.sides[0]
        return [
            Photograph(
                f"steps/aside_{angle:02d}_{i}.{self.ending}",
                Kind.STEP,
                step=1.0,
                side=side,
                angle=float(angle),
                exposure=seconds,
            )
            for angle in ANGLES[1:]
            for i, seconds in enumerate(exposures)
        ]


@dataclass(frozen=True)
class DomeRig:
    """Lamps around a thing, and a camera.

    Parameters
    ----------
    directions : (N, 3) float
        From the thing to each lamp, in the hemicube's frame: x right, y away, z up.
    camera : Camera
    exposing : Exposing
    spread : float
        How far lamps differ in strength, as a standard deviation of its logarithm.
    ending : str
    seed : int
    """

    directions: NDArray
    camera: simulate.Camera = field(default_factory=simulate.Camera)
    exposing: Exposing = Exposing()
    spread: float = 0.0
    ending: str = "png"
    seed: int = 0

    def photograph(
        self, lit: Callable[[int], NDArray], put: Put, ambient: NDArray | None = None
    ) -> Description:
        """Take all photographs of a thing.

        Parameters
        ----------
        lit : callable
            Gives the picture (H, W, 3) in the light of a lamp by its number, of an irradiance of
            1 across its beam.
        put : callable
            Keeps the values of a photograph under its file's name.
        ambient : (H, W, 3) float, optional

        Returns
        -------
        Description
            With the lamps' directions and strengths.
        """
        rng = np.random.default_rng(self.seed)
        count = len(self.directions)
        strengths = np.exp(self.spread * rng.normal(size=count))
        first = lit(0)
        room = np.zeros(first.shape) if ambient is None else np.asarray(ambient, np.float64)
        brightest = max(
            float(np.percentile(lit(k), 99.9)) * float(strengths[k]) for k in range(count)
        )
        exposures = simulate.exposures_for(brightest, self.exposing.count, self.exposing.stops)
        listed = []
        for k in range(-1, count):
            light = room if k < 0 else room + strengths[k] * lit(k)
            for i, seconds in enumerate(exposures):
                end = f"_{i}.{self.ending}" if len(exposures) > 1 else f".{self.ending}"
                name = f"ambient{end}" if k < 0 else f"lamp_{k:03d}{end}"
                kind = Kind.AMBIENT if k < 0 else Kind.LIGHT
                listed.append(Photograph(name, kind, lamp=None if k < 0 else k, exposure=seconds))
                put(name, self.camera.values(light, seconds, rng))
        lamps = [
            Lamp((float(x), float(z), float(-y)), strength=(float(s),) * 3)  # type: ignore
            for (x, y, z), s in zip(self.directions, strengths, strict=True)
        ]
        return Description(
            tuple(listed),
            tuple(lamps),
            width=room.shape[1],
            height=room.shape[0],
            curve=LINEAR if self.camera.curve == LINEAR else None,
        )


def spiral(count: int, lowest: float = -1.0) -> NDArray[np.float64]:
    """Spread directions evenly.

    Parameters
    ----------
    count : int
    lowest : float
        The least height, -1 for a sphere and 0 for all that is above the ground.

    Returns
    -------
    (count, 3) float64
        Unit vectors, x right, y away, z up.
    """
    z = 1 - (np.arange(count) + 0.5) / count * (1 - lowest)
    turn = np.arange(count) * np.pi * (3 - np.sqrt(5))
    flat = np.sqrt(1 - z * z)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=-1)
