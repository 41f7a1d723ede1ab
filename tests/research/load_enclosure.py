"""The allowance of small loads for one cell, written out corner by corner:
research/guarantee/README.md."""

import numpy as np

from research.guarantee.enclosure import DELTA
from research.guarantee.loaded_balance import loaded_balance

KAPPA, TORQUE, ROUNDING = np.sqrt(2) - 1, 0.15, 0.0


def difference(values, axis):
    """Largest change of vectors at the eight corners along the edges of one axis."""
    bit = 4 >> axis
    return max(
        np.linalg.norm(np.subtract(values[k | bit], values[k])) for k in range(8) if not k & bit
    )


def turned(values, h, axis):
    """What a turn and interpolation in turn lose of vectors at the corners: h^2/8 |p| + (h/4)
    |change of p|."""
    return h**2 / 8 * max(np.linalg.norm(v) for v in values) + h / 4 * difference(values, axis)


def imbalance(body, friction, size, states):
    """Share of the dissipation that interpolated forces may miss, and the error of their power."""
    l1, l2, l3 = body.lengths
    # a body that moves with velocity V at a point pays at least the least coefficient times |V|
    # there
    least, most = min(1, friction.mu_f, friction.mu_b), max(1, friction.mu_f, friction.mu_b)
    share = max(s.residual[0] for s in states) / l2 + max(s.residual[1] for s in states) * 4 / l2**2
    share = share / least + ROUNDING
    for link, length, axis in ((0, l1, 0), (2, l3, 1)):
        # friction on a link is no larger than its length, times the largest coefficient
        lost = size[axis] ** 2 / 8 * length * most + size[axis] / 4 * difference(
            [s.forces[link, :2] for s in states], axis
        )
        share += lost / (least * KAPPA * (length + l2))
    about_the_joint = [[s.forces[2, 1] * l3 / 2 + s.forces[2, 2]] for s in states]
    return share, size[2] / 4 * difference(about_the_joint, 2)


def allowance_by_loads(body, friction, cells, corners, reference, multiplier, n):
    """Gain and power of cell n."""
    at, size = cells.at[n], cells.size[:, n]
    free = [type(corners)(*(field[..., k] for field in corners)) for k in at]
    rise = ROUNDING
    for length, axis, joint in ((body.lengths[0], 0, -0.5), (body.lengths[2], 1, 0.5)):
        rise += (
            max(1, friction.mu_f, friction.mu_b)
            * length
            * turned(
                [(v[0], v[1] + joint * body.lengths[1] * v[2]) for v in (s.velocity for s in free)],
                size[axis],
                axis,
            )
        )
    above = np.array([s.potential for s in free]) + rise
    spins = [s.velocity[2] for s in free]

    def excess(fx, fy, torque):
        """Of l.z* over l.z', for a load of this force at the reference point and this torque about
        it."""
        states, loads = [], []
        for k, state in zip(at, free, strict=True):
            load = np.array(
                [fx, fy, fy * reference.at[k].real - fx * reference.at[k].imag + torque]
            )
            at_corner = cells.points[:2, [k]], cells.rates[:, [k]]
            found = loaded_balance(
                body,
                friction,
                *at_corner,
                load[:, None] / multiplier,
                state.velocity[:, None],
                DELTA,
            )
            loads.append(load), states.append(type(found)(*(field[..., 0] for field in found)))
        share, bilinear = imbalance(body, friction, size, states)
        worst = -np.inf
        for load, state, own, most in zip(loads, states, free, above, strict=True):
            proved = state.power + state.leftover_power - load @ state.velocity / multiplier
            worst = max(worst, multiplier * ((1 + share) * most - proved) - load @ own.velocity)
        crossed = (max(spins) - min(spins)) * reference.change[n] / 4 if torque == 0 else 0.0
        return max(worst + multiplier * bilinear + crossed, 0.0)

    forward, across = (max(excess(x, y, 0.0), excess(-x, -y, 0.0)) for x, y in ((1, 0), (0, 1)))
    spun = max(excess(0, 0, TORQUE), excess(0, 0, -TORQUE)) / TORQUE
    share, bilinear = imbalance(body, friction, size, free)
    lost = max(max(s.potential - s.power - s.leftover_power, 0.0) for s in free)
    gain = (
        np.hypot(forward, across) + (reference.beside[n] + reference.curvature[n]) * spun + ROUNDING
    )
    return gain, share * max(above) + bilinear + lost + ROUNDING
