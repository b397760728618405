#!/usr/bin/env python3
"""Lists circles of imports among Rust files, crate by crate; exit 1 if there is one.

A file imports another if it names something out of it: `use crate::a::b::C`, `super::b::C`, or such a path in the code.
A name that a module only hands on (`pub use b::C;` in mod.rs or lib.rs) counts as the file that it comes from.
`mod b;` is no import: a folder knows its files, not the other way round. Code under `#[cfg(test)]` counts too.
"""
import os
import re
import sys

PATH = re.compile(r"\b((?:crate|super|self)(?:::\w+)*)(::\{)?")


def items(text, start):
    """The comma-separated paths of a `{...}` group that begins at `start`, nested groups flattened."""
    out, depth, word, prefix = [], 1, "", []
    i = start
    while i < len(text) and depth:
        c = text[i]
        if c == "{":
            depth += 1
            prefix.append(word.strip())
            word = ""
        elif c in ",}":
            if word.strip():
                out.append("".join(prefix) + word.strip().split(" as ")[0])
            word = ""
            if c == "}":
                depth -= 1
                if prefix:
                    prefix.pop()
        else:
            word += c
        i += 1
    return out


def paths(text):
    """All paths of a file that begin with crate, super or self."""
    text = re.sub(r"//[^\n]*", "", text)
    for m in PATH.finditer(text):
        if m.group(2):
            yield from (m.group(1) + "::" + item for item in items(text, m.end()))
        else:
            yield m.group(1)


def load(root):
    """Module path -> (file, text) of one crate's src."""
    out = {}
    for folder, _, names in os.walk(root):
        for name in sorted(n for n in names if n.endswith(".rs")):
            file = os.path.join(folder, name)
            parts = os.path.relpath(file, root)[:-3].split(os.sep)
            if parts[-1] == "mod" or parts in (["lib"], ["main"]):
                parts = parts[:-1]
            out.setdefault(tuple(parts), (file, open(file, encoding="utf-8").read()))
    return out


def target(modules, module, path):
    """The file that a path leads to, through `pub use` where a module hands a name on."""
    steps = path.split("::")
    at = list(module)
    if steps[0] == "crate":
        at = []
    while steps and steps[0] in ("crate", "super", "self"):
        if steps[0] == "super":
            at = at[:-1]
        steps = steps[1:]
    while steps and tuple(at + steps[:1]) in modules:
        at, steps = at + steps[:1], steps[1:]
    if steps and tuple(at) in modules:
        handed = re.search(r"pub(?:\([^)]*\))? use ([\w:]+)::(?:\{[^}]*\b%s\b[^}]*\}|%s);" % (steps[0], steps[0]),
                           modules[tuple(at)][1])
        if handed and tuple(at + handed.group(1).replace("crate::", "").split("::")) in modules:
            at = at + handed.group(1).split("::")
    return tuple(at) if tuple(at) in modules else None


def circles(edges):
    """Strongly connected components of more than one module (Tarjan)."""
    index, low, stack, out = {}, {}, [], []

    def visit(v):
        index[v] = low[v] = len(index)
        stack.append(v)
        for w in sorted(edges.get(v, ())):
            if w not in index:
                visit(w)
                low[v] = min(low[v], low[w])
            elif w in stack:
                low[v] = min(low[v], index[w])
        if low[v] == index[v]:
            group = []
            while not group or group[-1] != v:
                group.append(stack.pop())
            if len(group) > 1:
                out.append(sorted(group))

    for v in sorted(edges):
        if v not in index:
            visit(v)
    return out


def main():
    sys.setrecursionlimit(10_000)
    found = 0
    for crate in sorted(os.listdir("crates")):
        root = os.path.join("crates", crate, "src")
        if not os.path.isdir(root):
            continue
        modules = load(root)
        edges = {}
        for module, (_, text) in modules.items():
            inner = [text[m.end():] for m in re.finditer(r"\nmod \w+ \{", text)]
            outer = text.split("\n#[cfg(test)]\nmod tests {")[0]
            for path in paths(outer):
                to = target(modules, module, path)
                if to is not None and to != module:
                    edges.setdefault(module, set()).add(to)
            for body in inner:
                # In a module inside the file, the first `super` is the file itself.
                for path in paths(body):
                    to = target(modules, module + ("tests",), path)
                    if to is not None and to != module:
                        edges.setdefault(module, set()).add(to)
        for group in circles(edges):
            found += 1
            print("circle:", ", ".join(modules[m][0] for m in group))
    print(f"{found} circles of imports")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
