#!/usr/bin/env python3
"""Simulates a scene of contact_scenes.py with Newton, on one core, and writes what it finds to a file of NumPy.

    newton_contact.py balls|drop OUT.npz --solver semi-implicit|vbd --nodes 905 --share 0.2 ...

Bodies are tetrahedra of gmsh, as regular as it makes them; nodes on the surface lie on the sphere, and the density is such
that the mass is the ball's. Needs newton and gmsh.
"""
import argparse
import math
import time

import contact_scenes as scenes
import gmsh
import newton
import numpy as np
import warp as wp


def sphere_of(size):
    """Nodes and tetrahedra of a ball with elements of one size [m]."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addSphere(0, 0, 0, scenes.RADIUS)
    gmsh.model.occ.synchronize()
    for bound in ("Min", "Max"):
        gmsh.option.setNumber(f"Mesh.MeshSize{bound}", size)
    gmsh.model.mesh.generate(3)
    for way in ("", "Netgen"):
        gmsh.model.mesh.optimize(way)
    tags, places, _ = gmsh.model.mesh.getNodes()
    _, corners = gmsh.model.mesh.getElementsByType(4)
    gmsh.finalize()
    number = np.zeros(int(tags.max()) + 1, int)
    number[tags.astype(int)] = np.arange(len(tags))
    tets = number[corners.astype(int)].reshape(-1, 4)
    used, tets = np.unique(tets, return_inverse=True)
    return places.reshape(-1, 3)[used], tets.reshape(-1, 4)


def ball_mesh(nodes):
    """The ball whose number of nodes is nearest to the one given, of 16 sizes of elements."""
    mean = 2 * scenes.RADIUS / (6 / math.pi * nodes) ** (1 / 3)
    meshes = (sphere_of(f * mean) for f in np.linspace(0.95, 1.4, 16))
    return min(meshes, key=lambda mesh: abs(len(mesh[0]) - nodes))


def lame(young, solver):
    """The constants that make the solver's law Hooke's at small strains: SolverSemiImplicit takes those of Smith et al.
    2018 as they are, SolverVBD converts Lamé's."""
    shear, first = young / 2 / (1 + scenes.POISSON), young * scenes.POISSON / (1 + scenes.POISSON) / (1 - 2 * scenes.POISSON)
    return (shear, first) if solver == "vbd" else (4 / 3 * shear, first + 5 / 6 * shear)


@wp.kernel
def slow(velocity: wp.array(dtype=wp.vec3), share: float):
    i = wp.tid()
    velocity[i] = velocity[i] * share


class Ball:
    """The mesh of one ball, and the radius of contact."""

    def __init__(self, options):
        self.points, self.tets = ball_mesh(options.nodes)
        a, b, c, d = self.points[self.tets].swapaxes(0, 1)
        size = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6
        self.tets[size < 0] = self.tets[size < 0][:, [0, 2, 1, 3]]
        self.volume = np.abs(size).sum()
        sides = self.tets[:, [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]].reshape(-1, 2)
        edges = np.linalg.norm(self.points[sides[:, 0]] - self.points[sides[:, 1]], axis=1)
        self.edge = edges.mean()
        # Spheres about nodes must not touch each other in a body at rest.
        self.radius = 0.5 * edges.min() if options.contact == "particles" else options.radius * self.edge
        # How far from walls, and from each other, nodes stay: bodies meet in the middle of the layer of triangles.
        self.reach = self.radius if options.contact == "particles" else 0.5 * self.radius

    def shrink(self):
        """Makes the ball smaller, so that it has its radius with its reach."""
        share = 1 - self.reach / scenes.RADIUS
        self.points, self.volume = share * self.points, share**3 * self.volume


class Bodies:
    """Balls in one of Newton's solvers."""

    def __init__(self, options, ball, young, centres, velocities, gravity=0.0, room=None):
        self.options = options
        self.edge, self.radius, self.reach = ball.edge, ball.radius, ball.reach
        builder = newton.ModelBuilder(gravity=wp.vec3(0.0, 0.0, -gravity))
        mu, first = lame(young, options.solver)
        for centre, velocity in zip(centres, velocities):
            builder.add_soft_mesh(
                pos=wp.vec3(*centre), rot=wp.quat_identity(), scale=1.0, vel=wp.vec3(*velocity), vertices=ball.points,
                indices=ball.tets.ravel(), density=scenes.MASS / ball.volume, k_mu=mu, k_lambda=first, k_damp=0.0,
                particle_radius=self.reach if room else self.radius)
        if room:
            planes = np.array([(0, 0, 1, 0), (1, 0, 0, 0), (-1, 0, 0, room), (0, 1, 0, 0), (0, -1, 0, room)])
            stiff = newton.ModelBuilder.ShapeConfig(ke=options.stiffness * young * self.edge, kd=0.0, kf=0.0, mu=0.0)
            for plane in planes:
                builder.add_shape_plane(plane, width=0.0, length=0.0, cfg=stiff)
        if options.solver == "vbd":
            builder.color()
        self.model = builder.finalize(device="cpu")
        self.model.soft_contact_ke = self.model.particle_ke = options.stiffness * young * self.edge
        for name in ("soft_contact_kd", "soft_contact_kf", "soft_contact_mu", "particle_kd", "particle_kf", "particle_mu"):
            setattr(self.model, name, 0.0)
        self.bodies, self.tris = len(centres), self.model.tri_indices.numpy()
        self.pipeline = newton.CollisionPipeline(self.model, soft_contact_gap=self.reach) if room else None
        self.contacts = self.pipeline.contacts() if room else None
        self.solver = self.make_solver()
        self.now, self.next, self.seconds = self.model.state(), self.model.state(), 0.0
        self.control = self.model.control()

    def make_solver(self):
        options = self.options
        if options.contact != "particles":
            self.model.particle_grid = None
        if options.solver == "vbd":
            return newton.solvers.SolverVBD(
                self.model, iterations=options.iterations, particle_enable_self_contact=True,
                particle_self_contact_margin=self.radius, particle_self_contact_gap=self.radius,
                particle_enable_tile_solve=False, friction_epsilon=1e-6)
        return newton.solvers.SolverSemiImplicit(self.model, enable_tri_contact=options.contact == "triangles")

    @property
    def q(self):
        return self.now.particle_q.numpy().astype(float).reshape(self.bodies, -1, 3)

    @property
    def v(self):
        return self.now.particle_qd.numpy().astype(float).reshape(self.bodies, -1, 3)

    @property
    def masses(self):
        return self.model.particle_mass.numpy().astype(float).reshape(self.bodies, -1)

    def step(self, dt, steps, keep=1.0):
        """Advances by some steps, each of which keeps a share of the velocities."""
        begin = time.process_time()
        for _ in range(steps):
            self.now.clear_forces()
            if self.pipeline:
                self.pipeline.collide(self.now, self.contacts)
            self.solver.step(self.now, self.next, self.control, self.contacts, dt)
            self.now, self.next = self.next, self.now
            if keep < 1:
                wp.launch(slow, dim=self.model.particle_count, inputs=[self.now.particle_qd, keep], device="cpu")
        self.seconds += time.process_time() - begin


def distance(points, triangles):
    """The smallest distance of points (n, 3) from triangles (m, 3, 3), which may not cross."""
    best = math.inf
    a, ab, ac = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normal = np.cross(ab, ac)
    ap = points[:, None] - a
    area = np.einsum("mk,mk->m", normal, normal)
    v = np.einsum("nmk,mk->nm", np.cross(ap, ac), normal) / area
    w = np.einsum("nmk,mk->nm", np.cross(np.broadcast_to(ab, ap.shape), ap), normal) / area
    above = np.abs(np.einsum("nmk,mk->nm", ap, normal)) / np.sqrt(area)
    inside = (v >= 0) & (w >= 0) & (v + w <= 1)
    best = min(best, above[inside].min(initial=math.inf))
    for i, j in ((0, 1), (1, 2), (2, 0)):
        start, side = triangles[:, i], triangles[:, j] - triangles[:, i]
        t = np.clip(np.einsum("nmk,mk->nm", points[:, None] - start, side) / np.einsum("mk,mk->m", side, side), 0, 1)
        best = min(best, np.linalg.norm(points[:, None] - start - t[..., None] * side, axis=2).min(initial=math.inf))
    return best


def gap_of(bodies):
    """The distance of two balls' surfaces, less that at which they begin to push each other [m]."""
    q = bodies.q
    count = q.shape[1]
    near = [np.abs(q[i, :, 0]) < 0.25 * scenes.RADIUS for i in (0, 1)]
    if bodies.options.contact == "particles":
        return np.linalg.norm(q[0][near[0]][:, None] - q[1][near[1]][None], axis=2).min() - 2 * bodies.radius
    gaps = []
    for one, other in ((0, 1), (1, 0)):
        tris = bodies.tris[bodies.tris[:, 0] // count == other] - other * count
        tris = tris[near[other][tris].all(axis=1)]
        surface = np.intersect1d(np.flatnonzero(near[one]), bodies.tris % count)
        gaps.append(distance(q[one][surface], q[other][tris]))
    return min(gaps) - bodies.radius


def balls(options, ball):
    reach = 2 if options.contact == "particles" else 1
    half = 0.5 * scenes.SPEED
    x = scenes.RADIUS + 0.5 * reach * ball.radius
    bodies = Bodies(options, ball, scenes.E, [(-x, 0, 0), (x, 0, 0)], [(half, 0, 0), (-half, 0, 0)])
    dt = options.share * bodies.edge / scenes.WAVE
    every = max(1, round(scenes.DURATION / 600 / dt))
    looks, gaps, mass, stable = [], [], bodies.masses, True
    # Until they have parted.
    while not looks or looks[-1][0] < 1.9 * scenes.DURATION and (min(gaps) >= 0 or gaps[-1] < 0.3 * ball.radius):
        weight = mass / mass.sum(axis=1, keepdims=True)
        x, v = ((weight * a[..., 0]).sum(axis=1) for a in (bodies.q, bodies.v))
        looks.append([dt * every * len(looks), *x, *v])
        gaps.append(gap_of(bodies))
        stable = bool(np.abs(v).max() < 2 * scenes.SPEED)
        if not stable:
            break
        bodies.step(dt, every)
    found = {"looks": looks, "gaps": gaps, "stable": stable}
    return bodies, dt, found, looks[-1][0]


def drop(options, ball):
    centres = scenes.drop_centres()
    ball.shrink()
    bodies = Bodies(options, ball, scenes.DROP_E, centres, np.zeros((27, 3)), scenes.GRAVITY, scenes.ROOM)
    dt = options.share * bodies.edge / scenes.DROP_WAVE
    every = max(1, math.ceil(1 / scenes.FRAMES / dt))
    dt = 1 / scenes.FRAMES / every
    frames, velocities, steps = [bodies.q], [bodies.v], 0
    while steps < round(scenes.DROP_END * scenes.FRAMES) * every and bodies.seconds < options.limit:
        bodies.step(dt, 1, 1 - scenes.DAMPING * dt)
        steps += 1
        if steps % every == 0:
            frames.append(bodies.q)
            velocities.append(bodies.v)
            if not np.isfinite(frames[-1]).all():
                break
    found = {"frames": np.array(frames), "velocities": np.array(velocities), "masses": bodies.masses}
    return bodies, dt, found, steps * dt


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", choices=["balls", "drop"])
    parser.add_argument("out")
    parser.add_argument("--solver", choices=["semi-implicit", "vbd"], required=True)
    parser.add_argument("--contact", choices=["triangles", "particles"], default="triangles")
    parser.add_argument("--nodes", type=int, required=True, help="of a ball, about")
    parser.add_argument("--share", type=float, required=True, help="time step, of the time of a pressure wave along an edge")
    parser.add_argument("--stiffness", type=float, default=1.0, help="of contact, of E times an edge")
    parser.add_argument("--radius", type=float, default=0.3, help="at which triangles push nodes away, of an edge")
    parser.add_argument("--iterations", type=int, default=10, help="of SolverVBD in each step")
    parser.add_argument("--limit", type=float, default=3600, help="time for steps of the drop [s]")
    options = parser.parse_args()
    wp.config.quiet = True
    ball = Ball(options)
    bodies, dt, found, end = {"balls": balls, "drop": drop}[options.scene](options, ball)
    np.savez(options.out, nodes=len(ball.points), step=dt, reach=bodies.reach, seconds=bodies.seconds, end=end, **found)


if __name__ == "__main__":
    main()
