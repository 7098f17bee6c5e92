"""A mix as a composition for Fusion: a table of tools that name the tools that they take.

Only tools that every Fusion has are used: Loader, ColorGain, Custom, Background and BetterResize.

Examples
--------
>>> from arto.core.mix.mix import Layer
>>> mix = Mix("a.exr", (4, 2), (Layer("key", gain=0.5),), together="a_layers.exr")
>>> "GainRed = Input { Value = 0.5, }" in fusion_comp(mix)
True

Source
------
Blackmagic Design, Fusion scripting guide: tools and inputs by name; compositions are Lua tables.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping

from .mix import Behind, Mix, words
from .nuke import node_name
from .stamp import stamped

_HASHES = re.compile("#+")
# What Fusion itself writes for a channel that is to be empty.
_EMPTY = "SomethingThatWontMatchHopefully"
_ADDED = {"Red": "r1 + r2", "Green": "g1 + g2", "Blue": "b1 + b2", "Alpha": "a1"}


def fusion_comp(mix: Mix) -> str:
    """Write the composition of a mix.

    Parameters
    ----------
    mix : Mix

    Returns
    -------
    str
        To be saved beside the plate, with the ending `.comp`.
    """
    return stamped(_Comp(mix).text())


class _Comp:
    """Writes the tools of one mix."""

    def __init__(self, mix: Mix) -> None:
        self._mix = mix
        self._tools: list[str] = []

    def text(self) -> str:
        mix = self._mix
        self._loader("Plate", mix.plate, (-1, -1))
        total = ""
        for i, layer in enumerate(mix.layers):
            name = node_name(layer.name)
            source = layer.file or mix.together or mix.plate
            channels = "" if layer.file else f"{layer.name}."
            self._loader(name, source, (i, 0), channels, alpha=False)
            gain = {"LockRGB": "1", "GainRed": _number(layer.gain)}
            self._tool("ColorGain", f"{name}_Gain", (i, 1), gain, {"Input": name})
            tint = {"LockRGB": "0"} | {
                f"Gain{colour}": _number(value)
                for colour, value in zip(("Red", "Green", "Blue"), layer.tint, strict=True)
            }
            self._tool("ColorGain", f"{name}_Tint", (i, 2), tint, {"Input": f"{name}_Gain"})
            part = f"{name}_Tint"
            if total:
                self._custom(f"{name}_Plus", (i, 3), _ADDED, [total, part])
                part = f"{name}_Plus"
            total = part
        stops = {c: f"{c[0].lower()}1 * 2 ^ n1" for c in ("Red", "Green", "Blue")}
        exposure = {"NumberIn1": _number(mix.exposure)}
        self._custom("Exposure", (0, 4), stops | {"Alpha": "a1"}, [total], exposure)
        alpha = {"Red": "r1", "Green": "g1", "Blue": "b1", "Alpha": "a2"}
        self._custom("Mix", (0, 5), alpha, ["Exposure", "Plate"])
        if mix.behind is not None:
            self._into(mix.behind)
        tools = "\n".join(self._tools)
        said = "\n".join(words(mix))
        last = mix.frame if mix.last is None else mix.last
        return (
            "Composition {\n"
            f"\tCurrentTime = {mix.frame},\n"
            f"\tRenderRange = {{ {mix.frame}, {last} }},\n"
            f"\tGlobalRange = {{ {mix.frame}, {last} }},\n"
            f"\tComments = {_text(said)},\n"
            f"\tTools = {{\n{tools}\n\t}},\n"
            f"\tPrefs = {{ Comp = {{ FrameFormat = {{ Width = {mix.size[0]}, "
            f"Height = {mix.size[1]}, Rate = {_number(mix.fps)}, DepthFull = 3, "
            f"AspectX = {_number(mix.aspect)}, AspectY = 1, }}, }}, }},\n"
            "}\n"
        )

    def _into(self, behind: Behind) -> None:
        """The things in footage."""
        width, height = self._mix.size
        self._loader("Caught", behind.file, (3, 6), alpha=behind.shadows == "ADD")
        if behind.footage is None:
            size = {"Width": str(width), "Height": str(height)}
            self._tool("Background", "Footage", (4, 6), size, {})
        else:
            self._loader("Footage", behind.footage, (4, 6), alpha=False)
        size = {"Width": str(width), "Height": str(height), "KeepAspect": "0"}
        self._tool("BetterResize", "Footage_Size", (4, 7), size, {"Input": "Footage"})
        rule = "{0}1 + {0}2 * {0}3"
        if behind.shadows == "ADD":
            rule = "max({0}1 + (1 - a2) * {0}3 + {0}2, 0)"
        by = {colour: rule.format(colour[0].lower()) for colour in ("Red", "Green", "Blue")}
        images = ["Mix", "Caught", "Footage_Size"]
        self._custom("Composite", (0, 8), by | {"Alpha": "a1"}, images)

    def _loader(
        self,
        name: str,
        file: str,
        place: tuple[int, int],
        channels: str = "",
        alpha: bool = True,
    ) -> None:
        beside = "/" not in file and "\\" not in file
        path = f"Comp:/{file}" if beside else file
        frame, last, length, start = self._mix.frame, self._mix.frame, "", -1
        if self._mix.last is not None and "#" in file:
            # Fusion finds a sequence by the file of its first frame
            last, start = self._mix.last, frame
            length = f"Length = {last - frame + 1}, "
            path = _HASHES.sub(lambda mark: f"{frame:0{len(mark[0])}d}", path)
        clip = (
            f'ID = "Clip1", Filename = {_text(path)}, FormatID = "OpenEXRFormat", {length}'
            f"StartFrame = {start}, LengthSetManually = true, TrimIn = 0, "
            f"TrimOut = {last - frame}, ExtendFirst = 0, ExtendLast = 0, Loop = 1, "
            f"GlobalStart = {frame}, GlobalEnd = {last},"
        )
        if not path.lower().endswith(".exr"):
            clip = clip.replace('FormatID = "OpenEXRFormat", ', "")
        names = {"Red": "R", "Green": "G", "Blue": "B", "Alpha": "A" if alpha else _EMPTY}
        inputs = {
            f'["Clip1.OpenEXRFormat.{colour}Name"]': (
                f"FuID {{ {_text(letter if letter == _EMPTY else channels + letter)} }}"
            )
            for colour, letter in names.items()
        }
        self._tool("Loader", name, place, inputs, {}, f"\t\t\tClips = {{ Clip {{ {clip} }}, }},\n")

    def _custom(
        self,
        name: str,
        place: tuple[int, int],
        rules: Mapping[str, str],
        images: list[str],
        numbers: Mapping[str, str] | None = None,
    ) -> None:
        values = {f"{colour}Expression": _text(rule) for colour, rule in rules.items()}
        sources = {f"Image{i}": image for i, image in enumerate(images, 1)}
        self._tool("Custom", name, place, values | dict(numbers or {}), sources)

    def _tool(
        self,
        kind: str,
        name: str,
        place: tuple[int, int],
        values: Mapping[str, str],
        sources: Mapping[str, str],
        before: str = "",
    ) -> None:
        lines = [f"\t\t\t\t{key} = Input {{ Value = {value}, }}," for key, value in values.items()]
        lines += [
            f'\t\t\t\t{key} = Input {{ SourceOp = "{source}", Source = "Output", }},'
            for key, source in sources.items()
        ]
        inputs = "\n".join(lines)
        self._tools.append(
            f"\t\t{name} = {kind} {{\n\t\t\tNameSet = true,\n{before}"
            f"\t\t\tInputs = {{\n{inputs}\n\t\t\t}},\n"
            f"\t\t\tViewInfo = OperatorInfo {{ Pos = {{ {110 * place[0]}, {66 * place[1]} }} }},\n"
            "\t\t},"
        )


def _number(value: float) -> str:
    return f"{value:.9g}"


def _text(value: str) -> str:
    """A Lua string, in which only what JSON escapes too has a meaning."""
    return json.dumps(value, ensure_ascii=False)
