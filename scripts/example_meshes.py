#!/usr/bin/env python3
"""Makes the surfaces of examples/: a bear, a pendulum, a horseshoe, a skittle and a rubber ring.

    scripts/example_meshes.py            writes them beside their scenes

The skittle and the ring are turned from profiles. Each other body is the set of points at which a function is negative, about the signed
distance from its surface: balls, ellipsoids and capsules, blended. The function is evaluated at the nodes of a cubic grid; a
cell with corners of both signs gets a vertex, which is then moved onto the surface along the gradient; each edge of the grid
with ends of both signs gets two triangles between the vertices of its four cells.
"""
import math
import pathlib

ROOT = pathlib.Path(__file__).resolve().parent.parent


def distance(p, q):
    return math.dist(p, q)


def capsule(p, a, b, radius):
    """Distance from a line between two points, thickened."""
    along = [y - x for x, y in zip(a, b)]
    square = sum(x * x for x in along)
    t = sum((x - y) * z for x, y, z in zip(p, a, along)) / square
    t = min(max(t, 0.0), 1.0)
    return distance(p, [x + t * y for x, y in zip(a, along)]) - radius


def ellipsoid(p, centre, radii):
    """About the distance from an ellipsoid."""
    inside = math.sqrt(sum(((x - c) / r) ** 2 for x, c, r in zip(p, centre, radii)))
    steep = math.sqrt(sum(((x - c) / (r * r)) ** 2 for x, c, r in zip(p, centre, radii)))
    return inside * (inside - 1) / steep if steep > 1e-12 else -min(radii)


def blend(values, width):
    """Smooth minimum of distances: rounded where two of them differ by less than a width."""
    least = values[0]
    for value in values[1:]:
        h = max(width - abs(least - value), 0.0) / width
        least = min(least, value) - h * h * width / 4
    return least


def bear(p):
    """A bear that sits and looks along -y, 0.19 m high."""
    q = (abs(p[0]), p[1], p[2])  # symmetric
    trunk = ellipsoid(q, (0, 0, 0.062), (0.052, 0.046, 0.062))
    head = ellipsoid(q, (0, -0.006, 0.142), (0.043, 0.039, 0.039))
    ear = ellipsoid(q, (0.034, 0.0, 0.176), (0.018, 0.012, 0.018))
    snout = ellipsoid(q, (0, -0.040, 0.132), (0.019, 0.018, 0.015))
    arm = capsule(q, (0.044, -0.008, 0.094), (0.066, -0.044, 0.066), 0.017)
    leg = capsule(q, (0.034, -0.010, 0.024), (0.050, -0.074, 0.022), 0.022)
    return blend([blend([trunk, head], 0.016), ear, snout, arm, leg], 0.010)


def pendulum(p):
    """A ball that hangs from an axle along y by two arms; its centre is 0.25 m below."""
    q = (p[0], abs(p[1]), p[2])
    ball = distance(q, (0, 0, -0.25)) - 0.05
    arm = capsule(q, (0, 0.0, -0.21), (0, 0.1, 0), 0.009)
    axle = capsule(q, (0, 0.0, 0), (0, 0.1, 0), 0.009)
    return blend([ball, arm, axle], 0.01)


def horseshoe(p):
    """Two arms along y, 70 mm apart, joined by half a ring: 28 mm thick."""
    x, y, z = p
    if y < 0:
        return math.hypot(math.hypot(x, y) - 0.05, z) - 0.014
    return capsule((abs(x), y, z), (0.05, 0, 0), (0.05, 0.1, 0), 0.014)


def gradient(f, p, step):
    slope = []
    for k in range(3):
        forward, back = list(p), list(p)
        forward[k] += step
        back[k] -= step
        slope.append((f(forward) - f(back)) / (2 * step))
    return slope


def onto(f, p, step):
    """Moves a point beside a surface onto it by Newton's method, by a cell at most."""
    start = p
    for _ in range(4):
        slope = gradient(f, p, 0.05 * step)
        square = sum(x * x for x in slope)
        if square < 1e-12:
            break
        value = f(p)
        p = [x - value * y / square for x, y in zip(p, slope)]
    return p if distance(p, start) < step else start


def surface_of(f, low, high, step):
    """Vertices and triangles of the surface inside a box on which a function is zero."""
    count = [math.ceil((b - a) / step) + 1 for a, b in zip(low, high)]
    low = [(a + b) / 2 - (n - 1) * step / 2 for a, b, n in zip(low, high, count)]
    node = lambda c: [a + k * step for a, k in zip(low, c)]
    cells = [(i, j, k) for i in range(count[0]) for j in range(count[1]) for k in range(count[2])]
    value = {c: f(node(c)) for c in cells}
    units = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    add = lambda a, b: (a[0] + b[0], a[1] + b[1], a[2] + b[2])
    take = lambda a, b: (a[0] - b[0], a[1] - b[1], a[2] - b[2])
    crossings, quads = {}, []
    for c in cells:
        for k in range(3):
            end = add(c, units[k])
            if end not in value or (value[c] < 0) == (value[end] < 0):
                continue
            t = value[c] / (value[c] - value[end])
            place = [x + t * (y - x) for x, y in zip(node(c), node(end))]
            u, v = units[(k + 1) % 3], units[(k + 2) % 3]
            around = [c, take(c, u), take(take(c, u), v), take(c, v)]
            for cell in around:
                crossings.setdefault(cell, []).append(place)
            quads.append(around if value[c] < 0 else around[::-1])
    number, vertices = {}, []
    for cell, places in crossings.items():
        number[cell] = len(vertices)
        vertices.append(onto(f, [sum(p[k] for p in places) / len(places) for k in range(3)], step))
    triangles = []
    for quad in quads:
        a, b, c, d = (number[cell] for cell in quad)
        across = distance(vertices[a], vertices[c]) < distance(vertices[b], vertices[d])
        triangles += [(a, b, c), (a, c, d)] if across else [(b, c, d), (b, d, a)]
    return vertices, triangles


def turned(profile, count):
    """Surface of revolution about z of a closed, counter-clockwise profile of points (r, z), of which some may be on the axis."""
    angles = [2 * math.pi * i / count for i in range(count)]
    number, vertices, triangles = {}, [], []

    def vertex(i, k):
        r, z = profile[k % len(profile)]
        key = (i % count if r > 0 else 0, k % len(profile))
        if key not in number:
            number[key] = len(vertices)
            vertices.append((r * math.cos(angles[key[0]]), r * math.sin(angles[key[0]]), z))
        return number[key]

    for i in range(count):
        for k in range(len(profile)):
            a, b, c, d = vertex(i, k), vertex(i, k + 1), vertex(i + 1, k + 1), vertex(i + 1, k)
            triangles += [t for t in ((a, c, b), (a, d, c)) if len(set(t)) == 3]
    return vertices, triangles


#: Heights and radii of a skittle [m], which cubics join.
SKITTLE = [(-0.03, 0.024), (0.0, 0.032), (0.045, 0.046), (0.114, 0.0605), (0.19, 0.044), (0.25, 0.0235), (0.30, 0.027), (0.345, 0.032),
           (0.40, 0.032)]


def skittle_radius(z):
    """Radius of a skittle at a height from 0 to 0.345 m."""
    k = max(j for j in range(1, len(SKITTLE) - 2) if SKITTLE[j][0] <= z)
    (za, ra), (zb, rb), (zc, rc), (zd, rd) = SKITTLE[k - 1:k + 3]
    t = (z - zb) / (zc - zb)
    start, end = (rc - ra) / (zc - za) * (zc - zb), (rd - rb) / (zd - zb) * (zc - zb)
    square, cube = t * t, t * t * t
    return (2 * cube - 3 * square + 1) * rb + (cube - 2 * square + t) * start + (3 * square - 2 * cube) * rc + (cube - square) * end


def skittle():
    """A pin of bowling, 0.377 m high, on a flat base."""
    side = [(skittle_radius(0.345 * k / 28), 0.345 * k / 28) for k in range(28)]
    angles = [math.pi / 2 * k / 4 for k in range(4)]
    return turned([(0, 0), (0.011, 0), (0.022, 0)] + side + [(0.032 * math.cos(a), 0.345 + 0.032 * math.sin(a)) for a in angles] +
                  [(0, 0.377)], 24)


def rubber_ring():
    """A ring of the radii 30 and 40 mm, 10 mm wide."""
    inner, outer, half, n = 0.03, 0.04, 0.005, 4
    share = [k / n for k in range(n)]
    profile = [(inner + t * (outer - inner), -half) for t in share] + [(outer, half * (2 * t - 1)) for t in share] + \
              [(outer - t * (outer - inner), half) for t in share] + [(inner, half * (1 - 2 * t)) for t in share]
    return turned(profile, 80)


def bodies():
    yield "squeezed_bear/bear.obj", "A bear that sits, 0.19 m high", \
        surface_of(bear, (-0.1, -0.11, -0.01), (0.1, 0.06, 0.21), 0.0068)
    yield "cradle/pendulum.obj", "A ball of the radius 0.05 m that hangs by two arms from an axle, the y axis", \
        surface_of(pendulum, (-0.06, -0.12, -0.31), (0.06, 0.12, 0.02), 0.0065)
    yield "clap/horseshoe.obj", "A horseshoe, 28 mm thick, with arms of 0.1 m", \
        surface_of(horseshoe, (-0.075, -0.075, -0.025), (0.075, 0.125, 0.025), 0.006)
    yield "skittles/skittle.obj", "A pin of bowling, 0.377 m high", skittle()
    yield "rubber_rings/ring.obj", "A ring of the radii 30 and 40 mm, 10 mm wide", rubber_ring()


def text_of(title, vertices, triangles):
    lines = [f"# {title}; {len(vertices)} vertices, {len(triangles)} triangles; made by scripts/example_meshes.py"]
    lines += ["v " + " ".join(f"{x + 0.0:.5f}" for x in v) for v in vertices]
    lines += ["f " + " ".join(str(k + 1) for k in t) for t in triangles]
    return "\n".join(lines) + "\n"


def main():
    for name, title, (vertices, triangles) in bodies():
        file = ROOT / "examples" / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text_of(title, vertices, triangles))


if __name__ == "__main__":
    main()
