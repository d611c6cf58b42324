"""A compiler call whose objects are kept on disk; a program of its own, which `compiling` puts in front of NGSolve's.

    python cached_compiler.py FOLDER TAG COMPILER -c SOURCE -o OBJECT

`TAG` names the version of what the source includes. Sources of NGSolve hold addresses, which differ from run to run, in
a file of their own; what they are called counts over a run, and is counted anew here. Where the folder cannot be written,
nothing is kept.
"""

import contextlib
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile

MOST = 400
"""Objects kept, some 0.1 to 2 MB each; the ones not used for longest go."""

ADDRESS = re.compile(r"(?<=compiled_code_pointer)\d+")


def main(folder: str, tag: str, compiler: str, *flags: str) -> int:
    """Exit status of the compiler, or 0 for an object that is there."""
    source, target = flags[flags.index("-c") + 1], flags[flags.index("-o") + 1]
    with open(source, encoding="utf-8") as file:
        text = file.read()
    numbers = [int(number) for number in ADDRESS.findall(text)]
    if numbers:
        first = min(numbers)
        text = ADDRESS.sub(lambda found: str(int(found[0]) - first), text)
        with open(source, "w", encoding="utf-8") as file:
            file.write(text)
    if "#include" not in text:  # addresses of this run
        return subprocess.call(["c++", "-fPIC", "-O1", *flags])
    with open(compiler, "rb") as file:
        key = hashlib.sha256("\n".join([tag, text]).encode() + file.read()).hexdigest()
    kept = os.path.join(folder, key + ".o")
    try:
        shutil.copyfile(kept, target)
        os.utime(kept)
        return 0
    except OSError:
        status = subprocess.call([compiler, *flags])
    if status == 0:
        with contextlib.suppress(OSError):
            keep(target, kept)
    return status


def keep(target: str, kept: str) -> None:
    """Put an object into the folder, all at once, and the oldest out of it."""
    folder = os.path.dirname(kept)
    os.makedirs(folder, exist_ok=True)
    handle, part = tempfile.mkstemp(dir=folder, suffix=".part")
    os.close(handle)
    shutil.copyfile(target, part)
    os.replace(part, kept)
    objects = [os.path.join(folder, name) for name in os.listdir(folder) if name.endswith(".o")]
    for old in sorted(objects, key=os.path.getmtime)[:-MOST]:
        os.remove(old)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
