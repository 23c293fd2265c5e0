"""Closed triangulated surfaces: OBJ files, cuts by a plane, recipes of a ball and a plate, and tetrahedra inside."""
import os
import subprocess
import tempfile

import numpy as np
from scipy.spatial import cKDTree


def read_obj(path):
    vertices, faces = [], []
    with open(path) as file:
        for text in file:
            words = text.split()
            if words[:1] == ["v"]:
                vertices.append([float(w) for w in words[1:4]])
            elif words[:1] == ["f"]:
                faces.append([int(w.split("/")[0]) - 1 for w in words[1:]])
    return np.array(vertices), np.array(faces)


def write_obj(path, vertices, faces):
    with open(path, "w") as file:
        file.writelines("v {:.17g} {:.17g} {:.17g}\n".format(*v) for v in vertices)
        file.writelines("f {} {} {}\n".format(*f) for f in faces + 1)


def volume(vertices, faces):
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


def compact(vertices, faces):
    used, index = np.unique(faces, return_inverse=True)
    return vertices[used], index.reshape(faces.shape)


def cut(vertices, faces, axis, level):
    """The part of a closed surface above a plane across an axis, closed by the section.

    @return vertices, faces, and the length of the section's borders by pairs of points (k, 2, 3)
    """
    height = vertices[:, axis] - level
    if np.abs(height).min() < 1e-9 * np.ptp(vertices[:, axis]):
        raise ValueError("a vertex lies on the plane")
    points, made, new, rim = list(vertices), {}, [], {}

    def crossing(a, b):
        key = (min(a, b), max(a, b))
        if key not in made:
            a, b = key
            x = vertices[a] + (vertices[b] - vertices[a]) * height[a] / (height[a] - height[b])
            x[axis] = level
            made[key] = len(points)
            points.append(x)
        return made[key]

    for face in faces:
        above = height[face] > 0
        if above.all():
            new.append(face)
        elif above.any():
            # Turned so that one corner is alone on its side.
            lone = np.flatnonzero(above)[0] if above.sum() == 1 else np.flatnonzero(~above)[0]
            a, b, c = np.roll(face, -lone)
            p, q = crossing(a, b), crossing(c, a)
            if above.sum() == 1:
                new.append([a, p, q])
                rim[q] = p
            else:
                new += [[p, b, c], [p, c, q]]
                rim[p] = q
    points = np.array(points)
    flat = [c for c in range(3) if c != axis]
    ends = []
    while rim:
        loop = [next(iter(rim))]
        while rim[loop[-1]] != loop[0]:
            loop.append(rim[loop[-1]])
        for p in loop:
            del rim[p]
        ends.append(points[np.column_stack([loop, np.roll(loop, -1)])])
        new += [[loop[i], loop[j], loop[k]] for i, j, k in ears(points[loop][:, flat])]
    vertices, faces = compact(points, np.array(new))
    return vertices, faces, np.concatenate(ends)


def ears(p):
    """Triangles of a simple polygon (n, 2), turning as the polygon does; the best-shaped ear is cut first."""
    cross = lambda a, b, c: (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    left, found = list(range(len(p))), []
    x, y = p.T
    sign = np.sign((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    while len(left) > 3:
        best, at = -1, None
        for m in range(len(left)):
            i, j, k = left[m - 1], left[m], left[(m + 1) % len(left)]
            area = sign * cross(p[i], p[j], p[k])
            size = sum(((p[a] - p[b]) ** 2).sum() for a, b in ((i, j), (j, k), (k, i)))
            if area / size <= best or area <= 0:
                continue
            rest = p[[o for o in left if o not in (i, j, k)]].T
            inside = np.ones(len(left) - 3, bool)
            for a, b in ((i, j), (j, k), (k, i)):
                inside &= sign * cross(p[a], p[b], rest) >= 0
            if not inside.any():
                best, at = area / size, m
        if at is None:
            raise ValueError("the section is not a simple polygon")
        found.append((left[at - 1], left[at], left[(at + 1) % len(left)]))
        del left[at]
    return found + [tuple(left)]


def ball(radius, divisions=4):
    """An icosahedron whose triangles are divided into four, `divisions` times, with vertices on the sphere: 5120
    triangles after four divisions."""
    g = (1 + 5 ** 0.5) / 2
    vertices = [np.array(v, float) for v in
                [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g), (0, -1, -g), (0, 1, -g),
                 (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6),
             (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10),
             (8, 6, 7), (9, 8, 1)]
    vertices = [v / np.linalg.norm(v) for v in vertices]
    for _ in range(divisions):
        middle, new = {}, []
        for face in faces:
            mid = []
            for a, b in zip(face, np.roll(face, -1)):
                key = (min(a, b), max(a, b))
                if key not in middle:
                    middle[key] = len(vertices)
                    x = vertices[a] + vertices[b]
                    vertices.append(x / np.linalg.norm(x))
                mid.append(middle[key])
            a, b, c = face
            p, q, r = mid
            new += [(a, p, r), (b, q, p), (c, r, q), (p, q, r)]
        faces = new
    return radius * np.array(vertices), np.array(faces)


def plate_surface(size, radius, rim=256):
    """A plate on [0, x] x [-y/2, y/2] x [-z/2, z/2] with a round hole of `rim` sides in its middle."""
    half = np.array([size[0] / 2, size[1] / 2])
    angle = np.arctan2(half[1], half[0])
    angles = np.unique(np.concatenate([2 * np.pi * np.arange(rim) / rim,
                                       [angle, np.pi - angle, np.pi + angle, 2 * np.pi - angle]]))
    ray = np.column_stack([np.cos(angles), np.sin(angles)])
    inner, outer = radius * ray, ray / np.abs(ray / half).max(1, keepdims=True)
    n, z = len(angles), size[2] / 2
    flat = np.concatenate([inner, outer]) + [half[0], 0]
    vertices = np.concatenate([np.column_stack([flat, np.full(2 * n, s)]) for s in (z, -z)])
    i = np.arange(n)
    j = np.roll(i, -1)
    # Borders of the upper side and, 2 n further, of the lower side.
    quads = [(i, i + n, j + n, j), (i + 2 * n, j + 2 * n, j + 3 * n, i + 3 * n), (j, j + 2 * n, i + 2 * n, i),
             (i + n, i + 3 * n, j + 3 * n, j + n)]
    faces = [np.column_stack(t) for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return vertices, np.concatenate(faces)


def table(path, head, *columns):
    np.savetxt(path, np.column_stack(columns), "%.17g", comments="", header=head)


def tetgen(folder, switches):
    """Runs TetGen on body.smesh of a folder; returns nodes and cells."""
    subprocess.run(["tetgen", switches, "body.smesh"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    nodes = np.loadtxt(os.path.join(folder, "body.1.node"), skiprows=1)[:, 1:4]
    cells = np.loadtxt(os.path.join(folder, "body.1.ele"), skiprows=1)[:, 1:5].astype(np.int32) - 1
    flipped = np.linalg.det(nodes[cells[:, 1:]] - nodes[cells[:, :1]]) < 0
    cells[flipped] = cells[flipped][:, [1, 0, 2, 3]]
    return nodes, cells


def sizes(x, rim, largest, reach, smallest=0.1):
    """Sizes of elements at points: `largest`, and smaller within `reach` of singular edges (k, 2, 3)."""
    steps = (np.arange(20) + 0.5) / 20
    points = (rim[:, None, 0] + steps[:, None] * (rim[:, None, 1] - rim[:, None, 0])).reshape(-1, 3)
    distance = cKDTree(points).query(x)[0]
    return largest * np.clip(distance / reach, smallest ** (1 / 0.65), 1) ** 0.65


def quality(nodes, cells):
    """The least ratio of volume to cubed edges; 1 for a regular tetrahedron, 0 for a flat one."""
    corner = nodes[cells]
    edges = corner[:, [0, 0, 0, 1, 1, 2]] - corner[:, [1, 2, 3, 2, 3, 3]]
    mean = np.sqrt((edges ** 2).sum(2).mean(1))
    return (2 ** 0.5 * np.linalg.det(corner[:, 1:] - corner[:, :1]) / mean ** 3).min()


def tetrahedra(vertices, faces, rim, largest, reach, start=None):
    """Graded tetrahedra inside a closed surface, whose planes they keep; `start`: a coarser mesh of the same body, on
    whose nodes the sizes of elements are given. A mesh with a flat element is made again with slightly smaller ones."""
    with tempfile.TemporaryDirectory() as folder:
        with open(os.path.join(folder, "body.smesh"), "w") as file:
            file.write(f"{len(vertices)} 3 0 0\n")
            file.writelines("{} {:.17g} {:.17g} {:.17g}\n".format(i + 1, *v) for i, v in enumerate(vertices))
            file.write(f"{len(faces)} 0\n")
            file.writelines("3 {} {} {}\n".format(*f) for f in faces + 1)
            file.write("0\n0\n")
        nodes, cells = tetgen(folder, "-pq1.6/5Q") if start is None else start
        name = os.path.join(folder, "body.b.")
        table(name + "node", f"{len(nodes)} 3 0 0", np.arange(1, len(nodes) + 1), nodes)
        table(name + "ele", f"{len(cells)} 4 0", np.arange(1, len(cells) + 1), cells + 1)
        for attempt in range(8):
            table(name + "mtr", f"{len(nodes)} 1", sizes(nodes, rim, largest * 0.98 ** attempt, reach))
            mesh = tetgen(folder, "-pq1.6/5mQ")
            if quality(*mesh) > 1e-6:
                return mesh
    raise RuntimeError("TetGen makes flat elements")


def creases(vertices, faces, degrees=60):
    """Re-entrant edges (k, 2, 3) of a closed surface whose faces turn by more than this angle: stresses are singular
    there."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    face = np.tile(np.arange(len(faces)), 3)
    key = np.sort(edges, axis=1)
    order = np.lexsort((key[:, 1], key[:, 0]))
    one, two = face[order[::2]], face[order[1::2]]
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    middle = vertices[faces].mean(1)
    rises = ((middle[two] - middle[one]) * normal[one]).sum(1) > 0
    sharp = (normal[one] * normal[two]).sum(1) < np.cos(np.radians(degrees))
    return vertices[key[order[::2]][rises & sharp]]


def distance_to(points, vertices, faces):
    """Distance of each point to a triangulated surface."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    found = []
    for x in points:
        best = np.full(len(faces), np.inf)
        for p, q in ((a, b), (b, c), (c, a)):
            d = q - p
            t = np.clip(((x - p) * d).sum(1) / (d * d).sum(1), 0, 1)
            best = np.minimum(best, np.linalg.norm(x - p - t[:, None] * d, axis=1))
        normal = np.cross(b - a, c - a)
        area = (normal * normal).sum(1)
        v = (np.cross(b - a, x - a) * normal).sum(1) / area
        w = (np.cross(x - a, c - a) * normal).sum(1) / area
        flat = (v >= 0) & (w >= 0) & (v + w <= 1)
        height = np.abs(((x - a) * normal).sum(1)) / np.sqrt(area)
        found.append(np.where(flat, np.minimum(best, height), best).min())
    return np.array(found)
