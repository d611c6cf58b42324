"""What a user waits for before the first step: modules that `import ngswell` and a first step must do without."""

import subprocess
import sys

SLOW = (
    "IPython", "asyncio", "concurrent.futures", "http.client", "matplotlib", "multiprocessing", "netgen.gui", "pandas",
    "scipy", "ssl", "tkinter", "unittest", "urllib.request", "xml.sax.saxutils",
)  # fmt: skip
"""Each takes from ten milliseconds to a second to import; pictures and VTK files ask for theirs when they are made."""

FIRST_STEP = """
from ngswell import *
bath = Bath("top", c=Ramp((0, 0.15), (10, 0.125)))
scene = Scene(mesh=column(0.5, 4), kinematics=Confined(), material=TABLE_1, supports=[Roller("bottom", "x")], baths=[bath])
scene.run(until=1, steps=Fixed(1.0), unstable="off")
"""


def slow_modules(code):
    """Those of SLOW that a fresh process has after `code`."""
    asked = f"{code}\nimport sys\nprint(*sorted({set(SLOW)!r} & sys.modules.keys()))"
    return set(subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True).stdout.split())


def test_a_first_step_imports_nothing_that_is_slow_and_not_needed():
    assert slow_modules(FIRST_STEP) == set()


def test_what_is_slow_is_noticed():
    assert "matplotlib" in slow_modules("import ngswell.plotting")
