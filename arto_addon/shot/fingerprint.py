"""The fingerprint: a digest of each thing in the picture, as the thing was when it was captured.

A fingerprint is a dictionary from a thing in words, `Material 'Can paint'`, to a digest of the
thing. Two fingerprints tell whether the scene is still as it was captured, and what has changed.
They are made of the scene's data, so nothing is rendered for them. Most of the data are the arrays
of meshes, which are only read again when Blender says that they changed. So a fingerprint is cheap
enough to be made after each change.

The viewport works out more from this data: transforms under constraints, and deformed meshes. These
are in the fingerprint by names that begin with `=`. They are compared only where both fingerprints
have them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Generator, Iterable

import bpy
import numpy as np

from ..blender.markers import camera_of
from ..work import driven
from . import external, pixels, walk

Fingerprint = dict[str, str]

# Settings of the scene that a capture leaves to the artist, and that change how the scene answers
# light.
_RENDER = (
    "filter_size", "use_motion_blur", "motion_blur_shutter", "motion_blur_position", "use_simplify",
    "simplify_subdivision_render", "simplify_child_particles_render", "simplify_volumes",
    "hair_type", "hair_subdiv", "use_high_quality_normals",
)  # fmt: skip
# Beginnings of the names of Cycles' settings that do not count: a capture sets them itself, or they
# only change how long a render takes. All other settings of Cycles count.
_CYCLES_NOT = (
    "preview_", "denois", "adaptive", "debug_", "bake_", "samples", "seed", "device", "tile_",
    "use_auto_tile", "time_limit", "use_denois", "use_preview", "use_adaptive", "use_animated_seed",
    "use_layer_samples", "use_sample_subset", "sample_", "sampling_pattern", "use_light_tree",
    "use_guiding", "guiding_", "use_deterministic", "use_surface_guiding", "use_volume_guiding",
    "use_progressive", "progressive", "scrambling", "auto_scrambling",
    "use_fast_gi", "film_transparent_glass", "film_transparent_roughness", "use_square_samples",
)  # fmt: skip
_LAYER = (
    "material_override",
    "use_solid",
    "use_sky",
    "use_strand",
    "use_volumes",
    "use_motion_blur",
)
_GEOMETRY = (bpy.types.Mesh, bpy.types.Curves, bpy.types.PointCloud)
_EXTERNAL = (bpy.types.Volume, bpy.types.CacheFile)

# Digests by `session_uid`. Each is dropped when Blender says that its data-block has changed.
_arrays: dict[int, str] = {}
_evaluated: dict[int, str] = {}


def forget(changed: Iterable[int] | None = None) -> None:
    """Drop the kept digests of data-blocks. changed: their `session_uid`s; None for all."""
    for kept in (_arrays, _evaluated):
        if changed is None:
            kept.clear()
        else:
            for uid in changed:
                kept.pop(uid, None)


def fingerprint(
    scene: bpy.types.Scene, view_layer: str, then: Fingerprint | None = None, full: bool = False
) -> Fingerprint:
    """Make the fingerprint of what a view layer renders.

    then: the fingerprint that the new one will be compared with. By `then`, a file with a new time
    and the old contents counts as unchanged. full: read all files, whatever their times. This is
    for the fingerprint of a capture, with which later ones are compared.
    """
    return driven(in_pieces(scene, view_layer, then, full), lambda _: None)


Pieces = Generator[None, None, Fingerprint]


def in_pieces(
    scene: bpy.types.Scene, view_layer: str, then: Fingerprint | None = None, full: bool = False
) -> Pieces:
    """Make the same fingerprint in pieces of a few milliseconds each.

    The scene must not change between two pieces: the fingerprint is then of no scene, and is to be
    begun again. Where something was removed meanwhile, a piece raises ReferenceError.
    """
    then = then or {}
    if full:
        forget()
    layer = scene.view_layers[view_layer]
    roots: list[bpy.types.ID] = [*rendered_objects(layer), *filter(None, [camera_of(scene)])]
    roots += filter(None, [layer.material_override])
    out = {"Render settings": _settings(scene, layer)}
    del layer
    asked: set[str] = set()
    out |= yield from _blocks(roots, then, full, set(), scene.frame_current, asked)
    for name in asked:
        there = scene.view_layers[view_layer]
        out[f"Attribute '{name}' of the view layer"] = external.attribute(scene, there, name)
    out |= yield from _worked_out(scene, view_layer)
    return dict(sorted(out.items()))


def of_blocks(
    roots: Iterable[bpy.types.ID],
    then: Fingerprint | None = None,
    full: bool = False,
    without: Iterable[bpy.types.NodeSocket] = (),
) -> Fingerprint:
    """Make the fingerprint of some data-blocks and all that they point to.

    then, full: see `fingerprint`; without: sockets whose values do not count.
    """
    passed = {(socket.as_pointer(), type(socket)) for socket in without}
    return driven(_blocks(roots, then or {}, full, passed), lambda _: None)


def _blocks(
    roots: Iterable[bpy.types.ID],
    then: Fingerprint,
    full: bool,
    passed: set[tuple[int, type]],
    frame: int | None = None,
    asked: set[str] | None = None,
) -> Pieces:
    """Make the fingerprint of data-blocks, in pieces.

    passed: parts that do not count; frame: of sequences of files, None where it does not count;
    asked: gets the names that Attribute nodes ask the view layer for.
    """
    out: Fingerprint = {}
    queue = list(roots)
    seen = {block.session_uid for block in queue}
    while queue:
        block = queue.pop()
        name = _words(block)
        looked = walk.Walk(block, passed)
        digest = looked.digest
        if isinstance(block, _GEOMETRY):
            if block.session_uid not in _arrays:
                _arrays[block.session_uid] = yield from walk.arrays_in_pieces(block)
            digest += _arrays[block.session_uid]
        elif isinstance(block, bpy.types.Key):
            if block.session_uid not in _arrays:
                _arrays[block.session_uid] = walk.shape_keys(block)
            digest += _arrays[block.session_uid]
        elif isinstance(block, bpy.types.Image):
            was = then.get(name, "")[len(digest) :]
            digest += pixels.image(block, was, full, frame)
        elif isinstance(block, _EXTERNAL):
            was = then.get(name, "")[len(digest) :]
            digest += external.digest(external.of_block(block, frame), was, full)
        if named := list(external.named(block, looked.files, frame)):
            was = then.get(name, "")[len(digest) :]
            digest += external.digest_named(named, was, full, frame)
        if asked is not None:
            asked |= looked.attributes
        out[name] = digest
        for found in looked.found:
            if found.session_uid not in seen:
                seen.add(found.session_uid)
                queue.append(found)
        yield
    return out


def images_of(found: Fingerprint) -> list[bpy.types.Image]:
    """The images that a fingerprint of the scene as it is has seen."""
    return [image for image in bpy.data.images if _words(image) in found]


def key_of(found: Fingerprint) -> str:
    """A short digest of a whole fingerprint, without what the viewport has worked out."""
    text = repr([(k, v) for k, v in found.items() if not k.startswith("=")])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def changes(then: Fingerprint, now: Fingerprint) -> list[str]:
    """List in words what differs between two fingerprints, the most telling change first."""
    out = []
    for name in sorted(then.keys() | now.keys(), key=_telling):
        a, b = then.get(name), now.get(name)
        if a == b:
            continue
        if name.startswith("="):
            # Comparable only if both were worked out under the same settings of the viewport.
            if a and b and a.split(":")[0] == b.split(":")[0]:
                out.append(f"{name[1:]} changed since")
        elif b is None:
            out.append(f"{name} is gone since")
        else:
            out.append(f"{name} {'is new' if a is None else 'changed'} since")
    return list(dict.fromkeys(out))


# The order in which changes are told. A change of a mesh or a material says more than that its
# object has changed as well, so objects come late.
_ORDER = ("Material", "Mesh", "Light", "Image", "Camera", "Curve", "Node", "Object", "Collection")


def _telling(name: str) -> tuple[bool, int, str]:
    kind = next((i for i, k in enumerate(_ORDER) if name.startswith(k)), len(_ORDER))
    return name.startswith("="), kind, name


def _words(block: bpy.types.ID) -> str:
    kind = block.bl_rna.name
    kind = {"Shader Node Tree": "Node group", "Geometry Node Tree": "Node group"}.get(kind, kind)
    if isinstance(block, bpy.types.Light):
        kind = "Light"
    elif isinstance(block, bpy.types.Curve):
        kind = "Curve"
    library = f" ({block.library.name})" if block.library else ""
    return f"{kind} '{block.name}'{library}"


def rendered_objects(layer: bpy.types.ViewLayer) -> list[bpy.types.Object]:
    """The objects that a render of the view layer has, also those that the viewport hides."""
    out: dict[int, bpy.types.Object] = {}

    def visit(there: bpy.types.LayerCollection) -> None:
        if there.exclude:
            return
        if not there.collection.hide_render:
            for thing in there.collection.objects:
                if not thing.hide_render:
                    out[thing.session_uid] = thing
        for child in there.children:
            visit(child)

    visit(layer.layer_collection)
    return list(out.values())


def _settings(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> str:
    parts: list[object] = [(n, getattr(scene.render, n, None)) for n in _RENDER]
    for owner in (scene.cycles, scene.cycles_curves, layer.cycles):
        for prop in owner.bl_rna.properties:
            name = prop.identifier
            if prop.type in {"POINTER", "COLLECTION"} or name.startswith(("bl_", *_CYCLES_NOT)):
                continue
            if not name.startswith(("use_pass", "pass_")) and not prop.is_readonly:
                value = getattr(owner, name)
                parts.append((name, round(value, 6) if isinstance(value, float) else value))
    parts += [(n, str(getattr(layer, n, None))) for n in _LAYER]
    parts += _flags(layer.layer_collection)
    return hashlib.blake2b(repr(parts).encode(), digest_size=12).hexdigest()


def _flags(there: bpy.types.LayerCollection) -> list[object]:
    """The collections that the view layer holds out, or shows only indirectly."""
    own = [(there.name, there.holdout, there.indirect_only)]
    found = own if there.holdout or there.indirect_only else []
    return found + [f for child in there.children for f in _flags(child)]


def _worked_out(scene: bpy.types.Scene, view_layer: str) -> Pieces:
    """Digests of the transforms and deformed geometry that the viewport has worked out."""
    out: Fingerprint = {}
    for thing in rendered_objects(scene.view_layers[view_layer]):
        layer = scene.view_layers[view_layer]
        depsgraph = layer.depsgraph
        if depsgraph is None or not depsgraph.scene:
            return {}
        if not thing.visible_get(view_layer=layer):
            continue
        if thing.session_uid not in _evaluated:
            _evaluated[thing.session_uid] = _shape(thing.evaluated_get(depsgraph), thing)
        matrix = [round(x, 5) for row in thing.matrix_world for x in row]
        digest = hashlib.blake2b(repr(matrix).encode(), digest_size=8).hexdigest()
        out[f"={_words(thing)}"] = f"{_evaluated[thing.session_uid]}{digest}"
        del layer, depsgraph
        yield
    return out


def _shape(evaluated: bpy.types.Object, thing: bpy.types.Object) -> str:
    """`<viewport's settings>:<digest of the deformed points>` of an object."""
    shown = [
        (m.name, m.show_viewport, getattr(m, "levels", 0), getattr(m, "show_on_cage", 0))
        for m in thing.modifiers
    ]
    settings = hashlib.blake2b(repr([shown, thing.mode]).encode(), digest_size=4).hexdigest()
    mesh = evaluated.data if isinstance(evaluated.data, bpy.types.Mesh) else None
    if mesh is None or not thing.modifiers:
        return f"{settings}:"
    points = np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.vertices.foreach_get("co", points)
    return f"{settings}:{walk.checksum(points).hex()}"
