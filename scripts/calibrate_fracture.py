#!/usr/bin/env python3
"""Measures the constant C of critical stretches, s_c = C sqrt(G_c / (E' s)), for lib/model/fracture.cpp.

A strip in plane strain between fixed grips is cut along a part of its middle plane. Its phyxels are a cubic lattice, with the
weights (1 - r^2/h^2)^3, the energy of a linear fit of displacements and hourglass control of phyxel. Nothing depends on z, so that
one column of phyxels along z stands for all: its pairs have the weights of all layers. The exact energy release rate G is the
energy that the strip has far ahead of the cut and lacks far behind it. C is the stretch of the pair at rest that is stretched most, over
sqrt(G / (E' s)): its root mean square over the places in the lattice at which the cut may end.

With --range it prints instead, for each place of the end, that stretch and the smallest such maximum while the crack grows by four spacings, pair by
pair: under a load by which that reaches s_c, a crack runs on from every place of the lattice.

Needs NumPy and SciPy. Prints the table, row by row.
"""
import argparse

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sl

HOURGLASS = 0.1  # strength of hourglass control
FADING = 4  # most_moment_growth of physics/fracture.hpp


class Strip:
    """Phyxels 1 apart, E = 1, whose grips are moved apart by a strain of 1."""

    def __init__(self, length, height, support, poisson):
        self.length, self.height, self.support = length, height, support
        self.lame = poisson / ((1 + poisson) * (1 - 2 * poisson))
        self.shear = 0.5 / (1 + poisson)
        self.modulus = 1 / (1 - poisson**2)  # E'
        self.place = np.stack(np.meshgrid(np.arange(length) + 0.0, np.arange(height) - (height - 1) / 2, indexing="ij"), -1)
        self.place = self.place.reshape(-1, 2)
        first, second, layer = [], [], []
        column, row = np.arange(len(self.place)) // height, np.arange(len(self.place)) % height
        reach = int(support)
        for dx in range(-reach, reach + 1):
            for dy in range(-reach, reach + 1):
                for dz in range(reach + 1):
                    if (dx, dy) <= (0, 0) or dx * dx + dy * dy + dz * dz >= support**2:
                        continue
                    inside = (column + dx >= 0) & (column + dx < length) & (row + dy >= 0) & (row + dy < height)
                    first.append(np.where(inside)[0])
                    second.append(first[-1] + dx * height + dy)
                    layer.append(np.full(len(first[-1]), dz))
        self.first, self.second, layer = np.concatenate(first), np.concatenate(second), np.concatenate(layer)
        self.offset = self.place[self.second] - self.place[self.first]
        self.squared = (self.offset**2).sum(1) + layer**2.0
        self.weight = np.where(layer == 0, 1, 2) * (1 - self.squared / support**2) ** 3
        self.cut = np.zeros(len(self.first), bool)
        from_y, to_y = self.place[self.first][:, 1], self.place[self.second][:, 1]
        self.crosses = from_y * to_y < 0
        share = from_y / np.where(self.crosses, from_y - to_y, 1)
        self.at = np.where(self.crosses, self.place[self.first][:, 0] + share * self.offset[:, 0], np.inf)
        self.intact = None  # tr A^-1 of each phyxel without cuts

    def stiffness(self):
        kept = ~self.cut
        i, j = np.r_[self.first[kept], self.second[kept]], np.r_[self.second[kept], self.first[kept]]
        x, w, n = np.r_[self.offset[kept], -self.offset[kept]], np.r_[self.weight[kept], self.weight[kept]], len(self.place)
        moment = np.zeros((n, 2, 2))
        for a in range(2):
            for b in range(2):
                moment[:, a, b] = np.bincount(i, w * x[:, a] * x[:, b], n)
        inverse = np.linalg.pinv(moment, rcond=1e-6, hermitian=True)
        shares = np.einsum("pab,pb->pa", inverse[i], x) * w[:, None]
        gradient = [
            (sp.csr_matrix((shares[:, b], (i, j)), (n, n)) - sp.diags(np.bincount(i, shares[:, b], n))).tocsr() for b in range(2)
        ]
        trace = np.trace(inverse, axis1=1, axis2=2)
        if self.intact is None:
            self.intact = trace
        spans = np.linalg.eigvalsh(moment)[:, 0] > 1e-6 * np.linalg.eigvalsh(moment)[:, 1]
        carried = sp.diags(np.where(spans, np.minimum(1, FADING * self.intact / trace), 0))
        x_axis, y_axis = sp.csr_matrix([[1.0, 0.0]]), sp.csr_matrix([[0.0, 1.0]])
        xx, yy = sp.kron(gradient[0], x_axis), sp.kron(gradient[1], y_axis)
        xy, volume = sp.kron(gradient[0], y_axis) + sp.kron(gradient[1], x_axis), xx + yy
        elastic = self.lame * volume.T @ carried @ volume + self.shear * (
            2 * (xx.T @ carried @ xx + yy.T @ carried @ yy) + xy.T @ carried @ xy
        )
        integral = 1 / 5 - 3 / 7 + 3 / 9 - 1 / 11
        kappa = HOURGLASS / (4 * np.pi * integral * self.support**5)
        residual = 2 * (sp.diags(np.bincount(i, w, n)) - sp.csr_matrix((w, (i, j)), (n, n)))
        for a in range(2):
            for b in range(2):
                residual = residual - gradient[a].T @ sp.diags(moment[:, a, b]) @ gradient[b]
        return (elastic + sp.kron(kappa * residual, sp.eye(2))).tocsr()

    def at_rest(self):
        """Displacements and energy."""
        n, x, y = len(self.place), self.place[:, 0], self.place[:, 1]
        u, held = np.zeros((n, 2)), np.zeros((n, 2), bool)
        grips = np.abs(y) > (self.height - 1) / 2 - 1.6
        u[grips, 1], held[grips] = y[grips], True
        held[(x < 0.5) | (x > self.length - 1.5), 0] = True  # planes of symmetry at both ends
        u, held, matrix = u.ravel(), held.ravel(), self.stiffness()
        free = np.where(~held)[0]
        # The last term holds what has lost its neighbours.
        system = matrix[free][:, free] + 1e-9 * sp.eye(len(free))
        u[free] = sl.spsolve(system.tocsc(), -(matrix[free][:, np.where(held)[0]] @ u[held]))
        return u.reshape(n, 2), 0.5 * u @ (matrix @ u)

    def stretches(self, u):
        found = (self.offset * (u[self.second] - u[self.first])).sum(1) / self.squared
        found[self.cut | (np.abs(self.place[self.first][:, 1]) > self.height / 2 - 4)] = -1
        return found


PLACES = np.arange(0.05, 1, 0.1)  # of the end of the cut, in spacings


def constants(support, poisson, height, advance=0):
    """The stretches at each place of the end of the cut, and the smallest while the crack grows by `advance` spacings."""
    length = 3 * height
    strip = Strip(length, height, support, poisson)
    whole = strip.at_rest()[1]
    strip.cut = strip.crosses.copy()
    unit = np.sqrt((whole - strip.at_rest()[1]) / (length - 1) / strip.modulus)
    first, smallest = [], np.inf
    for place in PLACES:
        tip = int(0.4 * length)
        strip.cut = strip.crosses & (strip.at < tip + place)
        first.append(strip.stretches(strip.at_rest()[0]).max() / unit)
    while advance > 0 and strip.at[strip.cut & strip.crosses].max() < tip + advance:
        stretches = strip.stretches(strip.at_rest()[0])
        smallest = min(smallest, stretches.max() / unit)
        strip.cut |= stretches >= smallest * unit * 0.9999
    return np.array(first), smallest


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--height", type=int, default=16, help="spacings across the strip")
    parser.add_argument("--range", action="store_true", help="print the stretches at all places, at poisson 0.25")
    options = parser.parse_args()
    supports = (1.8, 1.95, 2.1, 2.2)
    if options.range:
        for support in supports:
            first, smallest = constants(support, 0.25, options.height, 4)
            print(f"h={support:g}: {np.round(first, 3)}, while it grows {smallest:.3f}", flush=True)
        return
    print("poisson " + " ".join(f"h={h:<6g}" for h in supports))
    for poisson in (0.0, 0.1, 0.2, 0.25, 0.3, 0.35):
        row = [np.sqrt((constants(h, poisson, options.height)[0] ** 2).mean()) for h in supports]
        print(f"{poisson:<8g}" + " ".join(f"{value:.4f}  " for value in row), flush=True)


if __name__ == "__main__":
    main()
