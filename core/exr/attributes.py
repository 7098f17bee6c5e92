"""The attributes of a header: their values, from and to the bytes of a file.

Kinds of EXR and types of Python belong together: string and str, int and int, float and float,
rational and Fraction, timecode and `TimeCode`, box2i and four whole numbers, v2i and v3i and as
many whole numbers, v2f and v3f and as many floats, stringvector and a tuple of str. What is of
another kind stays as it is, as `Raw`, so that it can be handed on.

Examples
--------
>>> encoded("arto.key", "sky")
(b'string', b'sky')
>>> decoded(b"box2i", encoded("dataWindow", (0, 0, 7, 5))[1])
(0, 0, 7, 5)

Source
------
OpenEXR documentation, "OpenEXR File Layout", Predefined Attribute Types.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from ..errors import ExrError
from .head import COMPRESSIONS, Attributes, LayoutError

# What struct calls the numbers of the kinds that are only numbers.
_NUMBERS = {
    b"int": "i", b"float": "f", b"double": "d", b"v2i": "2i", b"v3i": "3i", b"v2f": "2f",
    b"v3f": "3f", b"v2d": "2d", b"v3d": "3d", b"box2i": "4i", b"box2f": "4f", b"m33f": "9f",
    b"m44f": "16f", b"m33d": "9d", b"m44d": "16d", b"chromaticities": "8f",
}  # fmt: skip
# The kinds of several numbers that are written, by their type and how many they are.
_SEVERAL = {
    (int, 2): b"v2i", (int, 3): b"v3i", (int, 4): b"box2i", (float, 2): b"v2f", (float, 3): b"v3f",
}  # fmt: skip
_LONGEST_NAME = 255
# The bits of a time code that are no digits.
_FLAGS = 0xC08080C0


@dataclass(frozen=True)
class TimeCode:
    """A moment of an edit.

    Parameters
    ----------
    hours, minutes, seconds, frame : int
        Up to 23, 59, 59 and 29, which is the last frame that EXR files have a number for.
    """

    hours: int
    minutes: int
    seconds: int
    frame: int


@dataclass(frozen=True)
class Raw:
    """The value of an attribute of a kind that is of no use here.

    Parameters
    ----------
    kind : bytes
        As the file names it.
    data : bytes
    """

    kind: bytes
    data: bytes


def decoded(kind: bytes, data: bytes) -> Any:
    """Turn the bytes of an attribute into its value.

    Parameters
    ----------
    kind : bytes
        As the file names it.
    data : bytes

    Returns
    -------
    object
        See the top of the module; of a compression its name.

    Raises
    ------
    LayoutError
        The bytes are too few or too many for the kind.
    """
    try:
        if kind == b"string":
            return data.decode()
        if kind in _NUMBERS:
            found = struct.unpack(f"<{_NUMBERS[kind]}", data)
            return found[0] if _NUMBERS[kind] in "ifd" else found
        if kind == b"rational":
            above, below = struct.unpack("<iI", data)
            return Fraction(above, below) if below else Raw(kind, data)
        if kind == b"timecode":
            moment, user = struct.unpack("<II", data)
            apart = user or moment & _FLAGS
            return (not apart and _time_code(f"{moment:08x}")) or Raw(kind, data)
        if kind == b"compression":
            (number,) = data
            return COMPRESSIONS[number] if number < len(COMPRESSIONS) else Raw(kind, data)
        if kind == b"stringvector":
            return _strings(data)
    except UnicodeDecodeError:
        raise LayoutError("a text in its header is no UTF-8") from None
    except (struct.error, ValueError):
        raise LayoutError("its header is damaged") from None
    return Raw(kind, data)


def encoded(name: str, value: Any) -> tuple[bytes, bytes]:
    """Turn the value of an attribute into bytes.

    Parameters
    ----------
    name : str
        Of the attribute, for messages.
    value : object
        See the top of the module.

    Returns
    -------
    kind, data : bytes

    Raises
    ------
    ExrError
        No kind of EXR holds the value.
    """
    try:
        if isinstance(value, str):
            return b"string", value.encode()
        if isinstance(value, Raw):
            return value.kind, value.data
        if type(value) is int:
            return b"int", struct.pack("<i", value)
        if type(value) is float:
            return b"float", struct.pack("<f", value)
        if isinstance(value, Fraction):
            return b"rational", struct.pack("<iI", value.numerator, value.denominator)
        if isinstance(value, TimeCode):
            parts = (value.hours, value.minutes, value.seconds, value.frame)
            digits = "".join(f"{part:02d}" for part in parts)
            if _time_code(digits) == value:
                return b"timecode", struct.pack("<II", int(digits, 16), 0)
        if isinstance(value, tuple | list) and value:
            if all(isinstance(v, str) for v in value):
                texts = [v.encode() for v in value]
                packed = [struct.pack("<I", len(text)) + text for text in texts]
                return b"stringvector", b"".join(packed)
            kind = _SEVERAL.get((type(value[0]), len(value)))
            if kind and len({type(v) for v in value}) == 1:
                return kind, struct.pack(f"<{_NUMBERS[kind]}", *value)
    except (struct.error, OverflowError, UnicodeEncodeError):
        pass
    raise ExrError(
        f"the header of an EXR file cannot say {name} = {value!r}: give a text, or a number of at "
        "most 32 bits"
    )


def encoded_head(values: Mapping[str, Any], name: str) -> Attributes:
    """Turn what a header shall say into its attributes, with those that a header needs.

    Parameters
    ----------
    values : mapping of str to object
        By the names of the attributes; see the top of the module.
    name : str
        Of the part; empty for none.

    Returns
    -------
    Attributes
        But for those that tell how the pixels are stored.

    Raises
    ------
    ExrError
        No kind of EXR holds a value, or an attribute has no possible name.
    """
    needed = {
        "pixelAspectRatio": 1.0,
        "screenWindowCenter": (0.0, 0.0),
        "screenWindowWidth": 1.0,
        "type": "scanlineimage",
    }
    found = {}
    for key, value in (needed | dict(values) | ({"name": name} if name else {})).items():
        in_file = key.encode()
        if not 0 < len(in_file) <= _LONGEST_NAME or b"\0" in in_file:
            raise ExrError(
                f"the header of an EXR file cannot have an attribute of the name {key!r}"
            )
        found[in_file] = encoded(key, value)
    return found


def _time_code(digits: str) -> TimeCode | None:
    """The moment of eight digits; None where there is no such moment."""
    if not (len(digits) == 8 and digits.isdecimal()):
        return None
    hours, minutes, seconds, frame = (int(digits[n : n + 2]) for n in (0, 2, 4, 6))
    if hours > 23 or minutes > 59 or seconds > 59 or frame > 29:
        return None
    return TimeCode(hours, minutes, seconds, frame)


def _strings(data: bytes) -> tuple[str, ...]:
    """The texts of a stringvector. Raises struct.error or ValueError."""
    found, at = [], 0
    while at < len(data):
        (length,) = struct.unpack_from("<I", data, at)
        at += 4 + length
        if at > len(data):
            raise ValueError("a text is cut off")
        found.append(data[at - length : at].decode())
    return tuple(found)
