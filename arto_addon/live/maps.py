"""Maps of worlds, made by a second Blender, so that the window never waits for a map.

The window saves the world into a small file and sends a question to the second Blender. The map
comes back a moment later. Only one question is on its way at a time. Questions do not queue: the
window asks again for what it wants by then.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import threading
from collections import OrderedDict
from dataclasses import asdict, dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import arrays, marked
from ...core.errors import ArtoError, SceneError
from ...core.memory import ended_by
from ..blender import scratch, scripts
from ..blender.addon import ADDON
from ..blender.colour import work_in, working_space
from ..job.snapshot import put_pixels
from ..shot import home
from ..shot.pixels import image as digest_of
from ..world import kept
from ..world.bake import rough
from ..world.check import check_world
from ..world.dials import without_dials
from ..world.studio import like_textures, of_textures
from .sent import Apart, Sent, images, put_back

# How a line with an answer begins: Blender prints other lines too.
ANSWER = "ARTO map "
# Width of a rough map, which takes a moment to make, and the number of maps kept in memory.
ROUGH_WIDTH = 512
MOST = 8
# The file of a map on its way, and the most bytes that it may have: 16384 x 8192 texels.
MAP, MOST_BYTES = "map.npy", 16384 * 8192 * 3 * 4
# Seconds that the second Blender has to end by itself.
_REAP = 2.0


@dataclass(frozen=True)
class Question:
    """What the window asks the second Blender for.

    blend: a file with the world in it; world: the world's name there; width: the width of a full
    map, 0 for a rough map; space: the working colour space; textures: see `studio.of_textures`;
    apart: its large packed images, see `sent`; painted: for each image that is in no file, its name
    and the file with its pixels; folder: where full maps are kept; out: the .npy file to write.
    """

    blend: str
    world: str
    width: int
    frame: int
    subframe: float
    space: str
    device: str
    textures: list[object]
    apart: list[Apart]
    painted: dict[str, str]
    folder: str
    out: str


class Maps:
    """The maps that the window has, by the key of their world, and the second Blender."""

    def __init__(self) -> None:
        """Make a temporary folder. Raises SceneError where there is no room for it."""
        try:
            self._folder = scratch.make()
        except OSError as e:
            raise SceneError(f"there is no room for temporary files ({e})") from e
        self._process: subprocess.Popen[str] | None = None
        self._found: OrderedDict[tuple[str, bool], NDArray[np.float32]] = OrderedDict()
        self._asked: tuple[str, bool] | None = None
        # the map that was made last, after the key of its world
        self.newest: tuple[str, NDArray[np.float32]] | None = None
        self._lock = threading.Lock()
        self.trouble = ""
        self._sent = Sent(self._folder)
        self._failed: dict[tuple[str, bool], str] = {}

    def start(self) -> None:
        """Start the second Blender. Raises SceneError where it cannot be started."""
        try:
            self._process = subprocess.Popen(
                command(),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                encoding="utf-8",
                errors="replace",
                **scripts.quietly(),
            )
        except OSError as e:
            raise SceneError(f"a second Blender cannot be started ({e})") from e
        threading.Thread(target=self._listen, args=(self._process,), daemon=True).start()

    def get(self, key: str, full: bool) -> NDArray[np.float32] | None:
        """The map (W / 2, W, 3) of a world at strength 1, not turned; None if not yet made."""
        with self._lock:
            found = self._found.get((key, full))
            if found is not None:
                self._found.move_to_end((key, full))
            return found

    def keep(self, key: str, image: NDArray[np.float32]) -> None:
        """Keep a rough map that was made without the second Blender."""
        with self._lock:
            self._add((key, False), image)

    def _add(self, of: tuple[str, bool], image: NDArray[np.float32]) -> None:
        self._found[of] = image
        self.newest = of[0], image
        while len(self._found) > MOST:
            self._found.popitem(last=False)

    def trouble_with(self, key: str) -> str:
        """Why a map of this world could not be made; empty where none has failed."""
        with self._lock:
            return self._failed.get((key, False)) or self._failed.get((key, True)) or ""

    @property
    def busy(self) -> bool:
        return self._asked is not None

    def ask(
        self, scene: bpy.types.Scene, layer: str, world: bpy.types.World, key: str, full: bool
    ) -> bool:
        """Ask for a map -> whether the question was sent.

        No question is sent while another is on its way, for a map that has failed before, or where
        the second Blender has just ended. Raises SceneError where the world cannot light anything
        or cannot be written.
        """
        if self._asked or (key, full) in self._failed:
            return False
        check_world(scene, layer)
        if self._process is None or self._process.poll() is not None:
            self.start()
        process = self._process
        assert process and process.stdin
        blend, name, apart = self._sent.world(scene, layer, world)
        painted, pixels = self._sent.painted(world)
        question = Question(
            blend=str(blend),
            world=name,
            width=scene.arto.environment_width if full else 0,
            frame=scene.frame_current,
            subframe=scene.frame_subframe,
            space=working_space(),
            device=scene.cycles.device,
            textures=of_textures(scene),
            apart=apart,
            painted=painted,
            folder=str(home.absolute(scene.arto.folder)),
            out=str(self._folder / MAP),
        )
        self._asked = (key, full)
        if pixels:  # writing many pixels takes long, and the window does not wait for it
            threading.Thread(target=self._send, args=(process, question, pixels)).start()
            return True
        return self._send(process, question, pixels)

    def _send(
        self,
        process: subprocess.Popen[str],
        question: Question,
        pixels: dict[Path, NDArray[np.float32]],
    ) -> bool:
        """Write painted pixels, then the question -> whether it was sent."""
        assert process.stdin
        try:
            for path, values in pixels.items():
                arrays.write(path, values)
        except OSError as e:
            self._sent.forget()
            self._answered(None, f"painted pixels cannot be written ({e}): make room on the disk")
            return False
        try:
            process.stdin.write(json.dumps(asdict(question)) + "\n")
            process.stdin.flush()
        except OSError:
            self._asked = None  # that Blender has ended: the next question starts another
            return False
        return True

    def _listen(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout
        for line in process.stdout:
            if line.startswith(ANSWER):
                try:
                    said = json.loads(line[len(ANSWER) :])
                    found = None if "error" in said else _map(self._folder / MAP)
                    self._answered(found, said.get("error", ""))
                except (OSError, ValueError, AttributeError, TypeError) as e:
                    self._answered(None, f"the map of the world cannot be read ({e})")
        # If a world makes the process end, the world counts as failed and is not tried again. If
        # another process has been started since, the open question is for the new process.
        try:
            how = ended_by(process.wait(_REAP))
        except subprocess.TimeoutExpired:
            how = "it closed its output"
        text = f"the Blender that makes maps of the world ended ({how}): change the world"
        self._answered(None, text, process)

    def _answered(
        self,
        found: NDArray[np.float32] | None,
        error: str,
        ended: subprocess.Popen[str] | None = None,
    ) -> None:
        """Close the open question: keep its map, or why there is none.

        ended: the process that has ended, where that is the answer.
        """
        with self._lock:
            if ended is not None and ended is not self._process:
                return
            asked, self._asked = self._asked, None
            if asked is None:
                return
            self.trouble = error
            if found is None:
                self._failed[asked] = error
                return
            self._add(asked, found)

    def close(self, wait: bool = True) -> None:
        """End the second Blender and remove the temporary files.

        wait: until that is done; the window does not wait.
        """
        leaving = threading.Thread(target=self._leave)
        leaving.start()
        if wait:
            leaving.join()

    def _leave(self) -> None:
        if self._process:
            with contextlib.suppress(OSError):
                assert self._process.stdin
                self._process.stdin.close()
            try:
                self._process.wait(_REAP)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        scratch.remove(self._folder)


def _map(path: Path) -> NDArray[np.float32]:
    """A map (W / 2, W, 3) that the second Blender made. Raises OSError, ValueError."""
    found = arrays.read(path, MOST_BYTES)
    if found.dtype != np.float32 or found.ndim != 3 or found.shape[1:] != (2 * len(found), 3):
        raise ValueError(f"it is no map, but {found.dtype} of {found.shape}")
    if not np.isfinite(found).all():
        raise ValueError("it is infinite or not a number in some texels")
    return found


def command() -> list[str]:
    """The command that starts the second Blender; a Python where Blender runs as a module."""
    if bpy.app.binary_path and not bpy.app.module:
        start = [bpy.app.binary_path, "-b", scripts.option(), "--addons", ADDON]
        return [*start, "--command", "arto", "maps"]
    run = f"import bpy, {ADDON}; {ADDON}.register(); from {__name__} import serve; serve()"
    return [sys.executable, "-c", run]


def serve() -> int:
    """Answer questions until the input ends, in the second Blender; returns the exit code."""
    for line in sys.stdin:
        try:
            said = {"map": _made(Question(**json.loads(line)))}
        except ArtoError as e:
            said = {"error": str(e)}
        except Exception as e:
            said = {"error": f"{type(e).__name__}: {e}"}
        print(ANSWER + json.dumps(said), flush=True)
    return 0


def _made(asked: Question) -> str:
    scene = bpy.context.scene
    work_in(asked.space)
    scene.frame_set(asked.frame, subframe=asked.subframe)
    scene.cycles.device = asked.device
    like_textures(scene, asked.textures)
    scene.arto.folder = asked.folder
    with bpy.data.libraries.load(asked.blend) as (_, into):
        into.worlds.append(asked.world)
    world = into.worlds[0]
    try:
        put_back(asked.apart)
        for name, pixels in asked.painted.items():
            image = bpy.data.images[name]
            put_pixels(image, Path(pixels))
        if not asked.width:
            for image in images(world):
                if reduced := _reduced(image):
                    image.user_remap(reduced)
        with without_dials(scene, scene.view_layers[0].name, world) as (plain, _, _):
            if asked.width:
                found = kept.environment(scene, asked.width, None, plain)
            else:
                found = rough(scene, ROUGH_WIDTH, plain)
        arrays.write(Path(asked.out), found.image)
    finally:
        bpy.data.worlds.remove(world)
        marked.remove_file(Path(asked.blend), "temporary")
        bpy.data.orphans_purge(do_recursive=True)
    return asked.out


# Names of reduced HDRIs, which Cycles loads in a moment, by what they were made from.
_small: dict[tuple[object, ...], str] = {}


def _reduced(image: bpy.types.Image) -> bpy.types.Image | None:
    """A smaller copy of an image, each pixel the mean of the pixels that it covers.

    None where the image is small already, was painted on, or is not a single file.
    """
    width, height = image.size
    scale = min(width // (2 * ROUGH_WIDTH), height // ROUGH_WIDTH)
    if image.source != "FILE" or scale < 2 or image.is_dirty:
        return None
    digest = digest_of(image)
    key = digest, image.filepath, image.colorspace_settings.name, image.alpha_mode
    if key in _small and _small[key] in bpy.data.images:
        return bpy.data.images[_small[key]]
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    w, h = width // scale, height // scale
    blocks = pixels.reshape(height, width, 4)[: h * scale, : w * scale]
    small = blocks.reshape(h, scale, w, scale, 4).mean(axis=(1, 3), dtype=np.float32)
    out = bpy.data.images.new("ARTO Reduced", w, h, alpha=True, float_buffer=image.is_float)
    out.colorspace_settings.name = image.colorspace_settings.name
    out.alpha_mode = image.alpha_mode
    out.pixels.foreach_set(np.ascontiguousarray(small).ravel())
    out.update()
    out.use_fake_user = True
    _small[key] = out.name
    return out
