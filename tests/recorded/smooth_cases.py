"""Smooth bodies: free ones, crawlers and prescribed motions, their form, mechanics and panels."""

import numpy as np

from colloc import Concertina, CrawlerBody, Friction, ModalBody, Wave
from colloc.smooth.balance import solve_smooth
from colloc.smooth.concertina import even_profile, even_slope, odd_profile, odd_slope
from colloc.smooth.curve import PanelGrid, curve, node_velocity, pulled_back, resultant
from tests.recorded.bodies import form, mechanics, shapes

PRECISION, FLOOR = 1e-6, 1e-10

UNEQUAL = Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)
LEGENDRE, FOURIER = ModalBody(modes=3, panels=6, order=5), ModalBody(modes=4, basis="fourier")
CRAWLER = CrawlerBody(epsilon=0.12, share=0.4, modes=3, panels=6, order=5)
ONE_BUMP, TWO_BUMPS = (
    Concertina(epsilon=0.1, amplitude=1.2, share=0.3, backwards=True),
    Concertina(0.08, 1.1, 0.6, bumps=2),
)
WAVES = Wave("sine", 0.8, 1.3), Wave("tanh", 1.2, 2.0, 8.0), Wave("standing", 0.7)


def forms():
    return [form(body, 0.6) for body in (LEGENDRE, FOURIER, CRAWLER, ONE_BUMP, TWO_BUMPS, *WAVES)]


def shapes_laid_into_modes():
    return [body.laid((0.3, 0.2, 0.5)) for body in (LEGENDRE, FOURIER)], LEGENDRE.swapped(
        shapes(LEGENDRE, 3, 1, 1.0)[0]
    )


def mechanics_of_legendre_modes():
    return mechanics(LEGENDRE, UNEQUAL, 1e-2, 0.7)


def mechanics_of_fourier_modes():
    return mechanics(FOURIER, Friction(mu_t=3.0, mu_f=1.0, mu_b=1.0), 1e-2, 0.6)


def mechanics_of_a_crawler():
    return mechanics(CRAWLER, UNEQUAL, 1e-2, 0.7)


def mechanics_of_prescribed_motions():
    return [mechanics(body, UNEQUAL, 1e-2, 1.0, count=2) for body in (ONE_BUMP, TWO_BUMPS, *WAVES)]


def a_guess_for_a_crawler():
    corners = (
        CRAWLER.concertina(amplitude=1.1, sides=9),
        CRAWLER.laid(np.array([0.3, 0.2, 0.5])),
        CRAWLER.wave(-1.0),
    )
    return corners, CRAWLER.reach, CRAWLER.width, CRAWLER.grid.edges


def profiles_of_bumps():
    x = np.linspace(-1.2, 1.2, 13)
    return (
        [profile(x) for profile in (odd_profile, odd_slope, even_profile, even_slope)],
        ONE_BUMP.stroke,
        TWO_BUMPS.stroke,
    )


def prescribed_motions():
    s, t = np.linspace(0, 1, 41)[:, None] * np.ones((1, 12)), (np.arange(12) + 0.3) / 12
    found = []
    for body in (ONE_BUMP, TWO_BUMPS, *WAVES):
        motion = body.prescribed()
        found.append(
            (
                motion.angle(s, t),
                motion.rate(s, t),
                motion.first_edges(t, 7),
                motion.stages,
                motion.fraction,
            )
        )
        found.append((body.regions, body.width) if isinstance(body, Concertina) else ())
    return found


def _solved(body, friction, t, **settings):
    return solve_smooth(body.prescribed(), friction, t, **settings)


def panels_that_adapt():
    t = np.array([0.05, 0.22, 0.4])
    coarse = {"delta": 1e-2, "quadrature_tolerance": 1e-6, "panels": 8, "order": 6}
    bump = _solved(ONE_BUMP, UNEQUAL, t, **coarse, regions=((0.0, 0.3), (0.7, 1.0)))
    return (
        bump,
        _solved(TWO_BUMPS, Friction(), t, **coarse),
        _solved(WAVES[1], UNEQUAL, t, **coarse),
    )


def fixed_panels():
    """Velocities from anywhere and from near, where an anchor moves, where nothing does."""
    angles, rates, z = shapes(LEGENDRE, 24, 8, 0.8)
    rates[:, 0] = 0.0
    first = LEGENDRE.solve(UNEQUAL, angles, rates, 1e-2)
    near = LEGENDRE.solve(UNEQUAL, angles, rates, 1e-4, start=first.z + 0.01 * z)
    return [
        (found.z, found.anchor, {"iterations": np.log1p(found.iterations)})
        for found in (first, near)
    ]


def curves():
    grid = PanelGrid(np.array([[0.0, 0.2, 0.2, 0.7, 1.0]]).T * np.ones((1, 3)), 4)
    rng = np.random.default_rng(2)
    angle, rate, density = rng.normal(size=(3, *grid.nodes.shape))
    found = []
    for reference in (0, 2, 4):
        now = curve(grid, angle, rate, reference, rng.normal(size=(1, 3)))
        blocks = tuple(tuple(rng.normal(size=(2, *angle.shape))) for _ in range(2))
        found += [
            now,
            node_velocity(now, rng.normal(size=(3, 3))),
            resultant(now, angle, density),
            pulled_back(now, blocks),
        ]
        found += [
            grid.edge_path(reference),
            grid.integrate(density, reference),
            grid.panel_sums(density),
        ]
    return found
