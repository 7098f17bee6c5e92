"""What scripts for compositors compute: the few kinds of nodes that ARTO writes, on arrays.

The programs themselves are not run. Scripts are read by the rules of their formats: Nuke's nodes
take their inputs from a stack, Fusion's tools are a Lua table whose tools name each other.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping
from typing import Any

import numpy as np

Image = dict[str, np.ndarray]
RGB = ("red", "green", "blue")
Files = Mapping[str, Mapping[str, np.ndarray]]


def read(files: Files, path: str) -> Image:
    """The channels of a file by their names in a compositor: `rgba.red`, `key.red`."""
    long = {"R": "red", "G": "green", "B": "blue", "A": "alpha"}
    out = {}
    for channel, pixels in files[path].items():
        layer, _, letter = channel.rpartition(".")
        out[f"{layer or 'rgba'}.{long[letter]}"] = pixels.astype(np.float64)
    return out


def rgb(image: Image) -> np.ndarray:
    """The colours of an image, (H, W, 3)."""
    return np.stack([image[f"rgba.{c}"] for c in RGB], axis=-1)


# Nuke


def unquoted(text: str) -> str:
    return re.sub(r"\\(.)", r"\1", text)


def nuke(script: str, files: Files, folder: str = "/shot") -> dict[str, Image]:
    """Run a script -> the image of each node by its name."""
    stack: list[str] = []
    variables: dict[str, str] = {}
    images: dict[str, Image] = {}
    layers: set[str] = set()
    lines = iter(script.splitlines())
    for line in lines:
        if not line or line.startswith(("#", "version ")):
            continue
        if line.startswith("add_layer "):
            layers |= set(line[len("add_layer {") : -1].split()[1:])
        elif line.startswith("set "):
            _, name, rest = line.split(" ", 2)
            assert rest == "[stack 0]"
            variables[name] = stack[-1]
        elif line.startswith("push $"):
            stack.append(variables[line[len("push $") :]])
        else:
            kind = line.removesuffix(" {")
            assert line.endswith(" {") and re.fullmatch("[A-Za-z0-9]+", kind), line
            knobs: dict[str, str] = {}
            for inner in lines:
                if inner == "}":
                    break
                assert inner.startswith(" "), inner
                knob, _, value = inner[1:].partition(" ")
                knobs[f"user {value}" if knob == "addUserKnob" else knob] = value
            if kind == "Root":
                continue
            inputs = [stack.pop() for _ in range(int(knobs.get("inputs", 1)))]
            name = knobs["name"]
            assert name not in images and re.fullmatch("[A-Za-z_][A-Za-z0-9_]*", name)
            images[name] = _nuke_node(kind, knobs, [images[i] for i in inputs], files, folder)
            for channel in images[name]:
                if not channel.startswith("rgba.") and kind == "Shuffle":
                    assert channel in layers
            stack.append(name)
    return images


def _nuke_node(kind: str, knobs: dict, inputs: list[Image], files: Files, folder: str) -> Image:
    if kind == "StickyNote":
        return {}
    if kind == "Read":
        given = unquoted(knobs["file"].strip('"'))
        here = "[file dirname [value root.name]]"
        path = given.replace(here, folder) if given.startswith(here) else given
        return read(files, unquoted(path))
    if kind == "Constant":
        return {f"rgba.{c}": np.array(float(knobs["color"])) for c in RGB}
    first = inputs[0]
    if kind == "Shuffle":
        # the layer's channels become those of rgba
        layer = knobs["in"]
        out = {f"rgba.{c}": first[f"{layer}.{c}"] for c in RGB}
        assert knobs["alpha"] == "black"
        return out | {"rgba.alpha": np.zeros_like(out["rgba.red"])}
    if kind == "Multiply":
        assert knobs["channels"] == "rgb"
        value = knobs["value"]
        if value.startswith("{{"):
            assert value == '{{"pow(2, stops)"}}'
            factors = [2.0 ** float(knobs["stops"])] * 3
        elif value.startswith("{"):
            factors = [float(v) for v in value[1:-1].split()][:3]
        else:
            factors = [float(value)] * 3
        return first | {
            f"rgba.{c}": first[f"rgba.{c}"] * f for c, f in zip(RGB, factors, strict=True)
        }
    if kind == "Merge2":
        assert knobs["output"] == "rgb"
        back, front = inputs
        rule = {
            "plus": lambda a, b, alpha: a + b,
            "multiply": lambda a, b, alpha: a * b,
            "stencil": lambda a, b, alpha: b * (1 - alpha),
        }[knobs["operation"]]
        alpha = front.get("rgba.alpha", 0.0)
        return back | {f"rgba.{c}": rule(front[f"rgba.{c}"], back[f"rgba.{c}"], alpha) for c in RGB}
    if kind == "Copy":
        back, front = inputs
        return back | {knobs["to0"]: front[knobs["from0"]]}
    if kind == "Reformat":
        width, height = (int(n) for n in shlex.split(knobs["format"])[0].split()[:2])
        assert all(p.shape in {(height, width), ()} for p in first.values())
        return first
    assert kind == "Clamp" and knobs["maximum_enable"] == "false", kind
    return first | {f"rgba.{c}": np.maximum(first[f"rgba.{c}"], 0) for c in RGB}


# Fusion


_LUA = re.compile(r'\s*("(?:[^"\\]|\\.)*"|[{}=,\[\]]|[A-Za-z_]\w*|-?[\d.]+(?:e[-+]?\d+)?)')


def lua(text: str) -> Any:
    """Read a Lua table of the kind that Fusion saves: (constructor, entries by key, the others)."""
    tokens = _LUA.findall(text)
    assert "".join(tokens) == re.sub(r'\s+(?=(?:[^"]*"[^"]*")*[^"]*$)', "", text)

    def value(at: int) -> tuple[Any, int]:
        token = tokens[at]
        if token == "{":
            return table("", at + 1)
        if token[0] == '"':
            return unquoted(token[1:-1]), at + 1
        if token in ("true", "false"):
            return token == "true", at + 1
        if token[0].isalpha() or token[0] == "_":
            assert tokens[at + 1] == "{"
            return table(token, at + 2)
        return float(token), at + 1

    def table(kind: str, at: int) -> tuple[Any, int]:
        named: dict[str, Any] = {}
        rest = []
        while tokens[at] != "}":
            if tokens[at] == "[":
                key, at = unquoted(tokens[at + 1][1:-1]), at + 4
                assert tokens[at - 1] == "=" and key not in named
                named[key], at = value(at)
            elif tokens[at + 1] == "=":
                key = tokens[at]
                assert key not in named
                named[key], at = value(at + 2)
            else:
                one, at = value(at)
                rest.append(one)
            if tokens[at] == ",":
                at += 1
        return (kind, named, rest), at + 1

    found, end = value(0)
    assert end == len(tokens)
    return found


def fusion(comp: str, files: Files, folder: str = "/shot") -> dict[str, Image]:
    """Run a composition -> the image of each tool by its name."""
    kind, said, _ = lua(comp)
    assert kind == "Composition"
    tools = said["Tools"][1]
    images: dict[str, Image] = {}

    def image(name: str) -> Image:
        if name not in images:
            kind, about, _ = tools[name]
            inputs = {key: entry[1] for key, entry in about["Inputs"][1].items()}
            values = {key: entry["Value"] for key, entry in inputs.items() if "Value" in entry}
            taken = {k: image(e["SourceOp"]) for k, e in inputs.items() if "SourceOp" in e}
            images[name] = _fusion_tool(kind, about, values, taken, files, folder)
        return images[name]

    for name in tools:
        image(name)
    return images


def _fusion_tool(
    kind: str, about: dict, values: dict, taken: dict[str, Image], files: Files, folder: str
) -> Image:
    if kind == "Loader":
        ((_, clip, _),) = about["Clips"][2]
        path = clip["Filename"].replace("Comp:", folder)
        channels = files[path]
        out = {}
        for colour in ("Red", "Green", "Blue", "Alpha"):
            name = values[f"Clip1.OpenEXRFormat.{colour}Name"][2][0]
            if name in channels:
                out[f"rgba.{colour.lower()}"] = channels[name].astype(np.float64)
            else:
                assert name == "SomethingThatWontMatchHopefully"
        return out
    if kind == "Background":
        return {f"rgba.{c}": np.zeros((int(values["Height"]), int(values["Width"]))) for c in RGB}
    if kind == "ColorGain":
        given = taken["Input"]
        gains = [values["GainRed"]] * 3
        if not values["LockRGB"]:
            gains = [values[f"Gain{c}"] for c in ("Red", "Green", "Blue")]
        return given | {
            f"rgba.{c}": given[f"rgba.{c}"] * g for c, g in zip(RGB, gains, strict=True)
        }
    if kind == "BetterResize":
        given = taken["Input"]
        size = int(values["Height"]), int(values["Width"])
        assert all(p.shape == size for p in given.values())
        return given
    assert kind == "Custom", kind
    known: dict[str, Any] = {"max": np.maximum, "n1": values.get("NumberIn1", 0.0)}
    for i in (1, 2, 3):
        for channel, pixels in taken.get(f"Image{i}", {}).items():
            known[f"{channel.removeprefix('rgba.')[0]}{i}"] = pixels
    known.setdefault("a1", 0.0)
    return {
        f"rgba.{c.lower()}": eval(  # of a language of four operations, which a test has written
            values[f"{c}Expression"].replace("^", "**"), {"__builtins__": {}}, known
        )
        for c in ("Red", "Green", "Blue", "Alpha")
    }
