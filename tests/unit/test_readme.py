"""The README's scene runs as it stands."""

import re
from pathlib import Path

README = Path(__file__).parents[2] / "README.md"


def test_the_scene_of_the_readme_runs(capsys):
    code = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert len(code) == 1
    exec(compile(code[0], str(README), "exec"), {"__name__": "readme"})
    printed = capsys.readouterr().out
    assert "bath on top|left|bottom: prescribed" in printed
    assert "weight" not in printed
