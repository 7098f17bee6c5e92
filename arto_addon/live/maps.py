"""Maps of worlds, made by a Blender of their own, so that the window never waits for one.

The window saves the world into a small file, asks for a map, and has it a moment later. One
question is on its way at a time; of those that wait, the newest wins.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import tempfile
import threading
from collections import OrderedDict
from dataclasses import asdict, dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import marked
from ...core.errors import ArtoError, SceneError
from ..blender import scripts
from ..blender.addon import ADDON
from ..blender.colour import work_in, working_space
from ..blender.nodes import shader_tree, trees
from ..job.snapshot import in_no_file, painted_pixels
from ..shot import home, walk
from ..world import kept
from ..world.bake import rough
from ..world.check import check_world
from ..world.dials import without_dials

# What the answer to a question begins with, among what Blender prints.
ANSWER = "ARTO map "
# Widths of a map that is made in a moment, and maps that stay in memory.
ROUGH_WIDTH = 512
MOST = 8
_REAP = 2.0


@dataclass(frozen=True)
class Question:
    """What the window asks for. blend: a file with the world in it; width: of a full map, 0 for a
    rough one; painted: images in no file, by name, and where their pixels are; folder: where full
    maps are kept; out: the .npy to write."""

    blend: str
    world: str
    width: int
    frame: int
    subframe: float
    space: str
    device: str
    painted: dict[str, str]
    folder: str
    out: str


class Maps:
    """The window's side: maps by what they are of, and the Blender that makes them."""

    def __init__(self) -> None:
        """Raises SceneError where there is no room for its files."""
        try:
            self._folder = Path(tempfile.mkdtemp(prefix="arto-live-"))
            marked.mark(self._folder, "maps")
        except OSError as e:
            raise SceneError(f"there is no room for temporary files ({e})") from e
        self._process: subprocess.Popen[str] | None = None
        self._found: OrderedDict[tuple[str, bool], NDArray[np.float32]] = OrderedDict()
        self._asked: tuple[str, bool] | None = None
        # the last one that was made: what it is of, and it
        self.newest: tuple[str, NDArray[np.float32]] | None = None
        self._lock = threading.Lock()
        self.trouble = ""
        self._number = 0
        self._failed: dict[tuple[str, bool], str] = {}

    def start(self) -> None:
        """Start the Blender. Raises SceneError."""
        try:
            self._process = subprocess.Popen(
                command(),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                encoding="utf-8",
                errors="replace",
            )
        except OSError as e:
            raise SceneError(f"a second Blender cannot be started ({e})") from e
        threading.Thread(target=self._listen, args=(self._process,), daemon=True).start()

    def get(self, key: str, full: bool) -> NDArray[np.float32] | None:
        """A map of strength 1 and no turn, (W / 2, W, 3), if it is there."""
        with self._lock:
            found = self._found.get((key, full))
            if found is not None:
                self._found.move_to_end((key, full))
            return found

    def trouble_with(self, key: str) -> str:
        """Why no map of that can be made; empty where one was, or nobody has tried."""
        with self._lock:
            return self._failed.get((key, False)) or self._failed.get((key, True)) or ""

    @property
    def busy(self) -> bool:
        return self._asked is not None

    def ask(
        self, scene: bpy.types.Scene, layer: str, world: bpy.types.World, key: str, full: bool
    ) -> bool:
        """Have a map made, if none is on its way -> whether it is now, or cannot be made.

        Raises SceneError where the world cannot light anything.
        """
        if self._asked or (key, full) in self._failed:
            return False
        check_world(scene, layer)
        if self._process is None or self._process.poll() is not None:
            self.start()
        process = self._process
        assert process and process.stdin
        # another name each time: a Blender that has read a library knows it
        self._number += 1
        blend = self._folder / f"world{self._number}.blend"
        painted = {}
        # images are named by whole paths: the file lies elsewhere
        written = world.copy() if world.library else world  # what is linked is in no other file
        name = written.name
        try:
            bpy.data.libraries.write(str(blend), {written}, path_remap="ABSOLUTE", fake_user=True)
        except (OSError, RuntimeError) as e:
            raise SceneError(f"the world cannot be written to {blend} ({e})") from e
        finally:
            if written != world:
                bpy.data.worlds.remove(written)
        for image in images(world):
            if in_no_file(image):
                painted[image.name] = str(self._folder / painted_pixels(image, self._folder))
        question = Question(
            blend=str(blend),
            world=name,
            width=scene.arto.environment_width if full else 0,
            frame=scene.frame_current,
            subframe=scene.frame_subframe,
            space=working_space(),
            device=scene.cycles.device,
            painted=painted,
            folder=str(home.absolute(scene.arto.folder)),
            out=str(self._folder / "map.npy"),
        )
        self._asked = (key, full)
        try:
            process.stdin.write(json.dumps(asdict(question)) + "\n")
            process.stdin.flush()
        except OSError:
            self._asked = None  # it has ended: another one is started with the next question
            return False
        return True

    def _listen(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout
        for line in process.stdout:
            if line.startswith(ANSWER):
                try:
                    said = json.loads(line[len(ANSWER) :])
                    found = None if "error" in said else np.load(said["map"])
                    self._answered(found, said.get("error", ""))
                except (OSError, ValueError, EOFError, KeyError) as e:
                    self._answered(None, f"the map of the world cannot be read ({e})")
        # a world that ends it is not asked for again; what was asked of the next one is not its
        if process is self._process:
            self._answered(None, "the Blender that makes maps of the world ended: change the world")

    def _answered(self, found: NDArray[np.float32] | None, error: str) -> None:
        """What was asked for has come, or never will."""
        with self._lock:
            asked, self._asked = self._asked, None
            if asked is None:
                return
            self.trouble = error
            if found is None:
                self._failed[asked] = error
                return
            self._found[asked] = found
            self.newest = asked[0], found
            while len(self._found) > MOST:
                self._found.popitem(last=False)

    def close(self) -> None:
        """End it, and remove its files."""
        if self._process:
            with contextlib.suppress(OSError):
                assert self._process.stdin
                self._process.stdin.close()
            try:
                self._process.wait(_REAP)
            except subprocess.TimeoutExpired:
                self._process.kill()
        marked.remove_quietly(self._folder, "maps", self._folder.parent)


def images(world: bpy.types.World) -> list[bpy.types.Image]:
    """The images of a world's nodes."""
    found = [n for t in trees(shader_tree(world), set()) for n in t.nodes]
    return [n.image for n in found if getattr(n, "image", None)]


def command() -> list[str]:
    """What starts the Blender that makes maps; of Blender as a module, a Python with it."""
    if bpy.app.binary_path and not bpy.app.module:
        start = [bpy.app.binary_path, "-b", scripts.option(), "--addons", ADDON]
        return [*start, "--command", "arto", "maps"]
    run = f"import bpy, {ADDON}; {ADDON}.register(); from {__name__} import serve; serve()"
    return [sys.executable, "-c", run]


def serve() -> int:
    """That Blender's side: answer questions until there are no more; the exit code."""
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
    scene.arto.folder = asked.folder
    with bpy.data.libraries.load(asked.blend) as (_, into):
        into.worlds = [asked.world]
    world = into.worlds[0]
    try:
        for name, pixels in asked.painted.items():
            image = bpy.data.images[name]
            image.pixels.foreach_set(np.load(pixels))
            image.update()
        if not asked.width:
            for image in images(world):
                if reduced := _reduced(image):
                    image.user_remap(reduced)
        with without_dials(world) as (plain, _, _):
            if asked.width:
                found = kept.environment(scene, asked.width, None, plain)
            else:
                found = rough(scene, ROUGH_WIDTH, plain)
        np.save(asked.out, found.image)
    finally:
        bpy.data.worlds.remove(world)
        marked.remove_file(Path(asked.blend), "maps")
        bpy.data.orphans_purge(do_recursive=True)
    return asked.out


# By what they are of: HDRIs brought to a size that Cycles has in a moment.
_small: dict[tuple[object, ...], str] = {}


def _reduced(image: bpy.types.Image) -> bpy.types.Image | None:
    """An image of fewer pixels, each the mean of those that it covers; None for one that is small,
    or that is more than one picture."""
    width, height = image.size
    scale = min(width // (2 * ROUGH_WIDTH), height // ROUGH_WIDTH)
    if image.source != "FILE" or scale < 2 or image.is_dirty:
        return None
    digest = walk.image(image)
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
