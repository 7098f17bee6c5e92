"""A folder of photographs, read by any description that it has: which picture has which lamp.

Known are `photographs.json` (ARTO's own), `*.lp` (domes of museums: a count, then name, x, y and
z), `light_directions.txt` with `filenames.txt` and `light_intensities.txt`, `lights.txt`, and CSV
files (name, x, y, z, or name, azimuth, elevation; and the lamp's strength). Pictures that no
description names are told by their names: `mask`, `dark`, `ambient`, `empty`.

Examples
--------
>>> import tempfile
>>> with tempfile.TemporaryDirectory() as there:
...     for name in ("a_1.jpg", "a_2.jpg", "a_10.jpg", "mask.png"):
...         _ = (Path(there) / name).write_bytes(b"")
...     lines = "3\\n 0 0 1\\n 1 0 1\\n 0 1 1\\n"
...     _ = (Path(there) / "lights.txt").write_text(lines)
...     said = read(Path(there))
>>> [photo.file for photo in said.photographs], said.lamps[1].direction
(['a_1.jpg', 'a_2.jpg', 'a_10.jpg', 'mask.png'], (1.0, 0.0, 1.0))
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from ..errors import PhotographsError
from ..regular import read_regular
from . import description_file
from .description import FILE, Description, Kind, Lamp, Photograph, Point

# What a picture's name may end with. Raw files are among them.
ENDINGS = {
    *(".jpg", ".jpeg", ".png", ".tif", ".tiff", ".exr", ".hdr", ".bmp", ".tga", ".webp", ".pgm"),
    *(".ppm", ".jp2", ".dpx", ".cr2", ".cr3", ".nef", ".arw", ".dng", ".raf", ".orf", ".rw2"),
}
_MOST_BYTES = 16 << 20
# Words in the names of pictures that no lamp shines in.
_WORDS = {
    Kind.MASK: ("mask", "matte"),
    Kind.DARK: ("dark", "bias"),
    Kind.AMBIENT: ("ambient", "nolight"),
    Kind.EMPTY: ("empty", "background"),
}
# Text files with the lamps' directions, one of which is read.
_LIGHTS = ("light_directions.txt", "lights.txt", "light_dirs.txt", "directions.txt", "light.txt")
# Words of pictures that are what others have made of the photographs.
_MADE = {"normal", "normals", "gt", "albedo", "depth", "preview", "thumbnail", "result"}
_SECONDS = (
    re.compile(r"(?<![\d.])(\d+)[-_](\d+)s(?:ec)?(?![a-z0-9])", re.IGNORECASE),
    re.compile(r"(?<![\d.])(\d+(?:\.\d+)?)()s(?:ec)?(?![a-z0-9])", re.IGNORECASE),
)
_STOPS = re.compile(r"(?<![a-z])ev[_=]?([+-]?\d+(?:\.\d+)?)", re.IGNORECASE)


def read(folder: Path) -> Description:
    """Read what a folder says of its photographs.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    Description
        All its photographs are there. Directions are as the files have them, of any length but 0.

    Raises
    ------
    PhotographsError
        There is no description, or a picture of it is missing, there twice, or has no lamp.
    """
    if not folder.is_dir():
        raise PhotographsError(f"there is no folder {folder}: choose one with photographs")
    if (folder / FILE).exists():
        said = description_file.read(folder / FILE)
        path = folder / FILE
    else:
        path, said = _other(folder)
    description_file.check(said, path)
    missing = [p.file for p in said.photographs if not (folder / p.file).is_file()]
    if missing:
        more = f" (and {len(missing) - 1} more)" if missing[1:] else ""
        raise PhotographsError(
            f"{path} names '{missing[0]:.80}'{more}, which is not in {folder}: put it there, or "
            "take its line out"
        )
    if not said.of(Kind.LIGHT) and not said.of(Kind.PATTERN):
        raise PhotographsError(f"{path} has no photograph in the light of a lamp or a monitor")
    return replace(said, photographs=tuple(map(with_exposure, said.photographs)))


def pictures_in(folder: Path) -> list[str]:
    """List the pictures in a folder, in the order in which people number them.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    list of str
        Their names: `b2` before `b10`.
    """
    names = [p.name for p in folder.iterdir() if p.suffix.lower() in ENDINGS and p.is_file()]
    return sorted((n for n in names if not n.startswith(".")), key=_numbered)


def _numbered(name: str) -> list[tuple[int, int, str]]:
    parts = re.split(r"(\d+)", name.lower())
    return [(0, int(p), "") if p.isdigit() else (1, 0, p) for p in parts if p]


def with_exposure(photo: Photograph) -> Photograph:
    """Read the exposure of a photograph from its name, where its description says none.

    Parameters
    ----------
    photo : Photograph

    Returns
    -------
    Photograph

    Examples
    --------
    >>> names = ("left_1-60s.jpg", "left_0.5s.jpg", "left_ev-2.jpg", "lamp_07.jpg")
    >>> [with_exposure(Photograph(name, Kind.LIGHT)).exposure for name in names]
    [0.016666666666666666, 0.5, 0.25, None]
    """
    if photo.exposure is not None:
        return photo
    stem = Path(photo.file).stem
    for pattern in _SECONDS:
        if found := pattern.search(stem):
            over = float(found[2] or 1)
            seconds = float(found[1]) / over if over else 0.0
            return replace(photo, exposure=seconds) if seconds > 0 else photo
    if found := _STOPS.search(stem):
        return replace(photo, exposure=2.0 ** max(-30.0, min(30.0, float(found[1]))))
    return photo


def _other(folder: Path) -> tuple[Path, Description]:
    """A description of another program, and its path."""
    pictures = pictures_in(folder)
    if not pictures:
        raise PhotographsError(
            f"there is no photograph in {folder}: choose the folder that has them"
        )
    if found := _one(folder, sorted(folder.glob("*.lp")) + sorted(folder.glob("*.LP"))):
        return found, _with_others(folder, _of_rows(found, _lp(found)), pictures)
    for name in _LIGHTS:
        if (folder / name).is_file():
            return folder / name, _of_numbers(folder, folder / name, pictures)
    if found := _one(folder, sorted(folder.glob("*.csv"))):
        return found, _with_others(folder, _of_rows(found, _csv(found)), pictures)
    raise PhotographsError(
        f"{folder} does not say where its lamps were: put an .lp file, light_directions.txt, "
        f"lights.txt, a CSV file or {FILE} there"
    )


def _one(folder: Path, found: list[Path]) -> Path | None:
    found = list(dict.fromkeys(found))
    if len(found) > 1:
        raise PhotographsError(
            f"{folder} has {len(found)} descriptions, {found[0].name} and {found[1].name}: leave "
            "one"
        )
    return found[0] if found else None


def _lines(path: Path) -> list[str]:
    try:
        text = read_regular(path, _MOST_BYTES).decode("utf-8-sig", "replace")
    except (OSError, ValueError) as e:
        raise PhotographsError(f"{path} cannot be read ({e})") from e
    lines = (line.strip() for line in text.replace("\r", "\n").split("\n"))
    return [line for line in lines if line and not line.startswith("#")]


def _floats(words: Iterable[str], path: Path, line: str) -> list[float]:
    try:
        found = [float(word) for word in words]
    except ValueError:
        found = [math.nan]
    if not all(map(math.isfinite, found)):
        raise PhotographsError(f"{path}: in '{line:.80}' is a word that is no number")
    return found


Row = tuple[str, Point, Point]


def _lp(path: Path) -> list[Row]:
    """Name, direction and strength by line. The names may have spaces, and folders before them."""
    lines = _lines(path)
    if not lines or not lines[0].split()[0].isdigit() or len(lines[0].split()) > 1:
        raise PhotographsError(f"{path} does not begin with the number of its photographs")
    out: list[Row] = []
    for line in lines[1:]:
        words = re.split(r"[\s,;]+", line)
        if len(words) < 4:
            raise PhotographsError(f"{path}: '{line:.80}' is not a name, x, y and z")
        x, y, z = _floats(words[-3:], path, line)
        name = line[: line.rindex(words[-3], 0, line.rindex(words[-2], 0, line.rindex(words[-1])))]
        out.append((name.strip(' \t,;"'), (x, y, z), (1.0, 1.0, 1.0)))
    if len(out) != int(lines[0]):
        raise PhotographsError(
            f"{path} says that it has {int(lines[0])} photographs, and has {len(out)}"
        )
    return out


def _csv(path: Path) -> list[Row]:
    """Rows of name, x, y, z or name, azimuth, elevation, with strengths; a first line may name
    the columns."""
    lines = _lines(path)
    mark = ";" if lines and lines[0].count(";") > lines[0].count(",") else ","
    rows = [[word.strip() for word in row] for row in csv.reader(lines, delimiter=mark)]
    names = ["name", "x", "y", "z", "strength"]
    if rows and not _is_number(rows[0][-1]):
        names = [word.lower() for word in rows.pop(0)]
    file = next((i for i, n in enumerate(names) if n in ("name", "file", "filename", "image")), 0)
    out: list[Row] = []
    for row in rows:
        line = mark.join(row)
        given = dict(zip(names, row, strict=False))

        def value(key: str, given: dict[str, str] = given, line: str = line) -> float:
            return _floats([given[key]], path, line)[0]

        if len(row) > file and {"x", "y", "z"} <= given.keys():
            where: Point = (value("x"), value("y"), value("z"))
        elif len(row) > file and {"azimuth", "elevation"} <= given.keys():
            a, e = (math.radians(value(key)) for key in ("azimuth", "elevation"))
            where = (math.cos(e) * math.cos(a), math.sin(e), math.cos(e) * math.sin(a))
        else:
            raise PhotographsError(f"{path}: '{line:.80}' is not a name, x, y and z")
        one = value("strength") if given.get("strength") else 1.0
        rgb = [value(c) if given.get(c) else one for c in ("red", "green", "blue")]
        out.append((row[file], where, (rgb[0], rgb[1], rgb[2])))
    return out


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _of_rows(path: Path, rows: Sequence[Row]) -> Description:
    """Photographs with a lamp each. Photographs of one direction are exposures of one lamp."""
    lamps: dict[tuple[Point, Point], int] = {}
    photos = []
    for name, where, strength in rows:
        if strength[0] <= 0 or strength[1] <= 0 or strength[2] <= 0:
            raise PhotographsError(f"{path}: the lamp of '{name:.80}' has no strength above 0")
        if math.hypot(*where) < 1e-12:
            raise PhotographsError(f"{path}: the direction of '{name:.80}' has length 0")
        lamp = lamps.setdefault((where, strength), len(lamps))
        photos.append(Photograph(_plain(path.parent, name), Kind.LIGHT, lamp=lamp))
    return Description(tuple(photos), tuple(Lamp(d, strength=s) for d, s in lamps))


def _plain(folder: Path, name: str) -> str:
    """A name of a picture in the folder. Descriptions of other machines have folders before it."""
    name = name.replace("\\", "/")
    if description_file.is_inside(name) and (folder / name).is_file():
        return name
    return name.rsplit("/", 1)[-1]


def _of_numbers(folder: Path, path: Path, pictures: Sequence[str]) -> Description:
    """Directions in the order of the pictures, whose names stand in `filenames.txt` or nowhere."""
    lines = _lines(path)
    if lines and len(lines[0].split()) == 1 and lines[0].isdigit():
        count = int(lines.pop(0))
        if count != len(lines):
            raise PhotographsError(f"{path} says that it has {count} lamps, and has {len(lines)}")
    words = [re.split(r"[\s,;]+", line) for line in lines]
    named = [row[0] for row in words if not _is_number(row[0])]
    if named and len(named) < len(words):
        raise PhotographsError(f"{path} has a name in some lines and in others none")
    rows = [_floats(row[bool(named) :], path, line) for row, line in zip(words, lines, strict=True)]
    names = named or _listed(folder, pictures)
    if len(rows) == 3 and {len(row) for row in rows} == {len(names)} != {3}:
        rows = [list(column) for column in zip(*rows, strict=True)]  # x, y and z a line each
    if any(len(row) not in (3, 4, 6) for row in rows):
        raise PhotographsError(f"{path} has a line that is not x, y and z")
    if len(names) != len(rows):
        raise PhotographsError(
            f"{path} has {len(rows)} lamps, and there are {len(names)} photographs: give each lamp "
            "its photograph (name a mask 'mask', and what no lamp lights 'dark' or 'ambient')"
        )
    strengths = [_strength(row[3:]) for row in rows]
    if (there := folder / "light_intensities.txt").is_file():
        found = [_floats(re.split(r"[\s,;]+", line), there, line) for line in _lines(there)]
        if len(found) != len(rows) or any(len(row) not in (1, 3) for row in found):
            raise PhotographsError(f"{there} is not a strength, or three, for each lamp")
        strengths = [_strength(row) for row in found]
    each = [(n, (r[0], r[1], r[2]), s) for n, r, s in zip(names, rows, strengths, strict=True)]
    return _with_others(folder, _of_rows(path, each), pictures)


def _strength(row: Sequence[float]) -> Point:
    """One strength of all channels, three, or none: then 1."""
    return (row[0], row[len(row) // 2], row[-1]) if row else (1.0, 1.0, 1.0)


def _listed(folder: Path, pictures: Sequence[str]) -> list[str]:
    """The photographs in the order of a list of them, or else of their names."""
    lists = [folder / "filenames.txt", *sorted(folder.glob("*.txt"))]
    for path in (p for p in dict.fromkeys(lists) if p.is_file() and p.name not in _LIGHTS):
        lines = [line for line in _lines(path) if not line.isdigit()]
        names = [_plain(folder, line) for line in lines]
        if names and set(names) <= set(pictures):
            return [name for name in names if kind_by_name(name) is Kind.LIGHT]
    lit = (name for name in pictures if kind_by_name(name) is Kind.LIGHT)
    return [name for name in lit if not _MADE & _words(name)]


def _words(name: str) -> set[str]:
    return set(re.split(r"[^a-z]+", Path(name).stem.lower()))


def kind_by_name(name: str) -> Kind:
    """Say what a picture is of, by the words in its name.

    Parameters
    ----------
    name : str

    Returns
    -------
    Kind
        `light` where no word says otherwise.
    """
    words = _words(name)
    return next((kind for kind, some in _WORDS.items() if words & set(some)), Kind.LIGHT)


def _with_others(folder: Path, said: Description, pictures: Sequence[str]) -> Description:
    """Add the pictures that a description does not name, and whose names say what they are."""
    named = {photo.file for photo in said.photographs}
    others = ((name, kind_by_name(name)) for name in pictures if name not in named)
    more = [Photograph(name, kind) for name, kind in others if kind is not Kind.LIGHT]
    masks = [p for p in more if p.kind is Kind.MASK]
    return replace(
        said, photographs=said.photographs + tuple(p for p in more if p not in masks[1:])
    )
