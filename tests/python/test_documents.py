"""What docs/python.md and examples/python show, run as it stands."""
import os
import pathlib
import re
import subprocess
import sys
import types

import pytest
from conftest import needs_module

SOURCE = pathlib.Path(__file__).resolve().parents[2]


def test_the_page_runs_from_its_beginning(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```python\n(.*?)^```", (SOURCE / "docs/python.md").read_text(),
                        re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 5
    page = types.ModuleType("page")  # a module, where processes look for the page's functions
    monkeypatch.setitem(sys.modules, "page", page)
    for block in blocks:
        exec(compile(block, "docs/python.md", "exec"), page.__dict__)


@pytest.mark.parametrize("script", sorted(p.name for p in (SOURCE / "examples/python").glob("*.py")))
def test_examples_run_and_draw(script, tmp_path):
    needs_module("matplotlib")
    picture = tmp_path / "picture.png"
    done = subprocess.run([sys.executable, SOURCE / "examples/python" / script, picture],
                          capture_output=True, text=True, env={**os.environ, "MPLCONFIGDIR": str(tmp_path)})
    assert done.returncode == 0, done.stderr
    assert picture.stat().st_size > 10_000 and done.stdout
