"""Simulations of the Python module, held against mechanics and against what the library promises."""
import multiprocessing
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from bodies import BEAM, MATERIAL, cube, simulation

import phyxel

# --- stepping ------------------------------------------------------------------------------------

def test_free_fall_is_free_fall():
    s = simulation(gravity=[0, 0, -9.81])
    s.run(until=0.05)
    # Verlet's steps are exact under constant acceleration, but for the start's half step: exactly
    # t^2 / 2 from rest, to rounding.
    fallen = -9.81 * s.time**2 / 2
    assert np.allclose(s.displacement[:, 2], fallen, rtol=1e-9)
    assert np.allclose(s.position, s.rest + s.displacement)
    assert s.energies()["total_energy"] == pytest.approx(0, abs=1e-9 * s.mass.sum())


def test_a_free_body_keeps_energy_and_momenta():
    s = simulation(body={"spin": [0, 0, 3], "velocity": [0, 1, 0]})
    before = s.energies()
    s.step(1500)
    after = s.energies()
    for name in ("momentum", "angular_momentum"):
        # sums of a thousand numbers: rounding
        assert np.allclose(after[name], before[name], rtol=1e-10, atol=1e-10)
    assert after["total_energy"] == pytest.approx(before["total_energy"], rel=1e-4)  # Verlet's
    assert after["step"] == s.steps == 1500


def test_forces_are_the_gradient_of_the_energy():
    s = simulation()
    rng = np.random.default_rng(1)
    u = 1e-3 * rng.standard_normal(s.rest.shape)
    du = rng.standard_normal(s.rest.shape)
    s.set_state(displacement=u)
    work = np.sum(s.forces() * du)
    energies = []
    step = 1e-7
    for sign in (1, -1):
        s.set_state(displacement=u + sign * step * du)
        energies.append(s.energies()["elastic_energy"])
    # central differences: (1e-7 / 1e-3)^2 of truncation, 1e-16 / 1e-4 of rounding
    assert work == pytest.approx(-(energies[0] - energies[1]) / (2 * step), rel=1e-6)


def test_a_body_that_names_no_law_is_neo_hookean():
    def end(**law):
        scene = simulation(body={"material": {**MATERIAL, **law}, "spin": (0, 0, 30)})
        scene.step(50)
        return scene.displacement.copy()
    assert np.array_equal(end(), end(law="neo-hookean"))
    assert not np.array_equal(end(), end(law="st-venant-kirchhoff"))


def test_homogeneous_stretch_has_its_stress_and_volume():
    s = simulation(body={"material": {**MATERIAL, "law": "st-venant-kirchhoff"}})
    stretch = np.diag([0.01, 0, 0])
    s.set_state(displacement=s.rest @ stretch)
    assert np.allclose(s.gradients(), stretch, atol=1e-12)
    assert np.allclose(s.volume_ratio(), 1.01, rtol=1e-6)  # the library keeps it in float for files
    green = 0.01 + 0.01**2 / 2
    mu, lam = 1e6 / 2.6, 0.3e6 / (1.3 * 0.4)
    second_piola = np.array([lam + 2 * mu, lam, lam]) * green
    cauchy = second_piola * np.array([1.01**2, 1, 1]) / 1.01
    assert np.allclose(s.von_mises(), cauchy[0] - cauchy[1], rtol=1e-6)


def test_live_state_is_no_copy_and_follows_every_step():
    s = simulation(gravity=[0, 0, -9.81])
    live = s.live
    displacement = live.displacement
    assert not displacement.flags.writeable and not displacement.flags.owndata
    with pytest.raises(ValueError):
        displacement[0, 0, 0] = 1
    for _ in range(3):
        s.step(7)
        assert np.array_equal(displacement[live.pack, :, live.lane], s.displacement)
        assert np.array_equal(live.velocity[live.pack, :, live.lane], s.velocity)
    assert np.abs(displacement).max() > 0
    del s
    assert np.isfinite(displacement).all()  # it keeps what it shows alive


def test_views_of_the_model_outlive_it():
    s = simulation()
    mass, rest = s.mass, s.rest
    offsets, indices = s.neighbours
    del s
    assert mass.sum() == pytest.approx(40, rel=1e-12)
    j = indices[offsets[5]:offsets[6]]
    assert 5 not in j and len(j) > 10
    assert np.linalg.norm(rest[j] - rest[5], axis=1).max() < 0.2


def test_external_forces_act():
    s = simulation()
    force = np.zeros_like(s.rest)
    force[:, 0] = 2.5 * s.mass
    s.external_forces = force
    assert np.array_equal(s.external_forces, force)
    s.step(200)
    # From v(-dt/2) = 0, which knows nothing of a force set later: half a step ahead of free fall.
    assert np.allclose(s.displacement[:, 0], 2.5 * s.time * (s.time + s.dt) / 2, rtol=1e-9)
    s.external_forces = None
    assert len(s.external_forces) == 0
    with pytest.raises(phyxel.InputError, match="external_forces"):
        s.external_forces = force[1:]


def test_equilibrium_of_a_pulled_bar_is_hookes():
    left = BEAM.regions["x-"]
    y, z = BEAM.position[left, 1], BEAM.position[left, 2]
    centre, side = left[np.argmin(y**2 + z**2)], left[np.argmax(y - abs(z))]
    s = simulation(body={"fixed": [{"region": "x-", "axes": "x"},
                                   {"indices": [centre], "axes": "yz"},
                                   {"indices": [side], "axes": "z"}],
                         "load": [{"region": "x+", "force": [4.0, 0, 0]}]},
                   solver={"method": "equilibrium", "device": "cpu", "precision": "double"})
    s.run()
    end = BEAM.regions["x+"]
    # F / (E A) of a bar of 1 m, softer by its open gradients at the surface (docs/accuracy.md)
    assert s.displacement[end, 0].mean() == pytest.approx(4.0 / (1e6 * 0.04), rel=0.02)
    assert s.residual < 1e-8


def test_states_that_do_not_fit_are_refused():
    s = simulation(body={"material": {**MATERIAL, "law": "j2", "yield_stress": 1e3}})
    n = len(s)
    fits = {name: np.zeros(n) for name in s.history}
    assert len(fits) == 7
    last = list(fits)[-1]
    for change, words in [
        (dict(displacement=np.zeros((n - 1, 3))), rf"displacement: shape \({n - 1}, 3\) found"),
        (dict(velocity=[[0, 0, np.nan]] * n), "velocity: .* row 0; allowed: finite numbers"),
        (dict(history=5), "history: 5 found; allowed: a dict of arrays"),
        (dict(history={3: np.zeros(n)}), "history: the key 3 found; allowed: names"),
        (dict(history={**fits, last: "many"}), f"history, {last}: no array of numbers found"),
        (dict(history={**fits, last: np.zeros(n + 1)}), rf"shape \({n + 1},\) found"),
        (dict(history={**fits, last: np.full(n, np.inf)}), "not finite at phyxel 0"),
        (dict(history={"strain": np.zeros(n)}), "column \"strain\" found"),
        (dict(history={last: np.zeros(n)}), "is missing"),
    ]:
        with pytest.raises(phyxel.InputError, match=words):
            s.set_state(**change)
    s.set_state(displacement=np.zeros((n, 3)), velocity=np.zeros((n, 3)), history=fits)
    s.external_forces = np.full((n, 3), 1e308)  # finite, though sums of it are not
    assert s.external_forces.min() == 1e308


def test_precisions_agree():
    tips = {}
    for precision in ("float", "mixed", "double"):
        s = phyxel.Simulation({"time": {"end": 0.05}, "gravity": [0, 0, -9.81],
                               "solver": {"device": "cpu"},
                               "body": [{"cloud": "beam", "material": MATERIAL,
                                         "fixed": [{"region": "x-"}]}]},
                              clouds={"beam": BEAM}, precision=precision)
        s.run()
        tips[precision] = s.displacement[:, 2].min()
        assert s.live.displacement.dtype == (np.float32 if precision == "float" else np.float64)
    # 1e-7 a step over some hundreds of steps
    assert tips["float"] == pytest.approx(tips["double"], rel=1e-4)
    assert tips["mixed"] == pytest.approx(tips["double"], rel=1e-4)


def stepped(_):
    s = simulation(solver={"device": "cpu", "precision": "double", "threads": 2})
    s.set_state(velocity=np.cross(s.rest, [0, 0, 1]))
    s.step(20)
    return s.displacement


@pytest.mark.parametrize("way", ["fork", "spawn"])
def test_a_child_steps_as_its_parent_does(way):
    expected = stepped(0)  # starts threads, which no fork copies
    with multiprocessing.get_context(way).Pool(2) as pool:
        for result in pool.map_async(stepped, range(3)).get(timeout=60):
            assert np.array_equal(result, expected)
    assert np.array_equal(stepped(0), expected)


@pytest.mark.parametrize("given, turns", [({}, "1000"), ({"GOMP_SPINCOUNT": "7"}, "7"),
                                          ({"OMP_WAIT_POLICY": "active"}, "30000000000")])
def test_waiting_threads_sleep_soon_unless_the_user_says_otherwise(given, turns):
    # The runtime itself tells how many turns its threads wait. Those of "active" are its own.
    environment = {k: v for k, v in os.environ.items()
                   if k not in ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT")}
    said = subprocess.run([sys.executable, "-c", "import phyxel"], text=True, check=True,
                          stderr=subprocess.PIPE,
                          env={**environment, "OMP_DISPLAY_ENV": "VERBOSE", **given}).stderr
    assert re.findall(r"GOMP_SPINCOUNT = '(\d+)'", said) == [turns]


def test_a_run_that_diverges_says_so():
    s = phyxel.Simulation({"time": {"end": 1, "step": 1e-2},
                           "solver": {"device": "cpu"},
                           "body": [{"cloud": "beam", "spin": [0, 3, 0], "material": MATERIAL}]},
                          clouds={"beam": BEAM}, unsafe_step=True)
    with pytest.raises(phyxel.DivergedError, match="step"):
        s.run(until=20.0)


@pytest.mark.parametrize("change, words", [
    (dict(device="gpu"), "device.*gpu"),
    (dict(precision="half"), "precision: \"half\""),
    (dict(method="euler"), "method: \"euler\""),
    (dict(threads=0), "threads: 0"),
    (dict(step=-1.0), "step: -1"),
    (dict(step=1.0), "unstable"),
    (dict(end=float("nan")), "end: nan"),
    (dict(end=1e300), r"end: 1e\+300 found; allowed: a number, 0 < end < 1e\+09"),
    (dict(step=1e-17), "steps; allowed: below 1e15"),
        (dict(step=1e-300), "step: 1e-300 found; allowed"),
    (dict(clouds={}), "body.cloud.*no clouds"),
    (dict(clouds={"bean": BEAM}), "did you mean \"bean\""),
])
def test_wrong_requests_are_refused(change, words):
    scene = {"time": {"end": 1}, "body": [{"cloud": "beam", "material": MATERIAL}]}
    with pytest.raises(phyxel.InputError, match=words):
        phyxel.Simulation(scene, **{"clouds": {"beam": BEAM}, **change})


def test_scenes_are_files_texts_and_dicts(tmp_path):
    text = ("title = \"a \\\"quoted\\\" one\"\n[time]\nend = 1e-2\n[[body]]\nshape = \"sphere\"\n"
            "radius = 0.5\nphyxels = 200\nmaterial = {young = 1e5, poisson = 0.3, density = 1e3}\n")
    (tmp_path / "scene.toml").write_text(text)
    as_dict = {"title": "a \"quoted\" one", "time": {"end": np.float64(1e-2)},
               "body": [{"shape": "sphere", "radius": 0.5, "phyxels": np.int64(200),
                         "material": {"young": 1e5, "poisson": 0.3, "density": 1e3}}]}
    made = [phyxel.Simulation(given) for given in (tmp_path / "scene.toml", text, as_dict)]
    assert {len(s) for s in made} == {len(made[0])}
    assert all(np.array_equal(s.mass, made[0].mass) for s in made)
    with pytest.raises(phyxel.InputError, match="radios.*radius"):
        phyxel.Simulation({**as_dict, "body": [{**as_dict["body"][0], "radios": 1}]})
    with pytest.raises(phyxel.InputError, match="no_such.toml"):
        phyxel.Simulation(tmp_path / "no_such.toml")
    sweep = tmp_path / "young=1e7"
    sweep.mkdir()
    (sweep / "scene.toml").write_text(text)
    assert len(phyxel.Simulation(str(sweep / "scene.toml"))) == len(made[0])
    odd = phyxel.to_toml({"title": "\U0001f600\x7f\t", "gravity": np.zeros(3), "x": np.array(1.5)})
    assert odd == '"title" = "\U0001f600\\u007f\\t"\n"gravity" = [0.0, 0.0, 0.0]\n"x" = 1.5\n'
    phyxel.Simulation({**as_dict, "title": "\U0001f600"})
    with pytest.raises(phyxel.InputError, match="steps; allowed: at most"):
        made[0].run(1e300)
    with pytest.raises(phyxel.InputError, match="found; allowed: text"):
        phyxel.to_toml({"title": object()})


def test_late_refusals_begin_with_the_scene(tmp_path):
    text = ("[time]\nend = 1.0\nstep = {}\n[[body]]\nshape = \"beam\"\nsize = [1, 0.2, 0.2]\n"
            "spacing = {}\nmaterial = {{young = 1e5, poisson = 0.3, density = 1e3}}\n{}")
    for scene, words in [
        (text.format("1.0", "0.1", ""), ": time.step = 1 s is unstable"),
        (text.format("1e-3", "9.0", ""), ":4:1: body \"beam\": shape \"beam\": spacing = 9 m"),
        (text.format("1e-3", "0.1", "[[body.fixed]]\nregion = \"left\"\n"), ":10:10: body \"beam\" has no"),
    ]:
        (tmp_path / "late.toml").write_text(scene)
        for given, name in [(tmp_path / "late.toml", tmp_path / "late.toml"), (scene, "scene")]:
            with pytest.raises(phyxel.InputError, match="^" + re.escape(f"{name}{words}")):
                phyxel.Simulation(given)


def test_numpy_2_is_refused_where_arrays_would_be_wrong(tmp_path):
    if phyxel._phyxel.pybind11_version >= (2, 12):
        pytest.skip("built with a pybind11 that knows NumPy 2")
    (tmp_path / "numpy.py").write_text("__version__ = '2.0.1'\n")
    path = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    loaded = subprocess.run([sys.executable, "-c", "import phyxel"], capture_output=True, text=True,
                            env={**os.environ, "PYTHONPATH": path})
    assert loaded.returncode != 0
    assert "ImportError: NumPy 2.0.1 is installed" in loaded.stderr
    assert "allowed are NumPy 1, or phyxel built with pybind11 2.12" in loaded.stderr


# --- trajectories --------------------------------------------------------------------------------

def test_trajectories_come_back(tmp_path):
    s = simulation(gravity=[0, 0, -9.81], time={"end": 0.1},
                   output={"frames_per_second": 50, "fields": ["displacement", "von_mises", "mass"]})
    with pytest.raises(phyxel.InputError, match="record"):
        s.write_frame()
    s.record(tmp_path / "out")
    s.run()
    t = phyxel.Trajectory(tmp_path / "out")
    assert len(t) == 6 and t.times[-1] == pytest.approx(0.1)
    last = t.phyxels[-1]
    assert np.array_equal(last.fields["displacement"], s.displacement)
    assert np.allclose(last.points, s.position)
    assert np.allclose(last.fields["mass"], s.mass, rtol=1e-6)  # in float
    assert last.fields["von_mises"].shape == (len(s),)
    surface = t.surface[0]
    assert np.array_equal(surface.triangles, s.triangles) and len(surface.normals) == len(surface)
    assert [frame.time for frame in t.surface[1:3]] == pytest.approx([0.02, 0.04])
    energy = t.energy
    assert np.allclose(energy["kinetic_energy"] + energy["gravity_energy"], 0,
                       atol=1e-9 * s.mass.sum())  # free fall
    with pytest.raises(phyxel.InputError, match="--force|earlier trajectory"):
        simulation().record(tmp_path / "out")
    simulation().record(tmp_path / "out", force=True)
    assert len(phyxel.Trajectory(tmp_path / "out")) == 1
    with pytest.raises(phyxel.InputError, match="no trajectory"):
        phyxel.Trajectory(tmp_path)


def test_reactions_carry_the_weight_and_come_back(tmp_path):
    s = simulation(body={"fixed": [{"region": "x-"}]}, gravity=[0, 0, -9.81],
                   solver={"device": "cpu", "precision": "double", "method": "equilibrium"})
    s.record(tmp_path / "out")
    s.run()
    support, = s.reactions()
    assert (support["body"], support["set"], support["work"]) == ("beam", "fixed 1", 0)
    weight = 9.81 * s.mass.sum()
    assert support["force"] == pytest.approx((0, 0, weight), abs=1e-6 * weight)
    # Half the length from the clamp, less what bending takes from it.
    assert support["torque"][1] == pytest.approx(-0.5 * weight, rel=0.06)
    written = phyxel.Trajectory(tmp_path / "out").reactions
    assert list(written) == [("beam", "fixed 1")]
    assert written["beam", "fixed 1"]["force_z"][-1] == support["force"][2]
    assert simulation().reactions() == []


def test_points_are_read(tmp_path):
    s = simulation(body={"fixed": [{"region": "x-"}]}, gravity=[0, 0, -9.81],
                   probe=[{"name": "tip", "point": [0.9, 0, 0]}, {"region": "x+"}],
                   solver={"device": "cpu", "precision": "double", "method": "equilibrium"})
    s.record(tmp_path / "out")
    s.run()
    x = s.rest[[3, 40, 77]]
    found = s.at(x)
    largest = abs(s.displacement).max()  # five phyxels across bend: a fit smooths that
    assert np.allclose(found["displacement"], s.displacement[[3, 40, 77]], rtol=0, atol=0.01 * largest)
    assert found["stress"].shape == found["strain"].shape == (3, 6)
    assert found["von_mises"].shape == (3,)
    assert np.array_equal(found["rest"], x)
    probes = s.probes()
    assert list(probes) == ["tip", "probe 2"]
    assert np.array_equal(probes["tip"]["stress"], s.at([[0.9, 0, 0]])["stress"])
    written = phyxel.Trajectory(tmp_path / "out").probes
    assert list(written) == [("tip", 1), ("probe 2", 1)]
    assert written["tip", 1]["displacement_z"][-1] == probes["tip"]["displacement"][0, 2]
    with pytest.raises(phyxel.InputError, match="from the nearest phyxel"):
        s.at([[9, 9, 9]])
    with pytest.raises(phyxel.InputError, match="which the model lacks"):
        s.at([[0.9, 0, 0]], body="cow")
    assert simulation().probes() == {}


def test_surfaces_follow():
    s = simulation(body={"velocity": [1, 0, 0]})
    s.step(50)
    points, normals = s.surface()
    assert np.allclose(points, BEAM.surfels + [s.time, 0, 0], atol=1e-12)
    assert np.allclose(normals, BEAM.normals, atol=1e-9)
    assert s.triangles.shape == BEAM.triangles.shape


def test_fields_are_on_the_surface(tmp_path):
    s = simulation(body={"fixed": [{"region": "x-"}], "velocity": [0, 0, 0.1]}, time={"end": 0.02},
                   output={"frames_per_second": 50, "fields": ["displacement", "velocity", "von_mises"]})
    s.record(tmp_path / "out")
    s.run()
    found = s.surface_fields(["velocity", "displacement", "von_mises"])
    points, _ = s.surface()
    assert found["velocity"].shape == points.shape and found["von_mises"].shape == (len(points),)
    assert np.allclose(BEAM.surfels + found["displacement"], points, atol=1e-12)
    # Surfels are on phyxels or near them, and the beam swings about its clamp.
    nearest = [np.argmin(np.linalg.norm(s.rest - x, axis=1)) for x in BEAM.surfels]
    assert np.allclose(found["velocity"], s.velocity[nearest], atol=0.3 * abs(s.velocity).max())
    assert abs(found["velocity"][:, 2]).max() > 0.5 * abs(s.velocity).max()
    written = phyxel.Trajectory(tmp_path / "out").surface[-1].fields
    for name, values in found.items():
        assert np.allclose(written[name], values, rtol=1e-6, atol=1e-6 * abs(values).max())
    assert s.surface_fields(["history"]) == {}
    with pytest.raises(phyxel.InputError, match='"mass" found; allowed: displacement, velocity, von_mises'):
        s.surface_fields(["mass"])
