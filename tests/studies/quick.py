"""A study at its quick size, through the command line."""

import csv
import json

from studies.__main__ import main

META = {
    "mesh",
    "steps",
    "rejected_steps",
    "newton_iterations",
    "seconds",
    "version_ngswell",
    "version_ngsolve",
    "linear_solver",
}


def quick(name, folder):
    """The numbers and the rows that a study writes to `folder`."""
    assert main([name, "--quick", "--out", str(folder)]) == 0
    assert (folder / f"{name}.png").stat().st_size > 10_000
    with open(folder / f"{name}.csv", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    assert len({len(row) for row in rows[:5]}) == 1
    numbers = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    assert numbers.keys() >= META
    return numbers, rows
