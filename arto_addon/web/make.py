"""Make a page: the shot as few numbers, its worlds, and how far it is from the plates."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import files
from ...core.errors import SceneError
from ...core.field.field import Field, proxy_folder
from ...core.field.head import HEADER
from ...core.preview import own_light
from ...core.units import size
from ...core.web import file, view
from ...core.web.budget import bare, bytes_for, within
from ...core.web.errors_of import Errors, errors, mirrors_of
from ...core.web.reader import Dials, Reader
from ...core.web.reduce import reduced
from ...core.web.shot import Shot, to_codes
from ..blender import denoise
from ..blender.scratch import temporary
from ..fit import guides
from ..plate.names import relit_file
from ..relight.relight import make_ready, with_own
from ..relight.shown import Light, Shown
from ..shot.home import check_outside
from ..shot.shot import check_same_shot
from ..work import Progress, Steps, Warned
from ..world.own import gains_of
from . import worlds
from .display import jpeg, table_of
from .pages import INDEX, SHOT, address, page

# The widest picture of a page. A wider shot is shown at a half, a quarter or an eighth.
WIDEST = 1280
# A light in which a page's picture is farther from the plate is warned of.
FAR = 0.05
# From this alpha on a pixel counts in the comparison with the plate.
OPAQUE = 0.999


@dataclass(frozen=True)
class Made:
    """A page that was made. index: the page of the folder; single: the page that is one file;
    bytes: of the shot without its worlds; errors: by the name of the world."""

    index: Path
    single: Path
    bytes: int
    whole: int
    components: int
    errors: dict[str, Errors]


def folder_of(scene: bpy.types.Scene) -> Path:
    """Where the button puts a page: beside the plate."""
    path = relit_file(scene)
    return path.with_name(f"{path.stem}_page")


def single_of(folder: Path) -> str:
    """The name of the page that is one file, in the folder of a page."""
    name = f"{folder.name}.html"
    return "page.html" if name == INDEX else name


def page_of(scene: bpy.types.Scene) -> Path:
    """The page that the button makes, as one file."""
    folder = folder_of(scene)
    return folder / single_of(folder)


def make(
    scene: bpy.types.Scene, view_layer: str, folder: Path, given: Sequence[Path] = ()
) -> Steps[Made]:
    """Make the page of a shot.

    folder: where it goes; given: environment maps to show in place of the looks. Raises SceneError,
    FieldError and what a relight raises.
    """
    check(folder)
    scene.view_layers[view_layer].update()
    shown = Shown(scene, view_layer)
    check_same_shot(scene, shown.field.about.shot, "the reflectance field", view_layer)
    if len(shown.takes) > 1:
        raise SceneError(
            "a shot with shadow catchers cannot become a page yet: its shadows are a ratio of two "
            "pictures. Make plates of its looks in place of it"
        )
    title = scene.name if scene.name != "Scene" else Path(bpy.data.filepath).stem or scene.name
    with ExitStack() as lent:
        there = worlds.worlds_of(scene, view_layer, given, lent)
        plates: dict[str, NDArray[np.float32]] = {}
        maps = []
        for i, (name, world) in enumerate(there.items()):
            yield Progress(0.3 * i / len(there), f"the plate and the map of '{name}'")
            plates[name] = yield from _plate(shown, folder, name, world)
            maps.append(worlds.reduced(scene, view_layer, name, world))
        field, factor = _sized(shown.field)
        yield Progress(0.3, "where the camera looks")
        sees = field.layer("alpha").min() < OPAQUE or field.tinted
        rays = worlds.rays_of(scene, view_layer) if sees else None
        shot: Shot | None = None
        for step in reduced(field, maps, rays, title, clean=_cleaner(shown, field)):
            if isinstance(step, Shot):
                shot = step
            else:
                yield Progress(0.32 + 0.5 * step, "the field as few numbers")
        assert shot is not None
        shot = within(_with_lamps(scene, field, shot), bytes_for(*field.shape))
    yield Progress(0.85, "how far it is from the plates")
    reader, found = Reader(shot), dict[str, Errors]()
    seen, mirror = field.layer("alpha") > OPAQUE, mirrors_of(shot)
    pictures = []
    for i, name in enumerate(plates):
        bare = reader.picture(Dials(world=i, behind=False))
        found[name] = errors(bare, _smaller(plates[name], factor), seen, mirror)
        pictures.append(reader.picture(Dials(world=i, behind=not scene.render.film_transparent)))
    about: dict[str, str | float] = {"behind": float(not scene.render.film_transparent)}
    about |= {f"error of {name}": round(e.all, 4) for name, e in found.items()}
    shot = replace(shot, view=table_of(scene), about=about)
    yield Progress(0.95, "writing the page")
    made = _write(scene, folder, title, shot, pictures, found)
    for name, error in found.items():
        words = f"'{name}': {error.all:.3f} from the plate, mirrors {error.mirrors:.3f}"
        if error.smooth > FAR:
            yield Warned(0.99, f"{words}. Small lamps are softer on the page than in the plate")
        else:
            yield Progress(0.99, words)
    yield Progress(
        1.0, f"wrote {made.index} and {made.single.name}: {size(made.whole)}, of it the shot "
        f"{size(made.bytes)} in {made.components} components"
    )  # fmt: skip
    return made


def check(folder: Path) -> None:
    """Raise SceneError where a page cannot be written into a folder, or would be over others'."""
    check_outside(folder, "a page")
    if folder.exists() and not folder.is_dir():
        raise SceneError(f"{folder} is no folder: choose another one for the page")
    if not files.is_writable(folder):
        raise SceneError(f"nothing can be written into {folder}: choose another one for the page")
    if not folder.is_dir() or not any(folder.iterdir()):
        return
    there = folder / SHOT
    if not (there.is_file() and there.open("rb").read(8) == file.MAGIC):
        raise SceneError(f"{folder} has files that are of no page: choose an empty folder")


def _sized(field: Field) -> tuple[Field, int]:
    """The field at the size of a page's picture, and how many times smaller it is."""
    factor = 1
    while field.shape[1] / factor > WIDEST and factor < 8:
        if not (proxy_folder(field.folder, 2 * factor) / HEADER).is_file():
            break
        factor *= 2
    return (field if factor == 1 else field.proxy(factor)), factor


def _smaller(picture: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """The means of blocks of a picture; blocks at the rims may be cut."""
    if factor == 1:
        return picture
    height, width = (-(-n // factor) * factor for n in picture.shape[:2])
    rows, columns = height - picture.shape[0], width - picture.shape[1]
    whole = np.pad(picture, ((0, rows), (0, columns), (0, 0)), mode="edge")
    blocks = whole.reshape(height // factor, factor, width // factor, factor, 3)
    return blocks.mean(axis=(1, 3))


def _cleaner(shown: Shown, field: Field):
    """The denoiser of a field's pictures; None where there is none or the artist wants none."""
    if not shown.scene.arto.denoise or not denoise.available():
        return None
    steer, clean = guides.guides_of(field), guides.clean(field)
    return lambda picture: denoise.denoise(steer, picture, clean=clean, like=shown.scene)


def _plate(
    shown: Shown, folder: Path, name: str, world: bpy.types.World
) -> Steps[NDArray[np.float32]]:
    """What a relight shows of the things in a world, before what is behind is added."""
    ready = yield from make_ready(shown, Light(folder / "plate.exr", name, world))
    picture = shown.pictures([ready.light])[0][0]
    parts, least, signed = yield from with_own(shown, ready, picture, ready.rendered[0])
    if shown.scene.arto.denoise and denoise.available():
        parts = [shown.denoised(*parts, signed=signed)]
    return np.maximum(sum(parts, np.zeros_like(parts[0])), least)


def _with_lamps(scene: bpy.types.Scene, field: Field, shot: Shot) -> Shot:
    """The shot with the gains of the artist's own lamps in them."""
    gains, whole = gains_of(scene), scene.arto.own_lamps
    own, scales = dict(shot.own), dict(shot.scales)
    for name in shot.own:
        if name == "own":
            light = own_light(field, whole, gains)
        else:
            light = whole * gains.get(name.removeprefix("own_"), 1.0) * field.layer(name)
        scales[name] = max(float(np.max(light)), 1e-6)
        own[name] = to_codes(light.transpose(2, 0, 1), scales[name])
    return replace(shot, own=own, scales=scales)


def _write(
    scene: bpy.types.Scene,
    folder: Path,
    title: str,
    shot: Shot,
    pictures: list[NDArray],
    found: dict[str, Errors],
) -> Made:
    """Write the folder, each file whole or not at all."""
    height, width = shot.size
    stills = []
    with temporary() as scratch:
        for i, picture in enumerate(pictures):
            light = view.shown(shot.view, picture.reshape(-1, 3)).reshape(height, width, 3)
            stills.append(jpeg(scene, light, scratch / f"{i}.jpg"))
        data = file.to_bytes(shot)
        (scratch / SHOT).write_bytes(data)
        names = [world.name for world in shot.worlds]
        single = single_of(folder)
        ratio = width / height
        texts = {
            INDEX: page(title, ratio, names, [f"look_{i}.jpg" for i in range(len(names))], single),
            single: page(title, ratio, names, list(map(address, stills)), single, data),
        }
        for name, text in texts.items():
            files.write_text(folder / name, text)
        for name in [SHOT, *(f"{i}.jpg" for i in range(len(stills)))]:
            to = folder / (name if name == SHOT else f"look_{name}")
            with files.whole(to) as partial:
                shutil.copyfile(scratch / name, partial)
    return Made(folder / INDEX, folder / single, bare(shot), len(data), len(shot.numbers), found)
