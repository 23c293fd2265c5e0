"""What surrounds the module: its stubs, its command, `phyxel.run` and tables for pandas."""
import ast
import importlib
import pathlib
import re
import shutil
import subprocess
import sys
import urllib.error
import urllib.request

import numpy as np
import pytest
from bodies import BEAM, MATERIAL
from conftest import needs_module

import phyxel

SOURCE = pathlib.Path(__file__).resolve().parents[2]
SCENE = {"time": {"end": 0.01}, "solver": {"device": "cpu", "precision": "double"},
         "output": {"frames_per_second": 500}, "gravity": [0, 0, -9.81],
         "body": [{"cloud": "beam", "material": MATERIAL, "fixed": [{"region": "x-"}, {"region": "x+"}]}],
         "probe": [{"name": "middle", "body": "beam", "from": [0.4, 0, 0], "to": [0.6, 0, 0], "points": 2}]}


def stubs():
    sys.path.insert(0, str(SOURCE / "scripts"))
    try:
        return importlib.import_module("make_stubs")
    finally:
        sys.path.pop(0)


def test_stubs_have_the_names_and_the_parameters_of_the_module():
    make_stubs, module = stubs(), importlib.import_module("phyxel._phyxel")
    text = make_stubs.STUBS.read_text()
    assert make_stubs.differences(text, module) == []
    assert make_stubs.differences(make_stubs.stubs_of(module), module) == []
    for old, new, said in (("def write_frame(", "def write_frames(", "SimulationBase.write_frame(self): not in the stubs"),
                           ("steps: int = 1", "steps: int = 2", "the module has (self, steps=1)"),
                           ("class InputError(Error, ValueError)", "class InputError(Error)", "the module has Error, ValueError")):
        assert old in text
        assert said in "\n".join(make_stubs.differences(text.replace(old, new), module))


def test_stubs_belong_to_the_package():
    folder = pathlib.Path(phyxel.__file__).parent
    assert (folder / "py.typed").exists()
    assert (folder / "_phyxel.pyi").read_text() == (SOURCE / "apps/python/phyxel/_phyxel.pyi").read_text()
    imports = [node for node in ast.parse((folder / "__init__.py").read_text()).body
               if isinstance(node, ast.ImportFrom) and node.module == "_phyxel"]
    names = {name.name for node in imports for name in node.names}
    assert len(names) > 10 and names <= stubs().shape_of((folder / "_phyxel.pyi").read_text()).keys()


def test_the_command_is_the_program():
    def said(*arguments):
        return subprocess.run([sys.executable, "-m", "phyxel", *arguments], capture_output=True, text=True)
    assert said("--version").stdout.split()[:2] == phyxel.version.split()[:2]  # the commit may differ in a build of parts
    wrong = said("rnu")
    assert wrong.returncode == 2 and wrong.stderr.startswith("phyxel: error: rnu: unknown command (did you mean \"run\"?)")


def test_view_serves_a_page(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text("[time]\nend = 1\n[solver]\ndevice = 'cpu'\nthreads = 1\n[[body]]\nshape = 'beam'\n"
                     "size = [1, 0.2, 0.2]\nspacing = 0.1\n[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1000\n")
    with phyxel.view(scene, paused=True, out=tmp_path / "out") as live:
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[0-9a-f]{32}", live.address)
        assert live.address in live._repr_html_()
        with urllib.request.urlopen(live.address) as answer:
            assert b"<canvas" in answer.read()
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(live.address[:-1])
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(live.address)
    scene.write_text("[time]\nend = 1\n")
    with pytest.raises(RuntimeError, match="body"):
        phyxel.view(scene)
    with pytest.raises(TypeError, match="pcae"):
        phyxel.view(scene, pcae=1)


def test_the_command_of_a_module_without_a_program_says_so(tmp_path):
    shutil.copytree(pathlib.Path(phyxel.__file__).parent, tmp_path / "site/lib/phyxel", ignore=shutil.ignore_patterns("bin"))
    done = subprocess.run([sys.executable, "-m", "phyxel", "--version"], capture_output=True, text=True, cwd=tmp_path,
                          env={"PYTHONPATH": str(tmp_path / "site/lib")})
    assert done.returncode == 2 and "no program beside it; allowed: " in done.stderr


def test_run_writes_the_trajectory_of_a_simulation(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = []
    trajectory = phyxel.run(SCENE, "out/beam", clouds={"beam": BEAM}, progress=lambda stage, share: told.append(stage))
    assert told and len(trajectory) == 6
    alone = phyxel.Simulation(SCENE, clouds={"beam": BEAM})
    alone.run()
    assert np.array_equal(trajectory.phyxels[-1].points, np.float32(alone.position)) or \
        np.array_equal(trajectory.phyxels[-1].points, alone.position)
    with pytest.raises(phyxel.InputError, match="out/beam"):
        phyxel.run(SCENE, "out/beam", clouds={"beam": BEAM})
    assert len(phyxel.run(SCENE, "out/beam", clouds={"beam": BEAM}, force=True, end=0.004)) == 3
    with pytest.raises(TypeError, match="presicion"):
        phyxel.run(SCENE, "out/other", clouds={"beam": BEAM}, presicion="float")
    assert not pathlib.Path("out/other").exists()


def test_run_writes_where_the_program_would(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    BEAM.write("beam.h5")
    body = {**SCENE["body"][0], "file": "beam.h5", "name": "beam"}
    del body["cloud"]
    pathlib.Path("bar.toml").write_text(phyxel.to_toml({**SCENE, "body": [body]}))
    assert phyxel.Simulation("bar.toml").directory == pathlib.Path("out/bar")
    assert phyxel.run("bar.toml").directory == pathlib.Path("out/bar") and pathlib.Path("out/bar/energy.csv").exists()


def test_tables_have_the_columns_of_the_logs(tmp_path):
    needs_module("pandas")
    trajectory = phyxel.run(SCENE, tmp_path / "out", clouds={"beam": BEAM})
    energy = trajectory.table("energy")
    assert list(energy.columns) == list(trajectory.energy) and len(energy) == 6
    assert np.array_equal(energy["total_energy"], trajectory.energy["total_energy"])
    probes = trajectory.table("probes")
    assert list(probes.columns[:3]) == ["time", "probe", "point"] and len(probes) == 12
    second = probes[(probes["probe"] == "middle") & (probes["point"] == 2)]
    assert np.array_equal(second["displacement_z"], trajectory.probes["middle", 2]["displacement_z"])
    reactions = trajectory.table("reactions")
    assert set(reactions["set"]) == {"fixed 1", "fixed 2"} and len(reactions) == 12
    assert len(trajectory.table("gases")) == 0
    with pytest.raises(phyxel.InputError, match="'energies' found; allowed: energy, reactions"):
        trajectory.table("energies")


def test_tables_without_pandas_say_what_is_missing(tmp_path, monkeypatch):
    trajectory = phyxel.run(SCENE, tmp_path / "out", clouds={"beam": BEAM})
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="pip install pandas, or the arrays of trajectory.energy"):
        trajectory.table("energy")


def test_tensors_of_frames_have_six_components(tmp_path):
    scene = {**SCENE, "output": {"frames_per_second": 500, "fields": ["stress", "von_mises"]}}
    frame = phyxel.run(scene, tmp_path / "run", clouds={"beam": BEAM}).phyxels[-1]
    xx, yy, zz, xy, yz, xz = frame.fields["stress"].T
    von_mises = np.sqrt(0.5 * ((xx - yy)**2 + (yy - zz)**2 + (zz - xx)**2) + 3 * (xy**2 + yz**2 + xz**2))
    assert von_mises.max() > 0
    assert frame.fields["von_mises"] == pytest.approx(von_mises, rel=1e-5, abs=1e-6 * von_mises.max())
