"""Fragments of broken bodies and their surfaces, as the Python module tells them."""
import numpy as np
import pytest
from bodies import simulation

import phyxel


def test_a_beam_that_is_cut_is_two_fragments(tmp_path):
    beam = phyxel.shape("block", size=(0.8, 0.2, 0.2), spacing=0.05, lattice="cells")
    cut = simulation({"name": "beam", "notch": [{"centre": [0.1, 0, 0], "normal": [1, 0, 0],
                                                 "radius": 9}]},
                     {"beam": beam}, time={"end": 0.01}, gravity=[0, 0, -10],
                     output={"frames_per_second": 200, "fields": ["fragment"]})
    heavy, light = cut.fragments()
    assert (heavy["body"], heavy["fragment"], light["fragment"]) == ("beam", 1, 2)
    assert light["mass"] == pytest.approx(1000 * 0.3 * 0.2 * 0.2, rel=1e-12)
    assert light["centre"] == pytest.approx((0.25, 0, 0), abs=1e-12)
    right = beam.surfels[cut.triangles][:, :, 0] > 0.1
    assert 0 < len(cut.triangles) < len(beam.triangles)
    assert np.all(right.all(axis=1) | ~right.any(axis=1))  # no triangle spans the cut
    cut.record(tmp_path / "out")
    cut.run()
    trajectory = phyxel.Trajectory(tmp_path / "out")
    fallen = trajectory.fragments["beam", 2]
    assert fallen["centre_z"] == pytest.approx(-5 * fallen["time"] ** 2, abs=1e-12)
    assert set(trajectory.fragments) == {("beam", 1), ("beam", 2)}
    assert set(trajectory.phyxels[-1].fields["fragment"]) == {1, 2}
    assert len(trajectory.surface[-1].triangles) == len(cut.triangles)
    assert simulation().fragments() == []
