"""Chains: form, contact, mechanics under several laws and loads, by the compiled kernel and by
NumPy."""

import numpy as np

from colloc import Chain, Friction
from colloc.laws.elliptic import Elliptic
from colloc.laws.power_law import PowerLaw
from colloc.laws.viscous import Viscous
from colloc.mechanics.chain_motion import chain_slopes
from colloc.mechanics.contact import (
    clearance,
    ends_and_links,
    excess,
    gap,
    intrusions,
    overlap,
    share_of_first,
    tangent_of_minimum,
)
from colloc.mechanics.densities import DRIVEN_WORK, Instants, PathLimits, torque_and_power
from colloc.mechanics.fixed_point import solve_balance
from colloc.mechanics.line_integrals import line_integrals
from colloc.mechanics.native_kernel import numpy_instead
from colloc.mechanics.solution_branches import all_balanced_velocities
from tests.hard.cases import HARD
from tests.recorded.bodies import form, mechanics, shapes

PRECISION, FLOOR = 1e-7, 1e-11

UNEQUAL = Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)
TWO, THREE, ODD = Chain((0.4, 0.6)), Chain(), Chain((0.2, 0.5, 0.3), weights=(0.5, 0.2, 0.3))
WIDE, FIVE = Chain((0.25, 0.25, 0.25, 0.25), width=0.05), Chain((0.1, 0.3, 0.2, 0.25, 0.15))


def forms():
    return [form(body, 2.8, count=12) for body in (TWO, THREE, ODD, WIDE, FIVE)]


def other_ends():
    found = []
    for body in (THREE, WIDE, FIVE):
        angles, rates, z = shapes(body, 4, 6, 1.0)
        found += [
            body.seen_from_head(angles, rates, z),
            body.swapped(angles),
            body.laid(np.array([0.5, 0.2, 0.3])),
        ]
    return found


def contact():
    rng = np.random.default_rng(5)
    angles, found = rng.uniform(-3.0, 3.0, (3, 40)), []
    for i, j in ((0, 3), (0, 2), (1, 3)):
        found += [clearance(WIDE, angles, i, j), intrusions(WIDE, angles, i, j)]
    first, second = rng.normal(size=(2, 9)) * 1e-3
    share = share_of_first(first, second)
    found += [
        gap(WIDE, angles),
        overlap(WIDE, angles),
        share,
        tangent_of_minimum(second, first, share),
    ]
    path = np.stack(
        [np.linspace(0, 3.0, 50), np.linspace(0.2, 3.1, 50), np.linspace(-2.0, 2.5, 50)]
    )
    lacking = [excess(WIDE, angles, *pair) for pair in ends_and_links(WIDE)]
    return found, lacking, WIDE.passing_depth(path), WIDE.crossing_depth(path)


def mechanics_of_chains():
    laws = Friction(), UNEQUAL, Friction(mu_t=0.5, mu_f=1.0, mu_b=5.0)
    return [
        mechanics(body, law, 1e-3, 2.0) for body, law in zip((THREE, ODD, FIVE), laws, strict=True)
    ]


def laws_of_friction():
    vs, vn, w = np.random.default_rng(16).normal(size=(3, 3, 9))
    length, found = np.array([[0.2], [0.5], [0.3]]), []
    for law in (
        Friction(),
        UNEQUAL,
        Elliptic(mu_t=1.7, mu_f=1.0, mu_b=1.3),
        PowerLaw(0.5, mu_t=2.0, mu_f=1.0),
        Viscous(normal=1.7, tangential=1.0),
    ):
        found += [
            getattr(law, name)(vs, vn, 0.1)
            for name in ("density", "density_secant", "density_jacobian")
        ]
        on_links = line_integrals(law)
        found += [
            integral(vs, vn, w, length, 0.1)
            for integral in (on_links.force, on_links.jacobian, on_links.secant)
        ]
        if law.associated:
            found += [
                law.density_potential(vs, vn, 0.1),
                on_links.potential(vs, vn, w, length, 0.1),
            ]
        found += [
            law.smallest,
            law.largest,
            law.degree,
            law.regularised,
            law.reversible,
            law.label,
            law.describe(),
        ]
        found += [
            on_links.largest_forces(length),
            law.kernel_numbers,
            law.in_units_of(2.0),
            law.in_speeds_of(2.0),
        ]
    return found


def mechanics_under_other_laws():
    return [
        mechanics(THREE, law, 1e-2, 2.0, count=3)
        for law in (Elliptic(mu_t=1.7, mu_f=1.0, mu_b=1.3), PowerLaw(0.5, mu_t=2.0, mu_f=1.0))
    ]


def _loaded(body, law, delta):
    angles, rates, _ = shapes(body, 8, 9, 2.5)
    load = 0.1 * np.random.default_rng(10).normal(size=(2, 8))
    solved = solve_balance(body, law, angles, rates, delta, load=load)
    return (
        solved.z,
        solved.iterations,
        solved.anchor,
        chain_slopes(body, law, angles, rates, delta, solved, load),
    )


def _at_rest():
    angles, _, start = shapes(THREE, 4, 15, 2.0)
    found = [
        solve_balance(THREE, law, angles, 0 * angles, 1e-3, start=start).z
        for law in (UNEQUAL, PowerLaw(0.5, mu_t=2.0))
    ]
    load = np.array([[0.05, 0.0, 0.1, 0.0], [0.1, 0.2, 0.0, 0.0]])
    return found, solve_balance(THREE, UNEQUAL, angles, 0 * angles, 1e-3, load=load).z


def bodies_whose_joints_rest():
    with numpy_instead():
        slow = _at_rest()
    return _at_rest(), slow


def under_loads():
    return [
        _loaded(body, law, 1e-4)
        for body, law in (
            (THREE, Friction()),
            (ODD, UNEQUAL),
            (FIVE, Friction(mu_t=10.0, mu_f=1.0, mu_b=1.0)),
        )
    ]


def _steps(count, methods=("auto",)):
    """Iterations and velocities at hard instants and random ones, from good starts and bad ones."""
    angles, rates, start = shapes(THREE, count, 14, np.pi)
    hard = np.array(list(HARD.values())).transpose(1, 2, 0)
    angles, rates = (
        np.concatenate([angles, hard[0]], axis=1),
        np.concatenate([rates, hard[1]], axis=1),
    )
    start, found = np.concatenate([start, np.zeros((3, hard.shape[2]))], axis=1), []
    for law, delta in (
        (Friction(), 1e-10),
        (UNEQUAL, 1e-5),
        (Friction(mu_t=0.5, mu_f=1.0, mu_b=5.0), 1e-7),
        (Friction(mu_t=10.0, mu_f=1.0, mu_b=1.0), 1e-4),
    ):
        for near in (None, start):
            for method in methods:
                solved = solve_balance(
                    THREE, law, angles, rates, delta, start=near, method=method, max_iterations=300
                )
                found.append(
                    {
                        "iterations": np.log1p(solved.iterations),
                        "anchor": solved.anchor[:count].mean(),
                    }
                )
    return found


def steps_of_the_kernel():
    return _steps(300, ("auto", "newton", "fixed_point"))


def steps_of_numpy():
    with numpy_instead():
        return _steps(5)


def by_numpy():
    with numpy_instead():
        return (
            _loaded(ODD, UNEQUAL, 1e-4),
            _loaded(THREE, Friction(), 1e-6),
            mechanics(FIVE, UNEQUAL, 1e-3, 2.0, count=3),
        )


def every_motion():
    angles, rates, _ = shapes(THREE, 30, 12, 2.5)
    return [
        all_balanced_velocities(
            THREE, Friction(mu_t=100.0, mu_f=1.0, mu_b=1.0), angles, rates, delta
        )
        for delta in (1e-3, 1e-5)
    ]


def actuators():
    angles, rates, z = shapes(FIVE, 5, 13, 2.0)
    limits = PathLimits(torque_and_power((0.1, 0.2, 0.3, 0.4), (0.4, 0.3, 0.2, 0.1)))
    now = Instants(FIVE, UNEQUAL, angles, rates, 1e-2, z=z)
    return now.power, DRIVEN_WORK.at(now), limits.at(now), limits.names, limits.least
