"""Bodies and simulations that the tests of the Python module share."""
import numpy as np

import phyxel

MATERIAL = {"young": 1e6, "poisson": 0.3, "density": 1000}
BEAM = phyxel.shape("beam", size=(1, 0.2, 0.2), spacing=0.05)


def simulation(body={}, clouds={"beam": BEAM}, **scene):
    base = {"time": {"end": 0.1}, "solver": {"device": "cpu", "precision": "double"},
            "body": [{"cloud": "beam", "material": MATERIAL, **body}]}
    return phyxel.Simulation({**base, **scene}, clouds=clouds)


def cube(side=1.0):
    points = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * side
    triangles = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
                 [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    return points, np.array(triangles)
