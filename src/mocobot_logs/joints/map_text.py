"""Put numbers of a position loop into the text of a map."""

import re
import tomllib
from collections.abc import Mapping


def with_control(text: str, numbers: Mapping[str, Mapping[str, float]]) -> str | None:
    """Replace keys under ``[control]`` by numbers (by key and joint); None where the map has them elsewhere."""
    told = tomllib.loads(text)
    if any(key in own for own in told.get("joint", {}).values() for key in numbers):
        return None
    lists = {key: [own[joint] for joint in told["joints"]] for key, own in numbers.items()}
    lines, out, inside, depth = text.splitlines(), [], False, 0
    for line in lines:
        header = re.match(r"\s*\[", line) is not None and depth == 0
        if header:
            inside = re.match(r"\s*\[control\]", line) is not None
        key = re.match(r"\s*(\w+)\s*=", line)
        if depth or (inside and key is not None and key[1] in lists):
            depth += line.count("[") - line.count("]")
        else:
            out.append(line)
        if header and inside:
            out += [f"{key} = [{', '.join(f'{x:.9g}' for x in own)}]" for key, own in lists.items()]
    new = "\n".join(out) + "\n"
    try:
        found = tomllib.loads(new).get("control", {})
    except tomllib.TOMLDecodeError:
        return None
    return new if all(len(found.get(key, ())) == len(own) for key, own in lists.items()) else None
