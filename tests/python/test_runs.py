"""Runs, steps and set-ups of the Python module beside other threads, under interrupts, and how far they tell they are."""
import os
import signal
import threading
import time

import numpy as np
import pytest

from bodies import BEAM, MATERIAL, cube, simulation

import phyxel


def test_other_threads_run_while_it_steps():
    s = simulation()
    ticks = []
    stop = threading.Event()
    thread = threading.Thread(target=lambda: [ticks.append(1) for _ in iter(stop.is_set, True)])
    thread.start()
    before = len(ticks)
    s.step(300)
    after = len(ticks)
    stop.set()
    thread.join()
    assert after > before


def test_one_thread_at_a_time():
    s = simulation()
    refused = []

    def meddle():
        while not refused:
            try:
                s.set_state(displacement=np.zeros_like(s.rest))
            except phyxel.InputError as error:
                refused.append(str(error))
    thread = threading.Thread(target=meddle)
    thread.start()
    while not refused:
        try:
            s.step(200)
        except phyxel.InputError as error:  # the other was faster
            refused.append(str(error))
    thread.join()
    assert "another thread" in refused[0]
    s.step(10)


def test_ctrl_c_stops_a_long_run():
    s = simulation()
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    previous = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            s.step(10**9)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, previous)
    steps = s.steps
    s.step(3)  # and it goes on
    assert s.steps == steps + 3


def test_ctrl_c_stops_a_run_of_short_frames():
    # A frame is a few steps here, far less than the interval at which signals are looked for.
    s = simulation(time={"end": 1e4}, output={"frames_per_second": 1e4})
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    previous = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            s.run()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, previous)


def test_set_up_tells_its_stages():
    heard = []
    cloud = phyxel.sample(cube(), phyxels=300, progress=lambda stage, share: heard.append((stage, share)))
    phyxel.Simulation({"time": {"end": 0.1}, "solver": {"device": "cpu"},
                       "body": [{"cloud": "cube", "material": MATERIAL}]}, clouds={"cube": cloud},
                      progress=lambda stage, share: heard.append((stage, share)))
    stages = {stage for stage, _ in heard}
    assert {"filling the surface", "evening out distances", "volumes of phyxels", "neighbours",
            "moments", "solver arrays", "largest time step"} <= stages
    for stage in stages:
        shares = [share for name, share in heard if name == stage]
        assert shares[0] == 0 and shares[-1] == 1, stage

    def refuse(stage, share):
        if stage == "moments":
            raise LookupError(stage)

    with pytest.raises(LookupError, match="moments"):
        phyxel.Simulation({"time": {"end": 0.1}, "body": [{"cloud": "beam", "material": MATERIAL}]},
                          clouds={"beam": BEAM}, progress=refuse)


def test_runs_tell_how_far_they_are():
    heard = []
    tell = lambda stage, share: heard.append((stage, share))
    s = simulation(time={"end": 0.05}, output={"frames_per_second": 100})
    s.run(progress=tell)
    assert heard[0] == ("steps", 0) and heard[-1] == ("steps", 1)
    shares = [share for _, share in heard]
    assert shares == sorted(shares)

    hung = dict(gravity=[0, 0, -9.81], solver={"method": "equilibrium", "device": "cpu"})
    rest = simulation({"fixed": [{"region": "x-"}]}, **hung)
    heard.clear()
    rest.run(progress=tell)
    assert heard[0] == ("search for rest", 0) and heard[-1] == ("search for rest", 1)
    rest.run()  # nobody hears any more
    assert heard[-1] == ("search for rest", 1) and len(heard) == len(set(heard))

    # What the function raises ends a run and a search, which go on from there.
    def refuse(stage, share):
        if 0 < share < 1:
            raise LookupError(stage)

    s = simulation(time={"end": 1e3})
    with pytest.raises(LookupError, match="steps"):
        s.run(progress=refuse)
    s.step(3)
    fine = phyxel.shape("beam", size=(1, 0.2, 0.2), spacing=0.02)
    rest = simulation({"fixed": [{"region": "x-"}]}, clouds={"beam": fine}, **hung)
    with pytest.raises(LookupError, match="search for rest"):
        rest.run(progress=refuse)


def test_ctrl_c_stops_a_set_up():
    heard = {}
    previous = signal.signal(signal.SIGALRM, signal.default_int_handler)

    def interrupt():  # as soon as the set-up has begun, however slow the machine is
        while not heard and sampling.is_set():
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGALRM)

    sampling = threading.Event()
    sampling.set()
    thread = threading.Thread(target=interrupt)
    try:
        with pytest.raises(KeyboardInterrupt):
            thread.start()
            # A method of dict runs no Python code, which would hear the signal itself.
            phyxel.sample(cube(), phyxels=300000, progress=heard.__setitem__)
            sampling.clear()
            thread.join()
    finally:
        sampling.clear()
        thread.join()
        signal.signal(signal.SIGALRM, previous)
    assert heard and "volumes of phyxels" not in heard  # the last stage
