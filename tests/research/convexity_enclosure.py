"""The allowance of strong convexity for one cell, written out with more digits (mpmath):
research/guarantee/README.md.

A second implementation of research/guarantee/native/enclosure.hpp, for a dissipation sqrt((sigma
vs)^2 + vn^2).
"""

import numpy as np
from mpmath import MPContext

mp = MPContext()
mp.prec = 80
PIECES, CORNERS = 16, range(8)


def norm(x, y):
    return mp.sqrt(x**2 + y**2)


def edges(axis):
    bit = 4 >> axis
    return [(i, i | bit) for i in CORNERS if not i & bit]


class Link:
    def __init__(self, i, lengths, sigma, low, size, motions, delta):
        self.l, self.side, self.delta = mp.mpf(lengths[i]), i - 1, mp.mpf(delta)
        self.sign = -1 if self.side < 0 else 1
        offset = (mp.mpf(1) / 2 if self.side > 0 else -mp.mpf(1) / 2) * lengths[1]
        axis = {0: 0, 1: None, 2: 1}[i]
        self.h = mp.mpf(0) if axis is None else size[axis]
        z = [[mp.mpf(x) for x in motion] for motion in motions]
        joint = [(a, b + offset * w) for a, b, w in z]

        def turned(at, p):
            angle = -self.side * at
            return mp.cos(angle) * p[0] - mp.sin(angle) * p[1], mp.sin(angle) * p[0] + mp.cos(
                angle
            ) * p[1]

        corner = [[low[a] + size[a] * (k >> (2 - a) & 1) for a in range(3)] for k in CORNERS]
        self.hinge = [
            p if axis is None else turned(corner[k][axis], p) for k, p in enumerate(joint)
        ]
        rate = {
            0: lambda k: 1 - z[k][2],
            1: lambda k: z[k][2],
            2: lambda k: z[k][2] + corner[k][2],
        }[i]
        self.spin = [rate(k) for k in CORNERS]
        self.off = mp.mpf(0)
        if axis is not None:
            change = max(
                [norm(joint[b][0] - joint[a][0], joint[b][1] - joint[a][1]) for a, b in edges(axis)]
            )
            self.off = self.h**2 / 8 * max([norm(*p) for p in joint]) + self.h / 4 * change
        self.stretch([mp.mpf(x) for x in sigma])
        self.v = [sum(p[c] for p in self.hinge) / 8 for c in (0, 1)]
        self.w = sum(self.spin) / 8
        centre = mp.mpf(0) if axis is None else low[axis] + size[axis] / 2
        x, y = (mp.mpf(1), mp.mpf(0)), (mp.mpf(0), mp.mpf(1))
        columns = [x, y] if axis is None else [turned(centre, x), turned(centre, y)]
        self.plain = [[columns[0][c], columns[1][c], columns[1][c] * offset] for c in (0, 1)]
        self.row = [[self.sigma * x for x in self.plain[0]], self.plain[1]]
        self.moving = axis is not None
        self.find_errors()

    def stretch(self, sigma):
        """Tangential velocities count sigma times: that of the sense in which the whole link slides
        all over the cell."""
        self.directed, along = sigma[0] != sigma[1], [p[0] for p in self.hinge]
        self.sigma, self.ratio = max(sigma), mp.mpf(1)
        if all(x > self.off for x in along):
            self.sigma = sigma[0]
        elif all(x < -self.off for x in along):
            self.sigma = sigma[1]
        elif self.directed:
            self.ratio = max(sigma) / min(sigma)
        self.mixed = self.ratio > 1
        self.norm = max([self.sigma, 1])  # of the stretch, as a matrix
        self.off *= self.norm
        self.hinge = [(self.sigma * x, y) for x, y in self.hinge]

    def at(self, k, s):
        return self.hinge[k][0], self.hinge[k][1] + s * self.spin[k]

    def spread(self, s):
        return (
            max(
                [
                    norm(self.at(k, s)[0] - self.v[0], self.at(k, s)[1] - self.v[1] - s * self.w)
                    for k in CORNERS
                ]
            )
            + self.off
        )

    def rows(self, s):
        return [self.row[0], [self.row[1][0], self.row[1][1], self.row[1][2] + self.sign * s]]

    def nodes(self):
        """Shorter where the mean velocity turns; where some corners are slow, where the mean of
        their directions does."""
        l, vs, vn, w = (float(x) for x in (self.l, *self.v, self.w))
        speeds = [max(float(norm(*self.at(k, s))) for s in (0, self.l)) for k in CORNERS]
        self.patterned = min(speeds) < 0.3 * max(speeds)
        if self.patterned:
            ways = [
                [float(x) / v for x in (*p, w)]
                for p, w, v in zip(self.hinge, self.spin, speeds, strict=True)
            ]
            vs, vn, w = np.mean(ways, axis=0)
            s0 = min(max(-vn / w, 0.0), l)
            width = max(
                abs(vs),
                1e-3,
                *(np.hypot(x - vs, y + s0 * turn - vn - s0 * w) for x, y, turn in ways),
            )
        else:
            width = max(abs(vs), float(self.spread(min(max(-vn / w, 0.0), l))), 1e-9)
        if abs(w) * l > 1e-3 * width:
            t = np.linspace(np.arcsinh(vn / width), np.arcsinh((vn + w * l) / width), PIECES + 1)
            nodes = np.clip((width * np.sinh(t) - vn) / w, 0.0, l)
        else:
            nodes = np.linspace(0.0, l, PIECES + 1)
        return [mp.mpf(0), *(mp.mpf(float(s)) for s in nodes[1:-1]), self.l]

    def find_errors(self):
        self.node = self.nodes()
        self.kind, self.error, self.cone = [], [], []
        self.gap = self.power = mp.mpf(0)
        for sa, sb in zip(self.node, self.node[1:], strict=False):
            spread, length = max([self.spread(sa), self.spread(sb)]), sb - sa
            ya, yb = self.v[1] + sa * self.w, self.v[1] + sb * self.w
            nearest = mp.mpf(0) if ya * yb <= 0 else min([abs(ya), abs(yb)])
            r = norm(self.v[0], nearest)
            kind, error, cone = "sliding", mp.mpf(0), None
            if self.mixed:
                kind, bend = "loose", 2 * spread
                if r >= 5 * spread and (r - spread) > 4 * self.delta:
                    bend = min([bend, self.ratio * spread**2 / (r - spread)])
                self.gap += (bend + self.delta) * length
                self.power += min([2 * spread, self.off + bend]) * length
            elif spread >= 0.3 * r:
                kind, gap, power, cone = self.interpolated(sa, sb, spread, r)
                if kind == "loose" and spread < 0.6 * r:
                    kind = "sliding"
                else:
                    self.gap += gap * length
                    self.power += power * length
            if kind == "sliding":
                error, power = self.sliding(sa, sb, ya, yb, spread, r)
                self.power += power * length
            self.kind.append(kind), self.error.append(error), self.cone.append(cone)

    def interpolated(self, sa, sb, spread, r):
        velocities = [self.at(k, s) for k in CORNERS for s in (sa, sb)]
        directions = [(x / norm(x, y), y / norm(x, y)) for x, y in velocities]
        u = [sum(d[c] for d in directions) for c in (0, 1)]
        u = [c / norm(*u) for c in u]
        cosine, left = min([d[0] * u[0] + d[1] * u[1] for d in directions]), r - spread
        gap = 2 * spread
        if left > spread:
            gap = min([gap, (1 if left >= 2 * spread else 2) * spread**2 / left])
        gap, power = gap + self.delta, 2 * spread
        if cosine > 0.6:
            sine, fastest = mp.sqrt(max([1 - cosine**2, 0])), max([norm(*v) for v in velocities])
            slowest = min([norm(*v) for v in velocities]) * cosine
            held = slowest / norm(slowest, self.delta)
            far = 1000 * self.delta
            speeds = [[(norm(*self.at(k, s))) for s in (sa, sb)] for k in CORNERS]
            apart = all(max(each) <= far or min(each) * cosine >= far for each in speeds)
            side = 2 * fastest * sine * cosine + self.off
            narrow = 2 * fastest * sine**2 + 2 * self.off + side**2 * 3 / 2 / (fastest + self.off)
            if apart:
                narrow += ((1 - held) / 4 + mp.mpf(1) / 2 / 10**6) * fastest + 1000 * self.delta
            else:
                narrow += (1 - held) * fastest
            if narrow < gap:
                return (
                    "slow",
                    narrow,
                    min([power, fastest * (1 - cosine) + self.off]),
                    (u, sine, fastest + self.off),
                )
        return "loose", gap, power, None

    def sliding(self, sa, sb, ya, yb, spread, r):
        m, sine = r - spread, spread / r
        first, last = ((self.v[0] / norm(self.v[0], y), y / norm(self.v[0], y)) for y in (ya, yb))
        u = [first[c] + last[c] for c in (0, 1)]
        u = [c / norm(*u) for c in u]
        sin_b, cos_b = abs(first[0] * u[1] - first[1] * u[0]), first[0] * u[0] + first[1] * u[1]
        lean = sin_b * mp.sqrt(1 - sine**2) + cos_b * sine
        if (cos_b * mp.sqrt(1 - sine**2) - sin_b * sine) < 0:
            lean = mp.mpf(1)
        error, power = self.off / m + self.delta**2 / (2 * m**2), self.off
        for axis in range(3):
            jumps = []
            for a, b in edges(axis):
                for s in (sa, sb):
                    p, q = self.at(a, s), self.at(b, s)
                    jumps.append((q[0] - p[0], q[1] - p[1]))
            D = max([norm(*d) for d in jumps]) + 4 * self.off
            side = max([abs(d[1] * u[0] - d[0] * u[1]) for d in jumps])
            along = max([abs(d[0] * u[0] + d[1] * u[1]) for d in jumps])
            c = min([side + along * lean + 4 * self.off, D])
            bend = (
                2 / mp.sqrt(3) * D**2 if 3 * c**2 > 2 * D**2 else c * mp.sqrt(4 * D**2 - 3 * c**2)
            )
            error += bend / (8 * m**2)
            power += c**2 / (8 * m)
        return min([error, 2 * sine + 1 - mp.sqrt(1 - sine**2)]), power

    def growth(self, H, A):
        vs, vn, w, l, h = *self.v, self.w, self.l, self.h
        hinge = (
            [[self.norm * x for x in row] for row in self.plain]
            if self.moving
            else [[mp.mpf(0)] * 3] * 2
        )
        along = max([abs(p[0] - vs) for p in self.hinge]) + self.off
        if self.mixed or (self.directed and abs(vs) <= (along + A)):
            return
        most = max([self.spread(mp.mpf(0)), self.spread(l)]) + A
        reach = min([abs(vn), abs(vn + w * l)])
        change = max([abs(x - w) for x in self.spin]) + 2 * A / l
        spin = abs(w) - change
        pivots = (vn < 0) != ((vn + w * l) < 0) and reach > 1.2 * most and spin > 0.3 * abs(w)
        turn = [0, 0, self.sign]
        b = [turn[i] * vs / w - self.row[0][i] for i in range(3)]
        c = [self.row[1][i] - turn[i] * vn / w for i in range(3)]
        if pivots:
            along += A
            T, s0 = mp.asinh((reach - most) / (abs(vs) + along)), -vn / w
            moved = (max([abs(self.at(k, s0)[1]) for k in CORNERS]) + self.off + A) / spin
            tilted = along / spin + abs(vs) / abs(w) * change / spin
            wide = 2 / (abs(w) + change)
            for stiff, row, lost, per in (
                (wide * (T - mp.tanh(T)), b, tilted, 3),
                (wide * mp.tanh(T), c, moved, 5),
            ):
                tau = mp.mpf(min(max(per * lost + 0.7 * h, 0.3), 0.6))
                add(H, stiff * (1 - tau), row)
                H[2][2] -= 2 * stiff * (1 / tau - 1) * lost**2
                for each in hinge:
                    add(H, -stiff * (1 / tau - 1) * h**2 / 2, each)
        for j, (sa, sb) in enumerate(zip(self.node, self.node[1:], strict=False)):
            length, ends = sb - sa, (self.rows(sa), self.rows(sb))
            if self.kind[j] == "slow":
                u, sine, speed = self.cone[j]
                factor = length / (2 * (speed + A))
                across = [sum(u[0] * e[1][i] - u[1] * e[0][i] for e in ends) / 2 for i in range(3)]
                add(H, (1 - sine**2) * factor / 2, across)
                for each in (*ends[0], *ends[1]):
                    add(H, -(sine**2) * factor * 3 / 2, each)
                for each in hinge:
                    add(H, -(h**2) * factor * 3 / 4, each)
            if self.kind[j] != "sliding":
                continue
            ya, yb = vn + w * sa, vn + w * sb
            nearest = mp.mpf(0) if ya * yb <= 0 else min([abs(ya), abs(yb)])
            r, spread = norm(vs, nearest), max([self.spread(sa), self.spread(sb)])
            far = (spread + A) / r
            half, sine = (1, far) if far < 0.12 else (mp.mpf(1) / 2, spread / r)
            if (pivots and nearest < reach) or sine >= 0.12:
                continue
            tau = mp.mpf(min(max(1.5 * sine + 0.75 * h, 0.3), 0.6))
            factor = half * (1 - tau) * (1 - sine**2) / (1 + far)
            t0, t1 = mp.asinh(ya / abs(vs)), mp.asinh(yb / abs(vs))
            flat = -factor * (mp.sech(t1) - mp.sech(t0)) * (-1 if vs < 0 else 1) / w
            add(H, factor * (t1 - t0 - mp.tanh(t1) + mp.tanh(t0)) / w, b)
            add(H, factor * (mp.tanh(t1) - mp.tanh(t0)) / w, c)
            add(H, flat, b, c), add(H, flat, c, b)
            lost = half * length / (r * (1 + far)) * (1 / tau - 1)
            for each in (*ends[0], *ends[1]):
                add(H, -lost * sine**2, each)
            for each in hinge:
                add(H, -lost * h**2 / 2, each)


def add(H, factor, a, b=None):
    for i in range(3):
        for j in range(3):
            H[i][j] += factor * a[i] * (b or a)[j]


def whitened(H):
    """x -> L^-1 x with H = L L^T."""
    L = [[mp.mpf(0)] * 3 for _ in range(3)]
    for i in range(3):
        for j in range(i + 1):
            left = (H[i][j] + H[j][i]) / 2 - sum(L[i][m] * L[j][m] for m in range(j))
            assert i != j or left > 0
            L[i][j] = mp.sqrt(left) if i == j else left / L[j][j]

    def forward(v):
        x = []
        for i in range(3):
            x.append((v[i] - sum(L[i][m] * x[m] for m in range(i))) / L[i][i])
        return x

    return forward


def reach_of(forward, rows):
    x, y = forward(rows[0]), forward(rows[1])
    a, b, c = (sum(p * q for p, q in zip(u, v, strict=True)) for u, v in ((x, x), (y, y), (x, y)))
    return mp.sqrt((a + b) / 2 + mp.sqrt((a - b) ** 2 / 4 + c**2))


def fourth_power_norm(forward, G):
    half = [forward(row) for row in G]
    K = [forward([half[i][j] for i in range(3)]) for j in range(3)]
    for _ in range(2):
        K = [[sum(K[i][m] * K[m][j] for m in range(3)) for j in range(3)] for i in range(3)]
    return mp.sqrt(mp.sqrt(mp.sqrt(sum(x**2 for row in K for x in row))))


def allowance(lengths, sigma, low, size, motions, forces, left, point, delta):
    """Gain and power; forces (8, 2, 2) on the outer links, left (force, torque), point (x, y,
    beside)."""
    low, size = [mp.mpf(float(x)) for x in low], [mp.mpf(float(x)) for x in size]
    links = [Link(i, lengths, sigma, low, size, motions, delta) for i in range(3)]
    turning = [mp.mpf(0)] * 3
    for i, which in ((0, 0), (2, 1)):
        f = [[mp.mpf(float(x)) for x in forces[k][which]] for k in CORNERS]
        change = max(
            [norm(f[b][0] - f[a][0], f[b][1] - f[a][1]) for a, b in edges(0 if i == 0 else 1)]
        )
        turning[i] = links[i].h ** 2 / 8 * max([norm(*x) for x in f]) + links[i].h / 4 * change
    G, total = [[mp.mpf(0)] * 3 for _ in range(3)], mp.mpf(0)
    for k in links:
        h = k.h / 2
        for j, error in enumerate(k.error):
            weight = error * (k.node[j + 1] - k.node[j])
            total += weight
            for row in (*k.rows(k.node[j]), *k.rows(k.node[j + 1])):
                add(G, weight * (1 + h) / 2, row)
            for row in k.plain:
                add(G, weight * h * (1 + h) * k.norm**2, row)
    gap, power = sum(k.gap for k in links), sum(k.power for k in links)
    for i in range(3):
        if found := resting(links, sigma, i, turning, left, point, mp.mpf(delta)):
            return found
    one, none = mp.mpf(1), mp.mpf(0)
    px, py, beside = (mp.mpf(float(x)) for x in point)
    force, torque = (mp.mpf(float(x)) for x in left)
    allowed = [mp.mpf(0.2) * max([k.spread(none), k.spread(k.l)]) for k in links]
    for _ in range(5):
        H = [[mp.mpf(0)] * 3 for _ in range(3)]
        for k, A in zip(links, allowed, strict=True):
            k.growth(H, A)
        forward = whitened(H)
        turn = reach_of(forward, [[none, none, one], [none] * 3])
        pull = mp.sqrt(total * fourth_power_norm(forward, G)) + torque * turn
        pull += force * reach_of(forward, [[one, none, none], [none, one, none]])
        pull += sum(e * reach_of(forward, k.plain) for e, k in zip(turning, links, strict=True))
        radius = (pull + mp.sqrt(pull**2 + 4 * gap)) / 2
        moved = []
        for k in links:
            # a turn by h/2 changes a velocity by at most that share of it, before it is stretched
            plain = k.norm * reach_of(forward, k.plain)
            hinge, tip = (reach_of(forward, k.rows(s)) + k.h / 2 * plain for s in (none, k.l))
            moved.append(radius * max([min([plain, hinge]), tip]))
        fit = [m < A for m, A in zip(moved, allowed, strict=True)]
        if all(fit):
            at_point = reach_of(forward, [[one, none, -py], [none, one, px]])
            return radius * (at_point + beside * turn), power + gap + pull * radius
        # any larger ones will do: these are those of the compiled code
        allowed = [
            max([1.5 * m, A]) if all(fit[: i + 1]) else 1.5 * m
            for i, (m, A) in enumerate(zip(moved, allowed, strict=True))
        ]
    raise AssertionError("nothing is known of this cell")


def resting(links, sigma, i, turning, left, point, delta):
    """Where link i rests at all corners: beta int |a| <= g + |rho.d| with beta = 1 - |f|, |a| on it
    as large as at one end."""
    k, (forth, back) = links[i], [mp.mpf(x) for x in sigma]
    speed = max([norm(*k.at(corner, s)) for corner in CORNERS for s in (0, k.l)])
    fastest = (speed + k.off) * max([forth / back, back / forth])
    beta = 1 - fastest / norm(fastest, delta)
    if speed > 100 * delta or beta < 1e-6:
        return None
    # a changes by at most 2/l along a body that turns as a whole: at the ends of the others, of a
    # on link i
    far, hinge = {i: mp.mpf(1)}, {i: mp.mpf(1)}
    for step in (-1, 1):
        j, before = i + step, mp.mpf(1)
        while 0 <= j < 3:
            hinge[j] = before if j != 1 else mp.mpf(1)
            before = far[j] = before + 2 * links[j].l / k.l
            j += step
    force, torque = (mp.mpf(float(x)) for x in left)
    others = [j for j in range(3) if j != i]
    rho = force * far[1] + torque * 2 / k.l + sum(turning[j] * hinge[j] for j in (0, 2))
    for j in others:
        rho += (
            links[j].norm
            * far[j]
            * sum(
                e * (b - a)
                for e, a, b in zip(links[j].error, links[j].node, links[j].node[1:], strict=False)
            )
        )
    room = beta * min([forth, back, 1]) * (mp.sqrt(2) - 1) * k.l - rho
    if room <= 0:
        return None
    given = 3 * fastest * k.l + sum(links[j].gap for j in others)
    moved = given / room
    px, py, beside = (mp.mpf(float(x)) for x in point)
    gain = moved * (far[1] + 2 / k.l * (norm(px, py) + beside))
    return gain, sum(each.power for each in links) + given + rho * moved
