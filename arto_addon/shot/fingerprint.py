"""The fingerprint: what everything in the picture was when it was captured, thing by thing.

A dictionary from a thing in words, `Material 'Can paint'`, to a digest of it. Two of them tell
whether the scene is still the one that was captured, and if not, what has changed. It is of the
data that a render is made of, and not of the render: cheap enough to be asked again after each
change, because the arrays of meshes, which are most of it, are only read again when Blender says
that they changed.

What is worked out from that data (transforms under constraints, deformed meshes) is in it as well,
by names that begin with `=`, where the viewport has worked it out: such a thing is compared only
where both sides have it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

import bpy
import numpy as np

from . import walk

Fingerprint = dict[str, str]

# Settings of the scene that a capture leaves to the artist, and that change how it answers light.
_RENDER = (
    "filter_size", "use_motion_blur", "motion_blur_shutter", "motion_blur_position", "use_simplify",
    "simplify_subdivision_render", "simplify_child_particles_render", "simplify_volumes",
    "hair_type", "hair_subdiv", "use_high_quality_normals",
)  # fmt: skip
# Of Cycles, all but those that a capture sets itself, or that only how long it takes hangs on.
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

# By `session_uid`: digests of what Blender tells changes of, dropped when it does.
_arrays: dict[int, str] = {}
_evaluated: dict[int, str] = {}


def forget(changed: Iterable[int] | None = None) -> None:
    """Read these again (by `session_uid`), or everything."""
    for kept in (_arrays, _evaluated):
        if changed is None:
            kept.clear()
        else:
            for uid in changed:
                kept.pop(uid, None)


def fingerprint(
    scene: bpy.types.Scene, view_layer: str, then: Fingerprint | None = None, full: bool = False
) -> Fingerprint:
    """The fingerprint of what a view layer renders.

    then: one that it is going to be compared with, for files that only have another time; full:
    read the files in any case, for one that others are to be compared with.
    """
    then = then or {}
    if full:
        forget()
    layer = scene.view_layers[view_layer]
    roots: list[bpy.types.ID] = [*_rendered(layer), *filter(None, [scene.camera])]
    roots += filter(None, [layer.material_override])
    out = {"Render settings": _settings(scene, layer), **of_blocks(roots, then, full)}
    out |= _worked_out(layer)
    return dict(sorted(out.items()))


def of_blocks(
    roots: Iterable[bpy.types.ID],
    then: Fingerprint | None = None,
    full: bool = False,
    without: Iterable[bpy.types.NodeSocket] = (),
) -> Fingerprint:
    """The fingerprint of some data-blocks and all that they point to; see `fingerprint`.

    without: sockets whose values do not count.
    """
    passed = {(socket.as_pointer(), type(socket)) for socket in without}
    then, out = then or {}, {}
    queue = list(roots)
    seen = {block.session_uid for block in queue}
    while queue:
        block = queue.pop()
        name = _words(block)
        looked = walk.Walk(block, passed)
        digest = looked.digest
        if isinstance(block, _GEOMETRY):
            if block.session_uid not in _arrays:
                _arrays[block.session_uid] = walk.arrays(block)
            digest += _arrays[block.session_uid]
        elif isinstance(block, bpy.types.Key):
            if block.session_uid not in _arrays:
                _arrays[block.session_uid] = walk.shape_keys(block)
            digest += _arrays[block.session_uid]
        elif isinstance(block, bpy.types.Image):
            was = then.get(name, "")[len(digest) :]
            digest += walk.image(block, was, full)
        elif isinstance(block, _EXTERNAL):
            was = then.get(name, "")[len(digest) :]
            digest += walk.file(block.filepath, block.library, was, full)
        out[name] = digest
        for found in looked.found:
            if found.session_uid not in seen:
                seen.add(found.session_uid)
                queue.append(found)
    return out


def key_of(found: Fingerprint) -> str:
    """A short digest of the whole, without what only the viewport works out."""
    text = repr([(k, v) for k, v in found.items() if not k.startswith("=")])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def changes(then: Fingerprint, now: Fingerprint) -> list[str]:
    """What has changed since, in words, the most telling first."""
    out = []
    for name in sorted(then.keys() | now.keys(), key=_telling):
        a, b = then.get(name), now.get(name)
        if a == b:
            continue
        if name.startswith("="):
            # worked out under the same settings of the viewport, or not to be compared
            if a and b and a.split(":")[0] == b.split(":")[0]:
                out.append(f"{name[1:]} changed since")
        elif b is None:
            out.append(f"{name} is gone since")
        else:
            out.append(f"{name} {'is new' if a is None else 'changed'} since")
    return list(dict.fromkeys(out))


# An object is named after its data, and what it points to after it: the last word has what changed.
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


def _rendered(layer: bpy.types.ViewLayer) -> list[bpy.types.Object]:
    """The objects that a render of the view layer has, wherever the viewport hides them."""
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
    """Collections that the view layer holds out, or sees only in reflections."""
    own = [(there.name, there.holdout, there.indirect_only)]
    found = own if there.holdout or there.indirect_only else []
    return found + [f for child in there.children for f in _flags(child)]


def _worked_out(layer: bpy.types.ViewLayer) -> Fingerprint:
    """Transforms and deformed geometry, as far as the viewport has them."""
    depsgraph = layer.depsgraph
    if depsgraph is None or not depsgraph.scene:
        return {}
    out = {}
    for thing in _rendered(layer):
        if not thing.visible_get(view_layer=layer):
            continue
        if thing.session_uid not in _evaluated:
            _evaluated[thing.session_uid] = _shape(thing.evaluated_get(depsgraph), thing)
        matrix = [round(x, 5) for row in thing.matrix_world for x in row]
        digest = hashlib.blake2b(repr(matrix).encode(), digest_size=8).hexdigest()
        out[f"={_words(thing)}"] = f"{_evaluated[thing.session_uid]}{digest}"
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
