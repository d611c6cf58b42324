"""Command line of the studies: `python -m studies [NAME] [--quick] [--out DIR] [--overwrite] [--from-rest]`."""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path
from time import perf_counter

from ngswell import NgswellError
from ngswell.plotting import use_style
from studies.output import prepare, write

PAPER = ("boundary_charge", "oscillation", "free_swelling")
STUDIES = (
    *PAPER,
    "convergence",
    "cylinder",
    "growth",
    "hard_cases",
    "iteration",
    "reductions",
    "speed_error",
    "stability",
    "tolerance",
    "treatments",
    "verification",
)


def main(arguments: list[str] | None = None) -> int:
    """Run the named study, or those of the paper; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m studies", description="Draw figures, with their numbers.")
    parser.add_argument("name", nargs="?", choices=STUDIES, help="one study; the paper's three if none is named")
    parser.add_argument("--quick", action="store_true", help="coarser and shorter, within about a minute")
    parser.add_argument("--out", type=Path, help="folder to write to; figures/ by default, figures/quick/ with --quick")
    parser.add_argument("--overwrite", action="store_true", help="replace files in the folder named with --out")
    parser.add_argument("--from-rest", action="store_true", help="free_swelling: skip the ramp of the charge")
    parser.add_argument("--plain", type=Path, help="speed_error: the plain NGSolve script to compare with")
    options = parser.parse_args(arguments)
    if options.from_rest and options.name != "free_swelling":
        parser.error("--from-rest goes with free_swelling")
    if options.plain and options.name != "speed_error":
        parser.error("--plain goes with speed_error")
    if options.plain and not options.plain.is_file():
        parser.error(f"--plain: there is no file {options.plain}")

    names = PAPER if options.name is None else (options.name,)
    special = {"from_rest": True} if options.from_rest else {"plain": options.plain} if options.plain else {}
    own = Path("figures/quick") if options.quick else Path("figures")
    folder = own if options.out is None else options.out
    try:
        prepare(folder, names, overwrite=options.overwrite or options.out is None)
        use_style()
        for name in names:
            clock = perf_counter()
            print(f"{name}: started", file=sys.stderr, flush=True)
            findings = importlib.import_module(f"studies.{name}").run(quick=options.quick, **special)
            write(folder, name, findings)
            print(f"{name}: {perf_counter() - clock:.0f} s, wrote {folder / name}.png, .csv, .json", file=sys.stderr)
            for key, value in findings.numbers.items():
                print(f"  {key} = {value:.6g}" if isinstance(value, float) else f"  {key} = {value}")
    except NgswellError as error:
        print(f"studies: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("studies: interrupted; what was finished is written", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
