"""Command line: `python -m studies [NAME] [--quick] [--out DIR] [--overwrite]`, and options that only one study has."""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path
from time import perf_counter
from types import ModuleType

from ngswell import NgswellError
from ngswell.plotting import use_style
from studies.output import prepare, write

PAPER = ("boundary_charge", "oscillation", "free_swelling")
STUDIES = {
    **{name: f"studies.paper.{name}" for name in PAPER},
    "convergence": "studies.limits.convergence",
    "cylinder": "studies.limits.cylinder",
    "growth": "studies.choices.growth",
    "hard_cases": "studies.hard_cases.run",
    "iteration": "studies.choices.iteration",
    "reductions": "studies.choices.reductions",
    "scaling": "studies.choices.scaling",
    "speed_error": "studies.choices.speed_error",
    "stability": "studies.choices.stability",
    "tolerance": "studies.choices.tolerance",
    "treatments": "studies.choices.treatments",
    "verification": "studies.limits.verification",
}
"""Where the study of each name is: a module with `run(quick, ...)` and, for options of its own, `options(parser)`."""


def main(arguments: list[str] | None = None) -> int:
    """Run the named study, or those of the paper; returns the exit status."""
    studies = {name: importlib.import_module(module) for name, module in STUDIES.items()}
    own = {name: own_options(study) for name, study in studies.items()}
    parser = argparse.ArgumentParser(
        prog="python -m studies", description="Draw figures, with their numbers.", parents=list(own.values()),
        conflict_handler="resolve",  # studies may share an option
    )  # fmt: skip
    parser.add_argument("name", nargs="?", choices=STUDIES, help="one study; the paper's three if none is named")
    parser.add_argument("--quick", action="store_true", help="coarser and shorter, within about a minute")
    parser.add_argument("--out", type=Path, help="folder to write to; figures/ by default, figures/quick/ with --quick")
    parser.add_argument("--overwrite", action="store_true", help="replace files in the folder named with --out")
    options = parser.parse_args(arguments)
    special: dict[str, dict[str, object]] = {}
    for name, of_study in own.items():
        defaults = vars(of_study.parse_args([]))
        special[name] = {option: getattr(options, option) for option in defaults}
        for option, value in special[name].items():
            owners = [study for study, other in own.items() if option in vars(other.parse_args([]))]
            if value != defaults[option] and options.name not in owners:
                parser.error(f"--{option.replace('_', '-')} goes with {' and '.join(owners)}")

    names = PAPER if options.name is None else (options.name,)
    folder = options.out or Path("figures/quick" if options.quick else "figures")
    try:
        prepare(folder, names, overwrite=options.overwrite or options.out is None)
        use_style()
        for name in names:
            clock = perf_counter()
            print(f"{name}: started", file=sys.stderr, flush=True)
            findings = studies[name].run(quick=options.quick, **special[name])
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


def own_options(study: ModuleType) -> argparse.ArgumentParser:
    """A parser of the options that only this study has."""
    parser = argparse.ArgumentParser(add_help=False)
    if hasattr(study, "options"):
        study.options(parser)
    return parser


if __name__ == "__main__":
    sys.exit(main())
