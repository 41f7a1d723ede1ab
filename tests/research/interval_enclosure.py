"""The allowance of strong convexity for one cell, written out in interval arithmetic (mpmath): research/guarantee/README.md.

A second implementation of research/guarantee/native/enclosure.h, for a dissipation sqrt((sigma vs)^2 + vn^2). Choices that are
free (nodes, the kind of a piece, tau) are made by midpoints; whatever is claimed is an interval that holds the exact value.
"""

import numpy as np
from mpmath import iv

iv.prec = 80
PIECES, CORNERS = 16, range(8)


def mid(x):
    return float(x.mid) if hasattr(x, "mid") else float(x)


def top(values):
    """Interval that holds the largest of some."""
    values = [iv.mpf(v) for v in values]
    return iv.mpf([max(v.a for v in values), max(v.b for v in values)])


def least(values):
    return -top([-v for v in values])


def norm(x, y):
    return iv.sqrt(x**2 + y**2)


def asinh(x):
    return iv.log(x + iv.sqrt(x**2 + 1)) if mid(x) > 0 else -iv.log(-x + iv.sqrt(x**2 + 1))


def tanh(x):
    e = iv.exp(2 * x)
    return (e - 1) / (e + 1)


def sech(x):
    e = iv.exp(x)
    return 2 / (e + 1 / e)


def edges(axis):
    bit = 4 >> axis
    return [(i, i | bit) for i in CORNERS if not i & bit]


class Link:
    def __init__(self, i, lengths, sigma, low, size, motions, delta):
        self.l, self.side, self.delta = iv.mpf(lengths[i]), i - 1, iv.mpf(delta)
        self.sign = -1 if self.side < 0 else 1
        offset = (iv.mpf(1) / 2 if self.side > 0 else -iv.mpf(1) / 2) * lengths[1]
        axis = {0: 0, 1: None, 2: 1}[i]
        self.h = iv.mpf(0) if axis is None else size[axis]
        z = [[iv.mpf(x) for x in motion] for motion in motions]
        joint = [(a, b + offset * w) for a, b, w in z]

        def turned(at, p):
            angle = -self.side * at
            return iv.cos(angle) * p[0] - iv.sin(angle) * p[1], iv.sin(angle) * p[0] + iv.cos(angle) * p[1]

        corner = [[low[a] + size[a] * (k >> (2 - a) & 1) for a in range(3)] for k in CORNERS]
        self.hinge = [p if axis is None else turned(corner[k][axis], p) for k, p in enumerate(joint)]
        rate = {0: lambda k: 1 - z[k][2], 1: lambda k: z[k][2], 2: lambda k: z[k][2] + corner[k][2]}[i]
        self.spin = [rate(k) for k in CORNERS]
        self.off = iv.mpf(0)
        if axis is not None:
            change = top([norm(joint[b][0] - joint[a][0], joint[b][1] - joint[a][1]) for a, b in edges(axis)])
            self.off = self.h**2 / 8 * top([norm(*p) for p in joint]) + self.h / 4 * change
        self.stretch([iv.mpf(x) for x in sigma])
        self.v = [sum(p[c] for p in self.hinge) / 8 for c in (0, 1)]
        self.w = sum(self.spin) / 8
        centre = iv.mpf(0) if axis is None else low[axis] + size[axis] / 2
        x, y = (iv.mpf(1), iv.mpf(0)), (iv.mpf(0), iv.mpf(1))
        columns = [x, y] if axis is None else [turned(centre, x), turned(centre, y)]
        self.plain = [[columns[0][c], columns[1][c], columns[1][c] * offset] for c in (0, 1)]
        self.row = [[self.sigma * x for x in self.plain[0]], self.plain[1]]
        self.moving = axis is not None
        self.find_errors()

    def stretch(self, sigma):
        """Tangential velocities count sigma times: that of the sense in which the whole link slides all over the cell."""
        self.directed, along = mid(sigma[0]) != mid(sigma[1]), [p[0] for p in self.hinge]
        self.sigma, self.ratio = top(sigma), iv.mpf(1)
        if all(mid(x) > mid(self.off) for x in along):
            self.sigma = sigma[0]
        elif all(mid(x) < -mid(self.off) for x in along):
            self.sigma = sigma[1]
        elif self.directed:
            self.ratio = top(sigma) / least(sigma)
        self.mixed = mid(self.ratio) > 1
        self.norm = top([self.sigma, 1])  # of the stretch, as a matrix
        self.off *= self.norm
        self.hinge = [(self.sigma * x, y) for x, y in self.hinge]

    def at(self, k, s):
        return self.hinge[k][0], self.hinge[k][1] + s * self.spin[k]

    def spread(self, s):
        return top([norm(self.at(k, s)[0] - self.v[0], self.at(k, s)[1] - self.v[1] - s * self.w) for k in CORNERS]) + self.off

    def rows(self, s):
        return [self.row[0], [self.row[1][0], self.row[1][1], self.row[1][2] + self.sign * s]]

    def nodes(self):
        """Shorter where the mean velocity turns; where some corners are slow, where the mean of their directions does."""
        l, vs, vn, w = (mid(x) for x in (self.l, *self.v, self.w))
        speeds = [max(mid(norm(*self.at(k, s))) for s in (0, self.l)) for k in CORNERS]
        self.patterned = min(speeds) < 0.3 * max(speeds)
        if self.patterned:
            ways = [(mid(p[0]) / v, mid(p[1]) / v, mid(w) / v) for p, w, v in zip(self.hinge, self.spin, speeds, strict=True)]
            vs, vn, w = np.mean(ways, axis=0)
            s0 = min(max(-vn / w, 0.0), l)
            width = max(abs(vs), 1e-3, *(np.hypot(x - vs, y + s0 * turn - vn - s0 * w) for x, y, turn in ways))
        else:
            width = max(abs(vs), mid(self.spread(min(max(-vn / w, 0.0), l))), 1e-9)
        if abs(w) * l > 1e-3 * width:
            t = np.linspace(np.arcsinh(vn / width), np.arcsinh((vn + w * l) / width), PIECES + 1)
            nodes = np.clip((width * np.sinh(t) - vn) / w, 0.0, l)
        else:
            nodes = np.linspace(0.0, l, PIECES + 1)
        return [iv.mpf(0), *(iv.mpf(float(s)) for s in nodes[1:-1]), self.l]

    def find_errors(self):
        self.node = self.nodes()
        self.kind, self.error, self.cone = [], [], []
        self.gap = self.power = iv.mpf(0)
        for sa, sb in zip(self.node, self.node[1:], strict=False):
            spread, length = top([self.spread(sa), self.spread(sb)]), sb - sa
            ya, yb = self.v[1] + sa * self.w, self.v[1] + sb * self.w
            nearest = iv.mpf(0) if mid(ya) * mid(yb) <= 0 else least([abs(ya), abs(yb)])
            r = norm(self.v[0], nearest)
            kind, error, cone = "sliding", iv.mpf(0), None
            if self.mixed:
                kind, bend = "loose", 2 * spread
                if mid(r) >= 5 * mid(spread) and mid(r - spread) > 4 * mid(self.delta):
                    bend = least([bend, self.ratio * spread**2 / (r - spread)])
                self.gap += (bend + self.delta) * length
                self.power += least([2 * spread, self.off + bend]) * length
            elif mid(spread) >= 0.3 * mid(r):
                kind, gap, power, cone = self.interpolated(sa, sb, spread, r)
                if kind == "loose" and mid(spread) < 0.6 * mid(r):
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
        cosine, left = least([d[0] * u[0] + d[1] * u[1] for d in directions]), r - spread
        gap = 2 * spread
        if mid(left) > mid(spread):
            gap = least([gap, (1 if mid(left) >= 2 * mid(spread) else 2) * spread**2 / left])
        gap, power = gap + self.delta, 2 * spread
        if mid(cosine) > 0.6:
            sine, fastest = iv.sqrt(top([1 - cosine**2, 0])), top([norm(*v) for v in velocities])
            slowest = least([norm(*v) for v in velocities]) * cosine
            held = slowest / norm(slowest, self.delta)
            far = 1000 * mid(self.delta)
            speeds = [[mid(norm(*self.at(k, s))) for s in (sa, sb)] for k in CORNERS]
            apart = all(max(each) <= far or min(each) * mid(cosine) >= far for each in speeds)
            side = 2 * fastest * sine * cosine + self.off
            narrow = 2 * fastest * sine**2 + 2 * self.off + side**2 * 3 / 2 / (fastest + self.off)
            if apart:
                narrow += ((1 - held) / 4 + iv.mpf(1) / 2 / 10**6) * fastest + 1000 * self.delta
            else:
                narrow += (1 - held) * fastest
            if mid(narrow) < mid(gap):
                return "slow", narrow, least([power, fastest * (1 - cosine) + self.off]), (u, sine, fastest + self.off)
        return "loose", gap, power, None

    def sliding(self, sa, sb, ya, yb, spread, r):
        m, sine = r - spread, spread / r
        first, last = ((self.v[0] / norm(self.v[0], y), y / norm(self.v[0], y)) for y in (ya, yb))
        u = [first[c] + last[c] for c in (0, 1)]
        u = [c / norm(*u) for c in u]
        sin_b, cos_b = abs(first[0] * u[1] - first[1] * u[0]), first[0] * u[0] + first[1] * u[1]
        lean = sin_b * iv.sqrt(1 - sine**2) + cos_b * sine
        if mid(cos_b * iv.sqrt(1 - sine**2) - sin_b * sine) < 0:
            lean = iv.mpf(1)
        error, power = self.off / m + self.delta**2 / (2 * m**2), self.off
        for axis in range(3):
            jumps = []
            for a, b in edges(axis):
                for s in (sa, sb):
                    p, q = self.at(a, s), self.at(b, s)
                    jumps.append((q[0] - p[0], q[1] - p[1]))
            D = top([norm(*d) for d in jumps]) + 4 * self.off
            side = top([abs(d[1] * u[0] - d[0] * u[1]) for d in jumps])
            along = top([abs(d[0] * u[0] + d[1] * u[1]) for d in jumps])
            c = least([side + along * lean + 4 * self.off, D])
            bend = 2 / iv.sqrt(3) * D**2 if 3 * mid(c) ** 2 > 2 * mid(D) ** 2 else c * iv.sqrt(4 * D**2 - 3 * c**2)
            error += bend / (8 * m**2)
            power += c**2 / (8 * m)
        return least([error, 2 * sine + 1 - iv.sqrt(1 - sine**2)]), power

    def growth(self, H, A):
        vs, vn, w, l, h = *self.v, self.w, self.l, self.h
        hinge = [[self.norm * x for x in row] for row in self.plain] if self.moving else [[iv.mpf(0)] * 3] * 2
        along = top([abs(p[0] - vs) for p in self.hinge]) + self.off
        if self.mixed or (self.directed and mid(abs(vs)) <= mid(along + A)):
            return
        most = top([self.spread(iv.mpf(0)), self.spread(l)]) + A
        reach = least([abs(vn), abs(vn + w * l)])
        change = top([abs(x - w) for x in self.spin]) + 2 * A / l
        spin = abs(w) - change
        pivots = (mid(vn) < 0) != (mid(vn + w * l) < 0) and mid(reach) > 1.2 * mid(most) and mid(spin) > 0.3 * abs(mid(w))
        turn = [0, 0, self.sign]
        b = [turn[i] * vs / w - self.row[0][i] for i in range(3)]
        c = [self.row[1][i] - turn[i] * vn / w for i in range(3)]
        if pivots:
            along += A
            T, s0 = asinh((reach - most) / (abs(vs) + along)), -vn / w
            moved = (top([abs(self.at(k, s0)[1]) for k in CORNERS]) + self.off + A) / spin
            tilted = along / spin + abs(vs) / abs(w) * change / spin
            wide = 2 / (abs(w) + change)
            for stiff, row, lost, per in ((wide * (T - tanh(T)), b, tilted, 3), (wide * tanh(T), c, moved, 5)):
                tau = iv.mpf(min(max(per * mid(lost) + 0.7 * mid(h), 0.3), 0.6))
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
            nearest = iv.mpf(0) if mid(ya) * mid(yb) <= 0 else least([abs(ya), abs(yb)])
            r, spread = norm(vs, nearest), top([self.spread(sa), self.spread(sb)])
            far = (spread + A) / r
            half, sine = (1, far) if mid(far) < 0.12 else (iv.mpf(1) / 2, spread / r)
            if (pivots and mid(nearest) < mid(reach)) or mid(sine) >= 0.12:
                continue
            tau = iv.mpf(min(max(1.5 * mid(sine) + 0.75 * mid(h), 0.3), 0.6))
            factor = half * (1 - tau) * (1 - sine**2) / (1 + far)
            t0, t1 = asinh(ya / abs(vs)), asinh(yb / abs(vs))
            flat = -factor * (sech(t1) - sech(t0)) * (-1 if mid(vs) < 0 else 1) / w
            add(H, factor * (t1 - t0 - tanh(t1) + tanh(t0)) / w, b)
            add(H, factor * (tanh(t1) - tanh(t0)) / w, c)
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
    L = [[iv.mpf(0)] * 3 for _ in range(3)]
    for i in range(3):
        for j in range(i + 1):
            left = (H[i][j] + H[j][i]) / 2 - sum(L[i][m] * L[j][m] for m in range(j))
            assert i != j or left.a > 0
            L[i][j] = iv.sqrt(left) if i == j else left / L[j][j]

    def forward(v):
        x = []
        for i in range(3):
            x.append((v[i] - sum(L[i][m] * x[m] for m in range(i))) / L[i][i])
        return x

    return forward


def reach_of(forward, rows):
    x, y = forward(rows[0]), forward(rows[1])
    a, b, c = (sum(p * q for p, q in zip(u, v, strict=True)) for u, v in ((x, x), (y, y), (x, y)))
    return iv.sqrt((a + b) / 2 + iv.sqrt((a - b) ** 2 / 4 + c**2))


def fourth_power_norm(forward, G):
    half = [forward(row) for row in G]
    K = [forward([half[i][j] for i in range(3)]) for j in range(3)]
    for _ in range(2):
        K = [[sum(K[i][m] * K[m][j] for m in range(3)) for j in range(3)] for i in range(3)]
    return iv.sqrt(iv.sqrt(iv.sqrt(sum(x**2 for row in K for x in row))))


def allowance(lengths, sigma, low, size, motions, forces, left, point, delta):
    """Gain and power, as intervals; forces (8, 2, 2) on the outer links, left (force, torque), point (x, y, beside)."""
    low, size = [iv.mpf(float(x)) for x in low], [iv.mpf(float(x)) for x in size]
    links = [Link(i, lengths, sigma, low, size, motions, delta) for i in range(3)]
    turning = [iv.mpf(0)] * 3
    for i, which in ((0, 0), (2, 1)):
        f = [[iv.mpf(float(x)) for x in forces[k][which]] for k in CORNERS]
        change = top([norm(f[b][0] - f[a][0], f[b][1] - f[a][1]) for a, b in edges(0 if i == 0 else 1)])
        turning[i] = links[i].h ** 2 / 8 * top([norm(*x) for x in f]) + links[i].h / 4 * change
    G, total = [[iv.mpf(0)] * 3 for _ in range(3)], iv.mpf(0)
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
        if found := resting(links, sigma, i, turning, left, point, iv.mpf(delta)):
            return found
    one, none = iv.mpf(1), iv.mpf(0)
    px, py, beside = (iv.mpf(float(x)) for x in point)
    force, torque = (iv.mpf(float(x)) for x in left)
    allowed = [iv.mpf(0.2) * top([k.spread(none), k.spread(k.l)]) for k in links]
    for _ in range(5):
        H = [[iv.mpf(0)] * 3 for _ in range(3)]
        for k, A in zip(links, allowed, strict=True):
            k.growth(H, A)
        forward = whitened(H)
        turn = reach_of(forward, [[none, none, one], [none] * 3])
        pull = iv.sqrt(total * fourth_power_norm(forward, G)) + torque * turn
        pull += force * reach_of(forward, [[one, none, none], [none, one, none]])
        pull += sum(e * reach_of(forward, k.plain) for e, k in zip(turning, links, strict=True))
        radius = (pull + iv.sqrt(pull**2 + 4 * gap)) / 2
        moved = []
        for k in links:
            # a turn by h/2 changes a velocity by at most that share of it, before it is stretched
            plain = k.norm * reach_of(forward, k.plain)
            hinge, tip = (reach_of(forward, k.rows(s)) + k.h / 2 * plain for s in (none, k.l))
            moved.append(radius * top([least([plain, hinge]), tip]))
        fit = [mid(m) < mid(A) for m, A in zip(moved, allowed, strict=True)]
        if all(fit):
            at_point = reach_of(forward, [[one, none, -py], [none, one, px]])
            return radius * (at_point + beside * turn), power + gap + pull * radius
        # any larger ones will do: these are those of the compiled code
        allowed = [
            top([1.5 * m, A]) if all(fit[: i + 1]) else 1.5 * m for i, (m, A) in enumerate(zip(moved, allowed, strict=True))
        ]
    raise AssertionError("nothing is known of this cell")


def resting(links, sigma, i, turning, left, point, delta):
    """Where link i rests at all corners: beta int |a| <= g + |rho.d| with beta = 1 - |f|, |a| on it as large as at one end."""
    k, (forth, back) = links[i], [iv.mpf(x) for x in sigma]
    speed = top([norm(*k.at(corner, s)) for corner in CORNERS for s in (0, k.l)])
    fastest = (speed + k.off) * top([forth / back, back / forth])
    beta = 1 - fastest / norm(fastest, delta)
    if mid(speed) > 100 * mid(delta) or mid(beta) < 1e-6:
        return None
    # a changes by at most 2/l along a body that turns as a whole: at the ends of the others, of a on link i
    far, hinge = {i: iv.mpf(1)}, {i: iv.mpf(1)}
    for step in (-1, 1):
        j, before = i + step, iv.mpf(1)
        while 0 <= j < 3:
            hinge[j] = before if j != 1 else iv.mpf(1)
            before = far[j] = before + 2 * links[j].l / k.l
            j += step
    force, torque = (iv.mpf(float(x)) for x in left)
    others = [j for j in range(3) if j != i]
    rho = force * far[1] + torque * 2 / k.l + sum(turning[j] * hinge[j] for j in (0, 2))
    for j in others:
        rho += (
            links[j].norm
            * far[j]
            * sum(e * (b - a) for e, a, b in zip(links[j].error, links[j].node, links[j].node[1:], strict=False))
        )
    room = beta * least([forth, back, 1]) * (iv.sqrt(2) - 1) * k.l - rho
    if mid(room) <= 0:
        return None
    given = 3 * fastest * k.l + sum(links[j].gap for j in others)
    moved = given / room
    px, py, beside = (iv.mpf(float(x)) for x in point)
    gain = moved * (far[1] + 2 / k.l * (norm(px, py) + beside))
    return gain, sum(each.power for each in links) + given + rho * moved
