"""Gases in cavities, as the Python module tells them."""
import numpy as np
import pytest
from bodies import simulation

import phyxel


def test_gases_are_read(tmp_path):
    box = lambda low, high: [(x, y, z) for z in (low, high) for y in (low, high)
                             for x in (low, high)]
    faces = np.array([(0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4),
                      (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5)])
    surface = (np.array(box(0, 1) + box(0.3, 0.7), dtype=float),
               np.concatenate([faces, faces[:, ::-1] + 8]))
    hollow = phyxel.sample(surface, phyxels=900)
    s = phyxel.Simulation(
        {"time": {"end": 0.02}, "output": {"frames_per_second": 100},
         "solver": {"device": "cpu", "precision": "double"},
         "body": [{"name": "cube", "cloud": "hollow",
                   "material": {"young": 2e4, "poisson": 0.3, "density": 1000},
                   "traction": [{"box": [[0.2] * 3, [0.8] * 3], "pressure": 2e3, "gas": 1}]}]},
        clouds={"hollow": hollow})
    s.record(tmp_path / "out")
    s.run()
    gas, = s.gases()
    assert (gas["body"], gas["set"]) == ("cube", "traction 1")
    assert gas["pressure"] * gas["volume"] == pytest.approx(2e3 * 0.064, rel=0.02)
    written = phyxel.Trajectory(tmp_path / "out").gases["cube", "traction 1"]
    assert len(written["volume"]) == 3
    assert written["pressure"][-1] == gas["pressure"]
    assert simulation().gases() == []
