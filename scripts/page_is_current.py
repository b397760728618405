#!/usr/bin/env python3
"""Exit 1 if crates/hingecast/src/view/page.html was not made of web/ as it is: run `make web`."""
import hashlib
import pathlib
import re
import sys

root = pathlib.Path(__file__).resolve().parent.parent
files = re.search(r"const sources = \[(.*?)\]", (root / "web/build.mjs").read_text())[1]
names = re.findall(r'"(.*?)"', files)
missing = {f"src/{p.name}" for p in (root / "web/src").iterdir()} - set(names)
total = hashlib.sha256()
for name in [*names, "package-lock.json"]:
    total.update((root / "web" / name).read_bytes())
made_of = re.search(r'name="sources" content="(\w*)"', (root / "crates/hingecast/src/view/page.html").read_text())[1]
if missing or made_of != total.hexdigest():
    sys.exit(f"page.html is not of these sources; run `make web` {sorted(missing) or ''}")
