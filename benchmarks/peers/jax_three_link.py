"""The three-link problem in JAX, all starts side by side: the reduced problem, compiled.

Run in the peers' environment: python -m benchmarks.peers.jax_three_link --starts 20

A gait gives the joint angles; Newton's method, for all points of all starts at once, balances each
point; sums over the points are distance and work. Derivatives pass through the balance by the
implicit function theorem. Each start has a BFGS of its own, in step with the others, and goes
through all levels of delta. Joints stay within their limits, at all times, by a change of
variables. On every turn all starts are solved, and one is reported, with its share of the time.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.peers.physics import DELTAS, GUESSES, balance_and_rates
from benchmarks.peers.runs import arguments, found, run
from benchmarks.peers.settings import DEGREE
from benchmarks.peers.starts import starts

BALANCED, STEPS, OPTIMAL, LONGEST = 1e-11, 60, 1e-10, 0.5
"""Net force at which Newton's method ends, its most steps; change of the efficiency at which a
search ends, its longest step."""


def inverse_times(M, b):
    """x of M x = b at every point, ``(3, 3, n)`` and ``(3, n)``, by Cramer's rule."""
    p, q, r = M[:, 0], M[:, 1], M[:, 2]
    normals = [jnp.cross(*pair, axis=0) for pair in ((q, r), (r, p), (p, q))]
    return jnp.stack([(n * b).sum(0) for n in normals]) / (normals[0] * p).sum(0)


def balance_and_drag(balance: Callable, z):
    """The balance at tail velocities, ``(3, n)``, and minus its derivatives."""
    units = [jnp.zeros_like(z).at[k].set(1.0) for k in range(3)]
    columns = [jax.jvp(balance, (z,), (unit,)) for unit in units]
    return columns[0][0], -jnp.stack([slope for _, slope in columns], 1)


def newton(balance: Callable, z):
    """Tail velocities at which the balance holds. It is the slope of a convex potential, so a step
    far beyond the least value on its way is halved, until it is not."""

    def at(z):
        force, matrix = balance_and_drag(balance, z)
        return force, inverse_times(matrix, force)

    def step(state):
        z, force, way, size, k = state
        new = z + size * way
        new_force, new_way = at(new)
        good = (new_force * way).sum(0) >= -0.5 * (force * way).sum(0)
        good |= jnp.abs(new_force).max(0) < BALANCED
        pairs = ((new, z), (new_force, force), (new_way, way), (1.0, size / 2))
        return *(jnp.where(good, new, old) for new, old in pairs), k + 1

    def unfinished(state):
        return (jnp.abs(state[1]).max() > BALANCED) & (state[4] < STEPS)

    return jax.lax.while_loop(unfinished, step, (z, *at(z), jnp.ones(z.shape[1]), 0))[0]


def parameters_of(u):
    """A0, A1, B1 of variables without limits: a joint's largest and smallest angle, as sines, and a
    phase."""
    high, low = np.pi * jnp.sin(u[0]), -np.pi * jnp.sin(u[1])
    radius = 0.5 * (high - low)
    return 0.5 * (high + low), radius * jnp.cos(u[2]), radius * jnp.sin(u[2])


def variables_of(own: np.ndarray) -> np.ndarray:
    """The variables of gaits, ``(n, 3)``, a little within their limits."""
    A0, radius = own[:, 0], np.hypot(own[:, 1], own[:, 2])
    ends = np.clip(np.array([A0 + radius, radius - A0]) / np.pi, -0.99, 0.99)
    return np.stack([*np.arcsin(ends), np.arctan2(own[:, 2], own[:, 1])], 1)


def reduced(intervals: int) -> Callable:
    """Minus the efficiency of a gait, and the velocities that balance it, from others to start
    with; by Radau's rule on each interval."""
    c, powers = np.array([(4 - 6**0.5) / 10, (4 + 6**0.5) / 10, 1.0]), np.arange(DEGREE)
    weights = c[:, None] ** (powers + 1) / (powers + 1) @ np.linalg.inv(c[:, None] ** powers)
    h = np.pi / intervals
    t = jnp.array(((np.arange(intervals)[:, None] + c) * h).ravel())

    def minus_efficiency(u, z, delta):
        own = parameters_of(u)

        def balance(z, own):
            return jnp.stack(balance_and_rates(jnp, t, 0.0, z, own, delta)[0])

        fixed = partial(balance, own=jax.lax.stop_gradient(own))
        z = newton(fixed, z)
        # one step more, with its matrix fixed, has the derivative of the solution
        z = z + inverse_times(balance_and_drag(fixed, z)[1], balance(z, own))
        turned = h * z[2].reshape(intervals, DEGREE) @ weights.T
        edges = jnp.cumsum(turned[:, -1]) - turned[:, -1]
        theta = (edges[:, None] + turned).ravel()
        sides = (theta, theta - np.pi / 2)
        rates = [balance_and_rates(jnp, t, side, z, own, delta)[1] for side in sides]
        rates = jnp.stack([rates[0][1], rates[1][1], rates[0][2]]).reshape(3, intervals, DEGREE)
        x, y, work = (rates @ weights[-1]).sum(1)
        return -jnp.hypot(x, y) / work, z

    return minus_efficiency


def build(count: int, intervals: int) -> tuple[np.ndarray, int, Callable]:
    """All starts, points, and the compiled function that values a gait for each start, with
    gradients."""
    jax.config.update("jax_enable_x64", True)
    every = jax.vmap(jax.value_and_grad(reduced(intervals), has_aux=True), in_axes=(0, 0, None))
    own, points = starts(count), DEGREE * intervals
    compiled = jax.jit(every).lower(jnp.array(own), jnp.zeros((count, 3, points)), 0.1).compile()
    return own, points, lambda *given: jax.tree.map(np.array, compiled(*given))


def searched(value: Callable, u, z, H, delta: float):
    """Where BFGS ends from every start, its velocities, inverse Hessians, and values."""
    (f, z), g = value(u, z, delta)
    size, going = np.ones(len(u)), np.ones(len(u), bool)
    while going.any():
        way = -np.einsum("kij,kj->ki", H, g)
        way *= np.minimum(1.0, LONGEST / np.maximum(np.abs(way).max(1), 1e-12))[:, None]
        step = np.where(going, size, 0.0)[:, None] * way
        (f1, z1), g1 = value(u + step, z, delta)
        good = going & (f1 <= f + 1e-4 * (g * step).sum(1))
        y, sy = g1 - g, (step * (g1 - g)).sum(1)
        for k in np.flatnonzero(good & (sy > 1e-14)):
            I = np.eye(3) - np.outer(step[k], y[k]) / sy[k]
            H[k] = I @ H[k] @ I.T + np.outer(step[k], step[k]) / sy[k]
        size = np.where(good, 1.0, 0.4 * size)
        going &= ~(good & (f - f1 < OPTIMAL)) & (size > 1e-6)
        for now, new in ((u, u + step), (f, f1), (g, g1), (z, z1)):
            now[good] = new[good]
    return u, z, H, f


def solve(program: tuple[np.ndarray, int, Callable], start: np.ndarray) -> dict:
    """Continuation in delta from all starts; the gait and efficiency of one."""
    own, points, value = program
    u, z, H = (
        variables_of(own),
        np.zeros((len(own), 3, points)),
        np.repeat(np.eye(3)[None], len(own), 0),
    )
    for level in DELTAS:
        u, z, H, f = searched(value, u, z, H, level / (2 * np.pi))
    mine = int(np.abs(own - start).max(1).argmin())
    return found(-f[mine], parameters_of(u[mine])) | {"at_once": len(own)}


if __name__ == "__main__":
    chosen = arguments(__doc__)
    run(chosen, lambda: build(max(chosen.starts, GUESSES), chosen.intervals), solve)
