"""The head of a field: what `field.json` says, checked (docs/field-format.md).

>>> head = FieldHead(Hemicube(patches=1), height=1080, width=1920)
>>> said = head.to_json()
>>> said["version"], said["patches"], said["tiles"]
(3, 6, [])
>>> FieldHead.read(Values.of(said, Path("field.json"), FieldError)) == head
True
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from ..errors import FieldError, HemicubeError
from ..hemicube import Hemicube
from ..region import Region
from ..values import Values
from .about import About
from .tile import SUFFIX

FORMAT = "ARTO reflectance field"
VERSION = 3
# In fields of the version before, a tile is a folder (see `tile_folder`).
READ = (2, 3)
HEADER = "field.json"


@dataclass(frozen=True)
class FieldTile:
    """A tile's entry in the head of a field.

    Parameters
    ----------
    name : str
        Of its file in the field's folder; of a tile of version 2, of its folder.
    region : Region
        Its place in the picture.
    entries : mapping of str to int
        By the name of each support model in use, how many entries it has.
    proxies : mapping of int to FieldTile
        By their factors, its entries in the heads of the field's proxies.
    checksum : int or None
        Of its arrays, see `tile.checksum_of`. Fields of the version before do not say it.
    """

    name: str
    region: Region
    entries: Mapping[str, int]
    proxies: Mapping[int, FieldTile] = field(default_factory=dict)
    checksum: int | None = None

    @staticmethod
    def read(region: Region, said: Values, shape: tuple[int, int], patches: int) -> FieldTile:
        """From an entry of a head, whose region was read.

        Parameters
        ----------
        region : Region
            The tile's.
        said : Values
            The entry, in its file.
        shape : tuple of int
            Height and width of the picture.
        patches : int
            Those of the hemicube, K.

        Returns
        -------
        FieldTile

        Raises
        ------
        FieldError
            If a value is missing, of the wrong kind, or out of bounds.
        """
        kind = "folder" if "folder" in said.data else "file"
        name = said.file_name(said.data.get(kind), kind)
        if (kind == "file") != name.endswith(SUFFIX):
            raise said.wrong(kind, name)
        used = said.kind("entries", dict)
        if used is None:
            raise said.wrong("entries", used)
        for model in used:
            said.whole(model, 0, region.pixels * patches, used)
        proxies = {}
        for factor, entry in said.kind("proxies", dict, {}).items():
            if not factor.isdecimal() or not 2 <= int(factor) <= 64:
                raise said.wrong("proxies", factor)
            size = tuple(-(-side // int(factor)) for side in shape)
            of = {"height": size[0], "width": size[1], "tiles": [entry]}
            ((small, _),) = Values.of(of, said.path, said.error, "proxies.").tiles()
            within = said.inside(entry, "proxies", "proxies.")
            proxies[int(factor)] = FieldTile.read(small, within, (size[0], size[1]), patches)
        return FieldTile(name, region, used, proxies, said.count("checksum", 0, 2**32 - 1))

    def to_json(self) -> dict[str, Any]:
        """What `read` reads.

        Returns
        -------
        dict
            As `json` writes it.
        """
        r = self.region
        out: dict[str, Any] = {
            "file" if self.name.endswith(SUFFIX) else "folder": self.name,
            "region": [r.x, r.y, r.width, r.height],
            "entries": dict(self.entries),
        }
        if self.checksum is not None:
            out["checksum"] = self.checksum
        if self.proxies:
            out["proxies"] = {str(f): proxy.to_json() for f, proxy in self.proxies.items()}
        return out


@dataclass(frozen=True)
class FieldHead:
    """What a field holds, and of what it is.

    Parameters
    ----------
    hemicube : Hemicube
        Its patches.
    height, width : int
        Of the whole picture, in pixels.
    about : About
        What it was made from.
    tiles : tuple of FieldTile
        Those that are there.
    others : mapping
        What the file says besides; it is written again.
    """

    hemicube: Hemicube
    height: int
    width: int
    about: About = field(default_factory=About)
    tiles: tuple[FieldTile, ...] = ()
    others: Mapping[str, Any] = field(default_factory=dict)

    @staticmethod
    def read(said: Values) -> FieldHead:
        """From a `field.json`.

        Parameters
        ----------
        said : Values
            The description that the file is.

        Returns
        -------
        FieldHead

        Raises
        ------
        FieldError
            If a value is missing, of the wrong kind or out of bounds, naming it; for a field of
            another version.
        """
        if "version" not in said.data:
            raise said.error(f"{said.path} cannot be read (it has no version)")
        version = said.data["version"]
        if type(version) is not int or version not in READ:
            raise FieldError(
                f"{said.path.parent} is a field of version {version!s:.20}; this ARTO reads "
                f"version {VERSION}, and {READ[0]}: fit again from the capture set"
            )
        try:
            hemicube = Hemicube.from_json(said.kind("hemicube", dict, {}))
        except HemicubeError as e:
            raise said.damaged("hemicube", e) from e
        shape = said.shape()
        patches = len(hemicube)
        tiles = [
            FieldTile.read(region, said.inside(entry, "tiles"), shape, patches)
            for region, entry in said.tiles()
        ]
        said.check_apart([tile.region for tile in tiles])
        about = About.read(said.inside(said.kind("about", dict, {}), "about", "about."))
        known = ("format", "version", "patches", *(f.name for f in fields(FieldHead)))
        return FieldHead(hemicube, *shape, about, tuple(tiles), said.others(known))

    def to_json(self) -> dict[str, Any]:
        """What `read` reads, in the order in which files have it.

        Returns
        -------
        dict
            As `json` writes it.
        """
        return {
            "format": FORMAT,
            "version": VERSION,
            "height": self.height,
            "width": self.width,
            "hemicube": self.hemicube.to_json(),
            "patches": len(self.hemicube),
            "about": self.about.to_json(),
            **self.others,
            "tiles": [tile.to_json() for tile in self.tiles],
        }

    def with_tiles(self, entries: list[Mapping[str, Any]], folder: Path) -> FieldHead:
        """The head with tiles that are described elsewhere, as capture sets do.

        Parameters
        ----------
        entries : mapping of str to int
            Of each tile its entry in `field.json`.
        folder : Path
            The field's; messages name it.

        Returns
        -------
        FieldHead

        Raises
        ------
        FieldError
            If an entry is damaged.
        """
        return read(folder, self.to_json() | {"tiles": [dict(entry) for entry in entries]})


def read(folder: Path, data: dict[str, Any] | None = None) -> FieldHead:
    """The head of the field in a folder.

    Parameters
    ----------
    folder : Path
        The field's.
    data : dict, optional
        What its file will say, where it is not written yet.

    Returns
    -------
    FieldHead

    Raises
    ------
    FieldError
        If there is none, or it is damaged, or of another version.
    """
    path = folder / HEADER
    if data is not None:
        return FieldHead.read(Values.of(data, path, _damaged))
    if not path.is_file():
        raise FieldError(f"there is no reflectance field in {folder}: run Fit first")
    return FieldHead.read(Values(path, _damaged))


def _damaged(text: str) -> FieldError:
    return FieldError(f"{text}: fit again")
