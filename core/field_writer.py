"""Writing a reflectance field, tile by tile; it is there only when it is complete."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from .errors import FieldError
from .field import HEADER, VERSION
from .files import PART, replace_folder, whole, write_text
from .hemicube import Hemicube
from .region import Region
from .supports import BY_CODE, NOTHING, REST

# A patch's brightest coefficient in its units: under the largest half float.
LARGEST = 6e4


class TileWriter:
    """Collects one tile's entries, patch after patch, and writes them at the end."""

    def __init__(self, region: Region, layers: dict[str, NDArray]) -> None:
        self.region = region
        self.layers = layers
        self.codes: list[NDArray] = []
        self.scales: list[float] = []
        self.parts: dict[int, tuple[list[NDArray], list[NDArray]]] = {}
        # what was dropped: by pixel and channel, and by patch
        self.rest: NDArray[np.float64] = np.zeros((region.pixels, 3))
        self.rest_of: list[float] = []

    def add(self, codes: NDArray, coefficient: NDArray, parameters: dict[int, NDArray]) -> None:
        """The next patch: model code (n,), R (n, 3), and each used code's parameters (m, p).

        Light without an entry is added to the pixel's rest. A coefficient below 0, which only
        patterns that do not fit together can give, is no light. Raises FieldError for one that is
        no number.
        """
        low, high = coefficient.min(initial=0), coefficient.max(initial=0)
        if not (low > -np.inf and high < np.inf):  # which NaN fails too
            self._refuse(coefficient)
        if low < 0:
            coefficient = np.maximum(coefficient, 0)
        # half floats are relative to the patch's brightest, so that any exposure fits them; that is
        # at their upper end, so that a firefly leaves nine decades below it their precision
        scale = float(high) / LARGEST or 1.0
        lit = (coefficient[:, 0] > 0) | (coefficient[:, 1] > 0) | (coefficient[:, 2] > 0)
        dropped = np.flatnonzero((codes == NOTHING) & lit)
        codes = codes.copy()
        codes[dropped] = REST
        self.rest[dropped] += coefficient[dropped]
        self.rest_of.append(float(coefficient[dropped].sum(dtype=np.float64)))
        self.codes.append(codes)
        self.scales.append(scale)
        for code, values in parameters.items():
            r, p = self.parts.setdefault(code, ([], []))
            r.append((coefficient[codes == code] / scale).astype(np.float16))
            p.append(np.rint(np.clip(values, 0, 1) * 65535).astype(np.uint16))

    def _refuse(self, coefficient: NDArray) -> NoReturn:
        bad = np.flatnonzero(~np.isfinite(coefficient).all(axis=-1))
        row, column = divmod(int(bad[0]), self.region.width)
        raise FieldError(
            f"patch {len(self.codes)} has reflection coefficients that are infinite or not a "
            f"number in {len(bad)} pixels, the first at ({self.region.x + column}, "
            f"{self.region.y + row}): repair the basis images there, or capture again"
        )

    def write(self, folder: Path) -> dict[str, int]:
        """Write the arrays; returns how many entries each model took."""
        folder.mkdir(parents=True)
        codes = np.stack(self.codes)
        np.save(folder / "codes.npy", codes)
        np.save(folder / "scales.npy", np.array(self.scales, np.float32))
        used = {}
        for code, (r, p) in sorted(self.parts.items()):
            name = BY_CODE[code].name
            np.save(folder / f"{name}_coefficient.npy", np.concatenate(r))
            np.save(folder / f"{name}_parameters.npy", np.concatenate(p))
            used[name] = sum(map(len, r))
        if self.rest.any():
            np.save(folder / "rest.npy", self.rest.astype(np.float32))
            # relative to the largest: only their ratios count, and none that is one may vanish
            weights = np.array(self.rest_of) / max(self.rest_of)
            weights = np.where(weights > 0, np.maximum(weights, 1e-30), 0)
            np.save(folder / "rest_weights.npy", weights.astype(np.float32))
        for name, pixels in self.layers.items():
            write_layer(folder, name, pixels)
        return used


def describe(hemicube: Hemicube, shape: tuple[int, int], **about: Any) -> dict[str, Any]:
    """A new `field.json` without tiles. `about` takes whatever else a reader should know."""
    return {
        "format": "ARTO reflectance field",
        "version": VERSION,
        "height": shape[0],
        "width": shape[1],
        "hemicube": hemicube.to_json(),
        "patches": len(hemicube),
        "about": about,
        "tiles": [],
    }


def write_tile(
    folder: Path, number: int, tile: TileWriter, of: Path | None = None
) -> dict[str, Any]:
    """Write a tile into the folder of a field, whole or not at all -> its entry in `field.json`.

    of: the field that it will be, for messages. Raises FieldError.
    """
    name = f"tile_{number:04d}"
    r = tile.region
    partial = folder / (name + PART)
    with _writing(of or folder):
        shutil.rmtree(partial, ignore_errors=True)
        used = tile.write(partial)
        replace_folder(partial, folder / name)
    return {"folder": name, "region": [r.x, r.y, r.width, r.height], "entries": used}


def write_head(folder: Path, head: dict[str, Any]) -> None:
    """Write `field.json`: with it the field is one. Raises FieldError."""
    with _writing(folder):
        write_text(folder / HEADER, json.dumps(head, indent=1))


def write_layer(folder: Path, name: str, pixels: NDArray) -> None:
    """Write one of `field.LAYERS` of a tile into its folder, whole or not at all."""
    dtype = np.float32 if name in ("own", "depth") else np.float16
    with whole(folder / f"{name}.npy") as partial, partial.open("wb") as f:
        np.save(f, pixels.astype(dtype))


class FieldWriter:
    """Writes a field tile by tile. It is there only once `close` has returned."""

    def __init__(self, folder: Path, hemicube: Hemicube, shape: tuple[int, int], **about: Any):
        self.folder = folder
        self.partial = folder.with_name(folder.name + PART)
        self.head = describe(hemicube, shape, **about)
        with _writing(folder):
            shutil.rmtree(self.partial, ignore_errors=True)
            self.partial.mkdir(parents=True)

    def add(self, tile: TileWriter) -> None:
        self.head["tiles"].append(
            write_tile(self.partial, len(self.head["tiles"]), tile, self.folder)
        )

    def close(self) -> None:
        write_head(self.partial, self.head)
        with _writing(self.folder):
            replace_folder(self.partial, self.folder)

    def abandon(self) -> None:
        """Remove what was written; a field that was there before stays."""
        shutil.rmtree(self.partial, ignore_errors=True)


class _writing:
    """Turns a failing write into a FieldError that says what to do."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, OSError):
            raise FieldError(
                f"the field {self.folder} cannot be written ({error}): make room on the disk, "
                "or choose a folder that can be written"
            ) from error
