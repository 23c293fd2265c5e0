"""Small-strain finite elements for the references: Lagrange tetrahedra and hexahedra, direct and multigrid solvers.

Arrays: `nodes` (n, 3) [m]; `cells` (m, k), the nodes of each element in the order of its shape functions. Vectors
of unknowns are nodes first, components last: u[3 i + c].
"""
import itertools

import numpy as np
import pypardiso
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from scipy.spatial import cKDTree

TET_EDGES = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])


class Tet:
    """Tetrahedron with linear (order 1) or quadratic (order 2) shape functions."""

    def __init__(self, order):
        self.order = order
        a, b = 0.58541019662496852, 0.1381966011250105  # degree 2: exact for the stiffness of straight elements
        self.points = np.array([[a, b, b], [b, a, b], [b, b, a], [b, b, b]]) if order == 2 else np.full((1, 3), 0.25)
        self.weights = np.full(len(self.points), 1 / 6 / len(self.points))

    def shapes(self, x):
        """Shape functions (points, k) and their gradients (points, k, 3) at points of the reference element."""
        bary = np.concatenate([1 - x.sum(1, keepdims=True), x], 1)
        dbary = np.vstack([-np.ones(3), np.eye(3)])
        if self.order == 1:
            return bary, np.broadcast_to(dbary, (len(x), 4, 3))
        i, j = TET_EDGES.T
        n = np.concatenate([bary * (2 * bary - 1), 4 * bary[:, i] * bary[:, j]], 1)
        corner = (4 * bary - 1)[:, :, None] * dbary
        edge = 4 * (bary[:, i, None] * dbary[j] + bary[:, j, None] * dbary[i])
        return n, np.concatenate([corner, edge], 1)


class Hex:
    """Hexahedron of any order on Gauss-Lobatto nodes, mapped by its own shape functions (isoparametric)."""

    def __init__(self, order):
        self.order = order
        legendre = np.polynomial.legendre.Legendre.basis(order)
        self.line = (np.concatenate([[-1], np.sort(legendre.deriv().roots().real), [1]]) + 1) / 2  # on [0, 1]
        x, w = np.polynomial.legendre.leggauss(order + 1)
        self.points = np.array(list(itertools.product((x + 1) / 2, repeat=3)))
        self.weights = np.prod(list(itertools.product(w / 2, repeat=3)), axis=1)

    def shapes(self, x):
        coefficients = np.linalg.inv(np.vander(self.line, increasing=True))
        powers = np.arange(self.order + 1)
        n = [x[:, c, None] ** powers @ coefficients for c in range(3)]
        d = [powers * x[:, c, None] ** np.maximum(powers - 1, 0) @ coefficients for c in range(3)]
        of = lambda a, b, c: np.einsum("pi,pj,pk->pijk", a, b, c).reshape(len(x), -1)
        return of(*n), np.stack([of(d[0], n[1], n[2]), of(n[0], d[1], n[2]), of(n[0], n[1], d[2])], 2)


def geometry(element, nodes, cells):
    """Gradients (m, points, k, 3) of shape functions and weights (m, points) with the Jacobian, at the element's points."""
    _, dn = element.shapes(element.points)
    jacobian = np.einsum("mki,qkj->mqij", nodes[cells], dn)
    det = np.linalg.det(jacobian)
    if det.min() <= 0:
        raise ValueError("an element is inverted")
    return dn[None] @ np.linalg.inv(jacobian), det * element.weights


def chunks(cells, k):
    size = max(1, 2_000_000 // k)
    return [slice(a, a + size) for a in range(0, len(cells), size)]


class Pattern:
    """Sparsity of nodes: each pair of nodes of each element has a slot among the non-zero blocks."""

    def __init__(self, cells, n):
        k = cells.shape[1]
        key = (cells[:, :, None].astype(np.int64) * n + cells[:, None, :]).reshape(-1)
        unique, slot = np.unique(key, return_inverse=True)
        del key
        self.n, self.slot = n, slot.astype(np.int32).reshape(len(cells), k * k)
        self.columns = (unique % n).astype(np.int32)
        self.rows = np.searchsorted(unique, np.arange(n + 1, dtype=np.int64) * n).astype(np.int32)


def stiffness(element, nodes, cells, young, poisson):
    """Stiffness as a BSR matrix of 3 x 3 blocks [N/m]."""
    lam, mu = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))
    pattern, k = Pattern(cells, len(nodes)), cells.shape[1]
    data = np.zeros((len(pattern.columns), 3, 3))
    for part in chunks(cells, k * k):
        g, w = geometry(element, nodes, cells[part])
        g = g.reshape(*g.shape[:2], -1)
        m = (np.swapaxes(g * w[..., None], 1, 2) @ g).reshape(len(g), k, 3, k, 3)
        trace = np.einsum("makbk->mab", m)
        slot = pattern.slot[part].reshape(-1)
        for i, j in itertools.product(range(3), repeat=2):
            value = lam * m[:, :, i, :, j] + mu * m[:, :, j, :, i] + (mu * trace if i == j else 0)
            data[:, i, j] += np.bincount(slot, value.reshape(-1), len(data))
    return sp.bsr_matrix((data, pattern.columns, pattern.rows), shape=(3 * len(nodes),) * 2)


def mass(element, nodes, cells, density):
    """Consistent mass of one component as a CSR matrix [kg]."""
    pattern, n = Pattern(cells, len(nodes)), element.shapes(element.points)[0]
    data = np.zeros(len(pattern.columns))
    for part in chunks(cells, n.shape[1] ** 2):
        _, w = geometry(element, nodes, cells[part])
        value = density * np.einsum("mq,qa,qb->mab", w, n, n)
        data += np.bincount(pattern.slot[part].reshape(-1), value.reshape(-1), len(data))
    return sp.csr_matrix((data, pattern.columns, pattern.rows), shape=(len(nodes),) * 2)


def body_force(element, nodes, cells, force):
    """Nodal forces (3 n) of a force per volume `force` [N/m^3] in the given elements."""
    n, total = element.shapes(element.points)[0], np.zeros(len(nodes))
    for part in chunks(cells, cells.shape[1]):
        _, w = geometry(element, nodes, cells[part])
        total += np.bincount(cells[part].reshape(-1), (w @ n).reshape(-1), len(nodes))
    return (total[:, None] * np.asarray(force, float)).reshape(-1)


class Factor:
    """Direct solver for a symmetric positive definite matrix; PARDISO needs its upper triangle only."""

    def __init__(self, matrix):
        self.solver = pypardiso.PyPardisoSolver(mtype=2)
        self.upper = sp.triu(matrix, format="csr")
        self.upper.sort_indices()
        self.solver.factorize(self.upper)

    def __call__(self, b):
        return self.solver.solve(self.upper, np.ascontiguousarray(b))

    def free(self):
        self.solver.free_memory(everything=True)


def direct(matrix, force, free):
    """Solves K u = f for the free unknowns (a mask of 3 n), the others being zero."""
    factor = Factor(matrix.tocsr()[free][:, free])
    u = np.zeros(len(force))
    u[free] = factor(force[free])
    factor.free()
    return u


class Multigrid:
    """Preconditioner for quadratic tetrahedra: Chebyshev smoothing, and a direct solver of linear tetrahedra."""

    def __init__(self, matrix, prolongation, coarse, free, free_coarse):
        self.a, self.p, self.free, self.keep = matrix, prolongation, free, free_coarse
        self.coarse = Factor(coarse.tocsr()[free_coarse][:, free_coarse])
        blocks = np.empty((matrix.shape[0] // 3, 3, 3))
        row = np.repeat(np.arange(len(blocks)), np.diff(matrix.indptr))
        on = matrix.indices == row
        blocks[row[on]] = matrix.data[on]
        self.inverse = np.linalg.inv(blocks)
        x = np.random.default_rng(1).standard_normal(len(free)) * free
        for _ in range(12):
            x /= np.linalg.norm(x)
            x = self.jacobi(self.a @ x)
        self.top = 1.1 * np.linalg.norm(x)

    def jacobi(self, r):
        return np.einsum("nij,nj->ni", self.inverse, r.reshape(-1, 3)).reshape(-1) * self.free

    def smooth(self, b, x, steps=3):
        """Chebyshev's iteration for the upper 9/10 of the spectrum."""
        low, high = self.top / 10, self.top
        theta, delta = (high + low) / 2, (high - low) / 2
        rho = delta / theta
        r = b - self.a @ x if x is not None else b
        d = self.jacobi(r) / theta
        x = d.copy() if x is None else x + d
        for _ in range(steps - 1):
            r = r - self.a @ d
            next_rho = 1 / (2 * theta / delta - rho)
            d = next_rho * rho * d + 2 * next_rho / delta * self.jacobi(r)
            x, rho = x + d, next_rho
        return x

    def __call__(self, b):
        x = self.smooth(b, None)
        coarse = np.zeros(len(self.keep))
        coarse[self.keep] = self.coarse((self.p.T @ ((b - self.a @ x) * self.free))[self.keep])
        x = x + (self.p @ coarse) * self.free
        return self.smooth(b, x)


def iterate(matrix, force, free, preconditioner, tolerance=1e-10):
    """Conjugate gradients for K u = f; ends at the given residual relative to f."""
    u, r = np.zeros(len(force)), force * free
    goal, d, before = tolerance * np.linalg.norm(r), None, 0
    for _ in range(200):
        z = preconditioner(r)
        now = r @ z
        d = z if d is None else z + now / before * d
        ad = (matrix @ d) * free
        step = now / (d @ ad)
        u, r, before = u + step * d, r - step * ad, now
        if np.linalg.norm(r) <= goal:
            return u
    raise RuntimeError("conjugate gradients did not converge")


def quadratic(nodes, cells):
    """Nodes and cells of quadratic tetrahedra on linear ones, and the prolongation from linear to quadratic (nodes)."""
    edges = np.sort(cells[:, TET_EDGES].reshape(-1, 2), axis=1)
    key, index = np.unique(edges[:, 0].astype(np.int64) * len(nodes) + edges[:, 1], return_inverse=True)
    a, b = key // len(nodes), key % len(nodes)
    n, e = len(nodes), len(key)
    more = np.concatenate([cells, n + index.reshape(-1, 6)], 1).astype(np.int32)
    rows = np.concatenate([np.arange(n), np.repeat(n + np.arange(e), 2)])
    columns = np.concatenate([np.arange(n), np.stack([a, b], 1).reshape(-1)])
    p = sp.csr_matrix((np.concatenate([np.ones(n), np.full(2 * e, 0.5)]), (rows, columns)), shape=(n + e, n))
    return np.concatenate([nodes, (nodes[a] + nodes[b]) / 2]), more, p


def solve_tetrahedra(nodes, cells, held, young, poisson, force_density):
    """Quadratic tetrahedra under forces per volume [N/m^3], clamped where `held` says so of points.

    @return nodes, cells, forces and displacements (n, 3) of the quadratic mesh; one for each force density
    """
    fine, more, p = quadratic(nodes, cells)
    free = np.repeat(~held(fine), 3).astype(float)
    matrix = stiffness(Tet(2), fine, more, young, poisson)
    coarse = stiffness(Tet(1), nodes, cells, young, poisson)
    mg = Multigrid(matrix, sp.kron(p, sp.eye(3), "csr"), coarse, free, np.repeat(~held(nodes), 3))
    forces, found = [], []
    for density in force_density:
        f = body_force(Tet(2), fine, more, density)
        u = iterate(matrix, f, free, mg)
        forces.append(f.reshape(-1, 3))
        found.append(u.reshape(-1, 3))
    mg.coarse.free()
    return fine, more, forces, found


def first_frequency(matrix, mass_matrix, free):
    """Lowest eigenfrequency [Hz] and its mode."""
    k = matrix.tocsr()[free][:, free]
    m = sp.kron(mass_matrix, sp.eye(3), "csr")[free][:, free]
    factor = Factor(k)
    operator = spl.LinearOperator(k.shape, matvec=factor, dtype=float)
    value, mode = spl.eigsh(k, k=1, M=m, sigma=0, OPinv=operator, tol=1e-12)
    factor.free()
    full = np.zeros(len(free))
    full[free] = mode[:, 0]
    return float(np.sqrt(value[0]) / (2 * np.pi)), full.reshape(-1, 3)


def stresses(element, nodes, cells, u, young, poisson):
    """Positions (m, points, 3) and Cauchy stresses (m, points, 3, 3) [Pa] at the integration points of elements."""
    lam, mu = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))
    g, _ = geometry(element, nodes, cells)
    n = element.shapes(element.points)[0]
    h = np.einsum("mqkj,mki->mqij", g, u[cells])
    strain = (h + np.swapaxes(h, 2, 3)) / 2
    trace = np.trace(strain, axis1=2, axis2=3)
    return np.einsum("qk,mki->mqi", n, nodes[cells]), 2 * mu * strain + lam * trace[..., None, None] * np.eye(3)


def von_mises(s):
    d = s - np.trace(s, axis1=-2, axis2=-1)[..., None, None] / 3 * np.eye(3)
    return np.sqrt(1.5 * (d * d).sum((-1, -2)))


def stress_at(points, element, nodes, cells, u, young, poisson, near=24):
    """Stresses (p, 3, 3) at interior points: quadratic least-squares fit of the stresses at integration points of the
    elements whose centres are nearest."""
    corners = 4 if isinstance(element, Tet) else cells.shape[1]
    tree = cKDTree(nodes[cells[:, :corners]].mean(1))
    found = []
    for x, some in zip(points, tree.query(points, k=near)[1]):
        where, s = stresses(element, nodes, cells[some], u, young, poisson)
        d = where.reshape(-1, 3) - x
        scale = np.linalg.norm(d, axis=1).max()
        d = d / scale
        basis = np.column_stack([np.ones(len(d)), d, d * d, d[:, [0]] * d[:, 1:], d[:, 1] * d[:, 2]])
        weight = np.exp(-2 * (d * d).sum(1))[:, None]
        fit = np.linalg.lstsq(basis * weight, s.reshape(-1, 9) * weight, rcond=None)[0]
        found.append(fit[0].reshape(3, 3))
    return np.array(found)


def locate(points, element, nodes, cells):
    """The element that holds each point, and the point's coordinates in the reference element."""
    corner = nodes[cells]
    low, high = corner.min(1), corner.max(1)
    slack = 0.01 * (high - low).max(1, keepdims=True)
    low, high = low - slack, high + slack
    found = []
    for x in points:
        some = np.flatnonzero(((low <= x) & (x <= high)).all(1))
        local = np.full((len(some), 3), 0.25)
        for _ in range(20 if isinstance(element, Hex) else 2):
            n, dn = element.shapes(local)
            miss = x - np.einsum("mk,mki->mi", n, corner[some])
            slope = np.einsum("mki,mkj->mij", corner[some], dn)
            local = np.clip(local + np.linalg.solve(slope, miss[..., None])[..., 0], -0.5, 1.5)
        inside = np.minimum(local.min(1), 1 - (local.max(1) if isinstance(element, Hex) else local.sum(1)))
        if len(some) == 0 or inside.max() < -1e-3:
            raise ValueError(f"the point {x} is in no element")
        found.append((some[np.argmax(inside)], local[np.argmax(inside)]))
    return np.array([f[0] for f in found]), np.array([f[1] for f in found])


def interpolate(where, element, cells, u):
    """Displacements (p, 3) at points found by `locate`."""
    return np.einsum("pk,pki->pi", element.shapes(where[1])[0], u[cells[where[0]]])


def stress_in(where, element, nodes, cells, u, young, poisson):
    """Stresses (p, 3, 3) of the elements themselves at points found by `locate`."""
    lam, mu = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))
    _, dn = element.shapes(where[1])
    some = cells[where[0]]
    g = dn @ np.linalg.inv(np.einsum("pki,pkj->pij", nodes[some], dn))
    h = np.einsum("pkj,pki->pij", g, u[some])
    strain = (h + np.swapaxes(h, 1, 2)) / 2
    return 2 * mu * strain + lam * np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(3)
