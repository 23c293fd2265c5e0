"""Simulations that a live view shows and steps."""
import gc
import os
import re
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request

import numpy as np
import pytest
from bodies import simulation
from conftest import needs_program
from page import Page

import phyxel


@pytest.fixture(autouse=True)
def _served():
    try:
        simulation().view().close()
    except phyxel.InputError as error:
        if "Boost.Beast" not in str(error):
            raise
        pytest.skip("built without Boost.Beast")


def stepped(steps, s=None):
    s = s or simulation(gravity=[0, 0, -9.81])
    s.step(steps)
    return s


def test_a_view_goes_on_from_the_present_state_and_gives_it_back():
    s = stepped(37)
    live = s.view(paused=True)
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[0-9a-f]{32}", live.address)
    assert live.address in live._repr_html_()
    page = Page(live.address)
    page.until(lambda: page.time is not None)
    assert page.time == s.time > 0
    page.send(do="step", count=101)
    page.until(lambda: page.time > 130 * s.dt)
    assert s.steps == 138 and s.time == page.time  # readable meanwhile
    page.send(do="play")
    page.until(lambda: page.time > 400 * s.dt)
    assert np.isfinite(s.energies()["total_energy"])
    live.close()
    steps = s.steps
    assert steps > 400
    s.step(50)
    # The same bits as without a view: pages look, and change nothing.
    alone = stepped(steps + 50)
    assert s.time == alone.time
    assert np.array_equal(s.displacement, alone.displacement)
    assert np.array_equal(s.velocity, alone.velocity)
    page.until(lambda: any("goes on in Python" in m.get("message", "") for m in page.messages))
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(live.address)


def test_values_that_users_set_stay():
    s = stepped(40)
    rest, mass = s.rest, s.mass.copy()
    with s.view(paused=True) as live:
        page = Page(live.address)
        page.send(do="set", gravity=[3.0, 0, 0])
        page.until(lambda: any(m.get("settings", {}).get("gravity") == [3, 0, 0] for m in page.messages))
    v, u, t = s.velocity, s.displacement, s.time
    s.step(100)
    # A free body: gravity alone moves its centre, now along x.
    share = (s.mass / s.mass.sum())[:, None]
    assert (share * (s.velocity - v)).sum(0) == pytest.approx([3 * (s.time - t), 0, 0], abs=1e-10)
    assert np.abs(s.displacement - u).max() > 0
    # Arrays of the model before outlive it.
    del s
    gc.collect()
    assert rest.shape == (len(mass), 3) and np.isfinite(rest).all()


def test_reset_goes_back_to_where_the_view_began():
    s = stepped(60)
    s.set_state(velocity=s.velocity + np.cross([0, 0, 40], s.rest))
    u, v, t = s.displacement, s.velocity, s.time
    with s.view(paused=True) as live:
        page = Page(live.address)
        page.send(do="step", count=200)
        page.until(lambda: page.time is not None and page.time > t + 150 * s.dt)
        page.send(do="reset")
        page.until(lambda: page.time == t)
    assert s.time == t
    assert np.array_equal(s.displacement, u) and np.array_equal(s.velocity, v)


def test_the_hand_adds_to_forces_of_ones_own():
    s = simulation()
    wind = np.zeros_like(s.rest)
    wind[:, 1] = 2.5 * s.mass
    s.external_forces = wind
    s.step(10)
    before, impulse = (s.mass[:, None] * s.velocity).sum(0), 0
    with s.view(paused=True) as live:
        page = Page(live.address)
        page.send(do="grab", phyxel=5)
        page.send(do="move", by=[0.3, 0, 0])
        for steps in range(14, 134, 4):  # the hand sets its force every four steps
            page.send(do="step", count=4)
            page.until(lambda: s.steps == steps)
            impulse = impulse + 4 * s.dt * s.external_forces.sum(0)
            hand = s.external_forces - wind
            assert hand[5, 0] > 0 and 5 < np.count_nonzero(hand[:, 0]) < len(s)  # on a patch around the phyxel
        gained = (s.mass[:, None] * s.velocity).sum(0) - before
        page.send(do="drop")
        page.send(do="step", count=1)
        page.until(lambda: s.steps == 131)
        assert np.array_equal(s.external_forces, wind)
    assert np.array_equal(s.external_forces, wind)
    # All that acts on a free body: its momentum, but for rounding.
    assert gained == pytest.approx(impulse, rel=1e-10, abs=1e-10)
    assert impulse[0] > 0 and impulse[1] > 0.5 * 2.5 * s.mass.sum() * 120 * s.dt


def test_what_changes_a_viewed_simulation_is_refused():
    s = simulation()
    live = s.view(paused=True)
    for change in (lambda: s.step(1), lambda: s.run(), lambda: s.set_state(displacement=s.displacement),
                   lambda: setattr(s, "external_forces", None), s.write_frame):
        with pytest.raises(phyxel.InputError, match="runs in a view; allowed: reading it, or close"):
            change()
    with pytest.raises(phyxel.InputError, match="one, until its close"):
        s.view()
    live.close()
    live.close()
    with s.view() as again:  # the first one, closed, does not end it
        live.close()
        assert urllib.request.urlopen(again.address).status == 200
    s.step(3)
    assert s.steps == 3
    for wrong, match in (({"pace": 0}, "pace"), ({"port": 70000}, "port"), ({"host": "192.0.2.1"}, "192.0.2.1")):
        with pytest.raises(phyxel.InputError, match=match):
            s.view(**wrong)
    s.step(1)
    with pytest.raises(phyxel.InputError, match="equilibrium"):
        simulation(solver={"method": "equilibrium", "device": "cpu"}).view()


def test_readers_wait_for_turns_only():
    s = simulation(gravity=[0, 0, -9.81])
    with s.view(pace=1000) as live:  # as fast as it can: turns follow each other at once
        page = Page(live.address)
        page.until(lambda: page.time is not None)
        done = threading.Event()
        listener = threading.Thread(target=lambda: page.until(done.is_set), daemon=True)
        listener.start()
        times = []
        while len(times) < 20:
            times.append(s.time)
            s.energies()
        done.set()
        listener.join()
    assert times == sorted(times) and times[-1] > times[0]


def test_what_a_page_saves_is_continued(tmp_path):
    s = stepped(20)
    with s.view(paused=True, out=tmp_path / "saved") as live:
        page = Page(live.address)
        page.send(do="step", count=30)
        page.send(do="save")
        page.until(lambda: any("Saved: " in m.get("message", "") for m in page.messages))
    folder = tmp_path / "saved/saved_0001"
    assert len(list(folder.glob("checkpoint_*"))) == 1
    assert not (folder / "session.jsonl").exists()  # it would begin at another state than the scene


def test_a_view_ends_with_its_object_and_with_python(tmp_path):
    s = simulation()
    address = (lambda live: live.address)(s.view())
    gc.collect()
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(address)
    s.step(1)
    program = ("import phyxel\n"
               "s = phyxel.Simulation({'time': {'end': 1}, 'solver': {'device': 'cpu'}, 'body': [{'shape': 'beam',\n"
               "  'size': [1, 0.2, 0.2], 'spacing': 0.1, 'material': {'young': 1e5, 'poisson': 0.3, 'density': 1000}}]})\n"
               "live = s.view()\nprint(live.address)\n")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, cwd=tmp_path)
    assert done.returncode == 0 and done.stdout.startswith("http://") and done.stderr == ""


def test_a_cell_of_a_notebook_shows_and_steps_it(tmp_path):
    needs_program("chromium")
    s = simulation(gravity=[0, 0, -9.81])
    with s.view() as live:
        (tmp_path / "notebook.html").write_text(f"<!doctype html><p>cell</p>{live._repr_html_()}")
        browser = subprocess.Popen(
            ["chromium", "--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
             f"--user-data-dir={tmp_path / 'chromium'}", "--remote-debugging-port=0", (tmp_path / "notebook.html").as_uri()],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        try:
            deadline = time.monotonic() + 100
            while s.time < 0.1 and time.monotonic() < deadline:
                time.sleep(0.05)
        finally:
            os.killpg(browser.pid, 9)
            browser.wait()
    # The page plays what it shows; nobody acts on it: free fall, for which Verlet's steps are exact.
    assert s.time >= 0.1
    fall = (s.mass[:, None] * s.displacement).sum(0)[2] / s.mass.sum()
    assert fall == pytest.approx(-9.81 / 2 * s.time ** 2, rel=1e-9)
