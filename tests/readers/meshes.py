"""Small meshes in closed form, written as PLY."""

import math


def cube(n, place):
    """A cube of n x n squares per face, its vertices moved by `place`; the vertices and triangles."""
    index, points, triangles = {}, [], []

    def at(p):
        if p not in index:
            index[p] = len(points)
            points.append(place(*(2 * c / n - 1 for c in p)))
        return index[p]

    for axis in range(3):
        for side in (0, n):
            for a in range(n):
                for b in range(n):
                    corners = []
                    for da, db in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        p = [0, 0, 0]
                        p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3] = side, a + da, b + db
                        corners.append(at(tuple(p)))
                    w, x, y, z = corners
                    for t in ((w, x, y), (w, y, z)):
                        triangles.append(t if side else t[::-1])
    return points, triangles


def box(n=8):
    """A cuboid of 4 x 3 x 2: flat faces, twelve sharp edges."""
    return cube(n, lambda x, y, z: (2 * x, 1.5 * y, z))


def ball(n=16):
    """The unit sphere: no sharp edge at all."""

    def place(x, y, z):
        x, y, z = (math.tan(math.pi / 4 * c) for c in (x, y, z))
        length = math.sqrt(x * x + y * y + z * z)
        return x / length, y / length, z / length

    return cube(n, place)


def write_ply(path, mesh):
    points, triangles = mesh
    head = "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n"
    head += "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
    lines = [" ".join(repr(float(c)) for c in p) for p in points] + ["3 {} {} {}".format(*t) for t in triangles]
    path.write_text(head.format(len(points), len(triangles)) + "\n".join(lines) + "\n")
    return path
