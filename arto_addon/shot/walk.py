"""Read every value of a data-block as bytes, and find the data-blocks that it points to.

Blender itself lists the properties of a data-block, so settings that a new Blender adds are read as
well. Properties that only change the artist's screen are left out: selection, colours of nodes,
folded panels.
"""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Generator, Iterable, Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...core.regular import open_regular
from ..work import driven

_DEPTH = 12


def _names(text: str) -> set[str]:
    return set(text.split())


# Properties of Blender's or ARTO's bookkeeping, and properties that change when they are read.
_NEVER = _names("""
    rna_type name name_full original session_uid users tag is_evaluated use_fake_user
    use_extra_user preview asset_data override_library library library_weak_reference
    animation_data id_data update_tag runtime_flag annotation grease_pencil bindcode depsgraph
    pixels execution_time persistent_uid is_runtime_data filepath_raw arto
""")
# Properties of an editor, which do not change the picture.
_SCREEN = _names("""
    select hide hide_select hide_viewport display display_type display_size empty_display_size
    empty_display_type lineart track_axis up_axis lock_location lock_rotation lock_scale
    lock_rotation_w lock_rotations_4d use_pin color_tag levels bound_box selection texture_mesh
    use_mesh_mirror_x use_mesh_mirror_y use_mesh_mirror_z use_mirror_topology use_paint_mask
    use_paint_mask_vertex use_paint_bone_selection use_mesh_edit_mode use_mirror_vertex_groups
    passepartout_alpha passepartout_color composition_guide_color use_camera_lock_parent
    select_control_point select_left_handle select_right_handle select_end select_point
    use_preview_world preview_render_type remesh_mode remesh_voxel_size symmetry_mode
    remesh_voxel_adaptivity use_remesh_fix_poles use_remesh_preserve_volume
    use_remesh_preserve_attributes
""")
_SCREEN_KEPT = {
    "show_render", "show_instancer_for_render", "show_only_shape_key", "show_unborn", "show_dead",
    "show_alive",
}  # fmt: skip
_NODES_OWN = {
    "location", "location_absolute", "width", "height", "dimensions", "color", "use_custom_color",
    "label", "parent", "warning_propagation", "internal_links",
}  # fmt: skip
# A transform is read by its channels (location, rotation, scale). These follow from the channels.
_DERIVED = {
    "matrix_world",
    "matrix_local",
    "matrix_basis",
    "matrix",
    "matrix_channel",
    "head",
    "tail",
}
# Kinds of data-blocks that objects may point to, and of which a render of the objects is not made.
_OTHERS = (
    bpy.types.Scene, bpy.types.World, bpy.types.Action, bpy.types.Text, bpy.types.Library,
    bpy.types.Screen, bpy.types.WorkSpace, bpy.types.WindowManager, bpy.types.Brush,
)  # fmt: skip
# Collections whose values are large arrays. `arrays` and `shape_keys` read them.
_ARRAYS = _names("""
    vertices edges loops polygons loop_triangles attributes uv_layers color_attributes points
    vertex_normals polygon_normals corner_normals skin_vertices curve_offset_data curves data
    position_data normals vertex_colors loop_triangle_polygons vertex_creases edge_creases
""")
_ARRAY_OWNERS = (
    bpy.types.Mesh, bpy.types.Curves, bpy.types.PointCloud, bpy.types.ShapeKey,
)  # fmt: skip


# A shader can read custom properties of these kinds of data-blocks only.
_CUSTOM = (bpy.types.Object, bpy.types.Mesh, bpy.types.Material, bpy.types.Camera, bpy.types.Light)


_OF_LAYER = {"VIEW_LAYER"}


class Walk:
    """The digest of a data-block, and in `found` the data-blocks that it points to.

    files: of each property that names a file or folder, what it belongs to, and its value;
    attributes: the names that Attribute nodes ask the view layer for.

    passed: parts of the data-block that do not count, by pointer and type.
    """

    def __init__(self, block: bpy.types.ID, passed: Iterable[tuple[int, type]] = ()) -> None:
        self._hash = hashlib.blake2b(digest_size=12)
        self.found: list[bpy.types.ID] = []
        self.files: list[tuple[bpy.types.bpy_struct, str]] = []
        self.attributes: set[str] = set()
        self._seen: set[tuple[int, type]] = set(passed)
        self._struct(block, 0)

    @property
    def digest(self) -> str:
        return self._hash.hexdigest()

    def _put(self, *values: object) -> None:
        self._hash.update(repr(values).encode("utf-8", "surrogatepass"))

    def _struct(self, value: bpy.types.bpy_struct, depth: int) -> None:
        # A socket points to its node, and the node to its sockets. So each is read only once.
        key = value.as_pointer(), type(value)
        if key in self._seen:
            return
        self._seen.add(key)
        node = isinstance(value, bpy.types.Node)
        if isinstance(value, bpy.types.ShaderNodeAttribute) and value.attribute_type in _OF_LAYER:
            self.attributes.add(value.attribute_name)
        for name, kind, array in _properties(type(value), value.bl_rna):
            if node and name in _NODES_OWN:
                continue
            if kind == "COLLECTION":
                self._collection(name, value, depth)
                continue
            item = getattr(value, name)
            if kind == "POINTER":
                self._pointer(name, item, depth)
            elif kind == "FLOAT" and array:
                self._put(name, [round(x, 6) for x in _flat(item)])
            elif kind == "FLOAT":
                self._put(name, round(item, 6))
            elif kind == "PATH":
                # A file's folder may change when the .blend moves, so only the file's name counts.
                self._put(name, item.replace("\\", "/").rpartition("/")[2])
                self.files.append((value, item))
            else:
                self._put(name, sorted(item) if isinstance(item, set) else _plain(item))
        if not isinstance(value, bpy.types.ID) or isinstance(value, _CUSTOM):
            self._custom(value)

    def _custom(self, value: bpy.types.bpy_struct) -> None:
        """Read custom properties, as drivers, Attribute nodes and modifiers depend on them."""
        try:
            names = sorted(value.keys())
        except (TypeError, AttributeError):
            return
        for name in names:
            item = value[name]
            if name.startswith(("arto", "_RNA_UI", "cycles")):
                continue
            if isinstance(item, bpy.types.ID):
                self._pointer(name, item, _DEPTH)
            elif isinstance(item, float):
                self._put(name, round(item, 6))
            elif isinstance(item, int | str | bool):
                self._put(name, item)
            elif hasattr(item, "to_list"):
                self._put(name, item.to_list())
            elif hasattr(item, "to_dict"):
                self._put(name, sorted(item.to_dict()))

    def _pointer(self, name: str, item: bpy.types.bpy_struct | None, depth: int) -> None:
        if item is None:
            return
        embedded = isinstance(item, bpy.types.ID) and item.is_embedded_data
        if isinstance(item, bpy.types.ID) and not embedded:
            if isinstance(item, bpy.types.Text):  # a lamp's profile, or a shader's script
                self._put(name, item.as_string())
            elif not isinstance(item, _OTHERS):
                self._put(name, type(item).__name__, item.name_full)
                self.found.append(item)
            return
        if depth < _DEPTH:
            self._put(name)
            self._struct(item, depth + 1)

    def _collection(self, name: str, value: bpy.types.bpy_struct, depth: int) -> None:
        if name in _ARRAYS and isinstance(value, _ARRAY_OWNERS):
            return
        if depth >= _DEPTH:
            return
        self._put(name)
        for item in getattr(value, name):
            if isinstance(item, bpy.types.NodeLink):
                self._put(item.from_node.name, item.from_socket.identifier)
                self._put(item.to_node.name, item.to_socket.identifier, item.is_muted)
            elif isinstance(item, bpy.types.ID):
                self._pointer(name, item, depth)
            elif item is not None:
                if hasattr(item, "name"):
                    self._put(item.name)
                self._struct(item, depth + 1)


def _plain(item: Any) -> object:
    return [_plain(i) for i in item] if isinstance(item, bpy.types.bpy_prop_array) else item


def _flat(item: bpy.types.bpy_prop_array) -> Iterator[float]:
    for x in item:
        if isinstance(x, float | int):
            yield x
        else:
            yield from _flat(x)


_kept: dict[type, list[tuple[str, str, bool]]] = {}


def _properties(kind: type, rna: bpy.types.Struct) -> list[tuple[str, str, bool]]:
    """List the properties of a type that may change a picture: (name, kind, whether an array)."""
    if kind not in _kept:
        out = []
        for prop in rna.properties:
            name = prop.identifier
            pointing = prop.type in {"POINTER", "COLLECTION"}
            # A name that is chosen from a list is a setting: the colour space of an image.
            chosen = name == "name" and prop.type == "ENUM"
            if (name in _NEVER and not chosen) or name in _SCREEN or name in _DERIVED:
                continue
            if name.startswith(("show_", "active_", "bl_")) and name not in _SCREEN_KEPT:
                continue
            if prop.is_readonly and not pointing:
                continue
            array = bool(getattr(prop, "is_array", False))
            path = prop.type == "STRING" and prop.subtype in {"FILE_PATH", "DIR_PATH"}
            out.append((name, "PATH" if path else prop.type, array))
        _kept[kind] = out
    return _kept[kind]


# Bytes that a checksum is made of in one go, in a few milliseconds.
_PIECE = 1 << 24
Pieces = Generator[None, None, bytes]


def checksum(values: np.ndarray) -> bytes:
    """A checksum of an array, which is enough to see a change, and five times as fast as a hash."""
    return zlib.crc32(values).to_bytes(4, "little")


def _checksum_in_pieces(values: np.ndarray) -> Pieces:
    every, found = values.view(np.uint8), 0
    for begin in range(0, len(every), _PIECE):
        found = zlib.crc32(every[begin : begin + _PIECE], found)
        yield
    return found.to_bytes(4, "little")


def arrays(data: bpy.types.ID) -> str:
    """The digest of the arrays of a mesh, hair curves or a point cloud."""
    return driven(arrays_in_pieces(data), lambda _: None)


def arrays_in_pieces(data: bpy.types.ID) -> Generator[None, None, str]:
    """The same digest, made in pieces that take a few milliseconds each.

    Between two pieces nothing of Blender's is held but the data-block. Raises ReferenceError where
    the data-block was changed meanwhile so that one of its arrays is gone.
    """
    out = hashlib.blake2b(digest_size=12)
    for name in [attribute.name for attribute in data.attributes]:
        # The edge of a corner follows from the vertices.
        if name.startswith(_EDITING) or name == ".corner_edge":
            continue
        attribute = data.attributes.get(name)
        if attribute is None:
            raise ReferenceError(f"{data.name} has no {name} any more")
        out.update(f"{name} {attribute.domain} {attribute.data_type}".encode())
        field, width, kind = _FIELDS.get(attribute.data_type, ("", 0, np.float32))
        if not field:
            out.update(repr([str(x.value) for x in attribute.data]).encode())
            yield
            continue
        values = np.empty(len(attribute.data) * width, kind)
        attribute.data.foreach_get(field, values)
        del attribute
        yield
        out.update((yield from _checksum_in_pieces(values)))
    if isinstance(data, bpy.types.Mesh):
        # Only counts: where each face begins takes longer to read than all the rest together.
        out.update(repr((len(data.polygons), len(data.loops))).encode())
    elif isinstance(data, bpy.types.Curves):
        starts = np.empty(len(data.curve_offset_data), np.int32)
        data.curve_offset_data.foreach_get("value", starts)
        out.update(checksum(starts))
    return out.hexdigest()


_EDITING = (".select", ".hide", ".uv_select", ".vs.", ".es.", ".pn.", ".sculpt")
_FIELDS: dict[str, tuple[str, int, type]] = {
    "FLOAT": ("value", 1, np.float32),
    "INT": ("value", 1, np.int32),
    "BOOLEAN": ("value", 1, np.bool_),
    "INT8": ("value", 1, np.int8),
    "FLOAT_VECTOR": ("vector", 3, np.float32),
    "FLOAT2": ("vector", 2, np.float32),
    "FLOAT_COLOR": ("color", 4, np.float32),
    "BYTE_COLOR": ("color", 4, np.float32),
    "INT32_2D": ("value", 2, np.int32),
    "INT16_2D": ("value", 2, np.int16),
    "QUATERNION": ("value", 4, np.float32),
    "FLOAT4X4": ("value", 16, np.float32),
}


def shape_keys(keys: bpy.types.Key) -> str:
    """The digest of the points of all shape keys."""
    out = hashlib.blake2b(digest_size=12)
    for block in keys.key_blocks:
        values = np.empty(len(block.data) * 3, np.float32)
        if len(block.data) and hasattr(block.data[0], "co"):
            block.data.foreach_get("co", values)
        out.update(checksum(values))
    return out.hexdigest()


# Digests of the contents of files, by path, size, both times and inode.
_contents: dict[tuple[str, int, int, int, int], str] = {}


def file(path: str, library: bpy.types.Library | None, then: str = "", full: bool = False) -> str:
    """The digest of a file: `size:time:digest of the contents`. then, full: see `image`."""
    if not path:
        return "none"
    try:
        # Relative to the open file: Blender adapts relative paths when it saves a copy elsewhere.
        there = Path(bpy.path.abspath(path, library=library))
        stat = there.stat()
        size, at = stat.st_size, stat.st_mtime_ns
        was = then.split(":")
        touched = len(was) == 3 and was[0] == str(size) and was[1] != str(at)
        if not (full or touched):
            same = was if was[:2] == [str(size), str(at)] else ["", "", ""]
            return f"{size}:{at}:{same[2]}"
        # A file that replaces another may have the same size and time, but never also the same
        # ctime and inode.
        key = str(there), size, at, stat.st_ctime_ns, stat.st_ino
        if key not in _contents:
            # a pipe or a device would be waited for, or read for ever
            with open_regular(there, follow=True) as f:
                _contents[key] = hashlib.file_digest(
                    f, lambda: hashlib.blake2b(digest_size=12)
                ).hexdigest()
    except OSError as e:  # The file cannot be read, and the digest says so.
        return f"{Path(path).name} {type(e).__name__}"
    return then if touched and was[2] == _contents[key] else f"{size}:{at}:{_contents[key]}"
