"""A mix as a script for Nuke: one node after another, each taking its inputs from a stack.

Only nodes that every Nuke has are used: Read, Shuffle, Multiply, Merge2, Copy, Reformat and Clamp.

Examples
--------
>>> mix = Mix("a.exr", (4, 2), (Layer("key", gain=0.5),), together="a_layers.exr")
>>> [line for line in nuke_script(mix).splitlines() if line.startswith(" value ")]
[' value 0.5', ' value {1 1 1 1}', ' value {{"pow(2, stops)"}}']

Source
------
Foundry, Nuke reference guide and developers' guide: script files, nodes and knobs.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ..file_names import short_hash
from .mix import Behind, Layer, Mix, words
from .stamp import stamped

# The folder of the script, as an expression: so files are found wherever the folder is moved.
_HERE = "\\[file dirname \\[value root.name]]"
_STEP = 90
_RGB = ("channels", "rgb")


def nuke_script(mix: Mix) -> str:
    """Write the script of a mix.

    Parameters
    ----------
    mix : Mix

    Returns
    -------
    str
        To be saved beside the plate, with the ending `.nk`.
    """
    return stamped("\n".join(_Script(mix).lines()) + "\n")


class _Script:
    """Writes the nodes of one mix, each with the names of the nodes that it takes."""

    def __init__(self, mix: Mix) -> None:
        self._mix = mix
        self._lines: list[str] = []
        width, height = mix.size
        self._format = f'"{width} {height} 0 0 {width} {height} {mix.aspect:g} "'

    def lines(self) -> list[str]:
        mix = self._mix
        self._lines += [f"# {line}" for line in words(mix)]
        self._lines += ["version 12.0 v1", "Root {", " inputs 0"]
        last = mix.frame if mix.last is None else mix.last
        self._lines += [f" first_frame {mix.frame}", f" last_frame {last}"]
        self._lines += [f" frame {mix.frame}", f" format {self._format}", f" fps {mix.fps:g}"]
        self._lines += [" colorManagement Nuke", "}"]
        for layer in mix.layers:
            if layer.file is None:
                channels = " ".join(f"{layer.name}.{c}" for c in ("red", "green", "blue"))
                self._lines.append(f"add_layer {{{layer.name} {channels}}}")
        note = _escaped("\n".join(words(mix)[1:])).replace("\n", "\\n")
        self._node("StickyNote", "Note", (), (0, -240), [("label", f'"{note}"')])
        self._read("Plate", mix.plate, (-200, 0))
        if mix.together is not None:
            self._read("Layers", mix.together, (0, 0))
        total = self._sum(mix.layers)
        user = ["addUserKnob {20 Mix}", "addUserKnob {7 stops R -10 10}"]
        user.append(f"stops {mix.exposure:.9g}")
        knobs = [_RGB, ("value", '{{"pow(2, stops)"}}')]
        self._node("Multiply", "Exposure", [total], (0, 4 * _STEP), knobs, user)
        # A, which gives the alpha, is the second input
        knobs = [("from0", "rgba.alpha"), ("to0", "rgba.alpha")]
        self._node("Copy", "Mix", ["Exposure", "Plate"], (0, 5 * _STEP), knobs)
        if mix.behind is not None:
            self._into(mix.behind, 6 * _STEP)
        if mix.data is not None:
            self._read("Data", mix.data, (-400, 0))
        return self._lines

    def _sum(self, layers: Sequence[Layer]) -> str:
        """Each layer with its gain and tint; returns the node of their sum."""
        total = ""
        for i, layer in enumerate(layers):
            x, name = 160 * i, node_name(layer.name)
            source, channels = "Layers", layer.name
            if layer.file is not None:
                source, channels = f"{name}_file", "rgba"
                self._read(source, layer.file, (x, 0))
            knobs = [("in", channels), ("alpha", "black")]
            self._node("Shuffle", name, [source], (x, _STEP), knobs)
            knobs = [_RGB, ("value", f"{layer.gain:.9g}")]
            self._node("Multiply", f"{name}_gain", [name], (x, 2 * _STEP), knobs)
            red, green, blue = layer.tint
            knobs = [_RGB, ("value", f"{{{red:.9g} {green:.9g} {blue:.9g} 1}}")]
            place = x, 2 * _STEP + 40
            self._node("Multiply", f"{name}_tint", [f"{name}_gain"], place, knobs)
            part = f"{name}_tint"
            if total:
                self._merge("plus", f"{name}_plus", [total, part], (x, 3 * _STEP))
                part = f"{name}_plus"
            total = part
        return total

    def _into(self, behind: Behind, y: int) -> None:
        """The things in footage."""
        self._read("Caught", behind.file, (300, y))
        if behind.footage is None:
            self._node("Constant", "Footage", (), (460, y), [_RGB, ("color", "0")])
        else:
            self._read("Footage", behind.footage, (460, y), raw=False)
        knobs = [("type", '"to format"'), ("format", self._format), ("resize", "distort")]
        self._node("Reformat", "Footage_size", ["Footage"], (460, y + _STEP), knobs)
        place = 460, y + 2 * _STEP
        if behind.shadows == "MULTIPLY":
            self._merge("multiply", "Footage_seen", ["Footage_size", "Caught"], place)
            self._merge("plus", "Composite", ["Mix", "Footage_seen"], (0, y + 3 * _STEP))
            return
        # what a stencil leaves of B is B times (1 - alpha of A)
        self._merge("stencil", "Footage_seen", ["Footage_size", "Caught"], place)
        self._merge("plus", "Things", ["Mix", "Footage_seen"], (0, y + 3 * _STEP))
        self._merge("plus", "Ground_light", ["Things", "Caught"], (0, y + 4 * _STEP))
        knobs = [_RGB, ("maximum_enable", "false")]
        self._node("Clamp", "Composite", ["Ground_light"], (0, y + 5 * _STEP), knobs)

    def _read(self, name: str, file: str, place: tuple[int, int], raw: bool = True) -> None:
        beside = "/" not in file and "\\" not in file
        path = f"{_HERE}/{_path(file)}" if beside else _path(file.replace("\\", "/"))
        knobs = [("file", f'"{path}"')]
        if self._mix.last is not None and "#" in file:
            ends = {"first": self._mix.frame, "last": self._mix.last}
            knobs += [(f"{of}{name}", str(n)) for of in ("", "orig") for name, n in ends.items()]
            knobs.append(("origset", "true"))
        if raw:
            knobs += [("format", self._format), ("raw", "true")]
        self._node("Read", name, (), place, knobs)

    def _merge(
        self, operation: str, name: str, inputs: Sequence[str], place: tuple[int, int]
    ) -> None:
        """inputs: B and A. The alpha is B's."""
        knobs = [("operation", operation), ("output", "rgb")]
        self._node("Merge2", name, inputs, place, knobs)

    def _node(
        self,
        kind: str,
        name: str,
        inputs: Sequence[str],
        place: tuple[int, int],
        knobs: Iterable[tuple[str, str]],
        after: Iterable[str] = (),
    ) -> None:
        # a node takes its first input from the top of the stack
        self._lines += [f"push ${_variable(one)}" for one in reversed(inputs)]
        self._lines.append(f"{kind} {{")
        if len(inputs) != 1:
            self._lines.append(f" inputs {len(inputs)}")
        self._lines += [f" {knob} {value}" for knob, value in knobs]
        self._lines += [f" name {name}", f" xpos {place[0]}", f" ypos {place[1]}"]
        self._lines += [f" {line}" for line in after]
        self._lines += ["}", f"set {_variable(name)} [stack 0]"]


def node_name(layer: str) -> str:
    """Make the name of a node out of the name of a layer.

    Parameters
    ----------
    layer : str

    Returns
    -------
    str
        Letters, digits and underscores, not beginning with a digit.
    """
    out = "".join(c if c.isascii() and (c.isalnum() or c == "_") else "_" for c in layer)
    out = f"L_{out}" if not out or out[0].isdigit() else out
    # another layer may have become the same
    return out if out == layer else f"{out}_{short_hash(layer)}"


def _variable(node: str) -> str:
    return f"N_{node}"


def _path(text: str) -> str:
    """A path inside quotes: it is read as a script's text, and then evaluated."""
    return _escaped("".join(f"\\{c}" if c in "\\[]$" else c for c in text))


def _escaped(text: str) -> str:
    """Text inside quotes, in which brackets, dollars and quotes have a meaning."""
    return "".join(f"\\{c}" if c in '\\"[]${}' else c for c in text)
